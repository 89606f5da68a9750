//! What every part of the walk needs.

use std::cell::Cell;
use std::fmt;
use std::marker::PhantomData;

use serde::Deserializer;
use serde::de::{DeserializeSeed, Error, Visitor};

use crate::{Names, TOTAL};

/// What the walk needs to know everywhere.
#[derive(Debug)]
pub(crate) struct Reader<'n> {
    pub names: &'n Names,
    /// How many elements may still be kept.
    pub left: Cell<usize>,
}

impl<'n> Reader<'n> {
    pub(crate) const fn new(names: &'n Names) -> Self {
        Self {
            names,
            left: Cell::new(TOTAL),
        }
    }

    /// Whether another element may be kept.
    pub fn take(&self) -> bool {
        let left = self.left.get();
        self.left.set(left.saturating_sub(1));
        left > 0
    }
}

/// The functions of a [`Visitor`] for numbers, by way of one for [`Number`].
macro_rules! numbers {
    ($value:ty) => {
        fn visit_u64<E: Error>(self, number: u64) -> Result<$value, E> {
            Ok(self.number(Number::Whole(number)))
        }

        fn visit_i64<E: Error>(self, number: i64) -> Result<$value, E> {
            Ok(self.number(u64::try_from(number).map_or(Number::Negative(number), Number::Whole)))
        }

        fn visit_f64<E: Error>(self, number: f64) -> Result<$value, E> {
            Ok(self.number(Number::Float(number)))
        }
    };
}
pub(super) use numbers;

/// A visitor that is asked for one kind of value and takes a name.
#[derive(Debug)]
pub(super) struct Name<F, T>(pub F, pub PhantomData<T>);

impl<'de, T, F: FnOnce(&str) -> T> DeserializeSeed<'de> for Name<F, T> {
    type Value = T;

    fn deserialize<D: Deserializer<'de>>(self, name: D) -> Result<T, D::Error> {
        name.deserialize_str(self)
    }
}

impl<T, F: FnOnce(&str) -> T> Visitor<'_> for Name<F, T> {
    type Value = T;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("the name of a member")
    }

    fn visit_str<E: Error>(self, name: &str) -> Result<T, E> {
        Ok((self.0)(name))
    }
}
