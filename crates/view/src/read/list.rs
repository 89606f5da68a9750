//! Lists of objects, of texts and of numbers.

use serde::Deserializer;
use serde::de::{DeserializeSeed, SeqAccess};

use super::free::Skip;
use super::object::{View, Whole};
use super::slot::{Readable, Slot};
use super::walk::Reader;
use crate::print::Sequence;
use crate::{ELEMENTS, List, Member, Number, Object, Print, Text};

/// What a list can be of.
pub(crate) trait Element: Default {
    /// The kind of object that it is.
    const HOLDS: Option<Object> = None;

    fn fill<'de, D: Deserializer<'de>>(&mut self, value: D, reader: &Reader<'_>) -> Result<Print, D::Error>;
}

impl<V: View> Element for V {
    const HOLDS: Option<Object> = Some(V::OBJECT);

    fn fill<'de, D: Deserializer<'de>>(&mut self, value: D, reader: &Reader<'_>) -> Result<Print, D::Error> {
        value.deserialize_any(Whole { view: self, reader })
    }
}

impl Element for Member<Text> {
    fn fill<'de, D: Deserializer<'de>>(&mut self, value: D, reader: &Reader<'_>) -> Result<Print, D::Error> {
        value.deserialize_any(Slot { slot: self, reader })
    }
}

impl Element for Member<Number> {
    fn fill<'de, D: Deserializer<'de>>(&mut self, value: D, reader: &Reader<'_>) -> Result<Print, D::Error> {
        value.deserialize_any(Slot { slot: self, reader })
    }
}

struct Fill<'a, 'n, T> {
    element: &'a mut T,
    reader: &'a Reader<'n>,
}

impl<'de, T: Element> DeserializeSeed<'de> for Fill<'_, '_, T> {
    type Value = Print;

    fn deserialize<D: Deserializer<'de>>(self, value: D) -> Result<Print, D::Error> {
        self.element.fill(value, self.reader)
    }
}

impl<T: Element> Readable for List<T> {
    const HOLDS: Option<Object> = T::HOLDS;

    fn read_list<'de, A: SeqAccess<'de>>(
        slot: &mut Member<Self>,
        mut list: A,
        reader: &Reader<'_>,
    ) -> Result<Print, A::Error> {
        let likely = list
            .size_hint()
            .unwrap_or_default()
            .min(ELEMENTS)
            .min(reader.left.get());
        let mut kept: Vec<T> = Vec::with_capacity(likely);
        let (mut total, mut sequence) = (0, Sequence::new());
        loop {
            let print = if kept.len() < ELEMENTS && reader.take() {
                let mut element = T::default();
                let fill = Fill {
                    element: &mut element,
                    reader,
                };
                let print = list.next_element_seed(fill)?;
                if print.is_some() {
                    kept.push(element);
                }
                print
            } else {
                list.next_element_seed(Skip)?
            };
            let Some(print) = print else { break };
            sequence.add(print);
            total += 1;
        }
        *slot = Member::There(Self::new(kept, total));
        Ok(sequence.done())
    }
}
