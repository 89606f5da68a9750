//! What our own tap saw, as a capture of the network tells it.

use super::packets::message;
use super::{Message, SourcePosition, Wire, WireEvent};
use tck_journal::event::{Direction, Event, Source};

/// What an event of the tap is; `None` for one of somebody else, or of a broker: what it hands on is heard elsewhere.
#[must_use]
pub fn wire(
    at: jiff::Timestamp,
    source: Source,
    direction: Option<Direction>,
    event: &Event,
    file: usize,
) -> Option<Wire> {
    if source != Source::Tap || direction == Some(Direction::ToDevice) && !matches!(event, Event::Closed { .. }) {
        return None;
    }
    let (connection, event) = match event {
        Event::Packet { connection, packet } => (
            *connection,
            WireEvent::Packet {
                packet: packet.clone(),
                sent: true,
            },
        ),
        Event::Undecodable { connection, .. } => (*connection, WireEvent::Gap { sent: true }),
        Event::Closed { connection, how } => (*connection, WireEvent::Closed { how: *how }),
        _ => return None,
    };
    Some(Wire {
        at: Some(at),
        connection: u64::try_from(file).unwrap_or_default() << 40 | connection,
        certain: true,
        event,
    })
}

/// The message in it.
#[must_use]
pub fn carried(wire: &Wire, place: SourcePosition) -> Option<Message> {
    message(wire, place)
}
