//! One direction of an MQTT connection: packets out of bytes, from the beginning or from the first message that can be
//! told for certain.

use tck_journal::event::Packet;
use tck_wire::Reader;

/// How much is read of a packet that does not become whole.
const LONGEST: usize = 4 << 20;
/// How much is read in search of the first message.
const SEARCHED: usize = 1 << 20;
/// MQTT 3.1.1, and 5.
const LEVELS: [u8; 2] = [4, 5];

/// What is read.
#[derive(Default)]
enum State {
    /// It is not known where a packet begins.
    #[default]
    Searching,
    /// Packet after packet.
    Reading(Box<Reader>),
    /// It is not MQTT.
    Foreign,
}

/// One direction of an MQTT connection: packets out of bytes, from the beginning or from the first message that can be
/// told for certain.
#[derive(Default)]
pub(super) struct MqttStream {
    state: State,
    level: Option<u8>,
    /// Bytes in search of the first message, or those since the last whole packet.
    search: Vec<u8>,
    pending: usize,
    /// What the first byte is.
    first: Option<u8>,
}

/// What came of some bytes.
#[derive(Debug, PartialEq)]
pub(super) enum Heard {
    /// A packet.
    Packet(Packet),
    /// Something that cannot be read: what follows is searched anew.
    Lost,
    /// It is not MQTT.
    Foreign,
}

impl MqttStream {
    /// The direction is seen from its beginning. It begins with this byte, or it is not MQTT.
    pub fn begin(&mut self, with: u8) {
        self.first = Some(with);
        self.state = State::Reading(Box::default());
        self.pending = 0;
        self.search.clear();
    }

    /// The protocol level of the connection.
    pub fn level(&self) -> Option<u8> {
        self.level
    }

    /// Learns the protocol level from the other direction.
    pub fn set_level(&mut self, level: u8) {
        self.level = Some(level);
        if let State::Reading(reader) = &mut self.state {
            reader.set_level(level);
        }
    }

    /// It is not MQTT.
    pub fn give_up(&mut self) {
        self.state = State::Foreign;
        self.search = Vec::new();
        self.pending = 0;
    }

    /// Whether it is known not to be MQTT.
    pub fn is_foreign(&self) -> bool {
        matches!(self.state, State::Foreign)
    }

    /// How many bytes are held.
    pub fn held(&self) -> usize {
        self.search.len() + self.pending
    }

    /// Bytes are missing: the next packet has to be found.
    pub fn gap(&mut self) {
        if !self.is_foreign() {
            self.first = None;
            self.state = State::Searching;
            self.search.clear();
            self.pending = 0;
        }
    }

    /// Takes in the bytes of a segment.
    pub fn push(&mut self, bytes: &[u8], heard: &mut Vec<Heard>) {
        let Some(first) = bytes.first() else { return };
        match &mut self.state {
            State::Foreign => {}
            State::Reading(_) if self.first.take().is_some_and(|wanted| wanted != *first) => {
                self.give_up();
                heard.push(Heard::Foreign);
            }
            State::Reading(reader) => {
                reader.push(bytes);
                self.pending += bytes.len();
                self.read(heard);
            }
            State::Searching => {
                // Packets begin where segments begin, if anywhere.
                if self.search.is_empty() && !looks_like_message(bytes) {
                    return;
                }
                self.search.extend_from_slice(bytes);
                self.find(heard);
            }
        }
    }

    fn read(&mut self, heard: &mut Vec<Heard>) {
        let State::Reading(reader) = &mut self.state else {
            return;
        };
        while let Some(piece) = reader.next_piece() {
            self.pending = self.pending.saturating_sub(piece.raw.len());
            match piece.content {
                Ok(packet) => {
                    if let Some(level) = reader.level() {
                        self.level = Some(level);
                    }
                    heard.push(Heard::Packet(packet));
                }
                Err(_) => {
                    heard.push(Heard::Lost);
                    self.gap();
                    return;
                }
            }
        }
        if self.pending > LONGEST {
            heard.push(Heard::Lost);
            self.gap();
        }
    }

    /// Whether the bytes begin with a whole message of JSON: then packets are known to begin here.
    fn find(&mut self, heard: &mut Vec<Heard>) {
        let levels: Vec<u8> = self.level.map_or(LEVELS.to_vec(), |level| vec![level]);
        for level in levels {
            let mut reader = Reader::default();
            reader.set_level(level);
            reader.push(&self.search);
            let Some(piece) = reader.next_piece() else {
                if self.search.len() > SEARCHED {
                    self.search.clear();
                }
                return;
            };
            if piece.content.as_ref().is_ok_and(is_message) {
                let mut reader = Reader::default();
                reader.set_level(level);
                reader.push(&self.search);
                self.level = Some(level);
                self.pending = self.search.len();
                self.search = Vec::new();
                self.state = State::Reading(Box::new(reader));
                self.read(heard);
                return;
            }
        }
        self.search.clear();
    }
}

/// Whether bytes may begin with a PUBLISH.
fn looks_like_message(bytes: &[u8]) -> bool {
    let [first, rest @ ..] = bytes else { return false };
    let is_publish = first >> 4 == 3 && (first >> 1) & 3 < 3;
    let Some(length) = rest.iter().take(4).position(|byte| byte & 0x80 == 0) else {
        return false;
    };
    let topic = rest.get(length + 1..length + 3);
    let topic_length = topic.map_or(0, |length| usize::from(u16::from_be_bytes([length[0], length[1]])));
    let topic = rest.get(length + 3..).unwrap_or_default();
    let topic = &topic[..topic.len().min(topic_length)];
    is_publish && topic_length > 0 && topic.iter().all(|byte| *byte >= 0x20)
}

fn is_message(packet: &Packet) -> bool {
    let Packet::Publish { topic, payload, .. } = packet else {
        return false;
    };
    let tck_journal::Payload::Whole(bytes) = payload else {
        return false;
    };
    let text = bytes.trim_ascii();
    topic.contains('/') && text.starts_with(b"{") && text.ends_with(b"}")
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn publish(level: u8, topic: &str, payload: &str) -> Vec<u8> {
        let mut body = u16::try_from(topic.len()).expect("short").to_be_bytes().to_vec();
        body.extend(topic.as_bytes());
        if level == 5 {
            body.push(0);
        }
        body.extend(payload.as_bytes());
        let length = body.len();
        let mut all = vec![
            0x30,
            u8::try_from(length % 128).expect("small") | 0x80,
            u8::try_from(length / 128).expect("short"),
        ];
        all.extend(body);
        all
    }

    fn topics(heard: &[Heard]) -> Vec<String> {
        let name = |heard: &Heard| match heard {
            Heard::Packet(Packet::Publish { topic, .. }) => topic.clone(),
            Heard::Packet(_) => "other".to_owned(),
            Heard::Lost => "lost".to_owned(),
            Heard::Foreign => "foreign".to_owned(),
        };
        heard.iter().map(name).collect()
    }

    #[test]
    fn a_talk_that_is_overheard_is_understood_from_its_first_message() {
        for level in LEVELS {
            let mut talk = MqttStream::default();
            let mut heard = Vec::new();
            talk.push(b"the rest of a message\"}", &mut heard);
            talk.push(&[0xc0, 0], &mut heard);
            let whole = publish(level, "a/b", &format!("{{\"a\":\"{}\"}}", "x".repeat(200)));
            talk.push(&whole[..100], &mut heard);
            talk.push(&whole[100..], &mut heard);
            talk.push(&[publish(level, "c/d", "{}"), vec![0xc0, 0]].concat(), &mut heard);
            assert_eq!(topics(&heard), ["a/b", "c/d", "other"]);
            assert_eq!(talk.level(), Some(level));
            talk.gap();
            talk.push(&whole[50..], &mut heard);
            talk.push(&publish(level, "e/f", "{}"), &mut heard);
            assert_eq!(topics(&heard)[3..], ["e/f"]);
        }
    }

    #[test]
    fn what_cannot_be_read_is_left_out() {
        let mut talk = MqttStream::default();
        let mut heard = Vec::new();
        talk.begin(0xf0);
        talk.push(&[0xf0, 0xff, 0xff, 0xff, 0xff, 1], &mut heard);
        talk.push(&publish(4, "a/b", "{}"), &mut heard);
        assert_eq!(topics(&heard), ["lost", "a/b"]);
        let mut talk = MqttStream::default();
        let mut heard = Vec::new();
        talk.begin(0x10);
        talk.push(b"GET / HTTP/1.1\r\n", &mut heard);
        talk.push(&publish(4, "a/b", "{}"), &mut heard);
        assert_eq!(topics(&heard), ["foreign"]);
        assert!(talk.is_foreign() && talk.held() == 0);
    }

    proptest! {
        #[test]
        fn no_bytes_make_it_panic_or_hold_more_than_it_may(parts in prop::collection::vec(prop::collection::vec(any::<u8>(), 0..60), 0..40), whole in any::<bool>()) {
            let mut talk = MqttStream::default();
            if whole {
                talk.begin(0x10);
            }
            let mut heard = Vec::new();
            for part in &parts {
                talk.push(part, &mut heard);
            }
            let total: usize = parts.iter().map(Vec::len).sum();
            prop_assert!(talk.held() <= total);
        }
    }
}
