//! The real bench over TCP: broker, tap, map server and link, with devices that behave and devices that do not.
#![expect(clippy::unwrap_used, clippy::panic, reason = "a test that cannot go on has failed")]

mod brokers;
mod clients;
mod device;
mod faults;
mod hostile;
mod lag;
mod rig;
mod surroundings;
mod traffic;
