//! What the harness does to the link.

use serde::{Deserialize, Serialize};

use super::vantage::Direction;

/// What the harness does to the link.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(tag = "fault", rename_all = "kebab-case", rename_all_fields = "camelCase")]
pub enum LinkFault {
    /// End the connection and refuse new ones until `restore`.
    Cut {
        /// RST instead of FIN.
        reset: bool,
    },
    /// Forward nothing, keep the connection open.
    Silence {
        /// Which way; both when absent.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        direction: Option<Direction>,
    },
    /// Hold every packet back for a while.
    Delay {
        /// Milliseconds.
        millis: u64,
        /// Which way; both when absent.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        direction: Option<Direction>,
    },
    /// Swallow the next PUBLISH packets on a topic.
    Drop {
        /// Last level of the topic; any when absent.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        topic: Option<String>,
        /// How many.
        count: u32,
        /// Which way; both when absent.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        direction: Option<Direction>,
    },
    /// Send the next PUBLISH packets on a topic twice.
    Duplicate {
        /// Last level of the topic; any when absent.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        topic: Option<String>,
        /// How many.
        count: u32,
        /// Which way; both when absent.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        direction: Option<Direction>,
    },
    /// Accept no new connections, leave the present one alone.
    Refuse,
    /// End all faults.
    Restore,
}
