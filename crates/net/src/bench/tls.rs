//! A certificate with its key, as files.

use std::path::PathBuf;

/// A certificate that is shown: by the tap to the device, or to a broker.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TlsFiles {
    /// PEM file with the certificate chain.
    pub certificate: PathBuf,
    /// PEM file with the private key.
    pub key: PathBuf,
}
