//! A sans-IO reference device over TCP.

use std::time::Duration;

use bytes::Bytes;

use vda5050_tck::bench::Offer;
use vda5050_tck::bench::endpoint::{Access, Endpoint};
use vda5050_tck::clock::Stamp;
use vda5050_tck::journal::event::{Event, LinkFault, Packet};
use vda5050_tck::link::Link;
use vda5050_tck::link::mqtt::BenchOptions;
use vda5050_tck::reference::{ConnectOptions, Device, Input, Output, Publication};
use vda5050_tck::simulate::driver::RunningDevice;
use vda5050_tck::suite::model::ServeBehaviour;

use crate::rig::*;

/// A device that connects, says that it is online, answers orders, reports the time every 100 ms, and can be
/// told to fetch, to drop its connection and to misbehave.
#[derive(Default)]
struct Answering {
    now: Option<vda5050_tck::clock::Moment>,
    connected: bool,
}

impl Answering {
    fn say(text: &str, retain: bool, out: &mut Vec<Output>) {
        let topic = if retain { "d/connection" } else { "d/state" }.to_owned();
        out.push(Output::Publish(Publication {
            topic,
            payload: Bytes::copy_from_slice(text.as_bytes()),
            qos: 1,
            retain,
        }));
    }
}

impl Device for Answering {
    fn connect_options(&mut self, _: Stamp) -> ConnectOptions {
        ConnectOptions {
            level: 4,
            client_id: "answering".to_owned(),
            keep_alive: Duration::from_secs(15),
            clean_session: true,
            will: Some(Publication {
                topic: "d/connection".to_owned(),
                payload: Bytes::from_static(b"broken"),
                qos: 1,
                retain: true,
            }),
            subscriptions: vec![("d/order".to_owned(), 1)],
        }
    }

    fn handle(&mut self, now: Stamp, input: Input, out: &mut Vec<Output>) {
        if self.now.is_none() {
            out.push(Output::Connect);
        }
        match input {
            Input::Connected => {
                self.connected = true;
                Self::say("online", true, out);
            }
            Input::ConnectionLost => out.push(Output::Connect),
            Input::Message { payload, .. } => {
                Self::say(&format!("got {}", String::from_utf8_lossy(&payload)), false, out);
            }
            Input::Time => Self::say("tick", false, out),
            Input::Download { progress, .. } => Self::say(&format!("{progress:?}"), false, out),
            Input::Command(name, value) => match name.as_str() {
                "fetch" => out.push(Output::Fetch {
                    token: 1,
                    url: value.as_str().unwrap().to_owned(),
                }),
                "drop" => out.extend([Output::Drop, Output::Connect]),
                "raw" => out.push(Output::Raw(vec![0xf7, 0x01, 0x00])),
                _ => {}
            },
        }
        self.now = Some(now.moment);
    }

    fn wake_up(&self) -> Option<vda5050_tck::clock::Moment> {
        self.now.map(|now| now + Duration::from_millis(100))
    }
}

#[tokio::test]
async fn a_reference_device_runs_over_tcp() {
    let mut rig = rig().await;
    let endpoint = Endpoint::parse(&rig.info.device_address, &Access::default()).unwrap();
    let options = BenchOptions::loopback(vec![]);
    let device = RunningDevice::start(Answering::default(), endpoint, options.clock, None);
    rig.until("online", |o| is_message(o, "online")).await;
    rig.until("tick", |o| is_message(o, "tick")).await;
    rig.order("hello", 1).await;
    rig.until("answer", |o| is_message(o, "got hello")).await;
    for (behaviour, wanted) in [(ServeBehaviour::Well, "Done"), (ServeBehaviour::NotFound, "Failed")] {
        let offer = Offer {
            name: "map".to_owned(),
            body: Bytes::from_static(b"map"),
            behaviour,
            secured: false,
        };
        let url = rig.link.serve(offer).await.unwrap();
        assert!(device.command("fetch", url.into()).await);
        rig.until(
            wanted,
            |o| matches!(&o.event, Event::Message { payload, .. } if payload.bytes().starts_with(wanted.as_bytes())),
        )
        .await;
    }
    assert!(device.command("raw", serde_json::Value::Null).await);
    rig.until("raw bytes", |o| matches!(o.event, Event::Undecodable { .. }))
        .await;
    assert!(device.command("drop", serde_json::Value::Null).await);
    rig.until("will", |o| is_message(o, "broken")).await;
    rig.until("online again", |o| is_message(o, "online")).await;
    rig.fault(LinkFault::Cut { reset: true }).await;
    rig.until("will", |o| is_message(o, "broken")).await;
    rig.fault(LinkFault::Restore).await;
    rig.until("online again", |o| is_message(o, "online")).await;
    device.stop().await;
    rig.until("DISCONNECT", |o| {
        is_packet(o, |p| matches!(p, Packet::Disconnect { .. }))
    })
    .await;
    rig.link.stop().await;
}
