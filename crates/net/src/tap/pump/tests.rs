//! What becomes of packets on their way through a pump.

use std::sync::Mutex;

use tokio::io::{DuplexStream, duplex};

use super::*;
use crate::bench::endpoint::Endpoint;
use crate::bench::inbox::{Inbox, inbox};
use crate::bench::kin::Kin;
use crate::tap::Upstream;
use tck_base::clock::WallClock;
use tck_journal::event::LinkFault;

const CONNECT: &[u8] = b"\x10\x0e\x00\x04MQTT\x04\x02\x00\x00\x00\x02id";

fn shared() -> (Shared, Inbox) {
    let (reporter, inbox) = inbox(WallClock::start());
    let broker = Endpoint::plain(([127, 0, 0, 1], 1).into());
    let shared = Shared {
        reporter,
        upstream: Upstream {
            broker,
            embedded: false,
        },
        tls: None,
        kin: Kin::default(),
        faults: Mutex::default(),
        control: watch::Sender::default(),
        open: watch::Sender::default(),
    };
    (shared, inbox)
}

fn publish(number: u8, size: usize) -> Vec<u8> {
    let length = size + 3;
    let mut packet = vec![0x30];
    if length > 127 {
        packet.push(u8::try_from(length % 128).unwrap() | 0x80);
        packet.push(u8::try_from(length / 128).unwrap());
    } else {
        packet.push(u8::try_from(length).unwrap());
    }
    packet.extend_from_slice(b"\x00\x01t");
    packet.resize(packet.len() + size, number);
    packet
}

/// Sizes of the payloads that were reported.
fn reported(inbox: &mut Inbox) -> Vec<usize> {
    let mut sizes = Vec::new();
    while let Some(occurrence) = inbox.ready().unwrap() {
        if let Event::Packet {
            packet: Packet::Publish { payload, .. },
            ..
        } = occurrence.event
        {
            sizes.push(payload.bytes().len());
        }
    }
    sizes
}

#[tokio::test]
async fn all_bytes_go_on_and_all_packets_are_reported_in_order_however_they_come() {
    let sizes: Vec<usize> = (0..40).map(|number| number * 90).collect();
    let packets = sizes.iter().map(|size| publish(1, *size));
    let sent = std::iter::once(CONNECT.to_vec())
        .chain(packets)
        .collect::<Vec<_>>()
        .concat();
    for (chunk, room) in [
        (1, 1 << 16),
        (7, 64),
        (1_000, 64),
        (1_000, 1 << 16),
        (usize::MAX, 64),
        (usize::MAX, 1 << 16),
    ] {
        let (shared, mut inbox) = shared();
        let both = Both::default();
        let mut pump = Pump::new(&shared, &both, 1, Direction::FromDevice);
        let (mut device, from) = duplex(1 << 20);
        let (to, mut broker) = duplex(room);
        let send = async {
            for part in sent.chunks(chunk) {
                device.write_all(part).await.unwrap();
                tokio::task::yield_now().await;
            }
            device.shutdown().await.unwrap();
        };
        let receive = async {
            let mut got = Vec::new();
            broker.read_to_end(&mut got).await.unwrap();
            got
        };
        let ((), (), got) = tokio::join!(send, pump.run(from, to, shared.control.subscribe()), receive);
        assert!(got == sent, "{chunk} bytes at once, room for {room}");
        assert_eq!(reported(&mut inbox), sizes, "{chunk} bytes at once, room for {room}");
    }
}

/// The device sends this, and the broker gets that.
async fn sends(ends: (&mut DuplexStream, &mut DuplexStream), packets: &[Vec<u8>], expected: &[u8]) {
    let (device, broker) = ends;
    device.write_all(&packets.concat()).await.unwrap();
    let mut got = vec![0; expected.len()];
    broker.read_exact(&mut got).await.unwrap();
    assert_eq!(got, expected);
}

#[tokio::test]
async fn a_fault_takes_hold_of_the_next_packet_although_the_ones_before_ran_ahead() {
    let (shared, mut inbox) = shared();
    let both = Both::default();
    let mut pump = Pump::new(&shared, &both, 1, Direction::FromDevice);
    let (mut device, from) = duplex(1 << 16);
    // Less than a packet: what is not taken at once goes on later.
    let (to, mut broker) = duplex(16);
    let talk = async {
        sends((&mut device, &mut broker), &[CONNECT.to_vec()], CONNECT).await;
        sends((&mut device, &mut broker), &[publish(1, 10)], &publish(1, 10)).await;
        shared.faults.lock().unwrap().apply(&LinkFault::Drop {
            topic: None,
            count: 1,
            direction: None,
        });
        sends(
            (&mut device, &mut broker),
            &[publish(2, 20), publish(3, 30)],
            &publish(3, 30),
        )
        .await;
        sends((&mut device, &mut broker), &[publish(4, 40)], &publish(4, 40)).await;
        device.shutdown().await.unwrap();
    };
    tokio::join!(talk, pump.run(from, to, shared.control.subscribe()));
    assert_eq!(reported(&mut inbox), [10, 20, 30, 40]);
}
