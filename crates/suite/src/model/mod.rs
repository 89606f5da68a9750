//! What a test is, once it has been read and linted.

mod conversation;
mod later;
mod monitor;
mod path;
mod purpose;
mod schema_cases;
mod serve;
mod tags;
mod vehicle;

use std::sync::Arc;

use tck_base::diagnostic::{Source, Span};
use tck_base::pattern::{Pattern, Term};
use tck_pack::{RequirementId, Role, VersionRange};

/// One scripted exchange; one row of `cases:` is one test.
#[derive(Clone, Debug)]
pub struct Test {
    /// Path below `suites/<role>/` without extension, and `[case]` for a row of a table.
    pub id: String,
    /// The part of the id before the first slash.
    pub group: String,
    /// One sentence.
    pub title: String,
    /// Which side it tests.
    pub device: Role,
    /// Protocol versions it is written for.
    pub spec: VersionRange,
    /// What the device, bench or profile must offer.
    pub needs: Vec<Need>,
    /// Whether the vehicle will drive.
    pub moves: bool,
    /// Words of its author that it is filed under; [`Test::tags`] has them all.
    pub tags: Vec<String>,
    /// What it says one after the other, when it is a conversation that was written down.
    pub conversation: Vec<ConversationPart>,
    /// The node on which the vehicle has to stand when it begins; where it stands, when nothing is said.
    pub begins: Option<String>,
    /// How far the test itself is trusted.
    pub maturity: Maturity,
    /// Why anybody cares.
    pub why: String,
    /// Preamble: unreached is inconclusive.
    pub given: Vec<Step>,
    /// Body: decides.
    pub steps: Vec<Step>,
    /// Postamble: always runs, decides nothing.
    pub finally: Vec<Step>,
    /// The file.
    pub source: Arc<Source>,
    /// The names of course nodes it uses, in order of appearance, and the pairs it drives.
    pub course: CourseNeed,
    /// Where it comes from, when it is one of many cases of which a run takes some.
    pub drawn: Option<Drawn>,
}

impl Test {
    /// What it is known by where the cases that a run draws from count as one: its table, else its id.
    #[must_use]
    pub fn table(&self) -> &str {
        match self.drawn {
            Some(_) => self.id.split('[').next().unwrap_or(&self.id),
            None => &self.id,
        }
    }

    /// Every step with its section, in the order they run.
    pub fn sections(&self) -> [(Section, &[Step]); 3] {
        [
            (Section::Given, &self.given),
            (Section::Steps, &self.steps),
            (Section::Finally, &self.finally),
        ]
    }

    /// Every requirement a clause of this test decides, in order, once.
    #[must_use]
    pub fn requirements(&self) -> Vec<RequirementId> {
        let mut all = Vec::new();
        let owed = self.given.iter().filter(|step| step.owes);
        for step in owed.chain(&self.steps) {
            for (id, _) in step.clauses() {
                if !all.contains(&id) {
                    all.push(id);
                }
            }
        }
        all
    }

    /// Whether it speaks to, or of, a second mock vehicle.
    #[must_use]
    pub fn needs_second_vehicle(&self) -> bool {
        let mut steps = self.sections().into_iter().flat_map(|(_, steps)| steps);
        steps.any(|step| step.verb.concerns_second_vehicle())
    }
}

/// A part of a test.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Section {
    /// `given`.
    Given,
    /// `steps`.
    Steps,
    /// `finally`.
    Finally,
}

/// How far a test is trusted.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Maturity {
    /// No second reader has held it against the standard yet.
    Open,
    /// What it holds true is disputed, for this reason: a finding of it wants a second look.
    Watchlist(String),
    /// A second reader has held it against the standard: when, and what was looked at.
    Reviewed(String),
}

impl Maturity {
    /// The word used in results.
    #[must_use]
    pub fn word(&self) -> &'static str {
        match self {
            Self::Open => "not reviewed",
            Self::Watchlist(_) => "watchlist",
            Self::Reviewed(_) => "reviewed",
        }
    }

    /// What is noted about it.
    #[must_use]
    pub fn note(&self) -> Option<&str> {
        match self {
            Self::Open => None,
            Self::Watchlist(note) | Self::Reviewed(note) => Some(note),
        }
    }
}

/// What a test needs to be applicable.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub enum Need {
    /// `action NAME` or `action NAME SCOPE`: the factsheet lists it (in that scope).
    Action {
        /// actionType.
        name: String,
        /// `INSTANT`, `NODE`, `EDGE` or `ZONE`.
        scope: Option<String>,
    },
    /// `no action NAME`: the factsheet does not list it.
    NoAction(String),
    /// `optional PATH`: the factsheet lists this optional parameter as supported or required.
    Optional(String),
    /// `no optional PATH`: the factsheet does not list it.
    NoOptional(String),
    /// `not required PATH`: the factsheet does not list it as required, or not at all.
    NotRequired(String),
    /// `vantage tap`: packets can be seen.
    Tap,
    /// `maps`: the bench can serve map files to the device.
    MapServer,
    /// `files over TLS`: the bench can serve files to the device over TLS.
    SecuredFiles,
    /// `hook NAME`: the profile has a hook of this name.
    Hook(String),
    /// `profile NAME`: the profile says so in `[device]`, such as `stops-between-nodes`,
    /// `node-bound`, `interruptible-actions`.
    Profile(String),
    /// `zone TYPE`: the factsheet says that the vehicle heeds zones of this type; `zones`: of any type.
    Zone(Option<String>),
    /// `no zone TYPE`: the vehicle does not heed zones of this type.
    NoZone(String),
    /// `limit NAME`: the factsheet states this protocol limit, such as `maxArrayLens.order.nodes`.
    Limit(String),
}

pub use conversation::{BrokenMember, ConversationPart, place_in_body};
pub use later::later;
pub use monitor::{About, Monitor, Recordings, Rule};
pub use path::Path;
pub use purpose::Purpose;
pub use schema_cases::{Drawn, Kind};
pub use serve::{CertificateFile, Serve};
pub use tck_course::CourseNeed;
pub use tck_journal::ServeBehaviour;
pub use vehicle::{VehicleStep, Which};

/// One step.
#[derive(Clone, Debug)]
pub struct Step {
    /// Where it stands: `steps[3]`; inlined steps carry the state's name: `given[0]/idle-on-course[2]`.
    pub path: String,
    /// One line for people.
    pub title: Option<String>,
    /// Versions it is for.
    pub spec: Option<VersionRange>,
    /// The verb and its arguments; shared by the tests that use the same state.
    pub verb: Arc<Verb>,
    /// What the innermost state that it comes from, and that says so, is for.
    pub purpose: Option<Purpose>,
    /// Whether its requirements stand under `owes:`: a precondition that is itself an obligation of the device.
    pub owes: bool,
    /// Whether its requirements stand under `prefers:`: broken is a warning by a ruling of the catalogue.
    pub prefers: bool,
    /// The whole step.
    pub span: Span,
    /// Key and value of the verb, for carets: `expect: state`.
    pub verb_span: Span,
}

impl Step {
    /// The clauses of this step: requirement and path of the clause.
    #[must_use]
    pub fn clauses(&self) -> Vec<(RequirementId, String)> {
        let mut all = Vec::new();
        let word = match (self.owes, self.prefers) {
            (true, _) => ".owes",
            (_, true) => ".prefers",
            _ => ".checks",
        };
        let mut checks = |bindings: &[Binding], suffix: &str| {
            all.extend(
                bindings
                    .iter()
                    .map(|b| (b.requirement.clone(), format!("{}{suffix}", self.path))),
            );
        };
        match &*self.verb {
            Verb::Expect(step) => {
                checks(&step.checks, word);
                let asserts = step.assert.iter().chain(&step.prefer);
                for assertion in asserts {
                    let kind = if step.prefer.iter().any(|other| std::ptr::eq(other, assertion)) {
                        "prefer"
                    } else {
                        "assert"
                    };
                    all.push((assertion.requirement.clone(), format!("{}.{kind}", self.path)));
                }
            }
            Verb::Never(step) => checks(&step.checks, word),
            Verb::Always(step) => {
                checks(&step.checks, word);
                if let Extent::Until(until) = &step.extent {
                    checks(&until.checks, ".until");
                }
            }
            Verb::Action(step) => checks(&step.checks, word),
            Verb::Retained(step) => {
                checks(&step.checks, word);
                for assertion in &step.assert {
                    all.push((assertion.requirement.clone(), format!("{}.assert", self.path)));
                }
            }
            Verb::Send(_) | Verb::Link(_) | Verb::Serve(_) | Verb::Operator(_) | Verb::Vehicle(_) => {}
        }
        all
    }
}

/// A requirement bound to the clause that decides it.
#[derive(Clone, Debug)]
pub struct Binding {
    /// The requirement.
    pub requirement: RequirementId,
    /// Where it is written.
    pub span: Span,
}

/// What a step does.
#[derive(Clone, Debug)]
pub enum Verb {
    /// Publish something.
    Send(Box<Send>),
    /// A matching message arrives.
    Expect(Box<Expect>),
    /// No matching message arrives.
    Never(Box<Never>),
    /// Every message matches.
    Always(Box<Always>),
    /// An action walks through these statuses.
    Action(Box<ActionWalk>),
    /// A fresh subscriber receives it with RETAIN set.
    Retained(Box<Retained>),
    /// Act on the tap.
    Link(LinkStep),
    /// Offer a file over HTTP.
    Serve(Serve),
    /// Run a hook of the profile.
    Operator(Operator),
    /// Say something to a mock vehicle (master control under test).
    Vehicle(VehicleStep),
}

/// `send:`.
#[derive(Clone, Debug)]
pub struct Send {
    /// Topic name.
    pub topic: String,
    /// Members laid over what the harness builds (JSON merge, `null` removes).
    pub payload: Option<Term>,
    /// Nodes and edges by course names.
    pub route: Option<Route>,
    /// Actions of an instantActions message.
    pub actions: Vec<SendAction>,
    /// How the finished message is broken.
    pub patch: Option<Patch>,
    /// These very bytes instead of a message.
    pub raw: Option<Raw>,
    /// QoS other than the pack's.
    pub qos: Option<u8>,
    /// Set RETAIN.
    pub retain: bool,
    /// On the topic of another vehicle, which there is not.
    pub neighbour: bool,
}

/// What `raw:` publishes.
#[derive(Clone, Debug)]
pub enum Raw {
    /// Text.
    Text(Term),
    /// `base64: …`.
    Bytes(Vec<u8>),
}

/// One instant action, or one action of a route element.
#[derive(Clone, Debug)]
pub struct SendAction {
    /// actionType.
    pub action: Term,
    /// The name other steps know it by; `${NAME.id}` is its actionId.
    pub name: Option<String>,
    /// Parameters.
    pub with: Vec<(String, Term)>,
    /// A mapping of parameters that comes from a variable, laid under `with`.
    pub with_all: Option<Term>,
    /// blockingType; `HARD` unless said.
    pub blocking: Option<Term>,
    /// Where it is written.
    pub span: Span,
}

/// A way over the course.
#[derive(Clone, Debug)]
pub struct Route {
    /// Released nodes.
    pub base: Vec<String>,
    /// Unreleased nodes.
    pub horizon: Vec<String>,
    /// sequenceId of the first node; found from the order sent before unless said.
    pub from: Option<u32>,
    /// Actions on nodes (`b`) and edges (`a-b`), by name. A name that occurs twice means the first.
    pub actions: Vec<(RoutePlace, Vec<SendAction>)>,
    /// Where it is written.
    pub span: Span,
}

/// A node or an edge of a route.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum RoutePlace {
    /// `b`.
    Node(String),
    /// `a-b`.
    Edge(String, String),
}

/// `patch:`.
#[derive(Clone, Debug)]
pub enum Patch {
    /// A mapping: JSON Merge Patch (RFC 7396).
    Merge(Term),
    /// A list: JSON Patch (RFC 6902).
    Operations(Term),
}

/// `where` and `check` of a clause.
#[derive(Clone, Debug, Default)]
pub struct Selection {
    /// The picture of the message; absent takes any.
    pub pattern: Option<Pattern>,
    /// A named check that has to hold as well.
    pub check: Option<CheckUse>,
}

/// A named check used in a test or monitor.
#[derive(Clone, Debug)]
pub struct CheckUse {
    /// Name in the registry, such as `order/remaining-route`.
    pub name: String,
    /// Arguments, if it takes any.
    pub with: Vec<(String, Term)>,
    /// Where it is written.
    pub span: Span,
}

/// A duration: `${time.react}` or `800 ms`, `5 s`, `2 min`.
#[derive(Clone, Debug)]
pub struct TimeTerm {
    /// Resolves to a name of `time.*` or a number of milliseconds.
    pub term: Term,
}

/// Where a scan begins.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum From {
    /// At the cursor (`expect`), at the mark (`never`, `always`).
    #[default]
    Usual,
    /// At the last stimulus.
    Mark,
    /// At the cursor.
    Here,
    /// Where the step itself begins: what came while an earlier step only waited is left aside.
    Now,
    /// The most recent message there is, whenever it came; then new ones.
    Latest,
    /// At the start of the test.
    Test,
}

/// One requirement and the picture that decides it.
#[derive(Clone, Debug)]
pub struct Assertion {
    /// The requirement.
    pub requirement: RequirementId,
    /// What the picked message must show.
    pub selection: Selection,
    /// Where it is written.
    pub span: Span,
}

/// `expect:`.
#[derive(Clone, Debug)]
pub struct Expect {
    /// Topic name, or `mqtt/connect`, `mqtt/publish`, `http/fetch` and so on.
    pub topic: String,
    /// Whose topic, with a master control under test.
    pub of: Which,
    /// What is decided by the picking itself.
    pub checks: Vec<Binding>,
    /// Which message is picked.
    pub selection: Selection,
    /// How long it may take, from the mark.
    pub within: TimeTerm,
    /// Where the scan begins.
    pub from: From,
    /// What the picked message must show.
    pub assert: Vec<Assertion>,
    /// What the picked message should show: broken is a warning by a ruling of the catalogue.
    pub prefer: Vec<Assertion>,
    /// Values to keep: name and path into the picked message.
    pub save: Vec<(String, Path)>,
}

/// `never:`.
#[derive(Clone, Debug)]
pub struct Never {
    /// Topic name.
    pub topic: String,
    /// Whose topic, with a master control under test.
    pub of: Which,
    /// What it decides.
    pub checks: Vec<Binding>,
    /// What must not come.
    pub selection: Selection,
    /// For how long, from now.
    pub during: TimeTerm,
    /// Where the scan begins.
    pub from: From,
}

/// `always:`.
#[derive(Clone, Debug)]
pub struct Always {
    /// Topic name.
    pub topic: String,
    /// Whose topic, with a master control under test.
    pub of: Which,
    /// What it decides.
    pub checks: Vec<Binding>,
    /// What every message must show.
    pub selection: Selection,
    /// Where the scan begins.
    pub from: From,
    /// How long.
    pub extent: Extent,
}

/// How long an `always` looks.
#[derive(Clone, Debug)]
pub enum Extent {
    /// `during:`, from now.
    During(TimeTerm),
    /// `until:` a message comes.
    Until(Box<Until>),
}

/// `until:` of an `always`.
#[derive(Clone, Debug)]
pub struct Until {
    /// Topic name; that of the `always` unless said.
    pub topic: String,
    /// Whose topic, with a master control under test.
    pub of: Which,
    /// What is decided by this message coming in time.
    pub checks: Vec<Binding>,
    /// The message.
    pub selection: Selection,
    /// How long it may take, from the mark.
    pub within: TimeTerm,
    /// Where it is written.
    pub at: Span,
}

/// `action:`.
#[derive(Clone, Debug)]
pub struct ActionWalk {
    /// Name given by `as`.
    pub name: String,
    /// What it decides.
    pub checks: Vec<Binding>,
    /// The walk that passes.
    pub through: Walk,
    /// A walk that is a warning by a ruling of the catalogue.
    pub tolerated: Option<Walk>,
    /// How long it may take, from the mark.
    pub within: TimeTerm,
    /// Values to keep, from the message that ended the walk.
    pub save: Vec<(String, Path)>,
}

/// `WAITING? -> RUNNING -> FINISHED | FAILED`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Walk {
    /// The stations in order.
    pub stations: Vec<Station>,
}

impl std::fmt::Display for Walk {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        for (at, station) in self.stations.iter().enumerate() {
            let before = if at == 0 { "" } else { ", then " };
            let perhaps = if station.optional { "perhaps " } else { "" };
            write!(f, "{before}{perhaps}{}", station.statuses.join(" or "))?;
        }
        Ok(())
    }
}

/// One station of a walk.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Station {
    /// Any of these statuses.
    pub statuses: Vec<String>,
    /// `?`: may be skipped, because states coalesce.
    pub optional: bool,
}

/// `retained:`.
#[derive(Clone, Debug)]
pub struct Retained {
    /// Topic name.
    pub topic: String,
    /// What it decides.
    pub checks: Vec<Binding>,
    /// What the message must show.
    pub selection: Selection,
    /// How long it may take, from now.
    pub within: TimeTerm,
    /// What the message must show, requirement by requirement.
    pub assert: Vec<Assertion>,
}

/// `link:`.
#[derive(Clone, Debug)]
pub struct LinkStep {
    /// What is done to the link.
    pub fault: tck_journal::event::LinkFault,
}

/// `operator:`.
#[derive(Clone, Debug)]
pub struct Operator {
    /// Name of the hook.
    pub hook: String,
    /// Parameters.
    pub with: Vec<(String, Term)>,
    /// How long it may take.
    pub within: Option<TimeTerm>,
    /// Whether it is run for every mock AGV, one after the other, with `${each.…}` about that one.
    pub each: bool,
}
