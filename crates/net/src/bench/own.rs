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

/// Who logs in at a broker: under a name, or without.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct User(pub Option<String>);

impl User {
    fn line(&self) -> Option<String> {
        self.0.as_ref().map(|name| format!("user {name}"))
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

    /// The lines of mosquitto's access rules with which a user may do all that a run does, and another one may use the topics of
    /// the device. `device_topics` are those the device publishes on.
    #[must_use]
    pub fn access_rules(&self, harness: &User, other: Option<&User>, device_topics: &[String]) -> String {
        let mut devices: Vec<&str> = device_topics
            .iter()
            .filter_map(|topic| topic.rsplit_once('/'))
            .map(|(device, _)| device)
            .collect();
        devices.dedup();
        let topics: Vec<String> = devices
            .iter()
            .map(|device| format!("topic readwrite {device}/#"))
            .collect();
        let own = format!("topic readwrite {}/#", self.topics);
        let mut parts = vec![(harness, [&[own], &topics[..]].concat())];
        parts.extend(other.filter(|other| *other != harness).map(|other| (other, topics)));
        // What is for everybody without a name stands before the first name.
        parts.sort_by_key(|(user, _)| user.0.is_some());
        let lines = parts
            .into_iter()
            .flat_map(|(user, lines)| user.line().into_iter().chain(lines));
        lines.collect::<Vec<_>>().join("\n")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_rules_name_what_a_run_uses_and_no_device_twice() {
        let names = OwnNames::default();
        let topics = ["uagv/v9/ACME/1/state", "uagv/v9/ACME/1/connection"].map(str::to_owned);
        let [tck, fleet] = ["tck", "fleet"].map(|name| User(Some(name.to_owned())));
        let nobody = User(None);
        let (own, device) = ("topic readwrite vda5050-tck/#", "topic readwrite uagv/v9/ACME/1/#");
        for (harness, other, rules) in [
            (&tck, None, format!("user tck\n{own}\n{device}")),
            (&tck, Some(&tck), format!("user tck\n{own}\n{device}")),
            (&nobody, None, format!("{own}\n{device}")),
            (&nobody, Some(&fleet), format!("{own}\n{device}\nuser fleet\n{device}")),
            (&tck, Some(&nobody), format!("{device}\nuser tck\n{own}\n{device}")),
        ] {
            assert_eq!(names.access_rules(harness, other, &topics), rules);
        }
        assert_ne!(names.client("watcher"), names.client("watcher"));
        assert!(names.client("").starts_with("tck-"));
    }
}
