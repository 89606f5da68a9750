//! How the harness reaches a device: addresses and TLS, the embedded broker, the tap, the map server, and links over
//! sockets and in memory.
#![forbid(unsafe_code)]
#![warn(missing_docs)]

pub mod bench;
pub mod broker;
pub mod link;
pub mod maps;
pub mod tap;
