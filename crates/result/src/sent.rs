//! What was sent before something was found.

use std::fmt;

use serde::{Deserialize, Serialize};

/// The last message that a test has sent before what it found.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Sent {
    /// Journal number.
    pub seq: u64,
    /// Name of its topic, such as `order`.
    pub topic: String,
    /// The members that the test is about: those it has broken, or else those it has set.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub members: Vec<SentMember>,
    /// How many more there are.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub more: usize,
    /// How the payload begins, where it is no message but bytes.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub raw: Option<String>,
}

/// A member of a message that was sent.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SentMember {
    /// Place in the message, such as `nodes[0].nodeId`.
    pub path: String,
    /// What stands there and of which kind it is, bounded; `left out` where nothing does.
    pub value: String,
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde wants it so")]
fn is_zero(count: &usize) -> bool {
    *count == 0
}

impl Sent {
    /// What the message is about: its members with their values, or its bytes; empty for a whole message.
    #[must_use]
    pub fn about(&self) -> String {
        let members = self.members.iter().map(|one| format!("{} {}", one.path, one.value));
        let mut all: Vec<String> = members.collect();
        if self.more > 0 {
            all.push(format!("{} more", self.more));
        }
        all.extend(self.raw.iter().map(|raw| format!("the bytes {raw}")));
        all.join(", ")
    }
}

impl fmt::Display for Sent {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "#{} {}", self.seq, self.topic)?;
        match self.about() {
            about if about.is_empty() => Ok(()),
            about => write!(f, ": {about}"),
        }
    }
}
