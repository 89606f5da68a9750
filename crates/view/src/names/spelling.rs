//! A message told by the usual names, those of 2.x, as a version writes it, and back: members, places, words.

use serde_json::{Map, Value, json};

use super::Names;
use super::details::Spelling;
use super::object::Object;
use super::table::Found;

impl Names {
    /// Whether something in a message of this version is found elsewhere than a suite says it.
    #[must_use]
    pub const fn differs(&self) -> bool {
        !self.plain || self.places
    }

    /// How a member of an object is written that is told by its usual name; `None` for one that nobody knows.
    #[must_use]
    pub fn spelling(&self, object: Object, usual: &str) -> Option<Spelling<'_>> {
        let members = object.shape().members;
        let at = members.iter().position(|entry| entry.wire == usual)?;
        let field = u8::try_from(at).ok()?;
        let table = self.table(object);
        let details = table.details(field);
        let among = || details.and_then(|details| details.among.as_deref());
        Some(Spelling::new(
            table.name(field).or_else(among),
            members[at].holds,
            details,
        ))
    }

    /// A message, or a part of one, that is told by the usual names, as this version writes it. What the version has no member for
    /// is left out; what nobody knows stays as it is.
    pub fn spell(&self, object: Object, value: &mut Value) {
        if self.plain {
            return;
        }
        match value {
            Value::Array(elements) => elements.iter_mut().for_each(|element| self.spell(object, element)),
            Value::Object(members) => self.spell_members(object, members),
            _ => {}
        }
    }

    /// As [`Names::spell`], of the members of an object.
    pub fn spell_members(&self, object: Object, members: &mut Map<String, Value>) {
        if self.plain {
            return;
        }
        for (usual, mut value) in std::mem::take(members) {
            let Some(spelling) = self.spelling(object, &usual) else {
                members.insert(usual, value);
                continue;
            };
            let Some(name) = spelling.name else { continue };
            if let Some(inner) = spelling.holds {
                self.spell(inner, &mut value);
            }
            spelling.write(&mut value);
            put(members, name, value);
        }
    }

    /// A message of this version, or a part of one, told by the usual names. A member of 2.x that the version does not have is no
    /// member of it and is left out.
    pub fn unspell(&self, object: Object, value: &mut Value) {
        if self.plain {
            return;
        }
        match value {
            Value::Array(elements) => elements.iter_mut().for_each(|element| self.unspell(object, element)),
            Value::Object(members) => {
                for (name, value) in std::mem::take(members) {
                    self.unspell_member(object, name, value, members);
                }
            }
            _ => {}
        }
    }

    fn unspell_member(&self, object: Object, name: String, mut value: Value, members: &mut Map<String, Value>) {
        let known = object.shape().members;
        match self.table(object).find(&name) {
            Some(Found::Member(field)) => {
                let usual = known[usize::from(field)].wire;
                if let Some(spelling) = self.spelling(object, usual) {
                    if let Some(inner) = spelling.holds {
                        self.unspell(inner, &mut value);
                    }
                    spelling.read(&mut value);
                }
                members.insert(usual.to_owned(), value);
            }
            Some(Found::Inside(moved)) => {
                for (inner, field) in moved {
                    if let Some(value) = value.get(&**inner) {
                        members.insert(known[usize::from(*field)].wire.to_owned(), value.clone());
                    }
                }
            }
            None if known.iter().any(|entry| entry.wire == name) => {}
            None => {
                members.insert(name, value);
            }
        }
    }

    /// A value that is told by the usual names, as this version writes it at a place of a message, such as `/nodes/0/nodePosition`.
    pub fn spell_at(&self, object: Object, pointer: &str, value: &mut Value) {
        let (mut here, mut last) = (Some(object), None);
        for name in pointer.split('/').skip(1).filter(|name| !is_place(name)) {
            last = here.and_then(|object| self.spelling(object, name));
            here = last.and_then(|spelling| spelling.holds);
        }
        if let Some(object) = here {
            self.spell(object, value);
        }
        if let Some(spelling) = last {
            spelling.write(value);
        }
    }

    /// Whether a place of a message, such as `/edges/0/startNodeId`, is in a member that this version does not have.
    #[must_use]
    pub fn has_lost(&self, object: Object, pointer: &str) -> bool {
        let names: Vec<&str> = pointer.split('/').skip(1).filter(|name| !is_place(name)).collect();
        self.spelled_names(object, &names).is_none()
    }

    /// The names along a path of usual names, lists entered without an index; `None` where a version that writes otherwise than 2.x
    /// has no such member.
    #[must_use]
    pub fn spelled_names<'a>(&'a self, object: Object, path: &[&'a str]) -> Option<Vec<&'a str>> {
        let mut here = Some(object);
        let mut names = Vec::with_capacity(path.len());
        for usual in path {
            match here.and_then(|object| self.spelling(object, usual)) {
                Some(spelling) => {
                    match spelling.name {
                        Some(name) => names.extend(name.split('/')),
                        // Whether a version that writes all as 2.x has the member is for its schema to say.
                        None if self.plain => names.push(*usual),
                        None => return None,
                    }
                    here = spelling.holds;
                }
                None => {
                    names.push(*usual);
                    here = None;
                }
            }
        }
        Some(names)
    }

    /// A path of usual names as it is written, such as `agvPosition.x`, `errors[0].errorType` or `/nodes/0/nodeId`. What the
    /// version has no name for stays as it is.
    #[must_use]
    pub fn spelled_path(&self, object: Object, path: &str) -> String {
        if !self.differs() {
            return path.to_owned();
        }
        let is_mark = |c: char| matches!(c, '.' | '[' | ']' | '/');
        let (mut here, mut spelled, mut rest) = (Some(object), String::new(), path);
        while !rest.is_empty() {
            let end = rest.find(is_mark).unwrap_or(rest.len());
            let (name, behind) = rest.split_at(end);
            match here
                .filter(|_| !is_place(name))
                .and_then(|object| self.spelling(object, name))
            {
                Some(spelling) => {
                    let separator = if path.starts_with('/') { "/" } else { "." };
                    spelled.push_str(&spelling.name.unwrap_or(name).replace('/', separator));
                    here = spelling.holds;
                }
                None => {
                    spelled.push_str(name);
                    here = here.filter(|_| is_place(name));
                }
            }
            let mark = behind.chars().next();
            spelled.extend(mark);
            rest = &behind[mark.map_or(0, char::len_utf8)..];
        }
        spelled
    }
}

/// Whether a part of a path is no name, but a place in a list, or nothing.
fn is_place(part: &str) -> bool {
    part == "-" || part.bytes().all(|byte| byte.is_ascii_digit())
}

/// Puts a member where it belongs: inside another one, or behind the elements that stand there.
fn put(members: &mut Map<String, Value>, name: &str, value: Value) {
    if let Some((outer, inner)) = name.split_once('/') {
        let outer = members.entry(outer).or_insert_with(|| json!({}));
        if let Value::Object(outer) = outer {
            outer.insert(inner.to_owned(), value);
        }
        return;
    }
    let is_joined = value.is_array() && members.get(name).is_some_and(Value::is_array);
    match value {
        Value::Array(more) if is_joined => {
            if let Some(Value::Array(there)) = members.get_mut(name) {
                there.extend(more);
            }
        }
        value => {
            members.insert(name.to_owned(), value);
        }
    }
}
