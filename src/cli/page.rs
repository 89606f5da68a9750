//! `--page`: the page for the people beside the device, served while a run goes on (docs/page.md).

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Duration;

use tokio::sync::watch;

use super::problem::Problem;
use crate::ui::{Follower, Prompter};
use tck_base::diagnostic::Diagnostic;
use tck_base::secrets::Secrets;
use tck_base::verdict::Verdict;
use tck_course::Layout;
use tck_engine::{Onlooker, Watcher};
use tck_journal::event::{Event, Gate, Plan};
use tck_net::link::mqtt::BenchInfo;
use tck_pack::{Catalogue, Pack, Role};
use tck_page::{
    Choice, Desk, Finding, Floor, FloorEdge, FloorNode, Page, PageError, PageServer, Planned, Prompt, RoutePart,
    StepFacts, TestFacts, VehicleOnFloor, Way,
};
use tck_profile::{Effective, Profile};
use tck_result::{RunResult, TestResult};
use tck_run::{Answer, Place, Progress, Request};
use tck_suite::model::{Step, Test};
use tck_view::{MessageView, StateView, Topic};

/// The name of the setting.
const SETTING: &str = "bench.page";

/// A page that is served.
pub(super) struct ServedPage {
    pub(super) page: Page,
    server: PageServer,
}

/// What is pressed on the page goes to the desk where the terminal asks, too.
struct AtDesk(Prompter);

impl Desk for AtDesk {
    fn answer(&self, number: u64, choice: Choice) -> bool {
        let answer = match choice {
            Choice::Done => Answer::Done,
            Choice::Skip => Answer::Skip,
            Choice::End => Answer::End,
        };
        self.0.board().answer(number, answer, Place::Page)
    }

    fn stop(&self) -> bool {
        self.0.say("stopped on the page");
        self.0.stop(Place::Page);
        true
    }
}

impl ServedPage {
    /// Serves the page where the profile says so, and says where it is. With the certificate of the bench it is served over TLS.
    pub(super) async fn start(
        effective: &Effective,
        desk: &Prompter,
        mut interrupt: watch::Receiver<bool>,
    ) -> Result<Option<Self>, Problem> {
        let bench = &effective.profile.bench;
        let Some(listen) = &bench.page else { return Ok(None) };
        let page = Page::default();
        let certificate = bench.tls_cert.as_deref().zip(bench.tls_key.as_deref());
        let served = PageServer::start(listen, certificate, page.clone(), Arc::new(AtDesk(desk.clone())));
        let server = served.await.map_err(|error| {
            let setting = match error {
                PageError::Listen(_) => SETTING,
                PageError::Certificate(_) => "bench.tls-cert",
            };
            Problem::Bench(Box::new(effective.complain(
                setting,
                "bench",
                error.to_string(),
                "this one",
            )))
        })?;
        said(&server);
        let stopped = page.clone();
        tokio::spawn(async move {
            if interrupt.wait_for(|interrupted| *interrupted).await.is_ok() {
                stopped.stops();
            }
        });
        Ok(Some(Self { page, server }))
    }

    /// Waits a moment until browsers have heard the end, which has to be said before where a run came to one.
    pub(super) async fn finish(self) {
        self.page.breaks_off();
        self.server.finish().await;
    }
}

/// Says where a page is; what is reached by others, for a tablet as well.
pub(super) fn said(server: &PageServer) {
    eprintln!(
        "the page for the people beside the vehicle is {} (docs/page.md)",
        server.url()
    );
    if server.is_reached_by_others() {
        if !server.is_secured() {
            eprintln!("it is not encrypted: whoever can read along in this network can use it as well");
        }
        eprintln!("{}", tck_page::qr_code(server.url()));
    }
}

/// Tells the page how a run is getting on.
pub(super) struct OnPage(pub(super) Page);

impl Watcher for OnPage {
    fn waiting(&mut self, step: &Step) {
        self.0.step(&StepFacts {
            path: step.path.clone(),
            title: step.title.clone(),
            does: step.verb_span.text().to_owned(),
        });
    }

    fn awaits(&mut self, left: Duration) {
        self.0.awaits(left);
    }
}

impl Progress for OnPage {
    fn planned(&mut self, plan: &Plan) {
        let tests = plan.tests.iter().map(|test| Planned {
            test: test.test.clone(),
            left_out: match &test.gate {
                Gate::Runs => None,
                Gate::NotApplicable(why) => Some(format!("not applicable: {why}")),
                Gate::Unobservable(why) => Some(why.to_string()),
            },
        });
        self.0.planned(tests.collect());
    }

    fn test_begun(&mut self, test: &Test, number: usize, of: usize) {
        self.0.test_begun(&TestFacts {
            test: test.id.clone(),
            title: test.title.clone(),
            why: test.why.clone(),
            number,
            of,
        });
    }

    fn test_ended(&mut self, result: &TestResult) {
        let verdict = result.verdict.unwrap_or(Verdict::Error);
        self.0.found(found_in(result));
        self.0.test_ended(&result.id, verdict, result.reason.as_deref());
    }

    fn note(&mut self, text: &str) {
        self.0.note(text);
    }

    fn left(&mut self, left: Duration) {
        self.0.left(left);
    }

    fn expects_device(&mut self, bench: &BenchInfo) {
        self.0.expects(&bench.device_url);
    }
}

/// Tells the page of questions, and of their answers.
pub(super) fn follower(page: Page) -> Follower {
    let answered = page.clone();
    Follower {
        asked: Box::new(move |question| {
            page.asked(&Prompt {
                number: question.number,
                step: question.step.clone(),
                text: question.text.clone(),
                seconds: question.seconds_left,
            });
        }),
        answered: Box::new(move |number, reply| {
            let from = reply.from.map_or_else(String::new, |place| format!(", {place}"));
            answered.answered(number, &format!("{}{from}", reply.answer.word()));
        }),
    }
}

/// The broker that is used, in words.
pub(super) fn broker(effective: &Effective) -> String {
    match &effective.profile.bench.broker {
        Some(url) => Secrets::default().out_of(url),
        None => "the built-in one".to_owned(),
    }
}

/// Why `--page` makes no sense in virtual time.
pub(super) fn in_virtual_time() -> Problem {
    let title = "a run in virtual time is over before anybody has opened a page";
    Diagnostic::whole("usage", title)
        .hint("leave one of --page and --virtual out; `--reference` tests the built-in device in real time")
        .into()
}

/// Shows the page what is recorded: messages, connections, and where the vehicle is.
pub(super) fn onlooker(page: Page, role: Role, pack: Arc<Pack>) -> Onlooker {
    Box::new(move |entry| {
        let (Event::Sent { topic, .. } | Event::Message { topic, .. }) = entry.event() else {
            page.saw(entry, None);
            return;
        };
        let name = topic.rsplit('/').next().unwrap_or(topic);
        let way = pack.topic(name).map(|rule| {
            if rule.publisher == role {
                Way::FromDevice
            } else {
                Way::ToDevice
            }
        });
        page.saw(entry, way.map(|way| (topic.as_str(), way)));
        if role != Role::Agv {
            return;
        }
        match entry.view(Topic::of_name(name), pack.names()) {
            Some(MessageView::State(state)) => page.vehicle(on_floor(state)),
            Some(MessageView::Connection(said)) => {
                if let Some(word) = said.connection_state.text() {
                    page.connection(word);
                }
            }
            _ => {}
        }
    })
}

fn on_floor(state: &StateView) -> VehicleOnFloor {
    let text = |text: Option<&str>| text.filter(|text| !text.is_empty()).map(str::to_owned);
    let spot = state.spot();
    let nodes = state.node_states.iter().map(|node| RoutePart {
        id: node.node_id.or_empty().to_owned(),
        released: node.released.is(true),
    });
    let edges = state.edge_states.iter().map(|edge| RoutePart {
        id: edge.edge_id.or_empty().to_owned(),
        released: edge.released.is(true),
    });
    VehicleOnFloor {
        x: spot.as_ref().map(|spot| spot.x),
        y: spot.as_ref().map(|spot| spot.y),
        theta: state.pose().map(|pose| pose.theta),
        map: spot.and_then(|spot| text(Some(spot.map_id.as_str()))),
        last_node: text(state.last_node_id.text()),
        order: text(state.order_id.text()),
        driving: state.driving.flag(),
        nodes: nodes.collect(),
        edges: edges.collect(),
    }
}

/// What each requirement asks, in the words of the version that the run is about.
pub(super) fn asks(catalogue: &Catalogue, pack: &Pack) -> BTreeMap<String, String> {
    let all = catalogue.all();
    all.map(|one| (one.id.as_str().to_owned(), one.edition(pack).text.clone()))
        .collect()
}

/// How often a person is asked in each test that is selected.
pub(super) fn prompts(request: &Request, profile: &Profile) -> BTreeMap<String, u64> {
    let of = |test: &Test| tck_run::prompts(test, &profile.hooks) as u64 * u64::from(request.repeat);
    let all = request.tests.iter().map(|test| (test.id.clone(), of(test)));
    all.filter(|(_, prompts)| *prompts > 0).collect()
}

/// A layout as the page draws it.
pub(super) fn floor(layout: &Layout) -> Floor {
    let nodes = layout.nodes().map(|node| FloorNode {
        id: node.id.clone(),
        x: node.x,
        y: node.y,
        map: node.map_id.clone(),
        station: node.station,
    });
    let edges = layout.edges().map(|edge| FloorEdge {
        id: edge.id.clone(),
        start: edge.start.clone(),
        end: edge.end.clone(),
        line: layout.line(edge),
    });
    Floor {
        nodes: nodes.collect(),
        edges: edges.collect(),
    }
}

/// What tests and monitors of a run have found, as far as it is known.
pub(super) fn findings_of(result: &RunResult) -> Vec<Finding> {
    let of_monitors = result.monitors.iter().flat_map(|monitor| {
        monitor.findings.iter().map(|finding| Finding {
            requirement: finding.requirement.clone(),
            verdict: finding.verdict,
            by: monitor.id.clone(),
            message: finding.message.clone(),
            record: finding.first.first().copied(),
            count: finding.count,
        })
    });
    result.tests.iter().flat_map(found_in).chain(of_monitors).collect()
}

/// What a test has found. One that was never begun is among those that are left out.
pub(super) fn found_in(test: &TestResult) -> Vec<Finding> {
    let mut all: Vec<Finding> = Vec::new();
    let is_known = test.journal.is_some();
    let found = test
        .decisions
        .iter()
        .filter(|decision| is_known && decision.verdict() > Verdict::Pass);
    for decision in found {
        let verdict = decision.verdict();
        let mut told = all.iter_mut();
        // What leaves several requirements undecided is said once.
        if let Some(told) = told.find(|told| told.verdict == verdict && told.message == decision.message) {
            told.requirement.push_str(", ");
            told.requirement.push_str(&decision.requirement);
            continue;
        }
        all.push(Finding {
            requirement: decision.requirement.clone(),
            verdict,
            by: test.id.clone(),
            message: decision.message.clone(),
            record: decision.witness,
            count: 1,
        });
    }
    all
}
