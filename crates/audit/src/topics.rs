//! Which vehicle a topic belongs to.

use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::ops::Range;
use std::sync::Arc;

use regex::{Captures, Regex};

use super::AuditError;
use tck_pack::Packs;

/// A topic of a vehicle.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Named {
    /// Key that all topics of the vehicle share.
    pub key: String,
    /// Manufacturer, if the topic says it.
    pub manufacturer: String,
    /// Serial number, if the topic says it.
    pub serial_number: String,
    /// Major version, if the topic says it.
    pub major: Option<u64>,
    /// Topic name.
    pub name: String,
    /// What stands before and behind the name.
    around: (String, String),
}

impl Named {
    /// Full topic by topic name.
    pub fn all<'n>(&self, names: impl Iterator<Item = &'n str>) -> BTreeMap<String, String> {
        let (before, behind) = &self.around;
        names
            .map(|name| (name.to_owned(), format!("{before}{name}{behind}")))
            .collect()
    }
}

/// A topic below a vehicle whose name is none, and nearly one.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Beside {
    /// The topics of the vehicle, with `{topic}` for the name.
    pub topics: String,
    /// Manufacturer, if the topic says it.
    pub manufacturer: String,
    /// Serial number, if the topic says it.
    pub serial_number: String,
    /// The name that is meant.
    pub meant: String,
    /// Whether it differs in case and punctuation alone.
    pub differs_in_spelling: bool,
}

/// A name without what people vary: case, underscores, hyphens.
fn plain(name: &str) -> String {
    let letters = name.chars().filter(char::is_ascii_alphanumeric);
    letters.map(|letter| letter.to_ascii_lowercase()).collect()
}

/// A level of a topic, by its name in the template; empty where the template does not have it.
fn level(found: &Captures<'_>, part: &str) -> String {
    found.name(part).map_or("", |part| part.as_str()).to_owned()
}

/// How topics are built.
pub(super) struct Topics {
    form: Regex,
    names: BTreeSet<String>,
    /// Topics that were read before.
    known: HashMap<String, Option<Arc<Named>>>,
}

/// How many topics are known again without being read.
const KNOWN: usize = 65_536;

/// Any interface name; the levels that are suggested otherwise.
const USUAL: &str = "{interface}/v{majorVersion}/{manufacturer}/{serialNumber}/{topic}";

impl Topics {
    pub fn new(packs: &Packs, template: Option<&str>) -> Result<Self, AuditError> {
        let template = template.unwrap_or(USUAL);
        // A profile may give how the topics begin.
        let whole = if template.contains("{topic}") {
            template.to_owned()
        } else {
            format!("{template}/{{topic}}")
        };
        let wrong = || AuditError::Template(template.to_owned());
        if !whole.contains("{serialNumber}") {
            return Err(wrong());
        }
        let mut form = regex::escape(&whole);
        let parts = [
            ("interface", ".+"),
            ("interfaceName", ".+"),
            ("majorVersion", "[0-9]+"),
            ("manufacturer", "[^/]*"),
            ("serialNumber", "[^/]*"),
            ("topic", "[^/]+"),
        ];
        for (name, part) in parts {
            form = form.replace(&regex::escape(&format!("{{{name}}}")), &format!("(?<{name}>{part})"));
        }
        let names = packs.all().iter().flat_map(|pack| pack.topics());
        Ok(Self {
            form: Regex::new(&format!("^{form}$")).map_err(|_| wrong())?,
            names: names.map(|rule| rule.name.as_str().to_owned()).collect(),
            known: HashMap::new(),
        })
    }

    /// Which parts of a topic of a vehicle are names of somebody, in their order, and of what.
    pub fn levels(&self, topic: &str) -> Option<Vec<(Range<usize>, &'static str)>> {
        let found = self.form.captures(topic)?;
        let kinds = [
            ("interface", "site"),
            ("interfaceName", "site"),
            ("manufacturer", "maker"),
            ("serialNumber", "vehicle"),
        ];
        let levels = kinds
            .into_iter()
            .filter_map(|(part, kind)| Some((found.name(part)?.range(), kind)));
        let mut levels: Vec<_> = levels.collect();
        levels.sort_by_key(|(range, _)| range.start);
        Some(levels)
    }

    /// Reads a topic whose name is nearly one of the protocol.
    pub fn beside(&self, topic: &str) -> Option<Beside> {
        let found = self.form.captures(topic)?;
        let name = found.name("topic")?;
        let written = name.as_str();
        if self.names.contains(written) || written.len() > 64 {
            return None;
        }
        let same = self.names.iter().find(|known| plain(known) == plain(written));
        let near = || {
            let mut names = self.names.iter();
            names.find(|known| strsim::osa_distance(&plain(known), &plain(written)) <= (known.len() / 4).min(2))
        };
        Some(Beside {
            topics: format!("{}{{topic}}{}", &topic[..name.start()], &topic[name.end()..]),
            manufacturer: level(&found, "manufacturer"),
            serial_number: level(&found, "serialNumber"),
            differs_in_spelling: same.is_some(),
            meant: same.or_else(near)?.clone(),
        })
    }

    /// A topic with the major version of another one, where it says one.
    pub fn with_major(&self, topic: &str, major: u64) -> String {
        let found = self.form.captures(topic);
        let level = found.and_then(|found| Some(found.name("majorVersion")?.range()));
        level.map_or_else(
            || topic.to_owned(),
            |level| format!("{}{major}{}", &topic[..level.start], &topic[level.end..]),
        )
    }

    /// Reads a topic unless it is known; `None` when it is none of the protocol.
    pub fn know(&mut self, topic: &str) -> Option<Arc<Named>> {
        if let Some(known) = self.known.get(topic) {
            return known.clone();
        }
        if self.known.len() >= KNOWN {
            self.known.clear();
        }
        let named = self.read(topic).map(Arc::new);
        self.known.insert(topic.to_owned(), named.clone());
        named
    }

    /// Reads a topic; `None` when it is none of the protocol.
    pub fn read(&self, topic: &str) -> Option<Named> {
        let found = self.form.captures(topic)?;
        let name = found.name("topic")?;
        if !self.names.contains(name.as_str()) {
            return None;
        }
        let around = (topic[..name.start()].to_owned(), topic[name.end()..].to_owned());
        Some(Named {
            key: format!("{}\n{}", around.0, around.1),
            manufacturer: level(&found, "manufacturer"),
            serial_number: level(&found, "serialNumber"),
            major: level(&found, "majorVersion").parse().ok(),
            name: name.as_str().to_owned(),
            around,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn topics(template: Option<&str>) -> Topics {
        let packs = Packs::load(tck_testing::assets()).expect("packs");
        Topics::new(&packs, template).expect("a template")
    }

    #[test]
    fn vehicles_are_told_by_their_topics() {
        let usual = topics(None);
        let named = usual.read("site/hall/v2/acme/7/state").expect("a topic");
        assert_eq!(
            (named.manufacturer.as_str(), named.serial_number.as_str()),
            ("acme", "7")
        );
        assert_eq!((named.name.as_str(), named.major), ("state", Some(2)));
        let all = named.all(["order"].into_iter());
        assert_eq!(all["order"], "site/hall/v2/acme/7/order");
        for other in [
            "site/v2/acme/7/states",
            "v2/acme/7/state",
            "a/b",
            "site/vx/acme/7/state",
            "",
        ] {
            assert_eq!(usual.read(other), None, "{other}");
        }
    }

    #[test]
    fn a_topic_can_have_another_major_version() {
        assert_eq!(
            topics(None).with_major("uagv/v2/acme/7/state", 3),
            "uagv/v3/acme/7/state"
        );
        let own = topics(Some("site/{serialNumber}/{topic}"));
        assert_eq!(own.with_major("site/7/state", 3), "site/7/state");
    }

    #[test]
    fn a_name_that_is_nearly_one_is_told_from_others() {
        let usual = topics(None);
        let meant = |topic: &str| {
            let beside = usual.beside(topic)?;
            Some((beside.meant, beside.differs_in_spelling))
        };
        let wanted = |name: &str, spelling| Some((name.to_owned(), spelling));
        assert_eq!(meant("a/v2/b/c/instantactions"), wanted("instantActions", true));
        assert_eq!(meant("a/v2/b/c/instant_actions"), wanted("instantActions", true));
        assert_eq!(meant("a/v2/b/c/instantAction"), wanted("instantActions", false));
        assert_eq!(meant("a/v2/b/c/orders"), wanted("order", false));
        assert_eq!(meant("a/v2/b/c/State"), wanted("state", true));
        for none in [
            "a/v2/b/c/state",
            "a/v2/b/c/log",
            "a/v2/b/c/stats/x",
            "a/b",
            "a/vx/b/c/orders",
        ] {
            assert_eq!(meant(none), None, "{none}");
        }
        let beside = usual.beside("a/v2/b/c/orders").expect("near");
        assert_eq!(
            (
                beside.topics.as_str(),
                beside.manufacturer.as_str(),
                beside.serial_number.as_str()
            ),
            ("a/v2/b/c/{topic}", "b", "c")
        );
    }

    #[test]
    fn a_site_may_have_names_of_its_own() {
        let own = topics(Some("plant.1/{topic}/of/{serialNumber}"));
        let named = own.read("plant.1/state/of/7").expect("a topic");
        assert_eq!((named.serial_number.as_str(), named.major), ("7", None));
        assert_eq!(named.all(["order"].into_iter())["order"], "plant.1/order/of/7");
        assert_eq!(own.read("plantx1/state/of/7"), None);
        let packs = Packs::load(tck_testing::assets()).expect("packs");
        assert!(Topics::new(&packs, Some("plant/{topic}")).is_err());
    }
}
