//! The real program over real sockets: what it says, what it writes and how it ends, whatever the device does.
//!
//! Every test runs the binary in a folder of its own and on free ports, under a limit that kills it, and no run
//! may panic. Few tests of the suite are used per run; whether the suite is right is proved elsewhere.
#![expect(clippy::unwrap_used, clippy::panic, reason = "a test that cannot go on has failed")]

mod asked;
mod auditing;
mod bench;
mod beside;
mod broken;
mod brokers;
mod bystanders;
mod campaigns;
mod certificates;
mod cluster;
mod counterparts;
mod discovering;
mod exit_codes;
mod exploring;
mod fleets;
mod following;
mod handed_over;
mod handing_over;
mod histories;
mod hooks;
mod hostile;
mod https;
mod inspecting;
mod interrupted;
mod layouts;
mod messages_only;
mod migrating;
mod mosquitto;
mod new_certificates;
mod output;
mod overhearing;
mod own_rules;
mod papers;
mod pipelines;
mod planning;
mod prompting;
mod questions;
mod rejudging;
mod repeatable;
mod resuming;
mod scheduled;
mod scripted;
mod seen;
mod selecting;
mod sharing;
mod simulating;
mod started;
mod tool;
mod transcripts;
mod validating;
mod watching;
mod websockets;
