//! What an MQTT 3.1.1 client answers and when it may go on, as pure state: no socket and no clock.

use std::collections::VecDeque;

use bytes::BytesMut;
use rumqttc::{Packet, PubAck, PubComp, PubRec, PubRel, Publish, QoS, StateError, valid_topic};

use super::client::{ClientEvent, IN_FLIGHT, LARGEST_PACKET, REQUESTS, quality};
use tck_base::device::Publication;

/// How many bytes may wait for the connection before messages wait as they are.
const ROOM: usize = 64 << 10;

/// What an own message of QoS 1 or 2 waits for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Awaits {
    /// PUBACK or PUBREC.
    Receipt,
    /// PUBCOMP.
    Completion,
}

/// Messages on their way in both directions.
#[derive(Debug, Default)]
pub(super) struct Flow {
    last_id: u16,
    /// Own messages on their way, by packet id.
    on_their_way: Vec<(u16, Awaits)>,
    /// Messages of QoS 2 that came and were not released yet.
    unreleased: Vec<u16>,
    /// Messages that may not go yet, in order.
    waiting: VecDeque<Publication>,
    awaits_pong: bool,
}

impl Flow {
    /// Writes a message to `out`, or keeps it in line. `false` when it cannot be sent or too much is waiting already.
    pub(super) fn publish(&mut self, message: Publication, out: &mut BytesMut) -> bool {
        if !valid_topic(&message.topic) {
            return false;
        }
        if self.waiting.is_empty() && self.may_go(out) {
            return self.send(message, out);
        }
        let has_room = self.waiting.len() < REQUESTS;
        if has_room {
            self.waiting.push_back(message);
        }
        has_room
    }

    /// Writes the messages in line that may go now.
    pub(super) fn fill(&mut self, out: &mut BytesMut) {
        while self.may_go(out)
            && let Some(message) = self.waiting.pop_front()
        {
            self.send(message, out);
            if self.waiting.is_empty() {
                self.waiting = VecDeque::new();
            }
        }
    }

    /// Whether no message waits.
    pub(super) fn is_clear(&self) -> bool {
        self.waiting.is_empty()
    }

    /// Writes DISCONNECT.
    pub(super) fn bye(out: &mut BytesMut) -> Result<(), StateError> {
        write(Packet::Disconnect, out)
    }

    /// Whether the next message may be written: also one of QoS 0 does not overtake those before it.
    fn may_go(&self, out: &BytesMut) -> bool {
        out.len() < ROOM && self.on_their_way.len() < usize::from(IN_FLIGHT)
    }

    fn send(&mut self, message: Publication, out: &mut BytesMut) -> bool {
        let mut publish = Publish::from_bytes(message.topic, quality(message.qos), message.payload);
        publish.retain = message.retain;
        if publish.qos != QoS::AtMostOnce {
            publish.pkid = self.next_id();
            self.on_their_way.push((publish.pkid, Awaits::Receipt));
        }
        out.reserve(publish.size());
        write(Packet::Publish(publish), out).is_ok()
    }

    /// A packet id that no message on its way has.
    pub(super) fn next_id(&mut self) -> u16 {
        // Fewer than that are on their way, so that one is free.
        for _ in 0..IN_FLIGHT {
            self.last_id = if self.last_id >= IN_FLIGHT { 1 } else { self.last_id + 1 };
            if !self.on_their_way.iter().any(|(id, _)| *id == self.last_id) {
                break;
            }
        }
        self.last_id
    }

    /// Writes PINGREQ. An error when the last one was not answered.
    pub(super) fn ping(&mut self, out: &mut BytesMut) -> Result<(), StateError> {
        if self.awaits_pong {
            return Err(StateError::AwaitPingResp);
        }
        self.awaits_pong = true;
        write(Packet::PingReq, out)
    }

    /// Takes a packet of the broker and writes what it is answered with. A message is an event.
    pub(super) fn take(&mut self, packet: Packet, out: &mut BytesMut) -> Result<Option<ClientEvent>, StateError> {
        match packet {
            Packet::Publish(message) => {
                match message.qos {
                    QoS::AtMostOnce => {}
                    QoS::AtLeastOnce => write(Packet::PubAck(PubAck::new(message.pkid)), out)?,
                    QoS::ExactlyOnce => {
                        if !self.unreleased.contains(&message.pkid) {
                            self.unreleased.push(message.pkid);
                        }
                        write(Packet::PubRec(PubRec::new(message.pkid)), out)?;
                    }
                }
                return Ok(Some(ClientEvent::Message {
                    topic: message.topic,
                    payload: message.payload,
                    qos: message.qos as u8,
                    retain: message.retain,
                    dup: message.dup,
                }));
            }
            Packet::PubAck(ack) => self.settle(ack.pkid, Awaits::Receipt)?,
            Packet::PubRec(ack) => {
                self.settle(ack.pkid, Awaits::Receipt)?;
                self.on_their_way.push((ack.pkid, Awaits::Completion));
                write(Packet::PubRel(PubRel::new(ack.pkid)), out)?;
            }
            Packet::PubComp(ack) => self.settle(ack.pkid, Awaits::Completion)?,
            Packet::PubRel(release) => {
                let known = self.unreleased.iter().position(|id| *id == release.pkid);
                self.unreleased
                    .swap_remove(known.ok_or(StateError::Unsolicited(release.pkid))?);
                write(Packet::PubComp(PubComp::new(release.pkid)), out)?;
            }
            Packet::PingResp => self.awaits_pong = false,
            Packet::UnsubAck(_) => {}
            _ => return Err(StateError::WrongPacket),
        }
        Ok(None)
    }

    /// An own message has what it waited for.
    fn settle(&mut self, id: u16, awaits: Awaits) -> Result<(), StateError> {
        let found = self.on_their_way.iter().position(|known| *known == (id, awaits));
        self.on_their_way.swap_remove(found.ok_or(StateError::Unsolicited(id))?);
        Ok(())
    }
}

fn write(packet: Packet, out: &mut BytesMut) -> Result<(), StateError> {
    packet.write(out, LARGEST_PACKET)?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn message(topic: &str, qos: u8) -> Publication {
        Publication {
            topic: topic.to_owned(),
            payload: topic.as_bytes().to_vec().into(),
            qos,
            retain: false,
        }
    }

    /// What was written.
    fn packets(out: &mut BytesMut) -> Vec<Packet> {
        std::iter::from_fn(|| Packet::read(out, LARGEST_PACKET).ok()).collect()
    }

    fn topics(out: &mut BytesMut) -> Vec<(String, u16)> {
        let published = packets(out).into_iter().filter_map(|packet| match packet {
            Packet::Publish(publish) => Some((publish.topic, publish.pkid)),
            _ => None,
        });
        published.collect()
    }

    #[test]
    fn messages_keep_their_order_behind_those_that_wait_for_an_answer() {
        let (mut flow, mut out) = (Flow::default(), BytesMut::new());
        for _ in 0..IN_FLIGHT {
            assert!(flow.publish(message("many", 1), &mut out));
        }
        let ids: Vec<u16> = topics(&mut out).into_iter().map(|(_, id)| id).collect();
        assert_eq!(ids, (1..=IN_FLIGHT).collect::<Vec<_>>());
        for topic in ["first", "second", "third"] {
            assert!(flow.publish(message(topic, u8::from(topic == "second")), &mut out));
        }
        flow.fill(&mut out);
        assert!(out.is_empty(), "so many are on their way");
        flow.take(Packet::PubAck(PubAck::new(7)), &mut out).unwrap();
        flow.fill(&mut out);
        let expected = [("first", 0), ("second", 7)].map(|(topic, id)| (topic.to_owned(), id));
        assert_eq!(topics(&mut out), expected);
        assert!(!flow.is_clear());
        flow.take(Packet::PubAck(PubAck::new(8)), &mut out).unwrap();
        flow.fill(&mut out);
        assert_eq!(topics(&mut out), [("third".to_owned(), 0)]);
        assert!(flow.is_clear());
    }

    #[test]
    fn too_much_is_refused_and_what_was_taken_is_lost_nowhere() {
        let (mut flow, mut out) = (Flow::default(), BytesMut::new());
        let payload = bytes::Bytes::from(vec![0; ROOM]);
        let big = |number: usize| Publication {
            topic: number.to_string(),
            payload: payload.clone(),
            qos: 0,
            retain: false,
        };
        let taken = (0..REQUESTS + 10)
            .filter(|number| flow.publish(big(*number), &mut out))
            .count();
        assert_eq!(taken, REQUESTS + 1);
        for number in 0..taken {
            flow.fill(&mut out);
            assert_eq!(topics(&mut out), [(number.to_string(), 0)]);
        }
    }

    #[test]
    fn a_message_of_qos_2_takes_four_packets_in_either_direction() {
        let (mut flow, mut out) = (Flow::default(), BytesMut::new());
        flow.publish(message("own", 2), &mut out);
        assert_eq!(topics(&mut out), [("own".to_owned(), 1)]);
        flow.take(Packet::PubRec(PubRec::new(1)), &mut out).unwrap();
        assert_eq!(packets(&mut out), [Packet::PubRel(PubRel::new(1))]);
        flow.take(Packet::PubComp(PubComp::new(1)), &mut out).unwrap();
        assert!(flow.take(Packet::PubComp(PubComp::new(1)), &mut out).is_err());

        let mut theirs = Publish::from_bytes("t", QoS::ExactlyOnce, "x".into());
        theirs.pkid = 9;
        let event = flow.take(Packet::Publish(theirs), &mut out).unwrap();
        assert!(matches!(event, Some(ClientEvent::Message { qos: 2, .. })));
        flow.take(Packet::PubRel(PubRel::new(9)), &mut out).unwrap();
        let answers = [Packet::PubRec(PubRec::new(9)), Packet::PubComp(PubComp::new(9))];
        assert_eq!(packets(&mut out), answers);
        assert!(flow.take(Packet::PubRel(PubRel::new(9)), &mut out).is_err());
    }

    #[test]
    fn what_nobody_asked_for_and_a_ping_without_answer_end_the_connection() {
        let (mut flow, mut out) = (Flow::default(), BytesMut::new());
        assert!(flow.take(Packet::PubAck(PubAck::new(3)), &mut out).is_err());
        assert!(flow.take(Packet::PingReq, &mut out).is_err());
        flow.ping(&mut out).unwrap();
        flow.take(Packet::PingResp, &mut out).unwrap();
        flow.ping(&mut out).unwrap();
        assert!(flow.ping(&mut out).is_err());
        assert!(!flow.publish(message("with/#", 0), &mut out), "no topic to publish on");
    }
}
