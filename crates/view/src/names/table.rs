//! From the name of a member to its place in a view, without hashing all of the name.

use super::details::Details;
use super::object::{Entry, Shape};
use crate::print;

/// Places in the index; a power of two, at least twice as many as an object has members.
const PLACES: usize = 128;

/// The names of the members of one object.
#[derive(Clone, Debug)]
pub struct Table {
    fields: Box<[Naming]>,
    keys: Box<[Key]>,
    /// Which key may stand at a place, counted from 1.
    places: Box<[u8; PLACES]>,
}

/// What is known of a field.
#[derive(Clone, Debug)]
struct Naming {
    name: Option<Box<str>>,
    /// The fingerprint of its usual name.
    usual: u64,
    /// Whether it does not count for the essence of the object.
    apart: bool,
    /// What else is different.
    details: Option<Box<Details>>,
}

/// A name that occurs in an object.
#[derive(Clone, Debug)]
struct Key {
    name: Box<str>,
    leads: Leads,
}

/// Where a name leads.
#[derive(Clone, Debug)]
enum Leads {
    Member(u8),
    /// Into an object that members were moved into: name and field of each.
    Inside(Box<[(Box<str>, u8)]>),
}

/// What a name is to an object.
#[derive(Clone, Copy, Debug)]
pub enum Found<'t> {
    /// A member.
    Member(u8),
    /// An object that members were moved into: name and field of each.
    Inside(&'t [(Box<str>, u8)]),
}

impl Table {
    pub(super) fn new(names: &[Option<&str>], shape: &Shape) -> Self {
        let mut keys: Vec<Key> = Vec::new();
        for (name, field) in names.iter().zip(0_u8..) {
            let Some(name) = name else { continue };
            match name.split_once('/') {
                None => keys.push(Key {
                    name: (*name).into(),
                    leads: Leads::Member(field),
                }),
                Some((outer, inner)) => {
                    let moved = (Box::from(inner), field);
                    let known = keys.iter_mut().find_map(|key| match &mut key.leads {
                        Leads::Inside(all) if *key.name == *outer => Some(all),
                        _ => None,
                    });
                    match known {
                        Some(all) => *all = all.iter().cloned().chain([moved]).collect(),
                        None => keys.push(Key {
                            name: outer.into(),
                            leads: Leads::Inside([moved].into()),
                        }),
                    }
                }
            }
        }
        let mut places = Box::new([0_u8; PLACES]);
        for (key, number) in keys.iter().zip(1_u8..) {
            let mut at = place(&key.name);
            while places[at] != 0 {
                at = (at + 1) % PLACES;
            }
            places[at] = number;
        }
        let naming = |(name, entry): (Option<&str>, &Entry)| Naming {
            name: name.map(Box::from),
            usual: print::of_bytes(entry.wire.as_bytes()),
            apart: entry.apart,
            details: None,
        };
        Self {
            fields: names.iter().copied().zip(shape.members).map(naming).collect(),
            keys: keys.into(),
            places,
        }
    }

    /// What else is different of a field.
    pub(super) fn tell(&mut self, field: usize, details: Details) {
        if let Some(naming) = self.fields.get_mut(field) {
            naming.details = Some(Box::new(details));
        }
    }

    /// What else is different of a field, if anything is.
    pub(super) fn details(&self, field: u8) -> Option<&Details> {
        self.fields.get(usize::from(field))?.details.as_deref()
    }

    /// Whether a field is written as in 2.x, where it is written at all.
    pub(super) fn is_plain(&self, field: u8, usual: &str) -> bool {
        self.details(field).is_none_or(Details::is_place) && self.name(field).is_none_or(|name| name == usual)
    }

    /// Whether what has no list of its own stands among other things.
    pub(super) fn has_places(&self) -> bool {
        let mut details = self.fields.iter().filter_map(|naming| naming.details.as_deref());
        details.any(Details::is_place)
    }

    pub(super) fn name(&self, field: u8) -> Option<&str> {
        self.fields.get(usize::from(field))?.name.as_deref()
    }

    /// The fingerprint of the usual name of a field, and whether it does not count for the essence of the object.
    pub(crate) fn usual(&self, field: u8) -> (u64, bool) {
        self.fields
            .get(usize::from(field))
            .map_or((0, false), |naming| (naming.usual, naming.apart))
    }

    pub(crate) fn find(&self, name: &str) -> Option<Found<'_>> {
        let mut at = place(name);
        loop {
            let key = self.keys.get(usize::from(self.places[at]).checked_sub(1)?)?;
            if *key.name == *name {
                return Some(match &key.leads {
                    Leads::Member(field) => Found::Member(*field),
                    Leads::Inside(all) => Found::Inside(all),
                });
            }
            at = (at + 1) % PLACES;
        }
    }

    /// A name that two members have.
    pub(super) fn doubled(&self) -> Option<&str> {
        let names = || self.keys.iter().map(|key| &*key.name);
        let again = |(at, name): (usize, &str)| names().take(at).any(|other| other == name);
        let outer = names().enumerate().find(|pair| again(*pair)).map(|(_, name)| name);
        outer.or_else(|| {
            self.keys.iter().find_map(|key| match &key.leads {
                Leads::Member(_) => None,
                Leads::Inside(all) => {
                    let twice =
                        |(at, (name, _)): (usize, &(Box<str>, u8))| all[..at].iter().any(|(other, _)| other == name);
                    all.iter()
                        .enumerate()
                        .find(|pair| twice(*pair))
                        .map(|(_, (name, _))| &**name)
                }
            })
        })
    }
}

/// Where a name is looked for first: by its length and four of its bytes.
fn place(name: &str) -> usize {
    let bytes = name.as_bytes();
    let byte = |at: usize| bytes.get(at).copied().map_or(0, u64::from);
    let length = bytes.len();
    let some = byte(0)
        | byte(length / 3) << 8
        | byte(length / 2) << 16
        | byte(length.wrapping_sub(1)) << 24
        | (length as u64) << 32;
    (some.wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 57) as usize
}
