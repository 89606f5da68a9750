//! Link faults, and the ways a connection ends.

use std::time::{Duration, Instant};

use tokio::io::AsyncReadExt;

use vda5050_tck::journal::event::{Close, Direction, LinkFault, Occurrence, Packet};
use vda5050_tck::link::Link;

use crate::rig::*;

#[tokio::test]
async fn a_cut_ends_the_connection_publishes_the_will_and_keeps_the_device_out() {
    for reset in [true, false] {
        let mut rig = rig().await;
        let mut device = rig.device().await;
        rig.fault(LinkFault::Cut { reset }).await;
        let mut closed = false;
        rig.until("will", |o| {
            closed |= is_closed(o, Close::Harness);
            is_message(o, "broken") && closed
        })
        .await;
        device.lost().await;
        let mut again = TestDevice::open(&rig.info, "device", 20);
        again.lost().await;
        rig.fault(LinkFault::Restore).await;
        rig.device().await;
        rig.link.stop().await;
    }
}

#[tokio::test]
async fn a_cut_is_over_when_fault_returns_and_resets_where_asked() {
    for (reset, wanted) in [(true, None), (false, Some(0))] {
        let mut rig = rig().await;
        let mut socket = raw_device(&mut rig).await;
        rig.fault(LinkFault::Cut { reset }).await;
        let mut byte = [0];
        let read = tokio::time::timeout(Duration::from_millis(200), socket.read(&mut byte))
            .await
            .unwrap();
        assert_eq!(read.ok(), wanted, "reset: {reset}");
        rig.link.stop().await;
    }
}

#[tokio::test]
async fn an_orderly_end_publishes_no_will_and_a_lost_device_does() {
    let mut rig = rig().await;
    let device = rig.device().await;
    device.client.disconnect().await;
    let mut goodbye = false;
    rig.until("end", |o| {
        goodbye |= is_packet(o, |p| matches!(p, Packet::Disconnect { code: 0 }));
        goodbye && is_closed(o, Close::DeviceFin)
    })
    .await;
    assert!(texts(&rig.during(300).await).is_empty());
    drop(rig.device().await);
    rig.until("will", |o| is_message(o, "broken")).await;
    rig.link.stop().await;
}

#[tokio::test]
async fn silence_keeps_the_connection_and_the_will_comes_by_keep_alive() {
    let mut rig = rig().await;
    let device = TestDevice::open(&rig.info, "device", 1);
    rig.until("SUBACK", |o| is_packet(o, |p| matches!(p, Packet::Suback { .. })))
        .await;
    rig.fault(LinkFault::Silence { direction: None }).await;
    let begun = Instant::now();
    device.send("d/state", "unheard", 0, false);
    let seen = rig.until("will", |o| is_message(o, "broken")).await;
    assert!(begun.elapsed() > Duration::from_secs(1));
    assert!(
        seen.iter()
            .any(|o| is_packet(o, |p| matches!(p, Packet::Publish { .. }))),
        "the tap hears the device"
    );
    assert!(!texts(&seen).contains(&"unheard".to_owned()));
    rig.link.stop().await;
}

#[tokio::test]
async fn a_short_silence_only_delays() {
    let mut rig = rig().await;
    let mut device = rig.device().await;
    rig.fault(LinkFault::Silence { direction: None }).await;
    device.send("d/state", "late", 1, false);
    rig.order("late, too", 1).await;
    assert!(texts(&rig.during(300).await).is_empty());
    rig.fault(LinkFault::Restore).await;
    rig.until("state", |o| is_message(o, "late")).await;
    assert_eq!(device.order().await, "late, too");
    rig.link.stop().await;
}

#[tokio::test]
async fn delay_holds_back_for_its_time() {
    let mut rig = rig().await;
    let device = rig.device().await;
    rig.fault(LinkFault::Delay {
        millis: 300,
        direction: Some(Direction::FromDevice),
    })
    .await;
    let begun = Instant::now();
    device.send("d/state", "a", 0, false);
    rig.until("state", |o| is_message(o, "a")).await;
    let took = begun.elapsed();
    assert!(
        took >= Duration::from_millis(300) && took < Duration::from_millis(1500),
        "{took:?}"
    );
    rig.link.stop().await;
}

#[tokio::test]
async fn drop_and_duplicate_touch_the_next_packets_on_a_topic() {
    let mut rig = rig().await;
    let mut device = rig.device().await;
    rig.fault(LinkFault::Drop {
        topic: Some("state".to_owned()),
        count: 1,
        direction: None,
    })
    .await;
    rig.fault(LinkFault::Duplicate {
        topic: Some("order".to_owned()),
        count: 1,
        direction: Some(Direction::ToDevice),
    })
    .await;
    device.send("d/state", "swallowed", 0, false);
    device.send("d/state", "comes", 0, false);
    assert_eq!(texts(&rig.until("state", |o| is_message(o, "comes")).await), ["comes"]);
    rig.order("twice", 1).await;
    rig.order("once", 1).await;
    let orders = [device.order().await, device.order().await, device.order().await];
    assert_eq!(orders, ["twice", "twice", "once"]);
    let seen = rig.during(200).await;
    let to_device = |o: &&Occurrence| {
        o.direction == Some(Direction::ToDevice) && is_packet(o, |p| matches!(p, Packet::Publish { .. }))
    };
    assert_eq!(seen.iter().filter(to_device).count(), 3);
    assert!(
        seen.iter()
            .any(|o| is_packet(o, |p| matches!(p, Packet::Publish { dup: true, qos: 1, .. })))
    );
    rig.link.stop().await;
}

#[tokio::test]
async fn refuse_leaves_the_present_connection_alone() {
    let mut rig = rig().await;
    let device = rig.device().await;
    rig.fault(LinkFault::Refuse).await;
    TestDevice::open(&rig.info, "other", 20).lost().await;
    device.send("d/state", "still here", 0, false);
    rig.until("state", |o| is_message(o, "still here")).await;
    rig.fault(LinkFault::Restore).await;
    rig.device().await;
    rig.link.stop().await;
}

#[tokio::test]
async fn only_what_the_harness_itself_takes_with_a_message_counts_as_its_own_time() {
    let mut rig = rig().await;
    let device = rig.device().await;
    assert_eq!(rig.link.time_to_pass_on(), None, "a CONNECT is no message");
    device.send("d/state", "at once", 1, false);
    rig.until("state", |o| is_message(o, "at once")).await;
    let before = rig.link.time_to_pass_on().unwrap();
    // To the harness it goes past the tap, to the device through it.
    assert_eq!(before.count, 1, "{before:?}");
    rig.fault(LinkFault::Delay {
        millis: 300,
        direction: Some(Direction::FromDevice),
    })
    .await;
    device.send("d/state", "held back", 0, false);
    rig.until("state", |o| is_message(o, "held back")).await;
    rig.fault(LinkFault::Silence { direction: None }).await;
    device.send("d/state", "kept", 0, false);
    rig.during(100).await;
    rig.fault(LinkFault::Restore).await;
    rig.until("state", |o| is_message(o, "kept")).await;
    assert_eq!(rig.link.time_to_pass_on(), Some(before));
    device.send("d/state", "at once again", 0, false);
    rig.until("state", |o| is_message(o, "at once again")).await;
    let after = rig.link.time_to_pass_on().unwrap();
    assert_eq!(after.count, 2, "{after:?}");
    rig.link.stop().await;
}
