//! A harness that is held up itself says so.

use std::time::Duration;

use vda5050_tck::journal::event::Event;
use vda5050_tck::link::Link;

use crate::rig::*;

#[tokio::test]
async fn a_harness_that_is_held_up_records_by_how_much() {
    let mut rig = rig().await;
    let until = rig.link.now().after(Duration::from_millis(100)).moment;
    // One thread does everything here, so nothing of the harness gets on meanwhile.
    tokio::spawn(async {
        tokio::time::sleep(Duration::from_millis(50)).await;
        std::thread::sleep(Duration::from_millis(800));
    });
    let mut lag = 0;
    while lag == 0 {
        let next = rig.link.next(until).await.unwrap();
        match next.map(|occurrence| occurrence.event) {
            Some(Event::Lag { micros, .. }) => lag = micros,
            Some(_) => {}
            None => panic!("it noticed nothing"),
        }
    }
    assert!((500_000..5_000_000).contains(&lag), "{lag}");
}
