use std::io::Cursor;

use bytes::Bytes;
use proptest::prelude::*;

use super::*;
use tck_journal::event::Close;
use tck_testing_captures::{Link, Stream, mqtt, pcap, pcapng};

/// What is told by a capture.
fn told(file: Vec<u8>) -> Vec<Item> {
    let mut packets = Packets::new(Box::new(Cursor::new(file)), 0).expect("a capture");
    std::iter::from_fn(|| packets.read().expect("readable")).collect()
}

/// What is told, in words.
fn words(file: Vec<u8>) -> String {
    let word = |item: &Item| match item {
        Item::Message(message) => {
            let way = if message.carried.is_some_and(|carried| carried.sent) {
                '>'
            } else {
                '<'
            };
            let length = message.payload.len();
            format!("{way}{} q{} {length}", message.topic, message.qos.unwrap_or(9))
        }
        Item::Wire(wire) => match &wire.event {
            WireEvent::Packet {
                packet: Packet::Publish { .. },
                ..
            } => String::new(),
            WireEvent::Packet {
                packet: Packet::Connect { client_id, .. },
                sent,
            } => {
                format!("connect {client_id}{}", if *sent { "" } else { " by the broker" })
            }
            WireEvent::Packet { .. } => "packet".to_owned(),
            WireEvent::Gap { sent } => format!("gap {}", if *sent { ">" } else { "<" }),
            WireEvent::Closed { how: Close::DeviceFin } => "fin".to_owned(),
            WireEvent::Closed {
                how: Close::DeviceReset,
            } => "reset".to_owned(),
            WireEvent::Closed { .. } => "closed".to_owned(),
        },
        Item::Record(_) => "record".to_owned(),
    };
    let all: Vec<String> = told(file).iter().map(word).filter(|word| !word.is_empty()).collect();
    all.join(", ")
}

fn connect(client_id: &str) -> Vec<u8> {
    let packet = Packet::Connect {
        level: 4,
        client_id: client_id.to_owned(),
        keep_alive: 15,
        clean_session: true,
        username: None,
        has_password: false,
        will: None,
    };
    mqtt(&packet).expect("known")
}

fn publish(topic: &str, length: usize, qos: u8) -> Vec<u8> {
    let packet = Packet::Publish {
        topic: topic.to_owned(),
        qos,
        retain: true,
        dup: false,
        packet_id: (qos > 0).then_some(7),
        payload: Payload::keep(Bytes::from(format!("{{{}}}", " ".repeat(length - 2)))),
    };
    mqtt(&packet).expect("known")
}

/// Frames a millisecond apart.
fn timed(frames: Vec<Vec<u8>>) -> Vec<(u64, Vec<u8>)> {
    frames
        .into_iter()
        .zip(0_u64..)
        .map(|(frame, at)| (at * 1000, frame))
        .collect()
}

/// A talk from its beginning to its end, with a message that needs several segments.
fn talk(link: Link, six: bool) -> Vec<Vec<u8>> {
    let (mut up, mut down) = Stream::pair(link, six, 50_000);
    let mut frames = vec![up.flagged("S")];
    frames.push(down.segment(&[]));
    frames.push(up.segment(&connect("vehicle")));
    let long = publish("a/state", 3000, 0);
    frames.extend(long.chunks(1000).map(|part| up.segment(part)));
    frames.push(up.segment(&[publish("a/connection", 20, 1), vec![0xc0, 0]].concat()));
    frames.push(down.segment(&publish("a/order", 30, 0)));
    frames.push(up.segment(&[0xe0, 0]));
    frames.push(up.flagged("F"));
    frames.push(down.flagged("F"));
    frames
}

const TALK: &str = "connect vehicle, >a/state q0 3000, >a/connection q1 20, packet, <a/order q0 30, packet";

#[test]
fn every_link_and_both_versions_of_ip_are_read() {
    for link in [
        Link::Ethernet,
        Link::Vlan,
        Link::Cooked,
        Link::Cooked2,
        Link::Raw,
        Link::Loopback,
    ] {
        for six in [false, true] {
            let frames = timed(talk(link, six));
            let ends = format!("{TALK}, closed");
            assert_eq!(words(pcap(link, &frames, 65_535)), ends, "{link:?}");
            assert_eq!(words(pcapng(link, &frames)), ends, "{link:?}");
        }
    }
}

#[test]
fn times_are_those_of_the_capture() {
    let frames = timed(talk(Link::Ethernet, false));
    for file in [pcap(Link::Ethernet, &frames, 65_535), pcapng(Link::Ethernet, &frames)] {
        let all = told(file);
        let times = all.iter().filter_map(|item| match item {
            Item::Message(message) => message.at,
            _ => None,
        });
        let times: Vec<String> = times.map(|at| format!("{at:.3}")).collect();
        let wanted = [
            "2026-01-01T00:00:00.006Z",
            "2026-01-01T00:00:00.007Z",
            "2026-01-01T00:00:00.008Z",
        ];
        assert_eq!(times, wanted);
    }
}

#[test]
fn out_of_order_and_twice_is_the_same() {
    let mut frames = timed(talk(Link::Ethernet, false));
    frames.swap(3, 4);
    let again = frames[5].clone();
    frames.insert(6, again);
    assert_eq!(words(pcap(Link::Ethernet, &frames, 65_535)), format!("{TALK}, closed"));
}

#[test]
fn what_is_lost_or_cut_off_is_a_gap_and_the_next_message_is_found() {
    let mut frames = timed(talk(Link::Ethernet, false));
    frames.remove(4);
    let lost = "connect vehicle, <a/order q0 30, gap >, >a/connection q1 20, packet, packet, closed";
    assert_eq!(words(pcap(Link::Ethernet, &frames, 65_535)), lost);
    let frames = timed(talk(Link::Ethernet, false));
    let cut = words(pcap(Link::Ethernet, &frames, 500));
    assert_eq!(
        cut,
        "connect vehicle, gap >, gap >, gap >, >a/connection q1 20, packet, <a/order q0 30, packet, closed"
    );
}

#[test]
fn what_is_encrypted_or_speaks_web_socket_is_counted() {
    let counted = |up_begins: &[u8], more: &[u8]| {
        let (mut up, mut down) = Stream::pair(Link::Ethernet, false, 50_000);
        let mut frames = vec![up.flagged("S"), down.segment(&[])];
        frames.push(up.segment(up_begins));
        frames.push(down.segment(more));
        frames.push(up.segment(more));
        let mut all = talk(Link::Ethernet, true);
        all.extend(frames);
        let file = pcap(Link::Ethernet, &timed(all), 65_535);
        let mut packets = Packets::new(Box::new(Cursor::new(file)), 0).expect("a capture");
        while packets.read().expect("readable").is_some() {}
        (packets.counted().encrypted, packets.counted().web_socket)
    };
    let hello = [&[0x16, 3, 1, 2, 0, 1][..], &[7; 500]].concat();
    let data = [&[0x17, 3, 3, 0, 90][..], &[9; 90]].concat();
    assert_eq!(counted(&hello, &data), (3, 0));
    let upgrade = b"GET /mqtt HTTP/1.1\r\nHost: broker\r\nUpgrade: websocket\r\n\r\n";
    assert_eq!(counted(upgrade, &[0x82, 5, 1, 2, 3, 4, 5]), (0, 3));
    assert_eq!(counted(b"GET / HTTP/1.1\r\n\r\n", b"text"), (0, 0));
}

#[test]
fn a_capture_that_begins_in_the_middle_is_understood_from_the_first_message() {
    let frames = timed(talk(Link::Ethernet, false)).split_off(5);
    let begun = words(pcap(Link::Ethernet, &frames, 65_535));
    assert_eq!(begun, ">a/connection q1 20, packet, <a/order q0 30, packet, closed");
}

#[test]
fn connections_are_kept_apart_and_other_traffic_is_left_out() {
    let (mut one, _) = Stream::pair(Link::Ethernet, false, 50_000);
    let (mut two, _) = Stream::pair(Link::Ethernet, false, 50_001);
    let (mut web, mut answer) = Stream::pair(Link::Ethernet, false, 50_002);
    let long = publish("a/state", 900, 0);
    let frames = vec![
        one.flagged("S"),
        two.flagged("S"),
        web.flagged("S"),
        one.segment(&connect("one")),
        two.segment(&connect("two")),
        web.segment(b"GET / HTTP/1.1\r\n\r\n"),
        answer.segment(&publish("no/message", 20, 0)),
        one.segment(&long[..400]),
        two.segment(&publish("b/state", 20, 0)),
        one.segment(&long[400..]),
        one.flagged("R"),
        b"no frame".to_vec(),
    ];
    let file = pcap(Link::Ethernet, &timed(frames), 65_535);
    assert_eq!(
        words(file),
        "connect one, connect two, >b/state q0 20, >a/state q0 900, reset"
    );
}

#[test]
fn who_is_the_client_is_learned_from_what_is_said() {
    // A broker on a high port, seen from the middle on.
    let (mut up, mut down) = Stream::pair(Link::Raw, false, 1_500);
    (up.to.1, down.from.1) = (60_000, 60_000);
    let frames = vec![
        up.segment(&publish("a/state", 20, 0)),
        up.segment(&[0xc0, 0]),
        up.segment(&publish("a/state", 21, 0)),
        down.segment(&publish("a/order", 22, 0)),
    ];
    let file = pcap(Link::Raw, &timed(frames), 65_535);
    assert_eq!(words(file), "<a/state q0 20, packet, >a/state q0 21, <a/order q0 22");
}

#[test]
fn a_file_may_end_in_the_middle_and_nonsense_is_an_error() {
    let whole = pcap(Link::Ethernet, &timed(talk(Link::Ethernet, false)), 65_535);
    for length in [25, 100, whole.len() - 3] {
        told(whole[..length].to_vec());
    }
    assert!(Packets::new(Box::new(Cursor::new(whole[..20].to_vec())), 0).is_err());
    let mut long = whole[..24].to_vec();
    long.extend([0, 0, 0, 0, 0, 0, 0, 0, 255, 255, 255, 127, 255, 255, 255, 127]);
    long.extend(vec![0; 100_000]);
    let mut packets = Packets::new(Box::new(Cursor::new(long)), 0).expect("a header");
    assert!(matches!(packets.read(), Err(_) | Ok(None)));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(96))]

    #[test]
    fn no_capture_makes_it_panic(
        spoiled in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 0..40),
        is_ng in any::<bool>(),
        length in any::<prop::sample::Index>(),
    ) {
        let frames = timed(talk(Link::Ethernet, false));
        let mut file = if is_ng { pcapng(Link::Ethernet, &frames) } else { pcap(Link::Ethernet, &frames, 65_535) };
        file.truncate(length.index(file.len()) + 1);
        for (at, byte) in spoiled {
            let at = at.index(file.len());
            file[at] = byte;
        }
        if let Ok(mut packets) = Packets::new(Box::new(Cursor::new(file)), 0) {
            while let Ok(Some(_)) = packets.read() {}
        }
    }
}
