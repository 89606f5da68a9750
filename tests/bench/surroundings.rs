//! TLS towards the device, and the map server.

use std::path::Path;
use std::process::Stdio;
use std::time::Duration;

use bytes::Bytes;
use tokio::io::AsyncWriteExt;
use tokio::net::TcpStream;

use vda5050_tck::bench::Offer;
use vda5050_tck::bench::client::{Client, ClientEvent, ClientOptions};
use vda5050_tck::bench::endpoint::{Access, Endpoint};
use vda5050_tck::bench::tls::TlsFiles;
use vda5050_tck::journal::event::{Event, Source};
use vda5050_tck::link::Link;
use vda5050_tck::link::mqtt::BenchOptions;
use vda5050_tck::suite::model::ServeBehaviour;

use crate::rig::*;

#[tokio::test]
async fn map_files_are_served_well_and_badly() {
    let mut rig = rig().await;
    for (behaviour, status, phase, good) in [
        (ServeBehaviour::Well, Some(200), "done", true),
        (ServeBehaviour::WrongBytes, Some(200), "done", true),
        (ServeBehaviour::NotFound, Some(404), "done", false),
        (ServeBehaviour::Cut, Some(200), "cut", false),
        (ServeBehaviour::Stall, None, "cut", false),
        (ServeBehaviour::Unreachable, None, "", false),
    ] {
        let body = Bytes::from(vec![7; 100_000]);
        let offer = Offer {
            name: "hall 1".to_owned(),
            body: body.clone(),
            behaviour,
            secured: false,
        };
        let url = rig.link.serve(offer).await.unwrap();
        let fetched = tokio::task::spawn_blocking(move || -> Result<Vec<u8>, ureq::Error> {
            let config = ureq::Agent::config_builder()
                .timeout_global(Some(Duration::from_millis(700)))
                .build();
            ureq::Agent::from(config).get(&url).call()?.into_body().read_to_vec()
        })
        .await
        .unwrap();
        assert_eq!(fetched.is_ok(), good, "{behaviour:?}: {fetched:?}");
        if let Ok(bytes) = fetched {
            assert_eq!(bytes.len(), body.len());
            assert_eq!(bytes == body, behaviour == ServeBehaviour::Well);
        }
        if behaviour == ServeBehaviour::Unreachable {
            assert!(rig.during(100).await.is_empty());
            continue;
        }
        rig.until("the end of the transfer", |o| {
            o.source == Source::Maps
                && matches!(&o.event, Event::Fetched { name, status: s, phase: p, .. } if name == "hall 1" && *s == status && p == phase)
        })
        .await;
    }
    rig.link.stop().await;
}

/// A certificate for this machine, valid for two days; `None` without openssl.
pub fn certificate(folder: &Path) -> Option<TlsFiles> {
    let (certificate, key) = (folder.join("cert.pem"), folder.join("key.pem"));
    let made = std::process::Command::new("openssl")
        .args(
            "req -x509 -newkey ec -pkeyopt ec_paramgen_curve:prime256v1 -nodes -days 2 -subj /CN=localhost".split(' '),
        )
        .args("-addext subjectAltName=DNS:localhost,IP:127.0.0.1 -addext basicConstraints=critical,CA:FALSE".split(' '))
        .arg("-out")
        .arg(&certificate)
        .arg("-keyout")
        .arg(&key)
        .stderr(Stdio::null())
        .status();
    made.is_ok_and(|status| status.success())
        .then_some(TlsFiles { certificate, key })
}

#[tokio::test]
async fn the_device_side_can_be_tls() {
    let folder = tempfile::tempdir().unwrap();
    let Some(tls) = certificate(folder.path()) else {
        return missing("openssl");
    };
    let certificate = tls.certificate.clone();
    let mut rig = rig_with(BenchOptions {
        tls: Some(tls),
        ..BenchOptions::loopback(topics())
    })
    .await;
    let (_, port) = rig.info.device_address.rsplit_once(':').unwrap();
    let access = Access {
        authority: Some(certificate),
        ..Access::default()
    };
    let endpoint = Endpoint::parse(&format!("mqtts://localhost:{port}"), &access).unwrap();
    let (client, mut events) = Client::open(&ClientOptions {
        endpoint,
        client_id: "secure".to_owned(),
        keep_alive: Duration::from_secs(20),
        clean_session: true,
        will: Some(message("d/connection", "broken", 1, true)),
        subscriptions: vec![],
    });
    assert_eq!(events.recv().await, Some(ClientEvent::Connected));
    assert!(client.publish(message("d/state", "secret", 1, false)));
    rig.until("state", |o| is_message(o, "secret")).await;
    // A device that does not speak TLS is told off and harms nobody.
    let mut plain = TcpStream::connect(&rig.info.device_address).await.unwrap();
    plain.write_all(CONNECT).await.unwrap();
    rig.until(
        "note",
        |o| matches!(&o.event, Event::Note { text } if text.contains("TLS")),
    )
    .await;
    drop(client);
    rig.until("will", |o| is_message(o, "broken")).await;
    rig.link.stop().await;
}
