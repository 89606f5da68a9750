//! The files of a certificate: whether they can be read, belong together, and lead to the authority they came with.

use bytes::Bytes;

/// What is wrong with a certificate that was fetched.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(not(feature = "tls"), expect(dead_code, reason = "no certificate is looked into"))]
pub(crate) enum Flaw {
    /// A file is not what it has to be.
    Unreadable,
    /// The key belongs to another certificate.
    OtherKey,
    /// No chain leads from the certificate to an authority, now and for a client.
    Stray,
}

impl Flaw {
    /// What is wrong, for people.
    pub(crate) fn text(self) -> &'static str {
        match self {
            Self::Unreadable => "a file is no key or no certificate",
            Self::OtherKey => "the key does not belong to the certificate",
            Self::Stray => "the certificate does not lead to its authority",
        }
    }
}

/// What is wrong with these files, as PEM; the chain is looked at where there is an authority.
#[cfg(feature = "tls")]
pub(crate) fn flaw(key: &Bytes, certificate: &Bytes, authority: Option<&Bytes>, now: jiff::Timestamp) -> Option<Flaw> {
    checks::check(key, certificate, authority, now).err()
}

/// Without TLS nothing is read, and no certificate is taken (`action_kinds`).
#[cfg(not(feature = "tls"))]
#[expect(clippy::unnecessary_wraps, reason = "as with TLS")]
pub(crate) fn flaw(_: &Bytes, _: &Bytes, _: Option<&Bytes>, _: jiff::Timestamp) -> Option<Flaw> {
    Some(Flaw::Unreadable)
}

#[cfg(feature = "tls")]
mod checks {
    use std::sync::Arc;
    use std::time::Duration;

    use rustls::crypto::ring;
    use rustls::pki_types::pem::PemObject as _;
    use rustls::pki_types::{CertificateDer, PrivateKeyDer, UnixTime};
    use rustls::server::WebPkiClientVerifier;
    use rustls::sign::CertifiedKey;
    use rustls::{Error, RootCertStore};

    use super::Flaw;

    pub(super) fn check(
        key: &[u8],
        certificate: &[u8],
        authority: Option<&bytes::Bytes>,
        now: jiff::Timestamp,
    ) -> Result<(), Flaw> {
        let provider = ring::default_provider();
        let key = PrivateKeyDer::from_pem_slice(key).map_err(|_| Flaw::Unreadable)?;
        let chain = certificates(certificate)?;
        CertifiedKey::from_der(chain.clone(), key, &provider).map_err(|error| match error {
            Error::InconsistentKeys(_) => Flaw::OtherKey,
            _ => Flaw::Unreadable,
        })?;
        let (Some(authority), Some((own, between))) = (authority, chain.split_first()) else {
            return Ok(());
        };
        let mut roots = RootCertStore::empty();
        roots.add_parsable_certificates(certificates(authority)?);
        let verifier = WebPkiClientVerifier::builder_with_provider(Arc::new(roots), Arc::new(provider));
        let verifier = verifier.build().map_err(|_| Flaw::Unreadable)?;
        let now = UnixTime::since_unix_epoch(Duration::from_secs(now.as_second().try_into().unwrap_or(0)));
        let verified = verifier.verify_client_cert(own, between, now);
        verified.map(drop).map_err(|_| Flaw::Stray)
    }

    fn certificates(file: &[u8]) -> Result<Vec<CertificateDer<'static>>, Flaw> {
        let all: Result<Vec<_>, _> = CertificateDer::pem_slice_iter(file).collect();
        all.ok().filter(|all| !all.is_empty()).ok_or(Flaw::Unreadable)
    }
}
