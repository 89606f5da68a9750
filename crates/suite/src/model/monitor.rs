//! What is always judged: a test without stimulus.

use std::sync::Arc;

use super::{Binding, CheckUse, Need};
use tck_base::diagnostic::Source;
use tck_base::pattern::Pattern;
use tck_pack::{Role, VersionRange};

/// An always-on check.
#[derive(Clone, Debug)]
pub struct Monitor {
    /// Path below `suites/monitors/` without extension.
    pub id: String,
    /// One sentence.
    pub title: String,
    /// Which side it judges.
    pub device: Option<Role>,
    /// Protocol versions it is written for.
    pub spec: VersionRange,
    /// What must be given for it to apply.
    pub needs: Vec<Need>,
    /// What it decides.
    pub checks: Vec<Binding>,
    /// The requirement of the standard in whose place it decides one of somebody's own, by the same named check.
    pub instead_of: Option<Binding>,
    /// Whether and how a recording can be judged by it.
    pub recordings: Recordings,
    /// What must have come by for a requirement to be decided; one that is not listed is decided by anything judged.
    pub about: Vec<About>,
    /// Why anybody cares.
    pub why: String,
    /// The rule.
    pub rule: Rule,
    /// Members of the state that show nothing any more once it has found something: what a test has waited for there
    /// in vain could not be observed.
    pub hides: Vec<String>,
    /// The file.
    pub source: Arc<Source>,
}

/// What a requirement is about: without such a message nothing is known of it.
#[derive(Clone, Debug)]
pub struct About {
    /// The requirement.
    pub requirement: Binding,
    /// Topic name or `mqtt/…`.
    pub topic: String,
    /// What a message must show.
    pub pattern: Pattern,
}

/// Whether and how recorded traffic, which somebody else has caused and which may lack messages, can be judged by a monitor.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Recordings {
    /// Each message by itself, whatever else is missing.
    Message,
    /// Each message with the topic that it came on, whatever else is missing.
    MessageOnTopic,
    /// Each message with the factsheet of the vehicle, whatever else is missing.
    MessageAndFactsheet,
    /// Only where nothing is missing: it holds messages against earlier ones.
    Unbroken,
    /// Only where nothing is missing, and where the recording says when messages came.
    UnbrokenInTime,
    /// Only by the packets between a client and its broker.
    Packets,
    /// Not at all, and why.
    Never(String),
}

impl Recordings {
    /// What holds of a monitor that does not say it: a picture shows one message, and of a named check nothing is known.
    #[must_use]
    pub fn of_rule(rule: &Rule) -> Self {
        match rule {
            Rule::Check(_) => Self::Never("the monitor does not say how, by its key `recordings`".to_owned()),
            Rule::Always { topic, .. } | Rule::Never { topic, .. } if topic.starts_with("mqtt/") => Self::Packets,
            Rule::Always { topic, .. } | Rule::Never { topic, .. } if topic.starts_with("http/") => {
                Self::Never("a recording shows nothing of the server of maps".to_owned())
            }
            Rule::Always { .. } | Rule::Never { .. } => Self::Message,
        }
    }
}

/// What a monitor holds true.
#[derive(Clone, Debug)]
pub enum Rule {
    /// Every message on the topic that matches `when` matches `pattern`.
    Always {
        /// Topic name or `mqtt/…`.
        topic: String,
        /// Which messages are judged; absent is all.
        when: Option<Pattern>,
        /// What they must show.
        pattern: Pattern,
    },
    /// No message on the topic matches.
    Never {
        /// Topic name or `mqtt/…`.
        topic: String,
        /// What must not come.
        pattern: Pattern,
    },
    /// A named check sees everything.
    Check(CheckUse),
}
