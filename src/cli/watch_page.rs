//! `watch --page`: what a watch hears and finds, on a page for people elsewhere (docs/page.md).

use std::sync::Arc;
use std::time::{Duration, Instant};

use super::page::said;
use super::problem::Problem;
use tck_base::clock::{Moment, Stamp};
use tck_base::diagnostic::Diagnostic;
use tck_base::secrets::Secrets;
use tck_base::verdict::Verdict;
use tck_journal::event::{Event, Record, Source};
use tck_journal::{Entry, Payload};
use tck_pack::Role;
use tck_page::{Facts, Finding, FleetVehicle, Nobody, Outcome, Page, PageServer, Way};
use tck_watch::alarm::Alarmed;
use tck_watch::session::{Contact, Happening, Viewer};
use tck_watch::vehicle_status::VehicleStatus;
use tck_watch::{Notice, Watch};

/// How often the page is shown the vehicles.
const EVERY: Duration = Duration::from_millis(500);
/// How many messages are kept beside what they show.
const KEPT: u64 = 5_000;
/// The largest message that is kept, in bytes.
const LARGEST: usize = 16 << 10;

/// A page of a watch that is served.
pub(super) struct WatchPage {
    page: Page,
    server: PageServer,
}

impl WatchPage {
    /// Serves the page on an address, and says where it is.
    pub(super) async fn start(listen: &str, broker: &str) -> Result<Self, Problem> {
        let page = Page::default();
        let server = PageServer::start(listen, None, page.clone(), Arc::new(Nobody)).await;
        let server = server.map_err(|error| Problem::from(Diagnostic::whole("page", error.to_string())))?;
        said(&server);
        page.begun(Facts {
            command: "watch".to_owned(),
            broker: Secrets::default().out_of(broker),
            ..Facts::default()
        });
        page.planned(Vec::new());
        Ok(Self { page, server })
    }

    /// Shows the page what a viewer is shown.
    pub(super) fn beside<'v, V: Viewer>(&self, viewer: &'v mut V) -> BesideViewer<'v, V> {
        BesideViewer {
            viewer,
            page: self.page.clone(),
            kept: 0,
            shown: None,
        }
    }

    /// Says how it ended, where it came to an end, and serves no more.
    pub(super) async fn finish(self, verdict: Option<&str>) {
        if let Some(verdict) = verdict {
            self.page.ended(Outcome {
                verdict: verdict.to_owned(),
                statement: "What was found stands below.".to_owned(),
                report: "on the terminal".to_owned(),
            });
        }
        self.page.breaks_off();
        self.server.finish().await;
    }
}

/// A viewer, and a page beside it.
pub(super) struct BesideViewer<'v, V> {
    viewer: &'v mut V,
    page: Page,
    kept: u64,
    shown: Option<Instant>,
}

impl<V: Viewer> Viewer for BesideViewer<'_, V> {
    fn found(&mut self, notice: &Notice) {
        self.viewer.found(notice);
        let found = &notice.found;
        if !matches!(found.verdict, Verdict::Fail | Verdict::Warning) || !notice.is_told() {
            return;
        }
        let record = self.keep(notice);
        self.page.found(vec![Finding {
            requirement: found.requirement.clone(),
            verdict: found.verdict,
            by: format!("{}, {}/{}", found.monitor, found.manufacturer, found.serial_number),
            message: found.text.clone(),
            record,
            count: found.count,
        }]);
    }

    fn happened(&mut self, happening: &Happening, at: jiff::Timestamp) {
        self.viewer.happened(happening, at);
        self.page.note(&match happening {
            Happening::Tap(address) => format!("vehicles are expected at mqtt://{address}"),
            Happening::Metrics(address) => format!("metrics are served at http://{address}/metrics"),
            Happening::Connected => "it listens at the broker".to_owned(),
            Happening::Again(unseen) => {
                format!(
                    "it listens again; what happened in {:.1} s was not seen",
                    unseen.as_secs_f64()
                )
            }
            Happening::Lost(why) => format!("the connection to the broker is lost, and tried again: {why}"),
            Happening::NotRecorded(why) => format!("nothing is recorded any more: {why}"),
        });
    }

    fn alarmed(&mut self, alarmed: &Alarmed) {
        self.viewer.alarmed(alarmed);
        let Alarmed {
            manufacturer,
            serial_number,
            alarm,
            ..
        } = alarmed;
        self.page.note(&format!("{manufacturer}/{serial_number}: {alarm}"));
    }

    fn tick(&mut self, watch: &Watch<'_>, contact: Contact) -> bool {
        if self.shown.is_none_or(|shown| shown.elapsed() >= EVERY) {
            self.shown = Some(Instant::now());
            self.page.fleet(watch.worst_first().into_iter().map(vehicle).collect());
        }
        self.viewer.tick(watch, contact)
    }
}

impl<V> BesideViewer<'_, V> {
    /// Keeps the message that shows a finding, so that the page can open it.
    fn keep(&mut self, notice: &Notice) -> Option<u64> {
        let (topic, payload) = notice.message.as_ref()?;
        if self.kept == KEPT || payload.len() > LARGEST {
            return None;
        }
        self.kept += 1;
        let event = Event::Message {
            topic: topic.clone(),
            qos: 0,
            retain: false,
            dup: false,
            payload: Payload::keep(payload.clone()),
        };
        let at = Stamp {
            moment: Moment::START,
            utc: notice.found.at.parse().unwrap_or(jiff::Timestamp::UNIX_EPOCH),
        };
        let entry = Entry::new(Record {
            seq: self.kept,
            at,
            source: Source::Link,
            direction: None,
            event,
        });
        let way = if notice.found.role == Role::Agv.word() {
            Way::FromDevice
        } else {
            Way::ToDevice
        };
        self.page.saw(&entry, Some((topic, way)));
        Some(self.kept)
    }
}

fn vehicle(status: &VehicleStatus) -> FleetVehicle {
    let worst = status.kinds.values().max_by(|one, other| {
        let key = |kind: &tck_watch::vehicle_status::Kind| (kind.verdict, kind.last.clone());
        key(one).cmp(&key(other))
    });
    FleetVehicle {
        name: format!("{}/{}", status.manufacturer, status.serial_number),
        connection: status.connection.clone(),
        mode: status.mode.clone(),
        order: status
            .order
            .as_ref()
            .map(|(order, update)| format!("{order}, update {update}")),
        last_node: status.last_node.clone(),
        driving: status.driving,
        errors: status
            .errors
            .iter()
            .map(|(level, kind)| format!("{level} {kind}"))
            .collect(),
        heard: status.heard.map(|at| at.utc.as_millisecond()),
        finding: worst.map(|kind| (kind.verdict, format!("{}: {}", kind.requirement, kind.text))),
        x: status.spot.map(|(x, _)| x),
        y: status.spot.map(|(_, y)| y),
        theta: status.heading,
        map: status.map.clone(),
    }
}
