use std::io::Cursor;

use proptest::prelude::*;

use super::*;

fn read_all(text: &[u8], mapping: Mapping) -> (Vec<Item>, Counted) {
    let mut lines = Lines::new(Box::new(Cursor::new(text.to_vec())), 0, mapping);
    let mut all = Vec::new();
    while let Some(item) = lines.read().expect("readable") {
        all.push(item);
    }
    (all, lines.counted())
}

/// Topic and payload of each message.
fn shown(items: &[Item]) -> Vec<String> {
    let messages = items.iter().map(|item| match item {
        Item::Message(message) => format!("{} {}", message.topic, String::from_utf8_lossy(&message.payload)),
        Item::Record(record) => format!("record {}", record.seq),
        Item::Wire(_) => "wire".to_owned(),
    });
    messages.collect()
}

fn message(item: &Item) -> &Message {
    match item {
        Item::Message(message) => message,
        Item::Record(_) | Item::Wire(_) => panic!("no message"),
    }
}

#[test]
fn what_mosquitto_sub_prints_is_read_with_its_facts() {
    let text = br#"
{"tst":"2026-01-02T05:04:05.250000Z+0200","topic":"a/b/state","qos":1,"retain":1,"payloadlen":9,"payload":{"x": 1.0}}
{"tst":"2026-01-02T05:04:05.250000Z+0200","topic":"a/b/state","qos":0,"retain":0,"payloadlen":9,"payload":"{\"x\": 1.0}"}
"#;
    let (all, counted) = read_all(text, Mapping::default());
    assert_eq!(shown(&all), ["a/b/state {\"x\": 1.0}", "a/b/state {\"x\": 1.0}"]);
    let first = message(&all[0]);
    assert_eq!((first.qos, first.retain, first.place.line), (Some(1), Some(true), 2));
    assert_eq!(message(&all[1]).retain, Some(false));
    assert_eq!(
        first.at.map(|at| at.to_string()).as_deref(),
        Some("2026-01-02T03:04:05.25Z")
    );
    assert_eq!((counted.lines, counted.skipped), (3, 0));
}

#[test]
fn lines_of_a_log_between_messages_are_counted_and_left_out() {
    let text = b"Subscribed (mid: 1)\na/b/state {\"x\":1}\n[warn] http://host {broken}\n{\"level\":\"info\"}\n\na/b/order {\"y\":{\n  \"z\": 2 }\n}\na/b/state {\"cut\na/b/state {\"x\":2}\n";
    let (all, counted) = read_all(text, Mapping::default());
    let expected = [
        "a/b/state {\"x\":1}",
        "a/b/order {\"y\":{\n  \"z\": 2 }\n}",
        "a/b/state {\"cut",
        "a/b/state {\"x\":2}",
    ];
    assert_eq!(shown(&all), expected);
    assert_eq!((counted.lines, counted.skipped), (10, 3));
    assert_eq!(message(&all[3]).place.line, 10);
}

#[test]
fn other_names_are_mapped_and_base64_is_unpacked() {
    let mapping = Mapping {
        time: Some("ts".to_owned()),
        topic: Some("mqtt.t".to_owned()),
        payload: Some("mqtt.p".to_owned()),
    };
    let text = br#"{"ts":1767323045.25,"mqtt":{"t":"a/b/state","p":"eyJ4IjoxfQ=="}}
{"ts":"?","mqtt":{"t":"a/b/state","p":"plain"}}
{"topic":"a/b","payload":"{}"}"#;
    let (all, counted) = read_all(text, mapping);
    assert_eq!(shown(&all), ["a/b/state {\"x\":1}", "a/b/state plain"]);
    assert!(message(&all[0]).at.is_some() && message(&all[1]).at.is_none());
    assert_eq!(counted.skipped, 1);
}

#[test]
fn a_line_beyond_all_limits_is_skipped_and_the_next_one_read() {
    let mut text = vec![b'x'; LINE + 100];
    text.extend_from_slice(b"\na/b/state {}\n");
    let (all, counted) = read_all(&text, Mapping::default());
    assert_eq!(shown(&all), ["a/b/state {}"]);
    assert_eq!(counted.skipped, 1);
}

proptest! {
    #[test]
    fn no_bytes_make_it_panic_and_every_line_is_counted(lines in prop::collection::vec("(a/b )?[{}\"\\\\:,a ]{0,20}|\\PC{0,20}", 0..12)) {
        let text = lines.join("\n");
        let (all, counted) = read_all(text.as_bytes(), Mapping::default());
        prop_assert!(all.len() as u64 + counted.skipped <= counted.lines);
        prop_assert!(counted.lines <= (lines.len().max(1) + text.matches(['\r', '\n']).count()) as u64);
    }

    #[test]
    fn no_raw_bytes_make_it_panic(bytes in prop::collection::vec(any::<u8>(), 0..300)) {
        let _ = read_all(&bytes, Mapping::default());
    }
}
