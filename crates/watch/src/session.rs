//! A watch from its begin to its end: listens, judges, records, answers scrapers, and tells a viewer.

use std::path::PathBuf;
use std::time::Duration;

use tokio::sync::watch;
use tokio::time::{Instant, MissedTickBehavior, interval, sleep_until};

use super::alarm::Alarmed;
use super::listener::Listener;
use super::metrics;
pub use super::metrics::Contact;
use super::recorder::{Recorder, Rotation};
use super::served::{Asked, MetricsServer};
use super::{Notice, Watch};
use tck_audit::result::AuditResult;
use tck_audit::{AuditError, Options};
use tck_base::clock::{Moment, WallClock};
use tck_base::verdict::Verdict;
use tck_capture::{Carried, Message, SourcePosition, from_journal};
use tck_journal::event::{Direction, Event, Payload, RunHeader};
use tck_judge::Rules;
use tck_net::bench::LinkError;
use tck_net::bench::client::ClientEvent;
use tck_net::bench::endpoint::Endpoint;
use tck_net::bench::inbox::inbox;
use tck_net::tap::{Tap, Upstream};

/// What a watch is to do.
#[derive(Clone, Debug)]
pub struct Settings {
    /// The broker.
    pub endpoint: Endpoint,
    /// Where vehicles connect to, if the watch is to be the tap between them and the broker.
    pub listen: Option<String>,
    /// Topic filters.
    pub filters: Vec<String>,
    /// What is judged.
    pub options: Options,
    /// Where a journal is written, and when its parts end.
    pub record: Option<(PathBuf, Rotation)>,
    /// Where metrics are served.
    pub metrics: Option<String>,
    /// End at the first violation.
    pub fail_fast: bool,
    /// How long to watch.
    pub time: Option<Duration>,
    /// How often the viewer is shown how things are.
    pub tick: Duration,
}

/// What happens to the watch itself.
#[derive(Clone, Debug, PartialEq)]
pub enum Happening {
    /// Vehicles may connect there.
    Tap(std::net::SocketAddr),
    /// Metrics are served there.
    Metrics(std::net::SocketAddr),
    /// It listens.
    Connected,
    /// It listens again; for so long nothing was seen.
    Again(Duration),
    /// Nothing is seen from now on.
    Lost(String),
    /// Nothing is recorded from now on; what is heard is judged as before.
    NotRecorded(String),
}

/// Who is shown what happens.
pub trait Viewer {
    /// Something was found.
    fn found(&mut self, notice: &Notice);
    /// Something happened to the watch itself.
    fn happened(&mut self, happening: &Happening, at: jiff::Timestamp);
    /// Something happened to a vehicle that somebody has to be told at once.
    fn alarmed(&mut self, alarmed: &Alarmed);
    /// How things are; called from time to time. `false` ends the watch.
    fn tick(&mut self, watch: &Watch<'_>, contact: Contact) -> bool;
}

/// Why a watch ended before its time.
#[derive(Debug, thiserror::Error)]
pub enum WatchError {
    /// The options.
    #[error(transparent)]
    Audit(#[from] AuditError),
    /// A port.
    #[error(transparent)]
    Link(#[from] LinkError),
    /// The first connection.
    #[error("cannot listen: {0}")]
    NeverConnected(String),
    /// The journal.
    #[error("cannot record: {0}")]
    Record(#[from] std::io::Error),
}

/// Watches until it is interrupted, or as the settings say.
///
/// # Errors
/// See [`WatchError`].
pub async fn run(
    rules: &Rules,
    settings: Settings,
    viewer: &mut impl Viewer,
    mut interrupt: watch::Receiver<bool>,
) -> Result<AuditResult, WatchError> {
    let clock = WallClock::start();
    let mut watch = Watch::new(rules, settings.options)?;
    let mut recorder = None;
    if let Some((path, rotation)) = &settings.record {
        let header = header(settings.listen.is_some());
        recorder = Some(Recorder::create(path, *rotation, header, clock.now())?);
    }
    let mut recording = Recording { recorder };
    let mut server = None;
    if let Some(address) = &settings.metrics {
        let started = MetricsServer::start(address).await?;
        viewer.happened(&Happening::Metrics(started.address), clock.now().utc);
        server = Some(started);
    }
    let (reporter, mut seen_at_tap) = inbox(clock);
    let mut tap = None;
    if let Some(address) = &settings.listen {
        let upstream = Upstream {
            broker: settings.endpoint.clone(),
            embedded: false,
        };
        let started = Tap::start(address, None, upstream, reporter).await?;
        viewer.happened(&Happening::Tap(started.address()), clock.now().utc);
        tap = Some(started);
    }
    let mut listener = Listener::new(settings.endpoint, &settings.filters);
    let mut contact = Contact::default();
    let mut gone: Option<Moment> = None;
    let mut after_gap = false;
    let mut ever = false;
    let mut ticks = interval(settings.tick);
    ticks.set_missed_tick_behavior(MissedTickBehavior::Delay);
    let begun = Instant::now();
    loop {
        let over = async {
            match settings.time {
                Some(time) => sleep_until(begun + time).await,
                None => std::future::pending().await,
            }
        };
        tokio::select! {
            _ = interrupt.changed() => break,
            () = over => break,
            _ = ticks.tick() => {
                if gone.is_none() {
                    let notices = watch.pass(clock.now());
                    tell(viewer, &mut watch);
                    if shown(viewer, &notices) && settings.fail_fast {
                        break;
                    }
                }
                if !viewer.tick(&watch, seen(contact, gone, clock.now().moment)) {
                    break;
                }
            }
            asked = ask(server.as_mut()) => {
                // Whoever asked may be gone again.
                let _ = asked.send(metrics::page(&watch, seen(contact, gone, clock.now().moment)));
            }
            occurrence = seen_at_tap.next(), if tap.is_some() => {
                let occurrence = occurrence?;
                if occurrence.direction == Some(Direction::ToDevice) && matches!(occurrence.event, Event::Packet { .. }) {
                    continue;
                }
                recording.write(viewer, occurrence.at.utc, |recorder| {
                    recorder.record(occurrence.at, occurrence.source, occurrence.direction, occurrence.event.clone())
                });
                let (at, source) = (occurrence.at, occurrence.source);
                let Some(wire) = from_journal::wire(at.utc, source, occurrence.direction, &occurrence.event, 0) else {
                    continue;
                };
                let message = from_journal::carried(&wire, SourcePosition::default());
                let mut notices = watch.take_wire(wire);
                if let Some(message) = message {
                    notices.extend(watch.take(at, message));
                }
                tell(viewer, &mut watch);
                if shown(viewer, &notices) && settings.fail_fast {
                    break;
                }
            }
            event = listener.next() => match event {
                ClientEvent::Connected => {
                    contact.connected = true;
                    ever = true;
                    let now = clock.now();
                    let happening = match gone.take() {
                        Some(since) => {
                            let unseen = now.moment.since(since);
                            contact.unseen += unseen.as_secs_f64();
                            watch.unseen(now.moment);
                            Happening::Again(unseen)
                        }
                        None => Happening::Connected,
                    };
                    viewer.happened(&happening, now.utc);
                }
                ClientEvent::Lost(why) if !ever => return Err(WatchError::NeverConnected(why)),
                ClientEvent::Lost(why) => {
                    let now = clock.now();
                    if std::mem::take(&mut contact.connected) {
                        contact.lost += 1;
                        gone = Some(now.moment);
                        after_gap = true;
                        viewer.happened(&Happening::Lost(why.clone()), now.utc);
                        recording.write(viewer, now.utc, |recorder| recorder.cut_off(now, &why));
                    }
                }
                ClientEvent::Message { topic, payload, qos, retain, dup } => {
                    let now = clock.now();
                    recording.write(viewer, now.utc, |recorder| recorder.message(now, Event::Message {
                        topic: topic.clone(), qos, retain, dup, payload: Payload::keep(payload.clone()),
                    }));
                    let message = Message {
                        at: Some(now.utc),
                        topic,
                        payload,
                        qos: Some(qos),
                        retain: Some(retain),
                        place: SourcePosition::default(),
                        after_gap: std::mem::take(&mut after_gap),
                        carried: tap.is_some().then_some(Carried::BESIDE_TAP),
                    };
                    let notices = watch.take(now, message);
                    tell(viewer, &mut watch);
                    if shown(viewer, &notices) && settings.fail_fast {
                        break;
                    }
                }
            },
        }
    }
    viewer.tick(&watch, seen(contact, gone, clock.now().moment));
    listener.stop().await;
    if let Some(tap) = tap {
        tap.stop().await;
    }
    recording.write(viewer, clock.now().utc, |recorder| recorder.finish());
    Ok(watch.finish())
}

/// The journal that is written, as long as it can be.
struct Recording {
    recorder: Option<Recorder>,
}

impl Recording {
    /// Writes something. A disk that is full ends the journal and not the watch, nor what goes through its tap.
    fn write(
        &mut self,
        viewer: &mut impl Viewer,
        at: jiff::Timestamp,
        write: impl FnOnce(&mut Recorder) -> std::io::Result<()>,
    ) {
        let Some(Err(error)) = self.recorder.as_mut().map(write) else {
            return;
        };
        self.recorder = None;
        viewer.happened(&Happening::NotRecorded(error.to_string()), at);
    }
}

/// Shows what was found; says whether something is violated.
fn shown(viewer: &mut impl Viewer, notices: &[Notice]) -> bool {
    for notice in notices {
        viewer.found(notice);
    }
    notices.iter().any(|notice| notice.found.verdict == Verdict::Fail)
}

/// Tells what somebody has to be told.
fn tell(viewer: &mut impl Viewer, watch: &mut Watch<'_>) {
    for alarmed in watch.alarms() {
        viewer.alarmed(&alarmed);
    }
}

/// The contact with the time that is unseen right now.
fn seen(contact: Contact, gone: Option<Moment>, now: Moment) -> Contact {
    let more = gone.map_or(0.0, |since| now.since(since).as_secs_f64());
    Contact {
        unseen: contact.unseen + more,
        ..contact
    }
}

async fn ask(server: Option<&mut MetricsServer>) -> Asked {
    if let Some(server) = server
        && let Some(asked) = server.asked.recv().await
    {
        return asked;
    }
    std::future::pending().await
}

/// What every part of the journal begins with: it is of no run.
fn header(tapped: bool) -> RunHeader {
    RunHeader {
        format: "vda5050-tck.journal/1".to_owned(),
        tool: tck_journal::tool(),
        vantage: if tapped { "tap" } else { "subscriber" }.to_owned(),
        ..RunHeader::default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Default)]
    struct Told(Vec<Happening>);

    impl Viewer for Told {
        fn found(&mut self, _: &Notice) {}
        fn happened(&mut self, happening: &Happening, _: jiff::Timestamp) {
            self.0.push(happening.clone());
        }
        fn alarmed(&mut self, _: &Alarmed) {}
        fn tick(&mut self, _: &Watch<'_>, _: Contact) -> bool {
            true
        }
    }

    #[test]
    fn a_full_disk_ends_the_journal_and_is_told_once() {
        let folder = tempfile::tempdir().expect("folder");
        let at = WallClock::start().now();
        let recorder = Recorder::create(
            &folder.path().join("site.jsonl"),
            Rotation::default(),
            header(false),
            at,
        );
        let mut recording = Recording {
            recorder: Some(recorder.expect("a journal")),
        };
        let mut told = Told::default();
        recording.write(&mut told, at.utc, |recorder| recorder.cut_off(at, "reset"));
        assert_eq!(told.0, []);
        for _ in 0..2 {
            recording.write(&mut told, at.utc, |_| Err(std::io::Error::other("no space left")));
        }
        assert_eq!(told.0, [Happening::NotRecorded("no space left".to_owned())]);
        recording.write(&mut told, at.utc, |_| panic!("nobody records any more"));
    }
}
