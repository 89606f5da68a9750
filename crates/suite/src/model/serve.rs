//! `serve:`: a file that the device may fetch.

use super::ServeBehaviour;
use tck_base::pattern::Term;

/// `serve:`.
#[derive(Clone, Debug)]
pub struct Serve {
    /// `${serve.NAME}` is the address.
    pub name: String,
    /// File of `fixtures/maps/` or of the profile; a built-in map unless said.
    pub file: Option<Term>,
    /// A JSON document that is served instead of a file.
    pub json: Option<Term>,
    /// A file of a certificate of the harness that is served instead, over TLS.
    pub certificate: Option<CertificateFile>,
    /// How it is served.
    pub behaviour: ServeBehaviour,
}

/// A file that belongs to a certificate which the harness makes for the device, another one for each test.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CertificateFile {
    /// The authorities that the device is to trust.
    Authority,
    /// The certificate of the device, by the authority of the harness.
    Certificate,
    /// The key that belongs to it.
    Key,
    /// A certificate for the same key, by an authority that calls itself the same and is another one.
    StrayCertificate,
    /// A key that does not belong to it.
    OtherKey,
    /// What looks like a certificate, and is none.
    BrokenCertificate,
}
