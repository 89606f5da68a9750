use ratatui::Terminal;
use ratatui::backend::TestBackend;
use serde_json::json;

use super::*;
use tck_audit::Options;
use tck_base::clock::{Moment, Stamp};
use tck_capture::{Message, SourcePosition};

fn heard(watch: &mut Watch<'_>, serial: &str, name: &str, payload: &serde_json::Value) {
    let utc = jiff::Timestamp::from_second(1_767_225_600).expect("time");
    let message = Message {
        at: Some(utc),
        topic: format!("uagv/v2/acme/{serial}/{name}"),
        payload: payload.to_string().into_bytes().into(),
        qos: Some(0),
        retain: Some(false),
        place: SourcePosition::default(),
        after_gap: false,
        carried: None,
    };
    let at = Stamp {
        moment: Moment::START,
        utc,
    };
    watch.take(at, message);
}

fn state(version: &str, serial: &str, mode: &str) -> serde_json::Value {
    json!({ "headerId": 1, "timestamp": "2026-01-01T00:00:00.00Z", "version": version, "manufacturer": "acme",
        "serialNumber": serial, "orderId": "o-1", "orderUpdateId": 2, "lastNodeId": "dock \u{1b}[2J", "lastNodeSequenceId": 4,
        "nodeStates": [{ "nodeId": "a", "sequenceId": 6, "released": true }, { "nodeId": "b", "sequenceId": 8, "released": false }],
        "edgeStates": [], "driving": false, "actionStates": [], "operatingMode": mode, "errors": [],
        "batteryState": { "batteryCharge": 81.4, "charging": false },
        "safetyState": { "eStop": "NONE", "fieldViolation": false } })
}

fn screen(view: &mut View, watch: &Watch<'_>) -> String {
    let mut terminal = Terminal::new(TestBackend::new(150, 44)).expect("terminal");
    let glances = watch.worst_first();
    view.choose(&glances);
    let contact = Contact {
        connected: true,
        ..Contact::default()
    };
    terminal
        .draw(|frame| view.draw(frame, &glances, contact))
        .expect("drawn");
    terminal.backend().to_string()
}

fn key(view: &mut View, code: KeyCode) -> bool {
    press(view, KeyEvent::new(code, KeyModifiers::NONE))
}

#[test]
fn vehicles_findings_and_the_wrong_member_are_shown() {
    let library = crate::assets::library(None).expect("suites");
    let version = library.rules.packs.latest().version.to_string();
    let options = Options {
        only: vec!["message/schema".to_owned()],
        ..Options::default()
    };
    let mut watch = Watch::new(&library.rules, options).expect("options");
    let mut view = View::new("mqtt://site:1883".to_owned());
    insta::assert_snapshot!("nobody", screen(&mut view, &watch));
    heard(
        &mut watch,
        "1",
        "connection",
        &json!({ "headerId": 0, "timestamp": "2026-01-01T00:00:00.00Z",
        "version": version, "manufacturer": "acme", "serialNumber": "1", "connectionState": "ONLINE" }),
    );
    heard(&mut watch, "1", "state", &state(&version, "1", "AUTOMATIC"));
    heard(&mut watch, "2", "state", &state(&version, "2", "AUTOMATISCH"));
    insta::assert_snapshot!("marked", screen(&mut view, &watch));
    key(&mut view, KeyCode::Tab);
    for _ in 0..4 {
        key(&mut view, KeyCode::PageUp);
    }
    let moved = screen(&mut view, &watch);
    assert!(moved.contains("\"headerId\": 1"), "{moved}");
    key(&mut view, KeyCode::Tab);
    assert!(key(&mut view, KeyCode::Down) && key(&mut view, KeyCode::Down));
    insta::assert_snapshot!("faultless", screen(&mut view, &watch));
    // It stays the chosen one when it becomes the worst.
    heard(
        &mut watch,
        "1",
        "state",
        &json!({ "headerId": "one", "errors": 7, "orderId": 3 }),
    );
    let worse = screen(&mut view, &watch);
    assert!(worse.find("acme 1") < worse.find("acme 2"), "{worse}");
    assert!(worse.contains("acme/1/state"), "{worse}");
    assert!(!key(&mut view, KeyCode::Char('q')));
    let interrupt = KeyEvent::new(KeyCode::Char('c'), KeyModifiers::CONTROL);
    assert!(!press(&mut view, interrupt));
}

#[test]
fn a_screen_of_any_size_and_a_fleet_are_drawn() {
    let library = crate::assets::library(None).expect("suites");
    let version = library.rules.packs.latest().version.to_string();
    let mut watch = Watch::new(&library.rules, Options::default()).expect("options");
    for number in 0..60 {
        let serial = format!("{number:02}");
        heard(&mut watch, &serial, "state", &state(&version, &serial, "AUTOMATIC"));
    }
    let glances: Vec<_> = watch.glances().collect();
    let mut view = View::new("mqtt://site".to_owned());
    for _ in 0..70 {
        key(&mut view, KeyCode::Down);
    }
    view.choose(&glances);
    for (width, height) in [(0, 0), (1, 1), (20, 5), (80, 24), (300, 100)] {
        let mut terminal = Terminal::new(TestBackend::new(width, height)).expect("terminal");
        let drawn = terminal.draw(|frame| view.draw(frame, &glances, Contact::default()));
        assert!(drawn.is_ok());
        if height == 24 {
            let text = terminal.backend().to_string();
            assert!(text.contains("acme 59") && text.contains("NOT CONNECTED"), "{text}");
        }
    }
}
