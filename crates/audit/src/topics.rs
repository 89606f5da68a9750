//! Which vehicle a topic belongs to.

use std::collections::{BTreeMap, BTreeSet};

use regex::Regex;

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

/// How topics are built.
pub(super) struct Topics {
    form: Regex,
    names: BTreeSet<String>,
}

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
        })
    }

    /// Reads a topic; `None` when it is none of the protocol.
    pub fn read(&self, topic: &str) -> Option<Named> {
        let found = self.form.captures(topic)?;
        let name = found.name("topic")?;
        if !self.names.contains(name.as_str()) {
            return None;
        }
        let level = |part: &str| {
            let part = found.name(part);
            part.map(|part| part.as_str().to_owned()).unwrap_or_default()
        };
        let around = (topic[..name.start()].to_owned(), topic[name.end()..].to_owned());
        Some(Named {
            key: format!("{}\n{}", around.0, around.1),
            manufacturer: level("manufacturer"),
            serial_number: level("serialNumber"),
            major: level("majorVersion").parse().ok(),
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
