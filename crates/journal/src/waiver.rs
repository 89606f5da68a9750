//! What is not held against a vehicle any more when it is asked whether a test can go on.
//!
//! A vehicle that keeps the node it stands on in its list, or leaves cancelOrder RUNNING, is guilty of that, once. Its
//! states are read from then on as they are meant, so that everything else can still be judged.

use serde::{Deserialize, Serialize};
use serde_json::Value;

/// One lasting mistake of the states, and how they are read in spite of it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct Waiver {
    /// The member of the state.
    pub member: String,
    /// How it is read.
    pub reading: Reading,
    /// The requirements that are about this mistake: where they are decided, the states are read as they are.
    pub about: Vec<String>,
    /// What the vehicle does, in one line.
    pub why: String,
}

/// How a member of a state is read.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(tag = "how", rename_all = "kebab-case")]
pub enum Reading {
    /// Without the nodes and edges that lie behind the vehicle by its own account.
    Passed,
    /// Without the elements that show this.
    Without {
        /// What they show.
        like: Value,
    },
    /// One value is read as another.
    As {
        /// What is shown; absent where the member is missing.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        shown: Option<Value>,
        /// What is meant.
        meant: Value,
    },
    /// One status of actions is read as another.
    Status {
        /// What is shown.
        shown: String,
        /// What is meant.
        meant: String,
    },
    /// Where nothing is shown, what was shown last still holds.
    Kept,
    /// True is read as false while the vehicle stays where it is.
    Standing,
}
