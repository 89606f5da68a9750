//! Devices that flood, break off and send garbage; and the bench itself under pressure.

use std::time::{Duration, Instant};

use tokio::io::AsyncWriteExt;
use tokio::net::TcpStream;

use vda5050_tck::bench::LinkError;
use vda5050_tck::journal::event::{Close, Event, LinkFault, Packet};
use vda5050_tck::link::Link;
use vda5050_tck::link::mqtt::{BenchOptions, MqttBench};

use crate::rig::*;

#[tokio::test]
async fn a_payload_of_20_mb_passes_and_is_kept_by_hash() {
    let mut rig = rig().await;
    let device = rig.device().await;
    device.send("d/state", &"x".repeat(20 << 20), 1, false);
    let seen = rig.until("state", |o| matches!(o.event, Event::Message { .. })).await;
    let Event::Message { payload, .. } = &seen.last().unwrap().event else {
        unreachable!()
    };
    assert_eq!(payload.len(), 20 << 20);
    assert!(payload.bytes().len() < 10_000);
    rig.link.stop().await;
}

#[tokio::test]
async fn half_a_packet_harms_nobody() {
    let mut rig = rig().await;
    let mut socket = raw_device(&mut rig).await;
    socket.write_all(&[0x30, 0x20, 0x00]).await.unwrap();
    rig.device().await;
    drop(socket);
    let seen = rig.until("end", |o| is_closed(o, Close::DeviceFin)).await;
    assert!(
        seen.iter()
            .any(|o| matches!(&o.event, Event::Undecodable { bytes, .. } if bytes.bytes() == [0x30, 0x20, 0x00]))
    );
    rig.link.stop().await;
}

#[tokio::test]
async fn garbage_is_reported_forwarded_and_costs_only_its_own_connection() {
    let mut rig = rig().await;
    for garbage in [
        &b"GET / HTTP/1.1\r\n\r\n"[..],
        b"\x30\x05\x00\x03\xff\xfe\xfdx",
        b"\xf0\xff\xff\xff\xff\xff\xff",
        b"\x00\x00\x00\x00",
        b"\x30\xff\xff\xff\x7f and on it goes",
    ] {
        let mut socket = raw_device(&mut rig).await;
        socket.write_all(garbage).await.unwrap();
        socket.write_all(&[b'x'; 70]).await.unwrap();
        rig.until("garbage", |o| matches!(o.event, Event::Undecodable { .. }))
            .await;
    }
    let device = rig.device().await;
    device.send("d/state", "unharmed", 0, false);
    rig.until("state", |o| is_message(o, "unharmed")).await;
    rig.link.stop().await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn five_thousand_messages_a_second_are_all_seen() {
    let mut rig = rig().await;
    let device = rig.device().await;
    let text = "s".repeat(2000);
    let sender = tokio::spawn(async move {
        for _ in 0..200 {
            for _ in 0..50 {
                device.send("d/state", &text, 0, false);
            }
            tokio::time::sleep(Duration::from_millis(10)).await;
        }
        device
    });
    let (mut packets, mut messages) = (0, 0);
    rig.until("the last message", |o| {
        packets += u32::from(is_packet(o, |p| matches!(p, Packet::Publish { .. })));
        messages += u32::from(matches!(o.event, Event::Message { .. }));
        messages == 10_000
    })
    .await;
    assert_eq!(packets, 10_000);
    sender.await.unwrap();
    rig.link.stop().await;
}

#[tokio::test]
async fn a_flooding_device_is_slowed_down_while_nobody_reads_and_a_cut_still_works() {
    let mut rig = rig().await;
    let mut socket = raw_device(&mut rig).await;
    let mut packet = vec![0x30, 0x80, 0x80, 0x04, 0x00, 0x07];
    packet.extend_from_slice(b"d/other");
    packet.resize(4 + (4 << 14), b'x');
    let flood = async {
        let mut sent = 0_usize;
        loop {
            match socket.write_all(&packet).await {
                Ok(()) => sent += packet.len(),
                Err(_) => return sent,
            }
            if sent > 2 << 30 {
                return sent;
            }
        }
    };
    tokio::pin!(flood);
    assert!(
        tokio::time::timeout(Duration::from_secs(3), &mut flood).await.is_err(),
        "TCP slows the device down"
    );
    rig.fault(LinkFault::Cut { reset: true }).await;
    assert!(flood.await < 1 << 30);
    rig.until("end", |o| is_closed(o, Close::Harness)).await;
    rig.link.stop().await;
}

#[tokio::test]
async fn stopping_is_quick_even_with_silent_connections() {
    let mut rig = rig().await;
    let _device = rig.device().await;
    let _silent = TcpStream::connect(&rig.info.device_address).await.unwrap();
    let _silent_at_the_broker = TcpStream::connect(&rig.info.broker_address).await.unwrap();
    rig.during(50).await;
    let begun = Instant::now();
    let address = rig.info.device_address.clone();
    rig.link.stop().await;
    assert!(begun.elapsed() < Duration::from_secs(1), "{:?}", begun.elapsed());
    assert!(TcpStream::connect(address).await.is_err());
}

#[tokio::test]
async fn a_port_in_use_is_said_clearly() {
    let taken = tokio::net::TcpListener::bind("127.0.0.1:0").await.unwrap();
    let listen = taken.local_addr().unwrap().to_string();
    let options = BenchOptions {
        listen: listen.clone(),
        ..BenchOptions::loopback(topics())
    };
    let error = MqttBench::start(options).await.err().unwrap();
    assert!(matches!(&error, LinkError::Listen { address, .. } if *address == listen));
    assert!(error.to_string().contains("another program"), "{error}");
}

#[tokio::test]
async fn next_returns_nothing_when_the_time_has_come_and_survives_being_given_up() {
    let mut rig = rig().await;
    let now = rig.link.now().moment;
    assert!(rig.link.next(now).await.unwrap().is_none());
    let device = rig.device().await;
    for _ in 0..200 {
        let far = rig.link.now().after(Duration::from_secs(60)).moment;
        let _ = tokio::time::timeout(Duration::from_micros(50), async {
            // Given up again and again while messages come in; none may be lost.
            assert!(rig.link.next(far).await.unwrap().is_none(), "nothing was sent yet");
        })
        .await;
    }
    device.send("d/state", "there", 0, false);
    rig.until("state", |o| is_message(o, "there")).await;
    rig.link.stop().await;
}
