//! One client on the tap, and what it looks like.

use std::collections::BTreeSet;
use std::sync::Arc;

use tck_journal::Entry;
use tck_journal::event::{Origin, Packet};

/// How many entries of a bystander are kept, in case it turns out to be the device.
const HELD: usize = 16;
/// How many topics of a stranger are named.
const TOPICS: usize = 4;

/// Whose a connection is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Who {
    /// The device's, as far as is known.
    Device,
    /// Somebody's who does nothing the device does.
    Bystander,
    /// Somebody's who does what only the device, or only its master control, may.
    Stranger,
}

/// What a CONNECT says of the program behind it. Two connections of one program look alike.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct ClientSignature {
    level: u8,
    keep_alive: u16,
    clean_session: bool,
    username: Option<String>,
    /// The topic of its will.
    pub will: Option<String>,
}

impl ClientSignature {
    /// Of a CONNECT packet.
    pub fn of(packet: &Packet) -> Self {
        let Packet::Connect {
            level,
            keep_alive,
            clean_session,
            username,
            will,
            ..
        } = packet
        else {
            return Self::default();
        };
        Self {
            level: *level,
            keep_alive: *keep_alive,
            clean_session: *clean_session,
            username: username.clone(),
            will: will.as_ref().map(|will| will.topic.clone()),
        }
    }
}

/// An open connection.
#[derive(Debug)]
pub(super) struct Client {
    pub id: String,
    pub peer: String,
    pub look: ClientSignature,
    pub who: Who,
    /// The topics of the device it publishes on.
    pub publishes: BTreeSet<String>,
    /// Whether it subscribes to just what is sent to the device.
    pub listens: bool,
    /// The journal number of its CONNECT.
    pub seq: u64,
    /// Whose it is, where the system tells.
    pub origin: Option<Origin>,
    /// What was left out of it.
    pub held: Vec<Arc<Entry>>,
}

impl Client {
    pub fn new(id: &str, peer: String, look: ClientSignature, who: Who, seq: u64) -> Self {
        Self {
            id: id.to_owned(),
            peer,
            look,
            who,
            publishes: BTreeSet::new(),
            listens: false,
            seq,
            origin: None,
            held: Vec::new(),
        }
    }

    /// Whether it is known not to be what was started.
    pub fn is_foreign(&self) -> bool {
        self.origin.as_ref().is_some_and(Origin::is_foreign)
    }

    /// Whether it is known to be what was started.
    pub fn is_own(&self) -> bool {
        matches!(self.origin, Some(Origin::Started { .. }))
    }

    /// Who it is, without what was left out of it.
    pub fn named(&self) -> Self {
        Self {
            id: self.id.clone(),
            peer: self.peer.clone(),
            look: ClientSignature::default(),
            who: self.who,
            publishes: BTreeSet::new(),
            listens: false,
            seq: self.seq,
            origin: self.origin.clone(),
            held: Vec::new(),
        }
    }

    /// Keeps what is left out.
    pub fn hold(&mut self, entry: &Arc<Entry>) {
        if self.who == Who::Bystander && !self.is_foreign() && self.held.len() < HELD {
            self.held.push(Arc::clone(entry));
        }
    }
}

/// Somebody who is not the device.
#[derive(Debug)]
pub(super) struct ForeignClient {
    peer: String,
    first: u64,
    messages: u64,
    topics: BTreeSet<String>,
    pub takeovers: u64,
    /// The program that has the connection, where the system tells.
    program: Option<String>,
    /// It is taken for the device: it carries its last will, or goes by its client id.
    poses: bool,
}

impl ForeignClient {
    /// First seen at an address, with this journal number.
    pub fn new(peer: &str, first: u64) -> Self {
        Self {
            peer: peer.to_owned(),
            first,
            messages: 0,
            topics: BTreeSet::new(),
            takeovers: 0,
            program: None,
            poses: false,
        }
    }

    /// It is not what was started: another program has it.
    pub fn is_of(&mut self, origin: &Origin) {
        let Origin::Other { process, name } = origin else {
            return;
        };
        let name = name.as_deref().unwrap_or("whose name may not be seen");
        self.program = Some(match process {
            Some(process) => format!("process {process}, {name:?}"),
            None => "a process that may not be seen".to_owned(),
        });
    }

    /// It is taken for the device.
    pub fn poses(&mut self) {
        self.poses = true;
    }

    /// It has published on a topic.
    pub fn publishes(&mut self, topic: &str) {
        self.messages += 1;
        if self.topics.len() < TOPICS {
            self.topics.insert(topic.to_owned());
        }
    }

    /// Whether it did what may show in the findings.
    pub fn is_busy(&self) -> bool {
        self.messages > 0 || self.takeovers > 0 || self.poses
    }

    /// Whether it may have been taken for the device: it went by its client id or its last will, or is known to be another
    /// program and spoke in its name.
    pub fn is_rival(&self) -> bool {
        self.poses || self.takeovers > 0 || (self.program.is_some() && self.messages > 0)
    }

    /// The limit that it sets to the statement.
    pub fn in_words(&self, id: &str) -> String {
        let mut did = Vec::new();
        if self.takeovers > 0 {
            did.push(format!(
                "took the client id of the device, which was thrown out, {} time(s)",
                self.takeovers
            ));
        }
        if self.messages > 0 {
            let topics: Vec<&str> = self.topics.iter().map(String::as_str).collect();
            did.push(format!(
                "published {} message(s) on {}",
                self.messages,
                topics.join(", ")
            ));
        }
        if self.poses && did.is_empty() {
            did.push("goes by the client id or the last will of the device".to_owned());
        }
        let is = match &self.program {
            Some(program) => format!("which is not what `device.command` has started but {program}"),
            None => "which is not the device".to_owned(),
        };
        format!(
            "The client {id:?} at {}, {is}, {} (from #{} on). What it sent was not judged, and what it may have caused is \
             undecided.",
            self.peer,
            did.join(", and "),
            self.first
        )
    }
}
