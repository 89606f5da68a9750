//! A device written by hand, byte by byte: it can be as wrong as a test wants.

use std::io::{Read as _, Write as _};
use std::net::{Shutdown, TcpStream};

use serde_json::{Value, json};

use crate::bench::{MANUFACTURER, SERIAL};

/// A device on a connection of its own, with MQTT 3.1.1.
pub struct Scripted {
    socket: TcpStream,
    headers: u32,
}

impl Scripted {
    /// Connects with a last will, subscribes, and says that it is online. It reads nothing that comes later,
    /// but it empties its socket, so that the broker is not held up.
    pub fn online(port: u16) -> Self {
        let mut this = Self::open(port);
        let online = this.message(&json!({ "connectionState": "ONLINE" }));
        this.publish("connection", online.to_string().as_bytes(), true);
        this
    }

    /// Connects, with a last will, and subscribes.
    pub fn open(port: u16) -> Self {
        let mut socket = TcpStream::connect(("127.0.0.1", port)).unwrap();
        socket.set_nodelay(true).unwrap();
        let mut this = Self {
            socket: socket.try_clone().unwrap(),
            headers: 0,
        };
        let will = this
            .message(&json!({ "connectionState": "CONNECTIONBROKEN" }))
            .to_string();
        // Last will with QoS 1 and RETAIN, clean session, no keep-alive.
        let mut connect = [text("MQTT").as_slice(), &[4, 0b0010_1110, 0, 0]].concat();
        for field in ["scripted", &topic("connection"), &will] {
            connect.extend(text(field));
        }
        this.packet(0x10, &connect);
        let mut connack = [0; 4];
        socket.read_exact(&mut connack).unwrap();
        assert_eq!(connack, [0x20, 2, 0, 0]);
        for (id, name) in [(1, "order"), (2, "instantActions")] {
            let subscribe = [[0, id].as_slice(), &text(&topic(name)), &[0]].concat();
            this.packet(0x82, &subscribe);
            let mut suback = [0; 5];
            socket.read_exact(&mut suback).unwrap();
            assert_eq!(suback, [0x90, 3, 0, id, 0]);
        }
        std::thread::spawn(move || {
            let mut thrown_away = [0; 4096];
            while socket.read(&mut thrown_away).is_ok_and(|length| length > 0) {}
        });
        this
    }

    /// Connects under this client id as any tool does, without a last will, and subscribes to everything.
    pub fn stranger(port: u16, client_id: &str) -> Self {
        let mut socket = TcpStream::connect(("127.0.0.1", port)).unwrap();
        socket.set_nodelay(true).unwrap();
        let mut this = Self {
            socket: socket.try_clone().unwrap(),
            headers: 0,
        };
        let connect = [text("MQTT").as_slice(), &[4, 0b0000_0010, 0, 60], &text(client_id)].concat();
        this.packet(0x10, &connect);
        let mut connack = [0; 4];
        socket.read_exact(&mut connack).unwrap();
        assert_eq!(connack, [0x20, 2, 0, 0]);
        this.packet(0x82, &[[0, 1].as_slice(), &text("#"), &[0]].concat());
        std::thread::spawn(move || {
            let mut thrown_away = [0; 4096];
            while socket.read(&mut thrown_away).is_ok_and(|length| length > 0) {}
        });
        this
    }

    /// Says DISCONNECT.
    pub fn say_goodbye(mut self) {
        self.raw(&[0xe0, 0]);
    }

    /// A message with header.
    pub fn message(&mut self, members: &Value) -> Value {
        let header = json!({
            "headerId": self.headers, "timestamp": "2026-03-02T08:15:30.12Z", "version": version(),
            "manufacturer": MANUFACTURER, "serialNumber": SERIAL,
        });
        self.headers += 1;
        let mut message = header;
        for (name, value) in members.as_object().into_iter().flatten() {
            message[name] = value.clone();
        }
        message
    }

    /// An idle state.
    pub fn state(&mut self) -> Value {
        self.message(&json!({
            "maps": [], "orderId": "", "orderUpdateId": 0, "lastNodeId": "", "lastNodeSequenceId": 0,
            "nodeStates": [], "edgeStates": [], "driving": false, "actionStates": [],
            "batteryState": { "batteryCharge": 80, "charging": false }, "operatingMode": "AUTOMATIC", "errors": [],
            "safetyState": { "eStop": "NONE", "fieldViolation": false },
        }))
    }

    /// Publishes an idle state.
    pub fn say_state(&mut self) {
        let state = self.state();
        self.publish("state", state.to_string().as_bytes(), false);
    }

    /// PUBLISH with QoS 0; a device that is cut off does not mind.
    pub fn publish(&mut self, name: &str, payload: &[u8], retain: bool) {
        let body = [text(&topic(name)).as_slice(), payload].concat();
        self.packet(0x30 | u8::from(retain), &body);
    }

    fn packet(&mut self, first: u8, body: &[u8]) {
        let mut packet = vec![first];
        let mut length = body.len();
        loop {
            let more = if length >= 128 { 0x80 } else { 0 };
            packet.push(u8::try_from(length % 128).unwrap() | more);
            length /= 128;
            if length == 0 {
                break;
            }
        }
        packet.extend_from_slice(body);
        self.raw(&packet);
    }

    /// Bytes as they are; a device that is cut off does not mind.
    pub fn raw(&mut self, bytes: &[u8]) {
        let _ = self.socket.write_all(bytes);
    }
}

impl Drop for Scripted {
    fn drop(&mut self) {
        let _ = self.socket.shutdown(Shutdown::Both);
    }
}

/// A topic of the device.
pub fn topic(name: &str) -> String {
    format!("uagv/v2/{MANUFACTURER}/{SERIAL}/{name}")
}

fn version() -> &'static str {
    "2.1.0"
}

/// A text with its length in front.
fn text(text: &str) -> Vec<u8> {
    let length = u16::try_from(text.len()).unwrap();
    [&length.to_be_bytes(), text.as_bytes()].concat()
}
