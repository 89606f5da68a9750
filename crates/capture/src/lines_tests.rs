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

/// Two messages, as each of these forms holds them.
#[test]
fn every_form_that_tools_write_holds_the_same_two_messages() {
    let forms = [
        (
            "array",
            "[{\"topic\":\"a/b/state\",\"payload\":{\"x\":1},\"time\":1767323045},\n {\"topic\":\"a/b/state\",\"payload\":{\"x\":2},\"time\":1767323046}]",
        ),
        (
            "array over lines",
            "\u{feff}\n[\n {\n  \"topic\": \"a/b/state\",\n  \"payload\": {\"x\":1},\n  \"ts\": 1767323045\n },\n {\n  \"topic\": \"a/b/state\",\n  \"payload\": {\"x\":2},\n  \"ts\": 1767323046\n }\n]\n",
        ),
        (
            "objects over lines",
            "{\n \"topic\": \"a/b/state\",\n \"payload\": {\"x\":1},\n \"time\": 1767323045\n}\n{\n \"topic\": \"a/b/state\",\n \"payload\": {\"x\":2},\n \"time\": 1767323046\n}\n",
        ),
        (
            "time before",
            "2026-01-02T03:04:05Z a/b/state {\"x\":1}\n[2026-01-02 03:04:06] a/b/state {\"x\":2}\n",
        ),
        (
            "number before",
            "1767323045.000 a/b/state {\"x\":1}\n1767323046000\ta/b/state\t{\"x\":2}\n",
        ),
        (
            "a client's connections",
            "[{\"clientId\":\"c\",\"messages\":[{\"createAt\":\"2026-01-02 03:04:05:000\",\"payload\":\"{\\\"x\\\":1}\",\"qos\":0,\"retain\":false,\"topic\":\"a/b/state\"},{\"createAt\":\"2026-01-02 03:04:06:000\",\"payload\":\"{\\\"x\\\":2}\",\"topic\":\"a/b/state\"}]}]",
        ),
        (
            "other names",
            "{\"Topic\":\"a/b/state\",\"Message\":\"{\\\"x\\\":1}\",\"receivedAt\":1767323045}\n{\"mqtt_topic\":\"a/b/state\",\"value\":{\"x\":2},\"@timestamp\":\"2026-01-02T03:04:06Z\"}\n",
        ),
        (
            "table",
            "time,topic,qos,payload\n2026-01-02T03:04:05Z,a/b/state,0,\"{\"\"x\"\":1}\"\n1767323046,a/b/state,0,\"{\"\"x\"\":2}\"\n",
        ),
        (
            "table with semicolons",
            "Topic;Timestamp;Message\r\na/b/state;1767323045;\"{\"\"x\"\":1}\"\r\na/b/state;1767323046;{\"x\":2}\r\n",
        ),
    ];
    for (form, text) in forms {
        let (all, counted) = read_all(text.as_bytes(), Mapping::default());
        let found = shown(&all);
        assert_eq!(found, ["a/b/state {\"x\":1}", "a/b/state {\"x\":2}"], "{form}");
        let times: Vec<i64> = all
            .iter()
            .filter_map(|item| message(item).at.map(jiff::Timestamp::as_second))
            .collect();
        assert_eq!(times, [1_767_323_045, 1_767_323_046], "{form}");
        assert_eq!(counted.skipped, 0, "{form}: {counted:?}");
        let lines = u64::try_from(text.lines().count()).expect("few");
        assert_eq!(counted.lines, lines, "{form}");
    }
}

#[test]
fn a_payload_in_a_table_may_hold_commas_lines_and_what_is_wrong_with_it() {
    let text = "time,topic,payload\n1767323045,a/b/state,\"{\"\"x\"\":\n1,\"\"x\"\":01}\"\n1767323046,a/b/state,{\"x\":2,\"y\":3}\n\nnoise\n";
    let (all, counted) = read_all(text.as_bytes(), Mapping::default());
    assert_eq!(
        shown(&all),
        ["a/b/state {\"x\":\n1,\"x\":01}", "a/b/state {\"x\":2,\"y\":3}"]
    );
    assert_eq!((message(&all[1]).place.line, counted.skipped), (4, 1));
}

#[test]
fn what_is_cut_off_takes_nothing_else_with_it() {
    let whole = "{\"topic\":\"a/b/state\",\"payload\":{\"x\":1}}";
    let (all, _) = read_all(
        format!("{{\"topic\":\"a/b\",\n{whole}\n").as_bytes(),
        Mapping::default(),
    );
    assert_eq!(shown(&all), ["a/b/state {\"x\":1}"]);
    let (all, counted) = read_all(format!("[{whole},{{\"topic\": [").as_bytes(), Mapping::default());
    assert_eq!((shown(&all).len(), counted.skipped), (1, 1));
    let (all, _) = read_all(format!("[  1.5] booted\n{whole}\n").as_bytes(), Mapping::default());
    assert_eq!(shown(&all), ["a/b/state {\"x\":1}"]);
    let (all, counted) = read_all(format!("[{whole}]\n{whole}\n").as_bytes(), Mapping::default());
    assert_eq!(
        (shown(&all).len(), message(&all[1]).place.line, counted.lines),
        (2, 2, 2)
    );
}

#[test]
fn a_line_of_a_log_with_a_topic_is_no_message() {
    let text = b"{\"level\":\"info\",\"topic\":\"a/b\",\"message\":\"connected\"}\nINFO a/b/state {\"x\":1}\n12 a/b/state {\"x\":1}\n";
    let (all, counted) = read_all(text, Mapping::default());
    assert_eq!((all.len(), counted.skipped), (0, 3));
}

proptest! {
    #[test]
    fn no_form_makes_it_panic_and_nothing_is_read_twice(text in "(\\[|time,topic,payload\n)?([\\[\\]{}\",:\\\\ \na1]|\\{\"topic\":\"a/b\",\"payload\":\\{\\}\\}){0,40}") {
        let (all, _) = read_all(text.as_bytes(), Mapping::default());
        prop_assert!(all.len() <= text.len() / 3 + 1);
    }

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
