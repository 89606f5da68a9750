//! Values of any type: kept as they are, or walked over for their fingerprint alone.

use std::fmt;
use std::marker::PhantomData;

use serde::Deserializer;
use serde::de::{DeserializeSeed, Error, MapAccess, SeqAccess, Visitor};

use super::walk::{Name, Reader, numbers};
use crate::print::{self, Members, Sequence};
use crate::{ELEMENTS, Json, List, Number, Print, Text};

/// The fingerprint of a value.
pub(crate) fn skip<'de, D: Deserializer<'de>>(value: D) -> Result<Print, D::Error> {
    value.deserialize_any(Skip)
}

/// Walks over a value.
#[derive(Clone, Copy, Debug)]
pub(super) struct Skip;

impl Skip {
    #[expect(clippy::unused_self, reason = "called as that of the other visitors")]
    fn number(self, number: Number) -> Print {
        print::of_number(number)
    }
}

impl<'de> DeserializeSeed<'de> for Skip {
    type Value = Print;

    fn deserialize<D: Deserializer<'de>>(self, value: D) -> Result<Print, D::Error> {
        value.deserialize_any(self)
    }
}

impl<'de> Visitor<'de> for Skip {
    type Value = Print;

    numbers!(Print);

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("JSON")
    }

    fn visit_bool<E: Error>(self, flag: bool) -> Result<Print, E> {
        Ok(print::of_flag(flag))
    }

    fn visit_str<E: Error>(self, text: &str) -> Result<Print, E> {
        Ok(print::of_text(text))
    }

    fn visit_unit<E: Error>(self) -> Result<Print, E> {
        Ok(print::NULL)
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<Print, A::Error> {
        let mut sequence = Sequence::new();
        while let Some(element) = list.next_element_seed(Self)? {
            sequence.add(element);
        }
        Ok(sequence.done())
    }

    fn visit_map<A: MapAccess<'de>>(self, mut object: A) -> Result<Print, A::Error> {
        let mut members = Members::default();
        while let Some(name) = object.next_key_seed(Name(|name: &str| print::of_bytes(name.as_bytes()), PhantomData))? {
            members.add(name, object.next_value_seed(self)?);
        }
        Ok(members.done())
    }
}

/// Keeps a value.
#[derive(Clone, Copy, Debug)]
pub(super) struct Keep<'a, 'n>(pub &'a Reader<'n>);

impl Keep<'_, '_> {
    #[expect(clippy::unused_self, reason = "called as that of the other visitors")]
    fn number(self, number: Number) -> (Json, Print) {
        (Json::Number(number), print::of_number(number))
    }
}

impl<'de> DeserializeSeed<'de> for Keep<'_, '_> {
    type Value = (Json, Print);

    fn deserialize<D: Deserializer<'de>>(self, value: D) -> Result<Self::Value, D::Error> {
        value.deserialize_any(self)
    }
}

impl<'de> Visitor<'de> for Keep<'_, '_> {
    type Value = (Json, Print);

    numbers!(Self::Value);

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("JSON")
    }

    fn visit_bool<E: Error>(self, flag: bool) -> Result<Self::Value, E> {
        Ok((Json::Flag(flag), print::of_flag(flag)))
    }

    fn visit_str<E: Error>(self, text: &str) -> Result<Self::Value, E> {
        Ok((Json::Text(Text::new(text)), print::of_text(text)))
    }

    fn visit_unit<E: Error>(self) -> Result<Self::Value, E> {
        Ok((Json::Null, print::NULL))
    }

    fn visit_seq<A: SeqAccess<'de>>(self, list: A) -> Result<Self::Value, A::Error> {
        self::list(list, self.0)
    }

    fn visit_map<A: MapAccess<'de>>(self, object: A) -> Result<Self::Value, A::Error> {
        self::object(object, self.0)
    }
}

/// Keeps a list.
pub(super) fn list<'de, A: SeqAccess<'de>>(mut list: A, reader: &Reader<'_>) -> Result<(Json, Print), A::Error> {
    let (mut kept, mut total, mut sequence) = (Vec::new(), 0, Sequence::new());
    loop {
        let print = if kept.len() < ELEMENTS && reader.take() {
            list.next_element_seed(Keep(reader))?.map(|(json, print)| {
                kept.push(json);
                print
            })
        } else {
            list.next_element_seed(Skip)?
        };
        let Some(print) = print else { break };
        sequence.add(print);
        total += 1;
    }
    Ok((Json::List(List::new(kept, total)), sequence.done()))
}

/// Keeps an object.
pub(super) fn object<'de, A: MapAccess<'de>>(mut object: A, reader: &Reader<'_>) -> Result<(Json, Print), A::Error> {
    let (mut kept, mut total, mut members) = (Vec::new(), 0, Members::default());
    loop {
        let keeps = kept.len() < ELEMENTS && reader.take();
        let name = |name: &str| (print::of_bytes(name.as_bytes()), keeps.then(|| Text::new(name)));
        let Some((hash, name)) = object.next_key_seed(Name(name, PhantomData))? else {
            break;
        };
        let print = match name {
            Some(name) => {
                let (json, print) = object.next_value_seed(Keep(reader))?;
                kept.push((name, json));
                print
            }
            None => object.next_value_seed(Skip)?,
        };
        members.add(hash, print);
        total += 1;
    }
    Ok((Json::Object(List::new(kept, total)), members.done()))
}

impl Print {
    /// The fingerprint of a value that has no view. That of an object with a view is the same where the version has the
    /// usual names for its members.
    #[must_use]
    pub fn of_value(value: &serde_json::Value) -> Self {
        // A tree has no syntax that could be wrong.
        skip(value).unwrap_or_default()
    }
}
