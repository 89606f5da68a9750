//! What stands in for TLS in a build without it: nothing can be secured.
#![allow(clippy::unused_async, reason = "a handshake that is made takes a while")]

use std::io;
use std::path::Path;

use tokio::net::TcpStream;
use ureq::config::ConfigBuilder;
use ureq::typestate::AgentScope;

use crate::bench::LinkError;
use crate::bench::stream::{Socket, Stream};
use crate::bench::tls::TlsFiles;

/// TLS towards a broker; never there.
#[derive(Clone, Debug)]
pub enum TlsClient {}

/// TLS towards devices; never there.
#[derive(Clone)]
pub enum TlsServer {}

impl TlsClient {
    pub(crate) fn new(_: Option<&Path>, _: Option<&TlsFiles>) -> Result<Self, LinkError> {
        Err(without())
    }

    pub(crate) async fn secure(&self, _: TcpStream, _: &str, _: &str) -> Result<Box<dyn Stream>, String> {
        match *self {}
    }
}

impl TlsServer {
    /// Shows this certificate, which a build without TLS never does.
    ///
    /// # Errors
    /// Always.
    pub fn new(_: &TlsFiles) -> Result<Self, LinkError> {
        Err(without())
    }

    pub(crate) async fn accept(&self, _: TcpStream) -> io::Result<Box<dyn Socket>> {
        match *self {}
    }
}

pub(crate) fn trusting(_: ConfigBuilder<AgentScope>, _: Option<&Path>) -> Result<ConfigBuilder<AgentScope>, LinkError> {
    Err(without())
}

fn without() -> LinkError {
    LinkError::Setup("this build speaks no TLS: it was made without the feature `tls`".to_owned())
}
