//! How the harness names itself at a broker: the topics it keeps for itself, and its client ids.

/// Topics and client ids of the harness. A broker with access rules has to allow them.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct OwnNames {
    /// How all topics begin that are the harness's own.
    pub topics: String,
    /// How all its client ids begin.
    pub client_id: String,
}

impl Default for OwnNames {
    fn default() -> Self {
        Self {
            topics: "vda5050-tck".to_owned(),
            client_id: "tck".to_owned(),
        }
    }
}

impl OwnNames {
    /// A client id that nobody else can know.
    #[must_use]
    pub fn client(&self, what: &str) -> String {
        let random = uuid::Uuid::new_v4().simple().to_string();
        let what = if what.is_empty() {
            String::new()
        } else {
            format!("{what}-")
        };
        format!("{}-{what}{random}", self.client_id)
    }

    /// The lines of mosquitto's access rules with which a user may do all that a run does. `device_topics` are those the
    /// device publishes on.
    #[must_use]
    pub fn access_rules(&self, user: Option<&str>, device_topics: &[String]) -> String {
        let mut lines: Vec<String> = user.map(|user| format!("user {user}")).into_iter().collect();
        lines.push(format!("topic readwrite {}/#", self.topics));
        let mut devices: Vec<&str> = device_topics
            .iter()
            .filter_map(|topic| topic.rsplit_once('/'))
            .map(|(device, _)| device)
            .collect();
        devices.dedup();
        lines.extend(devices.iter().map(|device| format!("topic readwrite {device}/#")));
        lines.join("\n")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_rules_name_what_a_run_uses_and_no_device_twice() {
        let names = OwnNames::default();
        let topics = ["uagv/v9/ACME/1/state", "uagv/v9/ACME/1/connection"].map(str::to_owned);
        assert_eq!(
            names.access_rules(Some("tck"), &topics),
            "user tck\ntopic readwrite vda5050-tck/#\ntopic readwrite uagv/v9/ACME/1/#"
        );
        assert_ne!(names.client("watcher"), names.client("watcher"));
        assert!(names.client("").starts_with("tck-"));
    }
}
