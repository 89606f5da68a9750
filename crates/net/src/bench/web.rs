//! HTTP and HTTPS to others: hooks of a profile, and downloads of mock vehicles.

use std::path::{Path, PathBuf};
use std::sync::{Arc, OnceLock};

use tokio_rustls::rustls::crypto::ring;
use ureq::Agent;
use ureq::config::ConfigBuilder;
use ureq::tls::{Certificate, RootCerts, TlsConfig, TlsProvider};
use ureq::typestate::AgentScope;

use super::LinkError;
use super::tls;

/// What the system trusts; reading it takes a while, and it does not change.
static SYSTEM: OnceLock<Vec<Certificate<'static>>> = OnceLock::new();

/// An agent for requests to this address. With TLS it trusts what the system trusts, and `authority`, a PEM file.
///
/// # Errors
/// [`LinkError::Setup`] when the file cannot be read.
pub fn agent(
    url: &str,
    authority: Option<&PathBuf>,
    limits: impl FnOnce(ConfigBuilder<AgentScope>) -> ConfigBuilder<AgentScope>,
) -> Result<Agent, LinkError> {
    let mut config = limits(Agent::config_builder());
    if url.starts_with("https://") {
        config = config.tls_config(trusting(authority.map(PathBuf::as_path))?);
    }
    Ok(config.build().into())
}

fn trusting(authority: Option<&Path>) -> Result<TlsConfig, LinkError> {
    let mut roots = match authority {
        Some(path) => tls::certificates(path)?
            .iter()
            .map(|certificate| Certificate::from_der(certificate).to_owned())
            .collect(),
        None => Vec::new(),
    };
    roots.extend_from_slice(SYSTEM.get_or_init(|| {
        let system = rustls_native_certs::load_native_certs().certs;
        system
            .iter()
            .map(|certificate| Certificate::from_der(certificate).to_owned())
            .collect()
    }));
    Ok(TlsConfig::builder()
        .provider(TlsProvider::Rustls)
        .root_certs(RootCerts::new_with_certs(&roots))
        .unversioned_rustls_crypto_provider(Arc::new(ring::default_provider()))
        .build())
}
