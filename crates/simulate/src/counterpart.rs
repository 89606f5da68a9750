//! Counterparts: how known products behave, as named sets of deviations of the reference devices.
//!
//! Each is a file of `counterparts/`. A habit is something that a product was seen to do, with the place where it can be
//! read and the day. A simulated device takes all of them. The harness of a run takes only what the standard permits: its own
//! messages must not break what it judges others by, so that nobody is accused of his answer to them.

use std::sync::Arc;

use super::built_in::BuiltIn;
use super::reference_agv::ReferenceAgv;
use tck_base::diagnostic::{self, Diagnostic, Source, did_you_mean};
use tck_base::yaml::{self, Node};
use tck_engine::{Manner, Manners};
use tck_pack::Role;
use tck_pack::reader::Reader;

const CODE: &str = "counterpart";
const KEYS: [&str; 8] = [
    "counterpart",
    "title",
    "role",
    "protocol",
    "topic-template",
    "source",
    "seen",
    "habits",
];
const HABIT_KEYS: [&str; 7] = [
    "does",
    "as",
    "manner",
    "only-simulated",
    "not-imitated",
    "where",
    "seen",
];

/// What a deviation of a reference device is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DeviationKind {
    /// It breaks the standard.
    Fault,
    /// It breaks what ends in a warning.
    Lapse,
    /// The standard permits it.
    Tolerance,
}

impl DeviationKind {
    /// The word used in outputs.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Fault => "fault",
            Self::Lapse => "lapse",
            Self::Tolerance => "tolerance",
        }
    }
}

/// A deviation of a reference device, by its name.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Deviation {
    /// Name, as in `list faults` and `list tolerances`.
    pub name: &'static str,
    /// What it is.
    pub kind: DeviationKind,
}

impl Deviation {
    /// The deviation of this name of the reference device of a role.
    fn find(role: Role, name: &str) -> Option<Self> {
        let known = Self::all(role).find(|known| *known == name)?;
        let is_fault = BuiltIn::faults(role).iter().any(|fault| fault.name == known);
        let kind = match (is_fault, BuiltIn::lapse(role, known)) {
            (false, _) => DeviationKind::Tolerance,
            (true, Some(_)) => DeviationKind::Lapse,
            (true, None) => DeviationKind::Fault,
        };
        Some(Self { name: known, kind })
    }

    fn all(role: Role) -> impl Iterator<Item = &'static str> + Clone {
        let faults = BuiltIn::faults(role).iter().map(|fault| fault.name);
        faults.chain(BuiltIn::tolerances(role).iter().map(|one| one.name))
    }
}

/// What is done about a habit.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Imitation {
    /// It is imitated.
    Imitated {
        /// By a simulated device; none where the reference device has the habit itself.
        deviation: Option<Deviation>,
        /// By the harness in a run, where it plays the master control.
        manner: Option<Manner>,
        /// Why no mock vehicle of a run takes it.
        only_simulated: Option<String>,
    },
    /// It is not imitated, for this reason.
    Not(String),
}

/// Something a product was seen to do.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Habit {
    /// What it does, in one sentence.
    pub does: String,
    /// What is done about it.
    pub imitation: Imitation,
    /// Where it can be read: a file of the source, or an issue.
    pub place: String,
    /// The day on which it was seen.
    pub seen: String,
}

impl Habit {
    /// The deviation by which a simulated device imitates it.
    #[must_use]
    pub fn deviation(&self) -> Option<Deviation> {
        match &self.imitation {
            Imitation::Imitated { deviation, .. } => *deviation,
            Imitation::Not(_) => None,
        }
    }

    /// The manner in which the harness imitates it as a master control.
    #[must_use]
    pub fn manner(&self) -> Option<Manner> {
        match &self.imitation {
            Imitation::Imitated { manner, .. } => *manner,
            Imitation::Not(_) => None,
        }
    }

    /// The tolerance by which mock vehicles of a run imitate it.
    fn of_mocks(&self) -> Option<&'static str> {
        let Imitation::Imitated {
            deviation: Some(deviation),
            manner: None,
            only_simulated: None,
        } = &self.imitation
        else {
            return None;
        };
        (deviation.kind == DeviationKind::Tolerance).then_some(deviation.name)
    }
}

/// A known product, as the other side meets it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Counterpart {
    /// Name, as after `--like`.
    pub name: String,
    /// What it is.
    pub title: String,
    /// Which side it is.
    pub role: Role,
    /// The protocol version it speaks, where it speaks one only.
    pub protocol: Option<String>,
    /// How its topics begin, where it does not take the usual ones.
    pub topic_template: Option<String>,
    /// Repository and version in which its habits were seen.
    pub source: String,
    /// Its habits.
    pub habits: Vec<Habit>,
}

impl Counterpart {
    /// The faults and lapses of a device that is simulated like it.
    pub fn faults(&self) -> impl Iterator<Item = &'static str> {
        self.of_kind(|kind| kind != DeviationKind::Tolerance)
    }

    /// The tolerances of a device that is simulated like it.
    pub fn tolerances(&self) -> impl Iterator<Item = &'static str> {
        self.of_kind(|kind| kind == DeviationKind::Tolerance)
    }

    fn of_kind(&self, wanted: impl Fn(DeviationKind) -> bool) -> impl Iterator<Item = &'static str> {
        let all = self.habits.iter().filter_map(Habit::deviation);
        all.filter(move |deviation| wanted(deviation.kind))
            .map(|deviation| deviation.name)
    }

    /// How the harness of a run words its messages like it.
    #[must_use]
    pub fn manners(&self) -> Manners {
        Manners::new(self.habits.iter().filter_map(Habit::manner))
    }

    /// What the harness of a run takes of it, by name: manners of a master control, or tolerances of vehicles.
    #[must_use]
    pub fn in_run(&self) -> Vec<&'static str> {
        let all = self.habits.iter();
        match self.role {
            Role::MasterControl => all.filter_map(Habit::manner).map(Manner::word).collect(),
            Role::Agv => all.filter_map(Habit::of_mocks).collect(),
        }
    }

    /// Lets a mock vehicle behave like it, as far as the standard permits.
    pub fn shape(&self, vehicle: &mut ReferenceAgv) {
        for name in self.habits.iter().filter_map(Habit::of_mocks) {
            // Every name was found among the tolerances when the file was read.
            let _ = vehicle.tolerate(name);
        }
    }

    /// What a report says of a run in which the harness was like it, in one sentence.
    #[must_use]
    pub fn limit(&self) -> String {
        let who = match self.role {
            Role::MasterControl => "The harness",
            Role::Agv => "The mock vehicles",
        };
        let taken = self.in_run();
        let (title, name) = (self.in_sentence(), &self.name);
        if taken.is_empty() {
            return format!(
                "`--like {name}` had no effect: {title} (counterpart {name}) has no habit that a run may take, and {} behaved as always.",
                who.to_lowercase()
            );
        }
        format!(
            "{who} behaved like {title} (counterpart {name}) in what a run permits: {}.",
            taken.join(", ")
        )
    }

    /// What it is, within a sentence: an article is written small there.
    fn in_sentence(&self) -> String {
        for (large, small) in [("A ", "a "), ("An ", "an "), ("The ", "the ")] {
            if let Some(rest) = self.title.strip_prefix(large) {
                return format!("{small}{rest}");
            }
        }
        self.title.clone()
    }
}

/// The counterparts that are known.
#[derive(Clone, Debug, Default)]
pub struct Counterparts(Vec<Counterpart>);

impl Counterparts {
    /// Reads files, each with its path and its text.
    ///
    /// # Errors
    /// Every mistake in them, with its place.
    pub fn read(files: impl IntoIterator<Item = (String, String)>) -> Result<Self, Vec<Diagnostic>> {
        let mut all = Vec::new();
        let mut problems = Vec::new();
        for (path, text) in files {
            all.extend(file(&Source::new(path, text), &mut problems));
        }
        if !problems.is_empty() {
            return Err(problems);
        }
        all.sort_by(|a: &Counterpart, b| a.name.cmp(&b.name));
        Ok(Self(all))
    }

    /// Every counterpart, by name.
    pub fn all(&self) -> impl Iterator<Item = &Counterpart> {
        self.0.iter()
    }

    /// The counterpart of this name, for this side.
    ///
    /// # Errors
    /// When there is none.
    pub fn find(&self, name: &str, role: Role) -> Result<&Counterpart, Diagnostic> {
        let found = self.0.iter().find(|one| one.name == name);
        if let Some(one) = found.filter(|one| one.role == role) {
            return Ok(one);
        }
        let title = match found {
            Some(one) => format!(
                "the counterpart `{name}` is of role {}, and {role} is meant here",
                one.role
            ),
            None => format!("there is no counterpart `{name}`"),
        };
        let names = self
            .0
            .iter()
            .filter(|one| one.role == role)
            .map(|one| one.name.as_str());
        let hint = match diagnostic::closest(name, names.clone()) {
            Some(close) => format!("did you mean `{close}`?"),
            None => format!(
                "there are {}; see `vda5050-tck list counterparts`",
                names.collect::<Vec<_>>().join(", ")
            ),
        };
        Err(Diagnostic::whole(CODE, title).hint(hint))
    }
}

/// One file; mistakes are added to `problems`.
fn file(source: &Arc<Source>, problems: &mut Vec<Diagnostic>) -> Option<Counterpart> {
    let root = match yaml::tree(source) {
        Ok(root) => root,
        Err(mistakes) => {
            problems.extend(mistakes);
            return None;
        }
    };
    let mut reader = Reader::new(CODE, problems);
    reader.known(&root, &KEYS);
    let name = reader.text(&root, "counterpart")?;
    let stem = source
        .name
        .rsplit('/')
        .next()
        .and_then(|file| file.strip_suffix(".yaml"));
    if let Some(place) = root.get("counterpart").filter(|_| stem != Some(name.as_str())) {
        let hint = format!("call the file {name}.yaml");
        reader.problem(
            place,
            "a counterpart that its file is not named after",
            "another name",
            &hint,
        );
    }
    let title = reader.text(&root, "title");
    let role: Option<Role> = reader.choice(&root, "role", &["agv", "master-control"]);
    let seen = day(&mut reader, &root)?;
    let from = reader.text(&root, "source");
    let items = reader.list(&root, "habits").unwrap_or_default();
    let role = role?;
    let habits: Vec<Option<Habit>> = items.iter().map(|item| habit(&mut reader, item, role, &seen)).collect();
    let optional = |reader: &mut Reader<'_>, key| root.get(key).and_then(|node| reader.as_text(node));
    let (protocol, topic_template) = (
        optional(&mut reader, "protocol"),
        optional(&mut reader, "topic-template"),
    );
    Some(Counterpart {
        name,
        title: title?,
        role,
        protocol,
        topic_template,
        source: from?,
        habits: habits.into_iter().collect::<Option<_>>()?,
    })
}

/// The day on which something was seen.
fn day(reader: &mut Reader<'_>, node: &Node) -> Option<String> {
    let text = reader.text(node, "seen")?;
    if text.parse::<jiff::civil::Date>().is_err()
        && let Some(place) = node.get("seen")
    {
        reader.problem(place, "a day that is none", "not a day", "write it as \"2026-11-27\"");
    }
    Some(text)
}

fn habit(reader: &mut Reader<'_>, node: &Node, role: Role, seen: &str) -> Option<Habit> {
    reader.known(node, &HABIT_KEYS);
    let does = reader.text(node, "does");
    let place = reader.text(node, "where");
    let seen = match node.get("seen") {
        Some(_) => day(reader, node)?,
        None => seen.to_owned(),
    };
    let imitation = imitation(reader, node, role);
    Some(Habit {
        does: does?,
        imitation: imitation?,
        place: place?,
        seen,
    })
}

fn imitation(reader: &mut Reader<'_>, node: &Node, role: Role) -> Option<Imitation> {
    let named = [node.get("as"), node.get("manner"), node.get("only-simulated")];
    if let Some(why) = node.get("not-imitated") {
        if let Some(place) = named.into_iter().flatten().next() {
            let title = "a habit that is imitated and is not";
            reader.problem(place, title, "beside `not-imitated`", "take one of the two out");
            return None;
        }
        return reader.as_text(why).map(Imitation::Not);
    }
    let [deviation, manner, only_simulated] = named;
    if deviation.is_none() && manner.is_none() {
        let hint = "name a deviation of the reference device with `as:`, or say why there is none with `not-imitated:`";
        reader.problem(node, "a habit of which nothing comes", "neither imitated nor not", hint);
        return None;
    }
    let only_simulated = match only_simulated {
        Some(why) => Some(reader.as_text(why)?),
        None => None,
    };
    Some(Imitation::Imitated {
        deviation: match deviation {
            Some(place) => Some(named_deviation(reader, place, role)?),
            None => None,
        },
        manner: match manner {
            Some(place) => Some(named_manner(reader, place, role)?),
            None => None,
        },
        only_simulated,
    })
}

fn named_deviation(reader: &mut Reader<'_>, place: &Node, role: Role) -> Option<Deviation> {
    let name = reader.as_text(place)?;
    let found = Deviation::find(role, &name);
    if found.is_none() {
        let title = format!("the reference device of role {role} has no fault or tolerance `{name}`");
        let hint = match diagnostic::closest(&name, Deviation::all(role)) {
            Some(close) => format!("did you mean `{close}`?"),
            None => "see `list faults` and `list tolerances`, or say why it is `not-imitated:`".to_owned(),
        };
        reader.problem(place, &title, "no such deviation", &hint);
    }
    found
}

fn named_manner(reader: &mut Reader<'_>, place: &Node, role: Role) -> Option<Manner> {
    let name = reader.as_text(place)?;
    if role == Role::Agv {
        let title = "a manner of the harness for a vehicle";
        let hint = "mock vehicles of a run take the tolerances named with `as:`; take it out";
        reader.problem(place, title, "for a master control", hint);
        return None;
    }
    let found = Manner::ALL.into_iter().find(|manner| manner.word() == name);
    if found.is_none() {
        let title = format!("the harness has no manner `{name}`");
        let hint = did_you_mean(&name, Manner::ALL.map(Manner::word));
        reader.problem(place, &title, "no such manner", &hint);
    }
    found
}

#[cfg(test)]
mod tests;
