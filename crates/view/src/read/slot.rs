//! Members, each read into its place.

use std::fmt;

use serde::Deserializer;
use serde::de::{DeserializeSeed, Error, MapAccess, SeqAccess, Visitor};

use super::free;
use super::walk::{Reader, numbers};
use crate::{Json, Member, Number, Object, Print, Text, print};

/// A type that a member can have.
pub(crate) trait Readable: Sized {
    /// The kind of object that it is, or that its elements are.
    const HOLDS: Option<Object> = None;

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

pub(super) struct Slot<'a, 'n, T> {
    pub slot: &'a mut Member<T>,
    pub reader: &'a Reader<'n>,
}

impl<T: Readable> Slot<'_, '_, T> {
    fn set(self, read: Option<T>, other: impl FnOnce() -> Json) {
        *self.slot = read.map_or_else(|| Member::Other(Box::new(other())), Member::There);
    }
}

impl<'de, T: Readable> DeserializeSeed<'de> for Slot<'_, '_, T> {
    type Value = Print;

    fn deserialize<D: Deserializer<'de>>(self, value: D) -> Result<Print, D::Error> {
        value.deserialize_any(self)
    }
}

impl<T: Readable> Slot<'_, '_, T> {
    fn number(self, number: Number) -> Print {
        self.set(T::of_number(number), || Json::Number(number));
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
        self.set(T::of_flag(flag), || Json::Flag(flag));
        Ok(print::of_flag(flag))
    }

    fn visit_str<E: Error>(self, text: &str) -> Result<Print, E> {
        self.set(T::of_text(text), || Json::Text(text.into()));
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

impl Readable for Text {
    fn of_text(text: &str) -> Option<Self> {
        Some(Self::new(text))
    }
}

impl Readable for Json {
    fn of_flag(flag: bool) -> Option<Self> {
        Some(Self::Flag(flag))
    }

    fn of_number(number: Number) -> Option<Self> {
        Some(Self::Number(number))
    }

    fn of_text(text: &str) -> Option<Self> {
        Some(Self::Text(Text::new(text)))
    }

    fn read_list<'de, A: SeqAccess<'de>>(
        slot: &mut Member<Self>,
        list: A,
        reader: &Reader<'_>,
    ) -> Result<Print, A::Error> {
        let (json, print) = free::list(list, reader)?;
        *slot = Member::There(json);
        Ok(print)
    }

    fn read_object<'de, A: MapAccess<'de>>(
        slot: &mut Member<Self>,
        object: A,
        reader: &Reader<'_>,
    ) -> Result<Print, A::Error> {
        let (json, print) = free::object(object, reader)?;
        *slot = Member::There(json);
        Ok(print)
    }
}
