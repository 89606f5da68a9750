use super::*;
use tck_base::clock::Stamp;
use tck_journal::Journal;
use tck_journal::event::{Close, Filter, LinkFault, Source};
use tck_pack::{Assets, Packs};

/// A tap, and what was said of each entry.
struct Tap {
    journal: Journal,
    company: ClientClassifier,
    seconds: u64,
}

const NAMES: [&str; 5] = ["order", "instantActions", "state", "visualization", "connection"];

impl Tap {
    fn new() -> Self {
        Self::of(Role::Agv)
    }

    fn of(role: Role) -> Self {
        let packs = Packs::load(&Assets::of_source_tree().unwrap()).unwrap();
        let topics = NAMES
            .iter()
            .map(|name| ((*name).to_owned(), format!("v/{name}")))
            .collect();
        let header = RunHeader {
            topics,
            ..RunHeader::default()
        };
        Self {
            journal: Journal::new(),
            company: ClientClassifier::of(role, &header, packs.latest()),
            seconds: 0,
        }
    }

    fn now(&self) -> Moment {
        Moment::from_micros(self.seconds * 1_000_000)
    }

    /// Whether it is judged.
    fn see(&mut self, event: Event) -> bool {
        let entry = self.journal.append(Occurrence {
            at: Stamp {
                moment: self.now(),
                utc: jiff::Timestamp::UNIX_EPOCH,
            },
            source: Source::Tap,
            direction: Some(Direction::FromDevice),
            event,
        });
        !matches!(self.company.observe(&entry), Attribution::Bystander)
    }

    fn connect(&mut self, connection: u64, id: &str, will: Option<&str>) -> bool {
        self.see(Event::Opened {
            connection,
            peer: format!("192.0.2.{connection}:1"),
        });
        self.see(Event::Packet {
            connection,
            packet: Packet::Connect {
                level: 4,
                client_id: id.to_owned(),
                keep_alive: 15,
                clean_session: true,
                username: None,
                has_password: false,
                will: will.map(|name| Will {
                    topic: format!("v/{name}"),
                    payload: payload("gone"),
                    qos: 1,
                    retain: true,
                }),
            },
        })
    }

    fn subscribe(&mut self, connection: u64, filter: &str) -> bool {
        let filter = filter.to_owned();
        self.see(Event::Packet {
            connection,
            packet: Packet::Subscribe {
                packet_id: 1,
                filters: vec![Filter { filter, qos: 0 }],
            },
        })
    }

    fn publish(&mut self, connection: u64, name: &str, text: &str) -> bool {
        self.see(Event::Packet {
            connection,
            packet: Packet::Publish {
                topic: format!("v/{name}"),
                qos: 0,
                retain: false,
                dup: false,
                packet_id: None,
                payload: payload(text),
            },
        })
    }

    fn delivered(&mut self, name: &str, text: &str) -> bool {
        self.see(Event::Message {
            topic: format!("v/{name}"),
            qos: 0,
            retain: false,
            dup: false,
            payload: payload(text),
        })
    }

    fn close(&mut self, connection: u64) -> bool {
        self.see(Event::Closed {
            connection,
            how: Close::DeviceFin,
        })
    }

    /// A vehicle with a will that publishes states.
    fn vehicle() -> Self {
        let mut tap = Self::new();
        assert!(tap.connect(1, "agv", Some("connection")));
        assert!(tap.subscribe(1, "v/order"));
        assert!(tap.publish(1, "connection", "online"));
        assert!(tap.publish(1, "state", "1"));
        tap
    }

    fn disturbs(&self) -> bool {
        self.company.interference(self.now()).is_some()
    }

    fn limits(&self) -> String {
        self.company.limits().join("\n")
    }
}

fn payload(text: &str) -> Payload {
    Payload::keep(bytes::Bytes::copy_from_slice(text.as_bytes()))
}

#[test]
fn an_onlooker_that_leaves_is_not_the_device() {
    let mut tap = Tap::vehicle();
    assert!(!tap.connect(2, "explorer", None));
    assert!(!tap.subscribe(2, "#"));
    assert!(!tap.close(2));
    assert!(tap.publish(1, "state", "2") && tap.delivered("state", "2"));
    assert!(!tap.disturbs() && tap.limits().is_empty());
    assert!(tap.close(1));
}

#[test]
fn an_onlooker_that_was_there_first_is_known_when_the_device_speaks_and_after_a_cut() {
    let mut tap = Tap::new();
    assert!(tap.connect(1, "explorer", None), "nobody else is there");
    assert!(tap.connect(2, "agv", Some("connection")));
    assert!(!tap.close(1));
    tap.close(2);
    assert!(!tap.connect(3, "explorer", None), "it is known");
    assert!(tap.connect(4, "agv", Some("connection")));
}

#[test]
fn a_socket_that_is_opened_and_closed_is_nobody() {
    let mut tap = Tap::vehicle();
    assert!(!tap.close(7));
    assert!(tap.close(1));
}

#[test]
fn who_publishes_what_the_device_publishes_is_left_out_and_named() {
    let mut tap = Tap::vehicle();
    tap.connect(2, "forger", None);
    assert!(!tap.publish(2, "state", "false"));
    assert!(!tap.delivered("state", "false"));
    assert!(tap.publish(1, "state", "true") && tap.delivered("state", "true"));
    assert!(tap.disturbs());
    assert!(
        tap.limits().contains("published 1 message(s) on v/state"),
        "{}",
        tap.limits()
    );
    assert!(tap.limits().contains("192.0.2.2"), "{}", tap.limits());
    tap.seconds += 60;
    assert!(!tap.disturbs());
}

#[test]
fn who_commands_the_device_is_named() {
    let mut tap = Tap::vehicle();
    tap.connect(2, "other", None);
    assert!(!tap.publish(2, "order", "go"));
    assert!(tap.disturbs());
    assert!(tap.limits().contains("v/order"), "{}", tap.limits());
    assert!(tap.publish(1, "order", "the device may not either"), "and is judged");
}

#[test]
fn who_takes_the_client_id_of_the_device_is_not_the_device() {
    let mut tap = Tap::vehicle();
    assert!(!tap.connect(2, "agv", None));
    assert!(tap.close(1), "the device was thrown out");
    assert!(tap.disturbs());
    assert!(tap.connect(3, "agv", Some("connection")), "it is back");
    assert!(!tap.close(2));
    assert!(!tap.connect(4, "agv", None));
    assert!(tap.limits().contains("2 time(s)"), "{}", tap.limits());
}

#[test]
fn a_device_may_come_back_while_its_former_connection_seems_open() {
    let mut tap = Tap::vehicle();
    assert!(tap.connect(2, "agv", Some("connection")) && tap.publish(2, "state", "2"));
    assert!(tap.disturbs(), "there may be two");
    assert!(
        tap.limits().contains("either the device came back, or there are two"),
        "{}",
        tap.limits()
    );
    assert_eq!(tap.company.mixed(), None);
    let before = tap.limits();
    tap.see(Event::Fault {
        fault: LinkFault::Silence { direction: None },
    });
    assert!(
        tap.connect(3, "agv", None),
        "a device that forgets its will is still the device"
    );
    assert!(tap.publish(3, "state", "3"));
    assert_eq!(tap.limits(), before, "the link was played with");
}

#[test]
fn two_that_throw_each_other_out_are_not_one_device() {
    let mut tap = Tap::vehicle();
    for connection in 2..4 {
        tap.seconds += 5;
        assert!(tap.connect(connection, "agv", Some("connection")));
        assert!(tap.publish(connection, "state", "1"));
    }
    assert!(
        tap.company.mixed().is_some_and(|why| why.contains("agv")),
        "{:?}",
        tap.company.mixed()
    );
    let mut tap = Tap::vehicle();
    for connection in 2..4 {
        tap.seconds += 600;
        assert!(tap.connect(connection, "agv", Some("connection")));
        assert!(tap.publish(connection, "state", "1"));
    }
    assert_eq!(tap.company.mixed(), None, "it comes back over a bad link");
}

#[test]
fn two_that_publish_in_turn_are_not_one_device() {
    let mut tap = Tap::vehicle();
    assert!(tap.connect(2, "agv-2", Some("connection")));
    assert!(tap.publish(2, "state", "2"));
    assert_eq!(tap.company.mixed(), None, "it may have taken the place of the other");
    assert!(tap.publish(1, "state", "3"));
    assert!(tap.company.mixed().is_some_and(|why| why.contains("v/state")));
    assert!(tap.limits().contains("in turn"), "{}", tap.limits());
}

fn origin(tap: &mut Tap, connection: u64, origin: Origin) {
    tap.see(Event::Traced { connection, origin });
}

fn other() -> Origin {
    Origin::Other {
        process: Some(7),
        name: Some("old-agv".to_owned()),
    }
}

#[test]
fn whoever_is_not_what_was_started_is_a_stranger_whatever_it_says_and_however_it_looks() {
    let mut tap = Tap::new();
    origin(&mut tap, 1, other());
    assert!(!tap.connect(1, "agv", Some("connection")), "nobody else is there");
    assert!(!tap.subscribe(1, "v/order"));
    assert!(!tap.publish(1, "connection", "online") && !tap.delivered("connection", "online"));
    assert!(!tap.publish(1, "state", "1") && !tap.delivered("state", "1"));
    assert!(
        !tap.delivered("connection", "gone"),
        "the broker has said its last will"
    );
    origin(&mut tap, 2, Origin::Started { process: 9 });
    assert!(tap.connect(2, "agv", Some("connection")), "it has the same client id");
    assert!(tap.publish(2, "state", "2") && tap.delivered("state", "2"));
    assert!(!tap.close(1));
    assert!(tap.limits().contains("process 7, \"old-agv\""), "{}", tap.limits());
    assert!(tap.company.mixed().is_some());
}

#[test]
fn an_onlooker_that_is_not_what_was_started_costs_nothing() {
    let mut tap = Tap::vehicle();
    origin(&mut tap, 2, other());
    assert!(!tap.connect(2, "explorer", None) && !tap.subscribe(2, "#") && !tap.close(2));
    assert!(!tap.disturbs() && tap.limits().is_empty());
    assert_eq!(tap.company.mixed(), None);
}

#[test]
fn what_cannot_be_traced_is_judged_and_said() {
    let mut tap = Tap::new();
    tap.see(Event::Opened {
        connection: 1,
        peer: "192.0.2.9:5".to_owned(),
    });
    origin(&mut tap, 1, Origin::Elsewhere);
    assert!(tap.connect(1, "agv", Some("connection")) && tap.publish(1, "state", "1"));
    assert!(tap.limits().contains("192.0.2.9"), "{}", tap.limits());
    assert_eq!(tap.company.mixed(), None);
}

#[test]
fn of_a_master_control_only_another_program_is_a_stranger() {
    let mut tap = Tap::of(Role::MasterControl);
    for connection in [1, 2] {
        assert!(tap.connect(connection, "fleet", None) && tap.publish(connection, "order", "1"));
    }
    assert!(tap.limits().is_empty() && !tap.disturbs());
    origin(&mut tap, 3, other());
    assert!(!tap.connect(3, "old-fleet", None));
    assert!(!tap.publish(3, "order", "2") && !tap.delivered("order", "2"));
    assert!(tap.delivered("order", "1") && tap.disturbs());
    assert!(tap.company.mixed().is_some());
}

#[test]
fn a_device_under_another_client_id_at_each_start_stays_the_device() {
    let mut tap = Tap::vehicle();
    assert!(tap.connect(2, "agv-2", Some("connection")));
    assert!(tap.publish(2, "connection", "online") && tap.publish(2, "state", "2"));
    assert!(tap.disturbs(), "nobody knows which of the two it is");
    tap.close(1);
    assert!(tap.publish(2, "state", "3"));
    assert!(tap.limits().is_empty());
}

#[test]
fn two_clients_of_a_device_are_the_device() {
    let mut tap = Tap::vehicle();
    tap.connect(2, "agv-view", None);
    assert!(tap.publish(2, "visualization", "1"));
    assert!(tap.publish(1, "state", "2") && tap.publish(2, "visualization", "2"));
    tap.connect(3, "agv-commands", None);
    assert!(tap.subscribe(3, "v/instantActions"));
    assert!(tap.close(2) && tap.close(3));
    assert!(!tap.disturbs() && tap.limits().is_empty());
}

#[test]
fn what_was_left_out_of_a_second_client_is_made_up_for() {
    let mut tap = Tap::vehicle();
    tap.connect(2, "agv-view", None);
    let entry = tap.journal.append(Occurrence {
        at: Stamp {
            moment: tap.now(),
            utc: jiff::Timestamp::UNIX_EPOCH,
        },
        source: Source::Tap,
        direction: Some(Direction::FromDevice),
        event: Event::Packet {
            connection: 2,
            packet: Packet::Publish {
                topic: "v/visualization".to_owned(),
                qos: 0,
                retain: false,
                dup: false,
                packet_id: None,
                payload: payload("1"),
            },
        },
    });
    let Attribution::Joined(before) = tap.company.observe(&entry) else {
        panic!("it is the device")
    };
    assert_eq!(before.len(), 1, "its CONNECT");
}
