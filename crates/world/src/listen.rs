//! What a check or a fact wants to be told of.
//!
//! Every observation is of exactly one [`Kind`]. A check names the kinds it listens to, and the judge calls it for no
//! other record.

use tck_view::Topic;

/// How a message on a topic was seen.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Seen {
    /// Delivered live to the standing subscription of the harness.
    Delivered,
    /// Delivered from what the broker had stored before.
    Stored,
    /// Published by the harness.
    Sent,
    /// Delivered to a fresh subscriber.
    Fetched,
    /// Published by the device, as the tap sees it.
    Published,
    /// Passed on to the device, as the tap sees it.
    Received,
}

/// What a check can listen to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Listen {
    /// Every record: for what has to notice that time passes.
    Everything,
    /// Every message that is delivered live on a topic of the vehicle.
    AnyDelivered,
    /// Every message the harness publishes on a topic of the vehicle.
    AnySent,
    /// Every message the device publishes on a topic of the vehicle, as the tap sees it.
    AnyPublished,
    /// A live message on this topic.
    Delivered(Topic),
    /// A message on this topic that the broker had stored.
    Stored(Topic),
    /// A message of the harness on this topic.
    Sent(Topic),
    /// A message of the device on this topic, as the tap sees it.
    Published(Topic),
    /// A message on this topic that is passed on to the device, as the tap sees it.
    Received(Topic),
    /// A message on its way to the vehicle on this topic, from the harness or from a master control: sent or delivered.
    ToVehicle(Topic),
    /// A message the device publishes on a topic that is none of the vehicle, as the tap sees it.
    Elsewhere,
    /// A CONNECT packet.
    Connect,
    /// A CONNACK packet.
    Connack,
    /// A SUBSCRIBE packet.
    Subscribe,
    /// A DISCONNECT packet.
    Disconnect,
    /// A connection is opened.
    Opened,
    /// A connection has ended.
    Closed,
    /// Bytes that are no packet.
    Undecodable,
    /// The harness changes what the link does.
    Fault,
    /// A hook was run.
    Hook,
    /// A person has answered.
    Answer,
    /// The harness was late.
    Lag,
    /// The harness does something to its mock vehicle.
    Vehicle,
    /// A stimulus was given, or a variable got its value.
    Step,
    /// The run begins.
    Begin,
    /// What becomes of the program that the run has started.
    Program,
}

/// The kind of one observation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Kind(u8);

/// How many topics there is room for.
const SLOTS: u8 = 16;
/// Where the kinds begin that are about no topic.
const OTHERS: u8 = 6 * SLOTS;

impl Kind {
    pub(crate) const ELSEWHERE: Self = Self(OTHERS);
    pub(crate) const CONNECT: Self = Self(OTHERS + 1);
    pub(crate) const CONNACK: Self = Self(OTHERS + 2);
    pub(crate) const SUBSCRIBE: Self = Self(OTHERS + 3);
    pub(crate) const DISCONNECT: Self = Self(OTHERS + 4);
    pub(crate) const OPENED: Self = Self(OTHERS + 5);
    pub(crate) const CLOSED: Self = Self(OTHERS + 6);
    pub(crate) const UNDECODABLE: Self = Self(OTHERS + 7);
    pub(crate) const FAULT: Self = Self(OTHERS + 8);
    pub(crate) const HOOK: Self = Self(OTHERS + 9);
    pub(crate) const ANSWER: Self = Self(OTHERS + 10);
    pub(crate) const LAG: Self = Self(OTHERS + 11);
    pub(crate) const VEHICLE: Self = Self(OTHERS + 12);
    pub(crate) const STEP: Self = Self(OTHERS + 13);
    pub(crate) const BEGIN: Self = Self(OTHERS + 14);
    pub(crate) const PROGRAM: Self = Self(OTHERS + 15);
    /// Nobody listens to it alone.
    pub(crate) const REST: Self = Self(OTHERS + 16);

    /// Of a message on a topic of the vehicle.
    pub(crate) const fn message(way: Seen, topic: Topic) -> Self {
        Self(way as u8 * SLOTS + topic as u8)
    }

    const fn bit(self) -> u128 {
        1 << self.0
    }
}

/// A set of kinds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Listens(u128);

impl Listens {
    /// All kinds that are named.
    #[must_use]
    pub fn to(all: &[Listen]) -> Self {
        Self(all.iter().fold(0, |bits, one| bits | Self::bits(*one)))
    }

    /// The kinds of both.
    #[must_use]
    pub fn and(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }

    /// Whether an observation of this kind is in the set.
    #[must_use]
    pub fn hears(self, kind: Kind) -> bool {
        self.0 & kind.bit() != 0
    }

    /// Whether some kind is in both sets.
    #[must_use]
    pub const fn overlaps(self, other: Self) -> bool {
        self.0 & other.0 != 0
    }

    fn bits(one: Listen) -> u128 {
        let of = |way: Seen, topic: Topic| Kind::message(way, topic).bit();
        let all = |way: Seen| u128::from(u16::MAX) << (way as u8 * SLOTS);
        match one {
            Listen::Everything => u128::MAX,
            Listen::AnyDelivered => all(Seen::Delivered),
            Listen::AnySent => all(Seen::Sent),
            Listen::AnyPublished => all(Seen::Published),
            Listen::Delivered(topic) => of(Seen::Delivered, topic),
            Listen::Stored(topic) => of(Seen::Stored, topic),
            Listen::Sent(topic) => of(Seen::Sent, topic),
            Listen::Published(topic) => of(Seen::Published, topic),
            Listen::Received(topic) => of(Seen::Received, topic),
            Listen::ToVehicle(topic) => of(Seen::Delivered, topic) | of(Seen::Sent, topic),
            Listen::Elsewhere => Kind::ELSEWHERE.bit(),
            Listen::Connect => Kind::CONNECT.bit(),
            Listen::Connack => Kind::CONNACK.bit(),
            Listen::Subscribe => Kind::SUBSCRIBE.bit(),
            Listen::Disconnect => Kind::DISCONNECT.bit(),
            Listen::Opened => Kind::OPENED.bit(),
            Listen::Closed => Kind::CLOSED.bit(),
            Listen::Undecodable => Kind::UNDECODABLE.bit(),
            Listen::Fault => Kind::FAULT.bit(),
            Listen::Hook => Kind::HOOK.bit(),
            Listen::Answer => Kind::ANSWER.bit(),
            Listen::Lag => Kind::LAG.bit(),
            Listen::Vehicle => Kind::VEHICLE.bit(),
            Listen::Step => Kind::STEP.bit(),
            Listen::Begin => Kind::BEGIN.bit(),
            Listen::Program => Kind::PROGRAM.bit(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_set_hears_what_it_names_and_nothing_else() {
        let set = Listens::to(&[Listen::ToVehicle(Topic::Order), Listen::Fault]);
        assert!(set.hears(Kind::message(Seen::Sent, Topic::Order)));
        assert!(set.hears(Kind::message(Seen::Delivered, Topic::Order)));
        assert!(!set.hears(Kind::message(Seen::Published, Topic::Order)));
        assert!(!set.hears(Kind::message(Seen::Delivered, Topic::State)));
        assert!(set.hears(Kind::FAULT) && !set.hears(Kind::HOOK) && !set.hears(Kind::REST));
        assert!(Listens::to(&[Listen::Everything]).hears(Kind::REST));
        assert!(Listens::to(&[Listen::AnyDelivered]).hears(Kind::message(Seen::Delivered, Topic::Other)));
    }
}
