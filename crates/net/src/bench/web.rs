//! HTTP and HTTPS to others: hooks of a profile, and downloads of mock vehicles.

use std::path::PathBuf;

use ureq::Agent;
use ureq::config::ConfigBuilder;
use ureq::typestate::AgentScope;

use super::LinkError;
use super::secure;

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
        config = secure::trusting(config, authority.map(PathBuf::as_path))?;
    }
    Ok(config.build().into())
}
