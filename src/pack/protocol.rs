//! One protocol version.

use super::Version;

/// One protocol version as data.
#[derive(Debug)]
pub struct Pack {
    /// Folder name below `schemas/`, major and minor.
    pub id: String,
    /// The version written into headers.
    pub version: Version,
}
