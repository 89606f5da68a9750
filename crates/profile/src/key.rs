//! The settings that have one value each: their names and what a value may be. Everything else about them
//! (unknown keys, environment variables, flags, merging, the list of effective values) follows from here.

use super::time;

/// One setting.
#[derive(Clone, Copy, Debug)]
pub struct Key {
    /// Section and name, such as `bench.listen`.
    pub path: &'static str,
    /// What a value may be.
    pub kind: Kind,
}

/// What a value may be.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Any text but none.
    Text,
    /// A level of an MQTT topic.
    Level,
    /// One of these words.
    Word(&'static [&'static str]),
    /// `true` or `false`.
    Flag,
    /// `5 s`.
    Duration,
    /// Metres per second.
    Speed,
    /// A file, relative to the file it is written in.
    File,
    /// Several files.
    Files,
    /// `host:port`.
    Address,
    /// `mqtt://host:port`, or with `mqtts`; `ws://host:port/path`, or with `wss`.
    Broker,
    /// Addresses of several brokers.
    Brokers,
    /// A topic prefix with placeholders.
    Template,
    /// A version, such as `1.2`; whether it is known is for the caller to say.
    Version,
    /// A program and its arguments, as a list or as one line.
    Command,
    /// An action and its parameters; its type alone when it has none and needs no place.
    Action(Place),
    /// Statements about capabilities.
    Claims,
    /// Several names.
    Names,
}

/// Placeholders of [`Kind::Template`].
pub const TEMPLATE_PLACEHOLDERS: &[&str] = &["majorVersion", "manufacturer", "serialNumber"];

/// Placeholders of `device.command`, also known to every hook.
/// `vehicle` is the serial number of the mock AGV a test is about, when a master control is tested. `free-port` is a
/// port of this machine that nobody used when the run began, for a device that serves its hooks itself.
pub const COMMON_PLACEHOLDERS: &[&str] = &[
    "broker-host",
    "broker-port",
    "manufacturer",
    "serial-number",
    "vehicle",
    "free-port",
];

/// Something a vehicle is like that no message says; `needs: profile NAME` of a test asks for it.
#[derive(Clone, Copy, Debug)]
pub struct Statement {
    /// Name, as in `[device]`.
    pub name: &'static str,
    /// What it means.
    pub doc: &'static str,
}

/// Every statement there is.
pub const STATEMENTS: &[Statement] = &[
    Statement {
        name: "stops-between-nodes",
        doc: "The vehicle can stop, and end a cancelled order, between two nodes.",
    },
    Statement {
        name: "node-bound",
        doc: "The vehicle can stop on nodes only and drives on to the next one.",
    },
    Statement {
        name: "interruptible-actions",
        doc: "The long action can be interrupted while it is running.",
    },
    Statement {
        name: "edge-actions",
        doc: "The long action can be done on an edge as well.",
    },
    Statement {
        name: "instant-actions",
        doc: "The long action can be sent as an instant action as well.",
    },
    Statement {
        name: "line-guided",
        doc: "The vehicle follows a physical or virtual line and may have no coordinates.",
    },
    Statement {
        name: "free-navigation",
        doc: "The vehicle plans its own way between two nodes.",
    },
    Statement {
        name: "straight-lines",
        doc: "Over an edge without a trajectory the vehicle drives on a line that leads straight from node to node.",
    },
    Statement {
        name: "permanently-powered",
        doc: "The vehicle gets its power all the time, so that there is no charge that could fall.",
    },
    Statement {
        name: "carries-load",
        doc: "The vehicle carries loads, and one may be put on it during the run.",
    },
    Statement {
        name: "map-hash",
        doc: "The vehicle checks mapHash as SHA-256 in hexadecimal.",
    },
    Statement {
        name: "small-map-storage",
        doc: "At most six more maps fit into the vehicle.",
    },
    Statement {
        name: "extends-base",
        doc: "The master control releases a way of three edges in parts, and at first not all of it. So it is taken to be \
              unless the profile says otherwise.",
    },
    Statement {
        name: "room-beside-edges",
        doc: "A metre of free floor lies on both sides of every edge of the course, so that curves may be ordered and \
              obstacles driven round.",
    },
    Statement {
        name: "zones-on-course",
        doc: "Tests may put zones of their own on the nodes and edges of the course: no other vehicle goes by them, and the \
              vehicle may be moved where one has stopped it.",
    },
    Statement {
        name: "certificate-may-change",
        doc: "Tests may give the vehicle certificates of the harness for its connection; somebody puts the right one back \
              afterwards. What it trusts from then on is an authority of the harness and those in `tls-ca` and `tls-cert`.",
    },
];

/// What the harness finds out by itself at the beginning of a run; tests ask for it as for a statement.
pub const FOUND: &[&str] = &["active-map"];

/// Where a sample action can be performed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Place {
    /// On any node, or wherever the test says.
    Anywhere,
    /// On any edge, where its effect is shown as an information of this type.
    Shown,
    /// In a zone, wherever the test puts it.
    Zone,
    /// At a node the profile names.
    Node,
    /// On an edge the profile names.
    Edge,
}

/// An action of the vehicle that tests may use. `needs: profile NAME` of a test asks for it, `${device.VARIABLE.type}`
/// holds it, and, if it has a place of its own, a route can lead there: `base: [a, VARIABLE]`.
#[derive(Clone, Copy, Debug)]
pub struct SampleKind {
    /// Name, as in `[device]`.
    pub name: &'static str,
    /// Name in suites.
    pub variable: &'static str,
    /// Where it can be performed.
    pub place: Place,
    /// What it is.
    pub doc: &'static str,
}

impl SampleKind {
    /// The sample action of that name in suites.
    #[must_use]
    pub fn of_variable(variable: &str) -> Option<&'static Self> {
        SAMPLE_ACTIONS.iter().find(|sample| sample.variable == variable)
    }

    /// Whether the profile has to say where it can be performed.
    #[must_use]
    pub fn is_station(&self) -> bool {
        matches!(self.place, Place::Node | Place::Edge)
    }
}

const fn sample(name: &'static str, variable: &'static str, place: Place, doc: &'static str) -> SampleKind {
    SampleKind {
        name,
        variable,
        place,
        doc,
    }
}

/// Every sample action there is.
pub const SAMPLE_ACTIONS: &[SampleKind] = &[
    sample(
        "long-action",
        "longAction",
        Place::Anywhere,
        "An action on a node that runs for some seconds and does no harm.",
    ),
    sample(
        "brief-action",
        "briefAction",
        Place::Anywhere,
        "An action on a node that ends within a second or two and does no harm.",
    ),
    sample(
        "uninterruptible-action",
        "uninterruptibleAction",
        Place::Anywhere,
        "An action on a node that runs for some seconds and cannot be interrupted.",
    ),
    sample(
        "edge-condition",
        "edgeCondition",
        Place::Shown,
        "An action on an edge that holds a condition as long as the vehicle is there, shown as an information.",
    ),
    sample(
        "pick",
        "pick",
        Place::Node,
        "A pick that succeeds: a load stands there whenever a test begins.",
    ),
    sample(
        "drop",
        "drop",
        Place::Node,
        "A drop that succeeds, and after which the pick succeeds again.",
    ),
    sample(
        "edge-pick",
        "edgePick",
        Place::Edge,
        "A pick on an edge that succeeds: a load stands there whenever a test begins.",
    ),
    sample(
        "edge-drop",
        "edgeDrop",
        Place::Edge,
        "A drop on an edge that succeeds, and after which the pick on the edge succeeds again.",
    ),
    sample(
        "failing-pick",
        "failingPick",
        Place::Node,
        "A pick that fails, because no load stands there.",
    ),
    sample(
        "failing-drop",
        "failingDrop",
        Place::Node,
        "A drop that fails, because the place is taken.",
    ),
    sample(
        "detect-object",
        "detectObject",
        Place::Node,
        "A search that finds its object.",
    ),
    sample(
        "edge-detect-object",
        "edgeDetectObject",
        Place::Edge,
        "A search on an edge that finds its object.",
    ),
    sample(
        "failing-detect-object",
        "failingDetectObject",
        Place::Node,
        "A search that does not find its object.",
    ),
    sample(
        "fine-positioning",
        "finePositioning",
        Place::Node,
        "A positioning on a target that is there.",
    ),
    sample(
        "edge-fine-positioning",
        "edgeFinePositioning",
        Place::Edge,
        "A positioning on an edge along a target that is there.",
    ),
    sample(
        "failing-fine-positioning",
        "failingFinePositioning",
        Place::Node,
        "A positioning on a target that is not there.",
    ),
    sample(
        "start-charging",
        "startCharging",
        Place::Node,
        "The beginning of charging, at a charger that is free.",
    ),
    sample(
        "failing-start-charging",
        "failingStartCharging",
        Place::Node,
        "The beginning of charging where there is no charger.",
    ),
    sample(
        "zone-action",
        "zoneAction",
        Place::Zone,
        "An action in a zone that ends within a second or two and does no harm.",
    ),
    sample(
        "long-zone-action",
        "longZoneAction",
        Place::Zone,
        "An action in a zone that runs for some seconds and does no harm.",
    ),
    sample(
        "lift",
        "lift",
        Place::Node,
        "An initPosition in a lift, which puts the vehicle on the map of another floor.",
    ),
];

const fn key(path: &'static str, kind: Kind) -> Key {
    Key { path, kind }
}

/// Every setting there is, in the order of the sections.
pub const KEYS: &[Key] = &[
    key("device.role", Kind::Word(&["agv", "master-control"])),
    key("device.manufacturer", Kind::Level),
    key("device.serial-number", Kind::Level),
    key("device.protocol", Kind::Version),
    key("device.topic-template", Kind::Template),
    key("device.command", Kind::Command),
    key("device.stops-between-nodes", Kind::Flag),
    key("device.node-bound", Kind::Flag),
    key("device.interruptible-actions", Kind::Flag),
    key("device.edge-actions", Kind::Flag),
    key("device.instant-actions", Kind::Flag),
    key("device.line-guided", Kind::Flag),
    key("device.free-navigation", Kind::Flag),
    key("device.straight-lines", Kind::Flag),
    key("device.permanently-powered", Kind::Flag),
    key("device.carries-load", Kind::Flag),
    key("device.map-hash", Kind::Flag),
    key("device.small-map-storage", Kind::Flag),
    key("device.room-beside-edges", Kind::Flag),
    key("device.extends-base", Kind::Flag),
    key("device.zones-on-course", Kind::Flag),
    key("device.certificate-may-change", Kind::Flag),
    key("device.long-action", Kind::Action(Place::Anywhere)),
    key("device.brief-action", Kind::Action(Place::Anywhere)),
    key("device.uninterruptible-action", Kind::Action(Place::Anywhere)),
    key("device.edge-condition", Kind::Action(Place::Shown)),
    key("device.pick", Kind::Action(Place::Node)),
    key("device.drop", Kind::Action(Place::Node)),
    key("device.edge-pick", Kind::Action(Place::Edge)),
    key("device.edge-drop", Kind::Action(Place::Edge)),
    key("device.failing-pick", Kind::Action(Place::Node)),
    key("device.failing-drop", Kind::Action(Place::Node)),
    key("device.detect-object", Kind::Action(Place::Node)),
    key("device.edge-detect-object", Kind::Action(Place::Edge)),
    key("device.failing-detect-object", Kind::Action(Place::Node)),
    key("device.fine-positioning", Kind::Action(Place::Node)),
    key("device.edge-fine-positioning", Kind::Action(Place::Edge)),
    key("device.failing-fine-positioning", Kind::Action(Place::Node)),
    key("device.start-charging", Kind::Action(Place::Node)),
    key("device.failing-start-charging", Kind::Action(Place::Node)),
    key("device.zone-action", Kind::Action(Place::Zone)),
    key("device.long-zone-action", Kind::Action(Place::Zone)),
    key("device.lift", Kind::Action(Place::Node)),
    key("device.claims", Kind::Claims),
    key("bench.listen", Kind::Address),
    key("bench.tap", Kind::Flag),
    key("bench.broker", Kind::Broker),
    key("bench.cluster", Kind::Brokers),
    key("bench.own-topics", Kind::Template),
    key("bench.client-id", Kind::Text),
    key("bench.maps-listen", Kind::Address),
    key("bench.maps-host", Kind::Text),
    key("bench.page", Kind::Address),
    key("bench.tls-cert", Kind::File),
    key("bench.tls-key", Kind::File),
    key("bench.tls-ca", Kind::File),
    key("bench.client-cert", Kind::File),
    key("bench.client-key", Kind::File),
    key("bench.username", Kind::Text),
    key("bench.password-env", Kind::Text),
    key("bench.password-file", Kind::File),
    key("motion.allowed", Kind::Flag),
    key("motion.max-speed", Kind::Speed),
    key("layout.lif", Kind::File),
    key("layout.vehicle-type", Kind::Text),
    key("layout.allow-list", Kind::Names),
    key("vehicles.manufacturer", Kind::Level),
    key("vehicles.serial-numbers", Kind::Names),
    key("vehicles.start-node", Kind::Text),
    key("time.react", Kind::Duration),
    key("time.slow", Kind::Duration),
    key("time.event", Kind::Duration),
    key("time.event-warning", Kind::Duration),
    key("time.state-period", Kind::Duration),
    key("time.drive", Kind::Duration),
    key("time.download", Kind::Duration),
    key("time.connect", Kind::Duration),
    key("time.reconnect", Kind::Duration),
    key("time.will", Kind::Duration),
    key("time.quiet", Kind::Duration),
    key("time.settle", Kind::Duration),
    key("time.notice", Kind::Duration),
    key("time.broker", Kind::Duration),
    key("maps.files", Kind::Files),
    key("certificate.laboratory", Kind::Text),
    key("certificate.laboratory-address", Kind::Text),
    key("certificate.number", Kind::Text),
    key("certificate.customer", Kind::Text),
    key("certificate.tester", Kind::Text),
    key("certificate.authorised-by", Kind::Text),
    key("certificate.place", Kind::Text),
    key("certificate.sample", Kind::Text),
    key("certificate.sample-received", Kind::Text),
    key("certificate.hardware-version", Kind::Text),
    key("certificate.firmware-version", Kind::Text),
];

/// The environment variable that holds a password unless `password-env` names another.
pub const PASSWORD_VARIABLE: &str = "VDA5050_TCK_PASSWORD";

impl Key {
    /// The key at a path.
    #[must_use]
    pub fn find(path: &str) -> Option<&'static Self> {
        KEYS.iter().find(|key| key.path == path)
    }

    /// The environment variable that sets it.
    #[must_use]
    pub fn variable(&self) -> String {
        format!("VDA5050_TCK_{}", self.path.replace(['.', '-'], "_").to_uppercase())
    }
}

impl Kind {
    /// What is allowed, for a hint.
    #[must_use]
    pub fn hint(self) -> String {
        match self {
            Self::Text => "a text, such as \"ACME\"".to_owned(),
            Self::Level => "a text without `/`, `+` and `#`, because it is a level of a topic".to_owned(),
            Self::Word(words) => format!(
                "one of {}",
                words
                    .iter()
                    .map(|word| format!("\"{word}\""))
                    .collect::<Vec<_>>()
                    .join(", ")
            ),
            Self::Flag => "true or false".to_owned(),
            Self::Duration => format!(
                "a duration such as \"800 ms\", \"{}\" or \"2 min\"",
                time::show(std::time::Duration::from_secs(5))
            ),
            Self::Speed => "a speed in m/s above 0, such as 0.5".to_owned(),
            Self::File => "the path of a file, relative to this one".to_owned(),
            Self::Files => "a list of files, such as [\"hall.map\"]".to_owned(),
            Self::Address => "host and port, such as \"127.0.0.1:1883\"".to_owned(),
            Self::Broker => "an address such as \"mqtt://host:1883\" or \"mqtts://host:8883\"".to_owned(),
            Self::Brokers => "a list of addresses, such as [\"mqtt://host:1883\"]".to_owned(),
            Self::Template => format!(
                "levels of a topic; the topic name is added as the last one. Placeholders: {}",
                TEMPLATE_PLACEHOLDERS
                    .iter()
                    .map(|name| format!("{{{name}}}"))
                    .collect::<Vec<_>>()
                    .join(" ")
            ),
            Self::Version => "a text such as \"1.2\" or \"1.2.3\"".to_owned(),
            Self::Command => "a list such as [\"./agv\", \"--broker\", \"{broker-host}:{broker-port}\"]".to_owned(),
            Self::Action(Place::Anywhere | Place::Zone) => {
                "an action such as \"beep\" or { type = \"wait\", parameters = { seconds = 20 } }".to_owned()
            }
            Self::Action(Place::Shown) => {
                "an action and the infoType that shows it, such as { type = \"blink\", shows = \"blinking\" }".to_owned()
            }
            Self::Action(Place::Node) => {
                "an action and its node, such as { type = \"pick\", node = \"P1\", parameters = { loadType = \"EPAL\" } }"
                    .to_owned()
            }
            Self::Action(Place::Edge) => {
                "an action and its edge, such as { type = \"pick\", edge = \"A1-P1\", parameters = { loadType = \"EPAL\" } }"
                    .to_owned()
            }
            Self::Claims => "a list of texts such as \"action pick NODE\", \"no action drop\", \"optional PATH\", \
                             \"limit NAME = 10\", \"no hook use-lift\", or names of statements"
                .to_owned(),
            Self::Names => "a list of names, such as [\"n1\", \"n2\"]".to_owned(),
        }
    }
}
