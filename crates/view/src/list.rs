//! Lists of a message.

use std::ops::Deref;

/// A list of a message: at most [`crate::ELEMENTS`] of its elements.
#[derive(Clone, Debug, PartialEq)]
pub struct List<T> {
    elements: Box<[T]>,
    total: usize,
}

impl<T> List<T> {
    pub(crate) fn new(elements: Vec<T>, total: usize) -> Self {
        Self {
            elements: elements.into_boxed_slice(),
            total,
        }
    }

    /// How many elements the list of the message has, kept or not.
    #[must_use]
    pub const fn total(&self) -> usize {
        self.total
    }

    /// Whether elements are not kept.
    #[must_use]
    pub const fn is_cut(&self) -> bool {
        self.total > self.elements.len()
    }

    /// All elements; `None` when some are not kept.
    #[must_use]
    pub fn complete(&self) -> Option<&[T]> {
        (!self.is_cut()).then_some(&self.elements)
    }
}

impl<T> Default for List<T> {
    fn default() -> Self {
        Self::new(Vec::new(), 0)
    }
}

impl<T> Deref for List<T> {
    type Target = [T];

    fn deref(&self) -> &[T] {
        &self.elements
    }
}

impl<'l, T> IntoIterator for &'l List<T> {
    type Item = &'l T;
    type IntoIter = std::slice::Iter<'l, T>;

    fn into_iter(self) -> Self::IntoIter {
        self.elements.iter()
    }
}
