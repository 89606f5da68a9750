//! What members are called, which depends on the version of the protocol.

mod details;
mod object;
mod spelling;
mod table;

use std::collections::BTreeMap;
use std::fmt;
use std::sync::{Arc, LazyLock};

use serde::{Deserialize, Deserializer};
use serde_json::Value;

use crate::print;
use details::Details;
pub use details::Spelling;
pub use object::Object;
pub(crate) use object::{Entry, Shape};
pub(crate) use table::{Found, Table};

/// A member that can be read, in the view that has it: [`crate::StateView::maps`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Field {
    object: Object,
    index: u8,
}

impl Field {
    /// The member with this name in 2.x. The compiler refuses a name that the object does not have.
    pub(crate) const fn new(object: Object, shape: &Shape, wire: &str) -> Self {
        let mut index = 0;
        while !same(shape.members[index].wire, wire) {
            index += 1;
        }
        #[expect(clippy::cast_possible_truncation, reason = "no object has so many members")]
        let index = index as u8;
        Self { object, index }
    }

    /// All of them.
    pub fn all() -> impl Iterator<Item = Self> {
        let of_object = |object: Object| {
            (0_u8..)
                .take(object.shape().members.len())
                .map(move |index| Self { object, index })
        };
        Object::ALL.into_iter().flat_map(of_object)
    }

    /// The kind of object that has it.
    #[must_use]
    pub const fn object(self) -> Object {
        self.object
    }

    /// Its name in 2.x, or the one it has had from its first version on.
    #[must_use]
    pub fn usual_name(self) -> &'static str {
        self.entry().wire
    }

    pub(crate) const fn index(self) -> u8 {
        self.index
    }

    fn entry(self) -> &'static Entry {
        &self.object.shape().members[usize::from(self.index)]
    }
}

/// Object and name: `state.maps`.
impl fmt::Display for Field {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}.{}", self.object, self.usual_name())
    }
}

const fn same(one: &str, other: &str) -> bool {
    let (one, other) = (one.as_bytes(), other.as_bytes());
    if one.len() != other.len() {
        return false;
    }
    let mut at = 0;
    while at < one.len() {
        if one[at] != other[at] {
            return false;
        }
        at += 1;
    }
    true
}

/// The names of members in one version of the protocol.
///
/// The default has the names of 2.x. The table `[members]` of `protocol.toml` says what is different, by object and by usual name:
///
/// ```
/// let names: tck_view::Names = toml::from_str(r#"
///     state.agvPosition = "mobileRobotPosition"  # has another name
///     state.zoneSetId = false                    # does not exist in this version
///     state.instantActionStates = true           # exists, which it does not in 2.x
///     batteryState.reach = "estimate/range"      # moved into an object inside this one
/// "#)?;
/// assert_eq!(names.name(tck_view::StateView::position), Some("mobileRobotPosition"));
/// assert!(names.lacks(tck_view::StateView::zone_set_id));
/// # Ok::<(), toml::de::Error>(())
/// ```
///
/// Where more than the name is different, a table says it: `name`; `among`, the member of the same object where the elements of a
/// list stand that a version has no list of its own for; `words`, what the version writes for words of 2.x; `ellipse`, whether a
/// radius of 2.x is written as one.
///
/// A member that was split is two fields, of which a version has one or both. What a version lacks is not read.
#[derive(Clone, Debug)]
pub struct Names {
    /// By object.
    tables: Arc<[Table]>,
    id: u64,
    /// Whether a message of this version is written as one of 2.x.
    plain: bool,
    /// Whether what a version has no list of its own for stands among other things.
    places: bool,
}

/// Two versions call everything the same.
impl PartialEq for Names {
    fn eq(&self, other: &Self) -> bool {
        self.id == other.id && self.plain == other.plain && self.places == other.places
    }
}

/// Why a table of names cannot be used.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum NamesError {
    /// No object goes by this name.
    #[error("there is no object `{0}` in the views of messages")]
    NoObject(String),
    /// The object has no such member.
    #[error("the views know no member `{object}.{member}`")]
    NoMember {
        /// The object.
        object: String,
        /// The member.
        member: String,
    },
    /// Two members go by the same name.
    #[error("two members of `{object}` are called `{name}`")]
    Twice {
        /// The object.
        object: String,
        /// The name of both.
        name: String,
    },
    /// A name that cannot be one.
    #[error(
        "{name} cannot stand for `{object}.{member}`: that is a name, two with a slash between them, or whether the version \
         has the member"
    )]
    NoName {
        /// The object.
        object: String,
        /// The member.
        member: String,
        /// What stands there.
        name: String,
    },
}

/// The names of 2.x.
static USUAL: LazyLock<Names> = LazyLock::new(|| {
    let table = |object: Object| {
        let members = object.shape().members.iter();
        let names = members.map(|entry| (!entry.later).then_some(entry.wire));
        Table::new(&names.collect::<Vec<_>>(), object.shape())
    };
    Names::of(Object::ALL.into_iter().map(table).collect())
});

impl Default for Names {
    fn default() -> Self {
        USUAL.clone()
    }
}

impl Names {
    fn of(tables: Vec<Table>) -> Self {
        let names = Field::all().map(|field| tables[field.object as usize].name(field.index).unwrap_or_default());
        let id = print::of_bytes(names.collect::<Vec<_>>().join("\n").as_bytes());
        let plain = Field::all().all(|field| tables[field.object as usize].is_plain(field.index, field.usual_name()));
        Self {
            places: tables.iter().any(Table::has_places),
            tables: tables.into(),
            id,
            plain,
        }
    }

    /// The default names with these changes.
    fn changed(changes: &BTreeMap<String, BTreeMap<String, Value>>) -> Result<Self, NamesError> {
        let mut tables = USUAL.tables.to_vec();
        for (object, changes) in changes {
            let found = Object::of_name(object).ok_or_else(|| NamesError::NoObject(object.clone()))?;
            let shape = found.shape();
            let mut members: Vec<Option<&str>> = shape
                .members
                .iter()
                .map(|entry| (!entry.later).then_some(entry.wire))
                .collect();
            let mut further = Vec::new();
            for (member, change) in changes {
                let at = shape.members.iter().position(|entry| entry.wire == member);
                let at = at.ok_or_else(|| NamesError::NoMember {
                    object: object.clone(),
                    member: member.clone(),
                })?;
                let no_name = || NamesError::NoName {
                    object: object.clone(),
                    member: member.clone(),
                    name: change.to_string(),
                };
                members[at] = match change {
                    Value::Bool(has) => has.then_some(shape.members[at].wire),
                    Value::String(name) if is_name(name) => Some(name),
                    Value::Object(_) => {
                        let told = Details::deserialize(change.clone()).map_err(|_| no_name())?;
                        further.push((at, told));
                        let own = told_name(change);
                        if own.is_some_and(|name| !is_name(name)) {
                            return Err(no_name());
                        }
                        own.or(members[at])
                    }
                    _ => return Err(no_name()),
                };
            }
            let mut table = Table::new(&members, shape);
            for (at, told) in further {
                table.tell(at, told);
            }
            if let Some(name) = table.doubled() {
                return Err(NamesError::Twice {
                    object: object.clone(),
                    name: name.to_owned(),
                });
            }
            tables[found as usize] = table;
        }
        Ok(Self::of(tables))
    }

    /// A number that tells these names from others: what was read by the one is not what is read by the other.
    #[must_use]
    pub const fn id(&self) -> u64 {
        self.id
    }

    /// What the version calls a member, with a slash where it stands inside another one; `None` when it has none.
    #[must_use]
    pub fn name(&self, field: Field) -> Option<&str> {
        self.table(field.object).name(field.index)
    }

    /// Whether the version has no such member.
    #[must_use]
    pub fn lacks(&self, field: Field) -> bool {
        self.name(field).is_none()
    }

    /// What stands in a message at the end of a path of fields: to show it as evidence, or to look for what only a device
    /// knows the name of.
    #[must_use]
    pub fn raw<'v>(&self, message: &'v Value, path: &[Field]) -> Option<&'v Value> {
        path.iter()
            .try_fold(message, |here, field| match self.name(*field)?.split_once('/') {
                None => here.get(self.name(*field)?),
                Some((outer, inner)) => here.get(outer)?.get(inner),
            })
    }

    /// The elements of a list of a message as they stand there, to show them as evidence; none where it is no list.
    #[must_use]
    pub fn raw_elements<'v>(&self, object: &'v Value, list: Field) -> &'v [Value] {
        let found = self.raw(object, &[list]).and_then(Value::as_array);
        found.map_or(&[], Vec::as_slice)
    }

    pub(crate) fn table(&self, object: Object) -> &Table {
        &self.tables[object as usize]
    }
}

/// The name that a table says beside other things.
fn told_name(change: &Value) -> Option<&str> {
    change.get("name")?.as_str()
}

/// Whether it is a name, or two with a slash between them.
fn is_name(name: &str) -> bool {
    name.split('/').count() <= 2 && !name.split('/').any(str::is_empty)
}

impl<'de> Deserialize<'de> for Names {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let changes = BTreeMap::deserialize(deserializer)?;
        Self::changed(&changes).map_err(serde::de::Error::custom)
    }
}
