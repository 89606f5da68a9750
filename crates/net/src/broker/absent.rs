//! What stands in for the embedded broker in a build without it: the broker of the surroundings has to be named.
#![allow(
    clippy::unused_async,
    reason = "a broker that is there takes a while to start and to stop"
)]

use std::net::SocketAddr;

use tokio::sync::watch;

use crate::bench::LinkError;

/// A running embedded broker; never there.
pub enum EmbeddedBroker {}

impl EmbeddedBroker {
    /// Starts none.
    ///
    /// # Errors
    /// [`LinkError::Setup`], always.
    pub async fn start() -> Result<Self, LinkError> {
        Err(LinkError::Setup(
            "this build has no broker of its own, as it was made without the feature `broker`: name the broker to use \
             in the profile"
                .to_owned(),
        ))
    }

    /// Where it listens.
    #[must_use]
    pub fn address(&self) -> SocketAddr {
        match *self {}
    }

    pub(crate) fn ended(&self) -> watch::Receiver<Option<String>> {
        match *self {}
    }

    /// Stops it.
    pub async fn stop(self) {
        match self {}
    }
}
