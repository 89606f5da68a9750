//! TLS towards the device and towards others, from PEM files.

#[cfg(not(feature = "tls"))]
mod absent;
#[cfg(feature = "tls")]
mod rustls;

#[cfg(not(feature = "tls"))]
pub(crate) use absent::trusting;
#[cfg(not(feature = "tls"))]
pub use absent::{TlsClient, TlsServer};
#[cfg(feature = "tls")]
pub(crate) use rustls::trusting;
#[cfg(feature = "tls")]
pub use rustls::{TlsClient, TlsServer};
