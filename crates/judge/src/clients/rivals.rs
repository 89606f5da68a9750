//! Others that may have been taken for the device, where no look tells them apart: they are named, and no run passes in which
//! they are more than a connection that was opened anew.

use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

use tck_base::clock::Moment;
use tck_journal::event::Origin;

/// How many are named.
const NAMED: usize = 8;
/// Who takes the client id of a connection that still seems open may be the device that comes back over a bad link. When that
/// is done again so soon, somebody who was thrown out has come back: there are two.
const SO_SOON: Duration = Duration::from_secs(60);

/// Connections under one client id.
#[derive(Debug)]
struct Double {
    first: u64,
    times: u64,
    peers: (String, String),
    /// When it was taken last.
    last: Moment,
    /// It was taken back and forth.
    is_duel: bool,
}

/// Others that may have been taken for the device, where no look tells them apart: they are named, and no run passes in
/// which they are more than a connection that was opened anew.
#[derive(Debug, Default)]
pub(super) struct Rivals {
    doubles: BTreeMap<String, Double>,
    /// The connection that has published last on a topic on which another one does so, too.
    spoke: BTreeMap<String, u64>,
    /// Clients that publish on the same topic in turn, and since when.
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
    pub(super) fn connects(&mut self, id: &str, (former, peer): (&str, &str), seq: u64, now: Moment) -> String {
        if self.doubles.len() < NAMED || self.doubles.contains_key(id) {
            let double = self.doubles.entry(id.to_owned()).or_insert_with(|| Double {
                first: seq,
                times: 0,
                peers: (former.to_owned(), peer.to_owned()),
                last: now,
                is_duel: false,
            });
            double.is_duel |= double.times > 0 && now.since(double.last) <= SO_SOON;
            double.times += 1;
            double.last = now;
        }
        format!(
            "a client at {peer} connected as {id:?} while the connection of {former} under that id was open (#{seq})"
        )
    }

    /// A client publishes on a topic on which another one that is connected has published. One that only takes the place of
    /// the other is no rival.
    pub(super) fn publish(&mut self, topic: &str, connection: u64, why: &str, seq: u64) {
        let before = self.spoke.insert(topic.to_owned(), connection);
        let in_turn = before.is_some_and(|before| before != connection);
        if in_turn && self.publish.len() < NAMED {
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
            format!("{what}, in turn (first at #{first}). Which of them is the device is not known, and what that may have caused is undecided.")
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
        let double = doubles.find(|(_, double)| double.is_duel);
        let double = double.map(|(id, _)| format!("more than one client is connected as {id:?}"));
        double.or_else(|| self.publish.keys().next().cloned())
    }
}

/// The host of an address with its port.
fn host(address: &str) -> &str {
    address.rsplit_once(':').map_or(address, |(host, _)| host)
}
