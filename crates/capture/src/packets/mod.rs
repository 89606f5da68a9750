//! Captured network traffic: pcap and pcapng files with MQTT over TCP.
//!
//! [`frames`] reads the file and finds the TCP segments, [`tcp_reassembly`] puts them in order, [`mqtt_stream`] cuts the stream into MQTT
//! packets, and [`connections`] keeps them apart. What was lost on the way into the capture is a gap and no mistake of
//! anybody.

mod connections;
mod frames;
mod mqtt_stream;
mod tcp_reassembly;
#[cfg(test)]
mod tests;

use std::collections::VecDeque;
use std::io::{self, BufRead};

use super::{Carried, Counted, Item, Message, Read, SourcePosition, Wire, WireEvent};
use connections::{Connections, Other};
use frames::{Frame, Frames};
use tck_journal::Payload;
use tck_journal::event::Packet;

pub(super) use frames::begins;

/// Captured network traffic: pcap and pcapng files with MQTT over TCP.
pub struct Packets {
    frames: Frames,
    file: usize,
    connections: Connections,
    told: Vec<Wire>,
    ready: VecDeque<Item>,
    counted: Counted,
    ended: bool,
}

impl Packets {
    /// Reads the capture of that number.
    ///
    /// # Errors
    /// It does not begin like a capture.
    pub fn new(reader: Box<dyn BufRead>, file: usize) -> io::Result<Self> {
        Ok(Self {
            frames: Frames::new(reader)?,
            file,
            connections: Connections::default(),
            told: Vec::new(),
            ready: VecDeque::new(),
            counted: Counted::default(),
            ended: false,
        })
    }

    /// How much was read so far, in frames.
    #[must_use]
    pub fn counted(&self) -> Counted {
        self.counted
    }

    /// Which frame was read last.
    #[must_use]
    pub fn place(&self) -> SourcePosition {
        SourcePosition {
            file: self.file,
            line: self.counted.lines,
        }
    }

    /// The next message, or what else is told of a connection; `None` at the end.
    ///
    /// # Errors
    /// What the operating system says, or what is wrong with the file.
    pub fn read(&mut self) -> Read {
        loop {
            if let Some(item) = self.ready.pop_front() {
                return Ok(Some(item));
            }
            if self.ended {
                return Ok(None);
            }
            match self.frames.read()? {
                None => {
                    self.ended = true;
                    self.connections.finish(&mut self.told);
                }
                Some(frame) => {
                    self.counted.lines += 1;
                    match frame {
                        Frame::Segment(segment) => match self.connections.push(segment, &mut self.told) {
                            Some(Other::Tls) => self.counted.encrypted += 1,
                            Some(Other::WebSocket) => self.counted.web_socket += 1,
                            None => {}
                        },
                        Frame::Other => self.counted.skipped += 1,
                    }
                }
            }
            let place = self.place();
            for wire in self.told.drain(..) {
                // Captures are told apart by the upper half of the number.
                let connection = u64::try_from(self.file).unwrap_or_default() << 40 | wire.connection;
                let wire = Wire { connection, ..wire };
                let message = message(&wire, place);
                self.ready.push_back(Item::Wire(Box::new(wire)));
                self.ready.extend(message.map(Item::Message));
            }
        }
    }
}

/// The message that a packet carries.
pub(super) fn message(wire: &Wire, place: SourcePosition) -> Option<Message> {
    let WireEvent::Packet {
        packet:
            Packet::Publish {
                topic,
                qos,
                retain,
                payload: Payload::Whole(payload),
                ..
            },
        sent,
    } = &wire.event
    else {
        return None;
    };
    // RETAIN of a client asks the broker to store the message; RETAIN of the broker says that it was stored.
    let sent = *sent;
    Some(Message {
        at: wire.at,
        topic: topic.clone(),
        payload: payload.clone(),
        qos: Some(*qos),
        retain: Some(*retain && !sent),
        place,
        after_gap: false,
        carried: Some(Carried {
            connection: wire.connection,
            sent,
        }),
    })
}
