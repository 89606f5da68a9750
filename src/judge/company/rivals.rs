//! Others that may have been taken for the device, where no look tells them apart: they are named, and no run passes in which
//! they are more than a connection that was opened anew.

use std::collections::{BTreeMap, BTreeSet};

use crate::journal::event::Origin;

/// How many are named.
const NAMED: usize = 8;
/// So often the client id of a device may be taken that still seems connected before it is more than one device that comes
/// back over a bad link.
const MORE_THAN_ONE: u64 = 2;

/// Two connections under one client id.
#[derive(Debug)]
struct Double {
    first: u64,
    times: u64,
    peers: (String, String),
    /// They are known to be of two machines.
    certain: bool,
}

/// See the module.
#[derive(Debug, Default)]
pub(super) struct Rivals {
    doubles: BTreeMap<String, Double>,
    /// Clients that publish on the same topic, and since when.
    publish: BTreeMap<String, u64>,
    /// Machines of which nobody knows which of their programs has a connection.
    elsewhere: BTreeSet<String>,
    /// How many connections of this machine could not be traced.
    unseen: u64,
}

impl Rivals {
    /// A connection was traced, as far as it can be.
    pub(super) fn traced(&mut self, origin: &Origin, peer: &str) {
        match origin {
            Origin::Elsewhere if self.elsewhere.len() < NAMED => {
                self.elsewhere.insert(host(peer).to_owned());
            }
            Origin::Unseen => self.unseen += 1,
            _ => {}
        }
    }

    /// A client connects under an id under which the device is connected, and looks like it. Gives what may follow from it.
    pub(super) fn connects(&mut self, id: &str, (former, peer): (&str, &str), seq: u64, certain: bool) -> String {
        if self.doubles.len() < NAMED || self.doubles.contains_key(id) {
            let double = self.doubles.entry(id.to_owned()).or_insert_with(|| Double {
                first: seq,
                times: 0,
                peers: (former.to_owned(), peer.to_owned()),
                certain: false,
            });
            double.times += 1;
            double.certain |= certain;
        }
        format!("a client at {peer} connected as {id:?} while the connection of {former} under that id was open (#{seq})")
    }

    /// Two clients publish on one topic.
    pub(super) fn publish(&mut self, why: &str, seq: u64) {
        if self.publish.len() < NAMED {
            self.publish.entry(why.to_owned()).or_insert(seq);
        }
    }

    /// What restricts the statement.
    pub(super) fn limits(&self) -> impl Iterator<Item = String> {
        let doubles = self.doubles.iter().map(|(id, double)| {
            let (former, peer) = &double.peers;
            format!(
                "While the connection of {former} as {id:?} was open, {peer} connected under the same client id, {} time(s) (first \
                 at #{}): either the device came back, or there are two. What that may have caused is undecided.",
                double.times, double.first
            )
        });
        let publish = self.publish.iter().map(|(what, first)| {
            let mut what = what.clone();
            if let Some(letter) = what.get_mut(..1) {
                letter.make_ascii_uppercase();
            }
            format!("{what} (first at #{first}). Which of them is the device is not known, and what that may have caused is undecided.")
        });
        let elsewhere = (!self.elsewhere.is_empty()).then(|| {
            let machines: Vec<&str> = self.elsewhere.iter().map(String::as_str).collect();
            format!(
                "Which program has the connections from {} is not known: that it is what `device.command` has started is \
                 believed.",
                machines.join(", ")
            )
        });
        let unseen = (self.unseen > 0).then(|| {
            format!(
                "Of {} connection(s) from this machine the program could not be seen: that it is what `device.command` has \
                 started is believed.",
                self.unseen
            )
        });
        doubles.chain(publish).chain(elsewhere).chain(unseen)
    }

    /// Why it is not certain who was judged.
    pub(super) fn mixed(&self) -> Option<String> {
        let mut doubles = self.doubles.iter();
        let double = doubles.find(|(_, double)| double.certain || double.times >= MORE_THAN_ONE);
        let double = double.map(|(id, _)| format!("more than one client is connected as {id:?}"));
        double.or_else(|| self.publish.keys().next().cloned())
    }
}

/// The host of an address with its port.
pub(super) fn host(address: &str) -> &str {
    address.rsplit_once(':').map_or(address, |(host, _)| host)
}
