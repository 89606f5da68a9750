//! Who is judged, and which topics are its own.

use std::collections::BTreeMap;

use super::{Pack, Role};

/// Who is judged.
#[derive(Clone, Debug)]
pub struct Participant {
    /// Which side it is.
    pub role: Role,
    /// Manufacturer as in topics and headers.
    pub manufacturer: String,
    /// Serial number as in topics and headers.
    pub serial_number: String,
    /// How its topics are built; the pack's own way unless said.
    pub topic_template: Option<String>,
}

impl std::fmt::Display for Participant {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{} {}", self.manufacturer, self.serial_number)
    }
}

impl Participant {
    /// Full topic by topic name.
    #[must_use]
    pub fn topics(&self, pack: &Pack) -> BTreeMap<String, String> {
        let template = self.topic_template.as_deref().unwrap_or_else(|| pack.topic_template());
        // A profile gives how the topics begin, a pack the whole of them.
        let template = if template.contains("{topic}") {
            template.to_owned()
        } else {
            format!("{template}/{{topic}}")
        };
        let full = |name: &str| pack.fill_topic(&template, &self.manufacturer, &self.serial_number, name);
        pack.topics()
            .iter()
            .map(|rule| (rule.name.as_str().to_owned(), full(rule.name.as_str())))
            .collect()
    }

    /// The topics the device publishes.
    #[must_use]
    pub fn published(&self, pack: &Pack) -> Vec<String> {
        let topics = self.topics(pack);
        let own = pack.topics().iter().filter(|rule| rule.publisher == self.role);
        own.filter_map(|rule| topics.get(rule.name.as_str()).cloned()).collect()
    }
}
