use std::cell::RefCell;
use std::rc::Rc;

use bytes::Bytes;

use super::*;
use tck_base::clock::WallClock;
use tck_base::device::ConnectOptions;
use tck_journal::ServeBehaviour;
use tck_journal::event::{Close, Packet};

type Log = Rc<RefCell<Vec<(Moment, Input)>>>;

/// A peer that connects at once, again half a second after a loss, and does what its script says.
struct Scripted {
    script: VecDeque<(Moment, Output)>,
    reconnect: Option<Moment>,
    keep_alive: u64,
    log: Log,
    started: bool,
}

impl Device for Scripted {
    fn connect_options(&mut self, _: Stamp) -> ConnectOptions {
        ConnectOptions {
            level: 4,
            client_id: "device".to_owned(),
            keep_alive: Duration::from_secs(self.keep_alive),
            clean_session: true,
            will: Some(outgoing("d/connection", "broken", 1, true)),
            subscriptions: vec![("d/order".to_owned(), 2)],
        }
    }

    fn handle(&mut self, now: Stamp, input: Input, out: &mut Vec<Output>) {
        if !std::mem::replace(&mut self.started, true) {
            out.push(Output::Connect);
        }
        if input == Input::ConnectionLost {
            self.reconnect = Some(now.moment + Duration::from_millis(500));
        }
        if input != Input::Time {
            self.log.borrow_mut().push((now.moment, input));
        }
        if self.reconnect.is_some_and(|at| at <= now.moment) {
            self.reconnect = None;
            out.push(Output::Connect);
        }
        while self.script.front().is_some_and(|(at, _)| *at <= now.moment) {
            out.extend(self.script.pop_front().map(|(_, output)| output));
        }
    }

    fn wake_up(&self) -> Option<Moment> {
        let next = self.script.front().map(|(at, _)| *at);
        [next, self.reconnect].into_iter().flatten().min()
    }
}

fn outgoing(topic: &str, text: &str, qos: u8, retain: bool) -> Publication {
    Publication {
        topic: topic.to_owned(),
        payload: Bytes::copy_from_slice(text.as_bytes()),
        qos,
        retain,
    }
}

fn ms(millis: u64) -> Moment {
    Moment::START + Duration::from_millis(millis)
}

fn publishes(at: u64, topic: &str, text: &str, qos: u8, retain: bool) -> (Moment, Output) {
    (ms(at), Output::Publish(outgoing(topic, text, qos, retain)))
}

struct Bench {
    link: MemoryLink,
    log: Log,
}

fn bench(script: Vec<(Moment, Output)>) -> Bench {
    bench_with(script, &MemoryOptions::default())
}

fn bench_with(script: Vec<(Moment, Output)>, options: &MemoryOptions) -> Bench {
    let log = Log::default();
    let peer = Scripted {
        script: script.into(),
        reconnect: None,
        keep_alive: 10,
        log: log.clone(),
        started: false,
    };
    let options = MemoryOptions {
        device_topics: vec!["d/state".to_owned(), "d/connection".to_owned()],
        ..options.clone()
    };
    let link = MemoryLink::new(WallClock::start().origin_stamp(), vec![Box::new(peer)], options);
    Bench { link, log }
}

fn wait<T>(future: impl Future<Output = T>) -> T {
    tokio::runtime::Builder::new_current_thread()
        .build()
        .unwrap()
        .block_on(future)
}

impl Bench {
    fn until(&mut self, millis: u64) -> Vec<Occurrence> {
        let mut seen = Vec::new();
        while let Some(occurrence) = wait(self.link.next(ms(millis))).unwrap() {
            seen.push(occurrence);
        }
        seen
    }

    fn fault(&mut self, fault: LinkFault) {
        wait(self.link.fault(fault)).unwrap();
    }

    fn send(&mut self, text: &str, qos: u8) {
        wait(self.link.publish(outgoing("d/order", text, qos, false))).unwrap();
    }

    fn orders(&self) -> Vec<(Moment, String)> {
        let text = |payload: &Bytes| String::from_utf8_lossy(payload).into_owned();
        (self.log.borrow().iter())
            .filter_map(|(at, input)| match input {
                Input::Message { payload, .. } => Some((*at, text(payload))),
                _ => None,
            })
            .collect()
    }

    fn losses(&self) -> usize {
        self.log
            .borrow()
            .iter()
            .filter(|(_, input)| *input == Input::ConnectionLost)
            .count()
    }
}

/// Text, QoS and RETAIN of every message on `topic`, with the moment.
fn messages(seen: &[Occurrence], wanted: &str) -> Vec<(Moment, String, u8, bool)> {
    (seen.iter())
        .filter_map(|occurrence| match &occurrence.event {
            Event::Message {
                topic,
                qos,
                retain,
                payload,
                ..
            } if topic == wanted => {
                let text = String::from_utf8_lossy(payload.bytes()).into_owned();
                Some((occurrence.at.moment, text, *qos, *retain))
            }
            _ => None,
        })
        .collect()
}

fn kinds(seen: &[Occurrence]) -> Vec<String> {
    let name = |value: serde_json::Value| {
        let kind = value["packet"]["type"].as_str().or(value["kind"].as_str());
        kind.unwrap_or_default().to_owned()
    };
    seen.iter()
        .map(|occurrence| name(serde_json::to_value(&occurrence.event).unwrap()))
        .collect()
}

#[test]
fn a_connection_is_reported_packet_by_packet_in_order() {
    let mut bench = bench(vec![]);
    let seen = bench.until(100);
    assert_eq!(kinds(&seen), ["opened", "connect", "connack", "subscribe", "suback"]);
    assert!(seen.iter().all(|occurrence| occurrence.source == Source::Tap));
    let Event::Packet {
        packet: Packet::Connect {
            will: Some(will),
            keep_alive,
            ..
        },
        ..
    } = &seen[1].event
    else {
        panic!("{:?}", seen[1]);
    };
    assert_eq!(
        (will.topic.as_str(), will.qos, will.retain, *keep_alive),
        ("d/connection", 1, true, 10)
    );
    assert_eq!(bench.log.borrow()[0].1, Input::Connected);
}

#[test]
fn a_message_keeps_its_qos_and_loses_its_retain_flag_on_a_live_delivery() {
    let mut bench = bench(vec![
        publishes(100, "d/state", "zero", 0, false),
        publishes(110, "d/state", "one", 1, true),
        publishes(120, "d/state", "two", 2, false),
    ]);
    let seen = bench.until(500);
    let got: Vec<_> = messages(&seen, "d/state")
        .into_iter()
        .map(|(_, text, qos, retain)| (text, qos, retain))
        .collect();
    let text = str::to_owned;
    assert_eq!(
        got,
        [
            (text("zero"), 0, false),
            (text("one"), 1, false),
            (text("two"), 2, false)
        ]
    );
}

#[test]
fn what_the_harness_publishes_reaches_the_device_once_whatever_the_qos() {
    let mut bench = bench(vec![]);
    bench.until(100);
    for qos in 0..3 {
        bench.send(&qos.to_string(), qos);
    }
    let seen = bench.until(200);
    assert_eq!(
        bench.orders().iter().map(|(_, text)| text.as_str()).collect::<Vec<_>>(),
        ["0", "1", "2"]
    );
    let first = seen.first().unwrap();
    assert_eq!(first.direction, Some(Direction::ToDevice));
    assert!(matches!(
        &first.event,
        Event::Packet {
            packet: Packet::Publish { qos: 0, .. },
            ..
        }
    ));
}

#[test]
fn a_fresh_subscriber_gets_what_is_retained_and_then_the_end() {
    let mut bench = bench(vec![publishes(50, "d/connection", "online", 1, true)]);
    bench.until(100);
    let request = wait(bench.link.fresh_subscriber("d/connection")).unwrap();
    let seen = bench.until(200);
    assert_eq!(kinds(&seen), ["retained", "retained-end"]);
    assert!(matches!(&seen[0].event, Event::Retained { request: r, retain: true, qos: 1, .. } if *r == request));
}

#[test]
fn a_cut_publishes_the_will_at_once_and_keeps_the_device_out_until_restore() {
    let mut bench = bench(vec![]);
    bench.until(1000);
    bench.fault(LinkFault::Cut { reset: true });
    let seen = bench.until(3000);
    assert!(seen.iter().any(|o| matches!(
        o.event,
        Event::Closed {
            how: Close::Harness,
            ..
        }
    )));
    let wills = messages(&seen, "d/connection");
    assert_eq!(wills.len(), 1);
    assert!(wills[0].0 - ms(1000) < Duration::from_millis(5));
    assert!(!kinds(&seen).contains(&"opened".to_owned()));
    assert!(bench.losses() > 1, "attempts are refused");
    bench.fault(LinkFault::Restore);
    assert!(kinds(&bench.until(4000)).contains(&"connack".to_owned()));
}

#[test]
fn disconnect_does_not_publish_the_will_and_drop_does() {
    for (output, wills) in [(Output::Disconnect, 0), (Output::Drop, 1)] {
        let mut bench = bench(vec![(ms(100), output)]);
        let seen = bench.until(20_000);
        assert_eq!(messages(&seen, "d/connection").len(), wills);
        assert!(seen.iter().any(|o| matches!(
            o.event,
            Event::Closed {
                how: Close::DeviceFin,
                ..
            }
        )));
    }
}

#[test]
fn silence_holds_everything_back_and_the_will_comes_after_one_and_a_half_keep_alive() {
    let mut bench = bench(vec![publishes(1500, "d/state", "unheard", 0, false)]);
    bench.until(1000);
    bench.fault(LinkFault::Silence { direction: None });
    let seen = bench.until(25_000);
    assert!(
        kinds(&seen).contains(&"publish".to_owned()),
        "the tap still hears the device"
    );
    assert!(messages(&seen, "d/state").is_empty());
    let wills = messages(&seen, "d/connection");
    assert_eq!(wills.len(), 1);
    let after = wills[0].0 - ms(2);
    assert!(
        after > Duration::from_millis(14_900) && after < Duration::from_millis(15_100),
        "{after:?}"
    );
    assert!(bench.losses() > 0, "the device notices by its own pings");
}

#[test]
fn a_short_silence_only_delays() {
    let mut bench = bench(vec![publishes(1500, "d/state", "late", 0, false)]);
    bench.until(1000);
    bench.fault(LinkFault::Silence { direction: None });
    bench.send("late too", 1);
    bench.until(3000);
    bench.fault(LinkFault::Restore);
    let seen = bench.until(4000);
    assert_eq!(messages(&seen, "d/state").len(), 1);
    assert_eq!(bench.orders().len(), 1);
    assert_eq!(bench.losses(), 0);
}

#[test]
fn delay_holds_back_in_order_and_restore_lets_go() {
    let mut bench = bench(vec![
        publishes(200, "d/state", "a", 0, false),
        publishes(300, "d/state", "b", 0, false),
    ]);
    bench.until(100);
    bench.fault(LinkFault::Delay {
        millis: 400,
        direction: Some(Direction::FromDevice),
    });
    let seen = bench.until(650);
    assert_eq!(messages(&seen, "d/state").len(), 1);
    bench.fault(LinkFault::Restore);
    assert_eq!(messages(&bench.until(660), "d/state")[0].1, "b");
}

#[test]
fn drop_and_duplicate_count_down() {
    let script = (0..4)
        .map(|n| publishes(100 + n, "d/state", &n.to_string(), 0, false))
        .collect();
    let mut bench = bench(script);
    bench.until(50);
    bench.fault(LinkFault::Drop {
        topic: Some("state".to_owned()),
        count: 1,
        direction: None,
    });
    bench.fault(LinkFault::Duplicate {
        topic: Some("state".to_owned()),
        count: 1,
        direction: None,
    });
    let seen = bench.until(500);
    let texts: Vec<_> = messages(&seen, "d/state")
        .into_iter()
        .map(|(_, text, ..)| text)
        .collect();
    assert_eq!(texts, ["1", "1", "2", "3"]);
}

#[test]
fn a_duplicated_qos_2_packet_is_still_delivered_once() {
    let mut bench = bench(vec![]);
    bench.until(50);
    bench.fault(LinkFault::Duplicate {
        topic: None,
        count: 2,
        direction: Some(Direction::ToDevice),
    });
    bench.send("exactly once", 2);
    bench.send("at least once", 1);
    bench.until(500);
    let texts: Vec<_> = bench.orders().into_iter().map(|(_, text)| text).collect();
    assert_eq!(texts, ["exactly once", "at least once", "at least once"]);
}

#[test]
fn refuse_leaves_the_present_connection_alone() {
    let mut bench = bench(vec![
        publishes(200, "d/state", "still here", 0, false),
        (ms(300), Output::Drop),
        (ms(400), Output::Connect),
    ]);
    bench.until(100);
    bench.fault(LinkFault::Refuse);
    let seen = bench.until(800);
    assert_eq!(messages(&seen, "d/state").len(), 1);
    assert!(!kinds(&seen).contains(&"opened".to_owned()));
    assert_eq!(bench.losses(), 1);
}

#[test]
fn pings_keep_an_idle_connection_alive() {
    let mut bench = bench(vec![]);
    let seen = bench.until(120_000);
    assert!(kinds(&seen).iter().filter(|kind| *kind == "pingreq").count() >= 11);
    assert!(messages(&seen, "d/connection").is_empty());
}

#[test]
fn garbage_is_reported_and_costs_the_connection() {
    let mut bench = bench(vec![(ms(100), Output::Raw(vec![0xf7, 0x02, 0x00, 0x00]))]);
    let seen = bench.until(400);
    assert!(kinds(&seen).contains(&"undecodable".to_owned()));
    assert!(
        seen.iter()
            .any(|o| matches!(o.event, Event::Closed { how: Close::Broker, .. }))
    );
    assert_eq!(messages(&seen, "d/connection").len(), 1);
}

#[test]
fn probes_return_and_time_stands_still_at_until() {
    let mut bench = bench(vec![]);
    bench.until(100);
    let probe = wait(bench.link.probe()).unwrap();
    assert!(bench.until(100).is_empty(), "nothing happens at once");
    let seen = bench.until(101);
    assert!(matches!(seen[0].event, Event::ProbeReceived { probe: p } if p == probe));
    assert_eq!(bench.link.now().moment, ms(101));
}

#[test]
fn every_way_to_serve_a_file_ends_as_it_should() {
    for (behaviour, ends, phase, within) in [
        (ServeBehaviour::Well, Ok("file"), "done", 100),
        (ServeBehaviour::WrongBytes, Ok("fild"), "done", 100),
        (ServeBehaviour::Slow, Ok("file"), "done", 7000),
        (ServeBehaviour::NotFound, Err(()), "done", 100),
        (ServeBehaviour::Stall, Err(()), "cut", 11_000),
        (ServeBehaviour::Cut, Err(()), "cut", 100),
        (ServeBehaviour::Unreachable, Err(()), "", 100),
    ] {
        let mut bench = bench(vec![]);
        let offer = Offer {
            name: "map 1".to_owned(),
            body: Bytes::from_static(b"file"),
            behaviour,
            secured: false,
        };
        let url = wait(bench.link.serve(offer)).unwrap();
        bench.link.perform(0, Output::Fetch { token: 7, url });
        let seen = bench.until(within);
        let last = seen.iter().rev().find_map(|o| match &o.event {
            Event::Fetched { phase, name, .. } => Some((phase.clone(), name.clone())),
            _ => None,
        });
        assert_eq!(last.clone().unwrap_or_default().0, phase, "{behaviour:?}");
        let end = bench.log.borrow().iter().rev().find_map(|(_, input)| match input {
            Input::Download { token: 7, progress } => Some(progress.clone()),
            _ => None,
        });
        match (end, ends) {
            (Some(Download::Done(body)), Ok(text)) => assert_eq!(&body[..], text.as_bytes()),
            (Some(Download::Failed(_)), Err(())) => {}
            other => panic!("{behaviour:?}: {other:?}"),
        }
    }
}

#[test]
fn jitter_and_coalescing_are_the_same_for_the_same_seed_and_keep_the_order() {
    let run = |seed| {
        let script = (0..50)
            .map(|n| publishes(100 + n, "d/state", &n.to_string(), 0, false))
            .collect();
        let options = MemoryOptions {
            jitter: Duration::from_millis(9),
            coalesce: Duration::from_millis(5),
            seed,
            ..MemoryOptions::default()
        };
        let mut bench = bench_with(script, &options);
        messages(&bench.until(1000), "d/state")
    };
    let first = run(1);
    assert_eq!(first, run(1));
    assert_ne!(first, run(2));
    let numbers: Vec<u32> = first.iter().map(|(_, text, ..)| text.parse().unwrap()).collect();
    assert!(numbers.is_sorted() && numbers.len() == 50);
}

#[test]
fn a_peer_of_the_harness_is_not_behind_the_tap_and_its_messages_are_reported_as_sent() {
    let mut bench = bench(vec![]);
    let script = VecDeque::from(vec![
        publishes(100, "d/state", "mock", 0, false),
        (ms(600), Output::Drop),
    ]);
    let log = Log::default();
    let own = Scripted {
        script,
        reconnect: None,
        keep_alive: 0,
        log,
        started: false,
    };
    bench.link = {
        let mut link = MemoryLink::new(bench.link.now(), vec![], bench.link.options.clone());
        assert_eq!(link.add_own_peer(Box::new(own)), 0);
        link
    };
    bench.until(50);
    bench.fault(LinkFault::Silence { direction: None });
    assert_eq!(kinds(&bench.until(500)), ["sent", "message"]);
    let seen = bench.until(900);
    assert_eq!(kinds(&seen), ["sent", "message"], "the broker sends its last will");
    assert!(matches!(&seen[0].event, Event::Sent { topic, .. } if topic == "d/connection"));
}

#[test]
fn without_a_tap_no_packet_is_seen_and_faults_are_refused() {
    let options = MemoryOptions {
        vantage: Vantage::Subscriber,
        ..MemoryOptions::default()
    };
    let mut bench = bench_with(vec![publishes(100, "d/state", "x", 1, false)], &options);
    assert_eq!(kinds(&bench.until(500)), ["message"]);
    assert!(matches!(
        wait(bench.link.fault(LinkFault::Refuse)),
        Err(LinkError::NeedsTap { .. })
    ));
}

#[test]
fn a_broken_broker_is_an_error_and_not_silence() {
    let mut bench = bench(vec![]);
    bench.until(100);
    bench.link.break_broker("killed");
    assert!(matches!(wait(bench.link.next(ms(200))), Err(LinkError::Broker { .. })));
    assert!(matches!(
        wait(bench.link.publish(outgoing("d/order", "x", 0, false))),
        Err(LinkError::Broker { .. })
    ));
}

#[test]
fn commands_reach_the_peer_they_name() {
    let mut bench = bench(vec![]);
    bench
        .link
        .command(0, "set-mode", serde_json::json!({ "mode": "MANUAL" }));
    bench.link.command(5, "nobody", serde_json::Value::Null);
    assert!(matches!(&bench.log.borrow()[0].1, Input::Command(name, _) if name == "set-mode"));
}
