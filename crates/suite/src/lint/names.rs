//! The names of variables that have a value without a step that gives them one, and what each of them means.

use tck_profile::{Place, SAMPLE_ACTIONS, SampleKind};

/// A variable, for people.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Variable {
    /// As it is written between the braces; a part in capitals stands for a name.
    pub name: String,
    /// What it is.
    pub doc: String,
}

/// The names of `time.`.
pub(super) const TIMES: [(&str, &str); 14] = [
    ("react", "What must happen has happened by then."),
    ("slow", "What happens later than this is a warning."),
    ("event", "A state that an event asks for is published by then."),
    ("drive", "A drive over an edge of the course is over by then."),
    ("download", "A download of a map is over by then."),
    ("connect", "The device has connected by then."),
    (
        "reconnect",
        "A device whose connection was cut has connected again by then.",
    ),
    (
        "will",
        "The broker has published the last will by then: one and a half keep-alives of the device, and a margin.",
    ),
    ("quiet", "For so long nothing may happen where nothing should."),
    ("broker", "The own part of the broker."),
    ("statePeriod", "The longest time between two states."),
    ("settle", "For so long the device is left alone to settle."),
    (
        "notice",
        "So long a message may lie unread at a master control before it counts as known.",
    ),
    (
        "look",
        "A time that fits several times into a slow drive over the first edge of the course.",
    ),
];

/// The members of a sample action that suites may use.
fn members(sample: &SampleKind) -> impl Iterator<Item = (&'static str, &'static str)> {
    let own = match sample.place {
        Place::Anywhere => None,
        Place::Zone => Some(("list", "its parameters as a list, as a zone has them")),
        Place::Shown => Some(("shows", "the information that shows it")),
        Place::Node => Some(("node", "the node where it is performed")),
        Place::Edge => Some(("edge", "the edge where it is performed")),
    };
    [
        ("type", "its actionType"),
        ("parameters", "its parameters, or one of them behind a dot"),
    ]
    .into_iter()
    .chain(own)
}

/// The names of `device.` that a profile may give.
pub(super) fn of_profile() -> Vec<String> {
    let all = SAMPLE_ACTIONS.iter();
    let names = all.flat_map(|sample| members(sample).map(|(member, _)| format!("{}.{member}", sample.variable)));
    names.collect()
}

/// Every variable there is without a step that defines it.
#[must_use]
pub fn variables() -> Vec<Variable> {
    let variable = |name: &str, doc: &str| Variable {
        name: name.to_owned(),
        doc: doc.to_owned(),
    };
    let mut all: Vec<Variable> = TIMES
        .iter()
        .map(|(name, doc)| variable(&format!("time.{name}"), doc))
        .collect();
    all.extend([
        variable("device.manufacturer", "Manufacturer of the vehicle under test."),
        variable("device.serialNumber", "Serial number of the vehicle under test."),
        variable("device.factsheet.PATH", "What its factsheet says there."),
    ]);
    for sample in SAMPLE_ACTIONS {
        let own = members(sample).map(|(member, what)| {
            let doc = format!("{} Of it: {what}.", sample.doc);
            variable(&format!("device.{}.{member}", sample.variable), &doc)
        });
        all.extend(own);
    }
    all.extend([
        variable(
            "course.NODE",
            "The nodeId of a node of the course: `a` is where the vehicle stands, `b` the next one, `far` is out of reach. \
             Members stand behind a dot, such as `course.a.x`.",
        ),
        variable(
            "course.NODE-NODE",
            "The edgeId of an edge of the course, such as `course.a-b`; members as of a node.",
        ),
        variable("run.NAME", "A fresh id, the same wherever the test writes the name."),
        variable(
            "now.in-2s",
            "In a message that is sent: the time so many seconds, or milliseconds (`now.in-500ms`), after it is made.",
        ),
        variable("serve.NAME.url", "Address of the file that `serve: NAME` offers."),
        variable("serve.NAME.sha256", "Hash of that file, unless it belongs to a certificate."),
        variable("vehicle.manufacturer", "Manufacturer of the first mock vehicle (master control under test)."),
        variable("vehicle.serialNumber", "Its serial number."),
        variable("second.manufacturer", "Manufacturer of the second mock vehicle (master control under test)."),
        variable("second.serialNumber", "Its serial number."),
        variable("each.manufacturer", "Of the mock vehicle at hand, in a step with `each: vehicle`."),
        variable("each.serialNumber", "Its serial number."),
        variable("each.next", "A node next to where it started."),
        variable("case.NAME", "A value of the case, in a test with `cases:`."),
        variable("with.NAME", "A value that the step `use:` hands over, in a state."),
        variable("NAME", "What an earlier step has kept with `save:`."),
        variable("NAME.id", "The actionId of the action that was sent `as: NAME`."),
    ]);
    all
}
