//! Objects that have a view.

use std::fmt;
use std::marker::PhantomData;

use serde::Deserializer;
use serde::de::{DeserializeSeed, Error, MapAccess, SeqAccess, Visitor};

use super::free::{self, Skip};
use super::slot::Readable;
use super::walk::{Name, Reader, numbers};
use crate::names::Found;
use crate::print::{self, Members};
use crate::{Deviation, Ellipse, Header, Json, Member, Number, Object, Print};

/// A view, as the table of its members defines it.
pub(crate) trait View: Default {
    const OBJECT: Object;

    /// Reads the value of a member.
    fn read_member<'de, D: Deserializer<'de>>(
        &mut self,
        index: u8,
        reader: &Reader<'_>,
        value: D,
    ) -> Result<Print, D::Error>;

    /// Takes down the fingerprints, and what stands there where it is no object.
    fn seal(&mut self, print: Print, essence: Print, odd: Option<Box<Json>>);

    /// The header, where it is a message.
    fn header_mut(&mut self) -> Option<&mut Header> {
        None
    }

    /// Takes down the fingerprint without headerId and timestamp, where it is a message.
    fn set_content(&mut self, _: Print) {}
}

/// Reads a message.
pub(crate) fn message<'de, V: View, D: Deserializer<'de>>(message: D, reader: &Reader<'_>) -> Result<V, D::Error> {
    let mut view = V::default();
    message.deserialize_any(Whole {
        view: &mut view,
        reader,
    })?;
    Ok(view)
}

/// Reads an object, or takes down that it is none.
pub(super) struct Whole<'a, 'n, V> {
    pub view: &'a mut V,
    pub reader: &'a Reader<'n>,
}

impl<V: View> Whole<'_, '_, V> {
    fn odd(self, (json, print): (Json, Print)) -> Print {
        self.view.set_content(print);
        self.view.seal(print, print, Some(Box::new(json)));
        print
    }

    fn number(self, number: Number) -> Print {
        self.odd((Json::Number(number), print::of_number(number)))
    }
}

impl<'de, V: View> Visitor<'de> for Whole<'_, '_, V> {
    type Value = Print;

    numbers!(Print);

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("JSON")
    }

    fn visit_bool<E: Error>(self, flag: bool) -> Result<Print, E> {
        Ok(self.odd((Json::Flag(flag), print::of_flag(flag))))
    }

    fn visit_str<E: Error>(self, text: &str) -> Result<Print, E> {
        Ok(self.odd((Json::Text(text.into()), print::of_text(text))))
    }

    fn visit_unit<E: Error>(self) -> Result<Print, E> {
        Ok(self.odd((Json::Null, print::NULL)))
    }

    fn visit_seq<A: SeqAccess<'de>>(self, list: A) -> Result<Print, A::Error> {
        let read = free::list(list, self.reader)?;
        Ok(self.odd(read))
    }

    fn visit_map<A: MapAccess<'de>>(self, object: A) -> Result<Print, A::Error> {
        fill(self.view, object, self.reader)
    }
}

/// Reads an object into its place.
pub(crate) fn plain<'de, V: View, A: MapAccess<'de>>(
    slot: &mut Member<V>,
    object: A,
    reader: &Reader<'_>,
) -> Result<Print, A::Error> {
    let mut view = V::default();
    let print = fill(&mut view, object, reader)?;
    *slot = Member::There(view);
    Ok(print)
}

/// Reads an object that is rare, or bigger than what it stands in.
pub(crate) fn boxed<'de, V: View, A: MapAccess<'de>>(
    slot: &mut Member<Box<V>>,
    object: A,
    reader: &Reader<'_>,
) -> Result<Print, A::Error> {
    let mut view = Box::<V>::default();
    let print = fill(&mut *view, object, reader)?;
    *slot = Member::There(view);
    Ok(print)
}

impl Readable for Deviation {
    const HOLDS: Option<Object> = Some(Object::Ellipse);

    fn of_number(radius: Number) -> Option<Self> {
        Some(Self::Radius(radius))
    }

    fn read_object<'de, A: MapAccess<'de>>(
        slot: &mut Member<Self>,
        object: A,
        reader: &Reader<'_>,
    ) -> Result<Print, A::Error> {
        let mut ellipse = Box::<Ellipse>::default();
        let print = fill(&mut *ellipse, object, reader)?;
        *slot = Member::There(Self::Ellipse(ellipse));
        Ok(print)
    }
}

/// What the name of a member means.
enum Meaning<'t> {
    Member(u8),
    Inside(u64, &'t [(Box<str>, u8)]),
    Header(u8),
    Unknown(u64),
}

/// Reads the members of an object.
fn fill<'de, V: View, A: MapAccess<'de>>(view: &mut V, mut object: A, reader: &Reader<'_>) -> Result<Print, A::Error> {
    let table = reader.names.table(V::OBJECT);
    let header = view.header_mut().map(|_| reader.names.table(Object::Header));
    let (mut members, mut apart) = (Members::default(), Members::default());
    let (mut of_header, mut changing) = (Members::default(), Members::default());
    let meaning = |name: &str| match table.find(name) {
        Some(Found::Member(field)) => Meaning::Member(field),
        Some(Found::Inside(moved)) => Meaning::Inside(print::of_bytes(name.as_bytes()), moved),
        None => match header.and_then(|header| header.find(name)) {
            Some(Found::Member(field)) => Meaning::Header(field),
            _ => Meaning::Unknown(print::of_bytes(name.as_bytes())),
        },
    };
    while let Some(meaning) = object.next_key_seed(Name(meaning, PhantomData))? {
        match meaning {
            Meaning::Member(index) => {
                let value = object.next_value_seed(Into { view, index, reader })?;
                let (name, is_apart) = table.usual(index);
                members.add(name, value);
                if is_apart {
                    apart.add(name, value);
                }
            }
            Meaning::Inside(name, moved) => members.add(name, object.next_value_seed(Inside { view, moved, reader })?),
            Meaning::Unknown(name) => members.add(name, object.next_value_seed(Skip)?),
            Meaning::Header(index) => {
                let value = match view.header_mut() {
                    Some(view) => object.next_value_seed(Into { view, index, reader })?,
                    None => object.next_value_seed(Skip)?,
                };
                let (name, _) = header.map_or((0, false), |header| header.usual(index));
                of_header.add(name, value);
                if Header::changes(index) {
                    changing.add(name, value);
                }
            }
        }
    }
    let rest = members;
    if let Some(header) = view.header_mut() {
        header.seal(of_header.done(), of_header.done(), None);
        members = members.with(of_header);
        view.set_content(members.without(changing).done());
    }
    let print = members.done();
    view.seal(print, rest.without(apart).done(), None);
    Ok(print)
}

/// Reads the value of a member into a view.
struct Into<'a, 'n, V> {
    view: &'a mut V,
    index: u8,
    reader: &'a Reader<'n>,
}

impl<'de, V: View> DeserializeSeed<'de> for Into<'_, '_, V> {
    type Value = Print;

    fn deserialize<D: Deserializer<'de>>(self, value: D) -> Result<Print, D::Error> {
        self.view.read_member(self.index, self.reader, value)
    }
}

/// Reads members of a view that stand in an object inside it.
struct Inside<'a, 'n, V> {
    view: &'a mut V,
    moved: &'a [(Box<str>, u8)],
    reader: &'a Reader<'n>,
}

impl<V> Inside<'_, '_, V> {
    #[expect(clippy::unused_self, reason = "called as that of the other visitors")]
    fn number(self, number: Number) -> Print {
        print::of_number(number)
    }
}

impl<'de, V: View> DeserializeSeed<'de> for Inside<'_, '_, V> {
    type Value = Print;

    fn deserialize<D: Deserializer<'de>>(self, value: D) -> Result<Print, D::Error> {
        value.deserialize_any(self)
    }
}

impl<'de, V: View> Visitor<'de> for Inside<'_, '_, V> {
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

    fn visit_seq<A: SeqAccess<'de>>(self, list: A) -> Result<Print, A::Error> {
        Skip.visit_seq(list)
    }

    fn visit_map<A: MapAccess<'de>>(self, mut object: A) -> Result<Print, A::Error> {
        let mut members = Members::default();
        let field = |name: &str| {
            let found = self.moved.iter().find(|(known, _)| **known == *name);
            (print::of_bytes(name.as_bytes()), found.map(|(_, field)| *field))
        };
        while let Some((name, field)) = object.next_key_seed(Name(field, PhantomData))? {
            let value = match field {
                Some(index) => object.next_value_seed(Into {
                    view: &mut *self.view,
                    index,
                    reader: self.reader,
                })?,
                None => object.next_value_seed(Skip)?,
            };
            members.add(name, value);
        }
        Ok(members.done())
    }
}
