//! The walk over a message, from a tree or from bytes: what stands there goes to its member, and everything into the
//! fingerprints.

mod free;
mod list;
mod object;

use std::cell::Cell;
use std::fmt;
use std::marker::PhantomData;

use serde::Deserializer;
use serde::de::{DeserializeSeed, Error, MapAccess, SeqAccess, Visitor};

pub(crate) use free::skip;
pub(crate) use object::{View, boxed, message, plain};

use crate::{Member, Names, Number, Print, TOTAL, print};

/// What the walk needs to know everywhere.
#[derive(Debug)]
pub(crate) struct Reader<'n> {
    names: &'n Names,
    /// How many elements may still be kept.
    left: Cell<usize>,
}

impl<'n> Reader<'n> {
    pub(crate) const fn new(names: &'n Names) -> Self {
        Self {
            names,
            left: Cell::new(TOTAL),
        }
    }

    /// Whether another element may be kept.
    fn take(&self) -> bool {
        let left = self.left.get();
        self.left.set(left.saturating_sub(1));
        left > 0
    }
}

/// A type that a member can have.
pub(crate) trait Readable: Sized {
    fn of_flag(_: bool) -> Option<Self> {
        None
    }

    fn of_number(_: Number) -> Option<Self> {
        None
    }

    fn of_text(_: &str) -> Option<Self> {
        None
    }

    fn read_list<'de, A: SeqAccess<'de>>(
        slot: &mut Member<Self>,
        list: A,
        reader: &Reader<'_>,
    ) -> Result<Print, A::Error> {
        let (json, print) = free::list(list, reader)?;
        *slot = Member::Other(Box::new(json));
        Ok(print)
    }

    fn read_object<'de, A: MapAccess<'de>>(
        slot: &mut Member<Self>,
        object: A,
        reader: &Reader<'_>,
    ) -> Result<Print, A::Error> {
        let (json, print) = free::object(object, reader)?;
        *slot = Member::Other(Box::new(json));
        Ok(print)
    }
}

/// Reads a member into its place.
pub(crate) fn member<'de, T: Readable, D: Deserializer<'de>>(
    slot: &mut Member<T>,
    reader: &Reader<'_>,
    value: D,
) -> Result<Print, D::Error> {
    value.deserialize_any(Slot { slot, reader })
}

struct Slot<'a, 'n, T> {
    slot: &'a mut Member<T>,
    reader: &'a Reader<'n>,
}

impl<T: Readable> Slot<'_, '_, T> {
    fn set(self, read: Option<T>, other: impl FnOnce() -> crate::Json) {
        *self.slot = read.map_or_else(|| Member::Other(Box::new(other())), Member::There);
    }
}

impl<'de, T: Readable> DeserializeSeed<'de> for Slot<'_, '_, T> {
    type Value = Print;

    fn deserialize<D: Deserializer<'de>>(self, value: D) -> Result<Print, D::Error> {
        value.deserialize_any(self)
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
pub(crate) use numbers;

impl<T: Readable> Slot<'_, '_, T> {
    fn number(self, number: Number) -> Print {
        self.set(T::of_number(number), || crate::Json::Number(number));
        print::of_number(number)
    }
}

impl<'de, T: Readable> Visitor<'de> for Slot<'_, '_, T> {
    type Value = Print;

    numbers!(Print);

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("JSON")
    }

    fn visit_bool<E: Error>(self, flag: bool) -> Result<Print, E> {
        self.set(T::of_flag(flag), || crate::Json::Flag(flag));
        Ok(print::of_flag(flag))
    }

    fn visit_str<E: Error>(self, text: &str) -> Result<Print, E> {
        self.set(T::of_text(text), || crate::Json::Text(text.into()));
        Ok(print::of_text(text))
    }

    fn visit_unit<E: Error>(self) -> Result<Print, E> {
        *self.slot = Member::Null;
        Ok(print::NULL)
    }

    fn visit_seq<A: SeqAccess<'de>>(self, list: A) -> Result<Print, A::Error> {
        T::read_list(self.slot, list, self.reader)
    }

    fn visit_map<A: MapAccess<'de>>(self, object: A) -> Result<Print, A::Error> {
        T::read_object(self.slot, object, self.reader)
    }
}

impl Readable for bool {
    fn of_flag(flag: bool) -> Option<Self> {
        Some(flag)
    }
}

impl Readable for Number {
    fn of_number(number: Number) -> Option<Self> {
        Some(number)
    }
}

impl Readable for crate::Text {
    fn of_text(text: &str) -> Option<Self> {
        Some(Self::new(text))
    }
}

impl Readable for crate::Deviation {
    fn of_number(radius: Number) -> Option<Self> {
        Some(Self::Radius(radius))
    }

    fn read_object<'de, A: MapAccess<'de>>(
        slot: &mut Member<Self>,
        object: A,
        reader: &Reader<'_>,
    ) -> Result<Print, A::Error> {
        let mut ellipse = Box::<crate::Ellipse>::default();
        let print = object::fill(&mut *ellipse, object, reader)?;
        *slot = Member::There(Self::Ellipse(ellipse));
        Ok(print)
    }
}

/// A visitor that is asked for one kind of value and takes a name.
struct Name<F, T>(F, PhantomData<T>);

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
