//! Always-on checks, judged on everything that happens in a run.
//!
//! A monitor's findings are kept once per requirement and verdict, with a count and the first occurrences,
//! not as noise in every test.

use std::collections::BTreeSet;
use std::sync::Arc;

use serde_json::Map;

use super::clause_outcome::unbound_text;
use super::decide::mood;
use super::hidden::Hidden;
use super::run_contexts::Ground;
use super::step::shown_path;
use tck_base::pattern::{Bindings, Bound, Pattern, Unbound};
use tck_base::time::TimeLimits;
use tck_base::verdict::{Accumulated, Verdict};
use tck_check::{CheckContext, CheckFinding, Running, Shared, find};
use tck_journal::Entry;
use tck_journal::event::Event;
use tck_result::{MonitorFinding, MonitorResult};
use tck_suite::model::{Monitor, Need, Recordings, Rule};
use tck_suite::spelled;
use tck_view::Topic;
use tck_world::{End, Listen, Listens, Observation, World};

/// How many occurrences of a finding are kept by number.
pub(super) const FIRST: usize = 5;
/// How many elements that do not show themselves are told apart in a test.
const ELEMENTS: usize = 4096;
/// How many different findings a monitor keeps.
const DIFFERENT: usize = 64;

/// A monitor on duty.
pub struct MonitorJudge {
    monitor: Arc<Monitor>,
    rule: Watching,
    judged: u64,
    /// The requirements it is bound to that this version has.
    owed: Vec<String>,
    /// What requirements are about, and has not come by yet.
    unseen: Vec<Awaited>,
    findings: Vec<MonitorFinding>,
    /// Why it cannot be judged, though it should be: a variable without a value.
    open: Option<String>,
    /// What fails since the running test began.
    broken: Option<Broken>,
    /// The requirement of the first fail of the run.
    accuses: Option<String>,
    /// Whether findings that say different things are kept apart: they are taken after each entry.
    apart: bool,
}

/// What a monitor that hides members has failed in a test.
struct Broken {
    /// The first requirement.
    requirement: String,
    /// The entry that showed it first.
    seq: u64,
    /// The elements that all of it is about; `None` when it is about more than those, or nobody knows.
    elements: Option<BTreeSet<String>>,
}

impl Broken {
    /// Takes in a further finding.
    fn also(&mut self, element: Option<&String>) {
        match (&mut self.elements, element) {
            (Some(elements), Some(element)) if elements.len() < ELEMENTS => {
                elements.insert(element.clone());
            }
            _ => self.elements = None,
        }
    }
}

/// A message without which nothing is known of a requirement.
struct Awaited {
    requirement: String,
    topic: String,
    pattern: Bound,
}

/// What the monitors of one vehicle know together.
#[derive(Debug, Default)]
pub struct Knowledge {
    /// The facts.
    pub world: World,
    /// What several of them work out once.
    pub shared: Shared,
}

enum Watching {
    Pattern {
        topic: String,
        when: Option<Bound>,
        pattern: Bound,
        forbidden: bool,
    },
    Check {
        running: Box<dyn Running>,
        listens: Listens,
        with: Map<String, serde_json::Value>,
        /// The limits, where the monitor has some of its own.
        time: Option<Box<TimeLimits>>,
    },
    /// Something it needs is not there: judges nothing.
    Off,
}

impl MonitorJudge {
    /// Puts a monitor on duty; `None` when it is not meant for this version.
    pub fn start(
        monitor: &Arc<Monitor>,
        ground: &Ground,
        bindings: &Bindings,
        tap: bool,
        known: &mut Knowledge,
    ) -> Option<Self> {
        let bound = monitor.checks.iter().map(|binding| binding.requirement.as_str());
        let owed = bound.filter(|id| mood(&ground.catalogue, &ground.pack, id).is_some());
        let owed: Vec<String> = owed.map(str::to_owned).collect();
        if !monitor.spec.contains(ground.pack.version) || owed.is_empty() {
            return None;
        }
        let mut open = None;
        let rule = if monitor.needs.contains(&Need::Tap) && !tap {
            Watching::Off
        } else {
            Self::watch(&monitor.rule, ground, bindings, known).unwrap_or_else(|unbound| {
                open = Some(unbound_text(&unbound));
                Watching::Off
            })
        };
        let about = monitor.about.iter().filter_map(|about| {
            Some(Awaited {
                requirement: about.requirement.requirement.as_str().to_owned(),
                topic: about.topic.clone(),
                pattern: spelled(&about.pattern, ground.pack.names(), &about.topic)
                    .bind(bindings)
                    .ok()?,
            })
        });
        Some(Self {
            unseen: about.collect(),
            owed,
            open,
            monitor: Arc::clone(monitor),
            rule,
            judged: 0,
            findings: Vec::new(),
            broken: None,
            accuses: None,
            apart: false,
        })
    }

    /// From now on findings that say different things are kept apart, where each message is judged by itself: what is wrong with it
    /// is named at once. What one message shows beside others is one mistake, however it is said.
    pub(super) fn keep_apart(&mut self) {
        self.apart = matches!(
            self.monitor.recordings,
            Recordings::Message | Recordings::MessageAndFactsheet
        );
    }

    fn watch(rule: &Rule, ground: &Ground, bindings: &Bindings, known: &mut Knowledge) -> Result<Watching, Unbound> {
        let bind = |pattern: &Pattern, topic: &str| spelled(pattern, ground.pack.names(), topic).bind(bindings);
        Ok(match rule {
            Rule::Always { topic, when, pattern } => Watching::Pattern {
                topic: topic.clone(),
                when: when.as_ref().map(|when| bind(when, topic)).transpose()?,
                pattern: bind(pattern, topic)?,
                forbidden: false,
            },
            Rule::Never { topic, pattern } => Watching::Pattern {
                topic: topic.clone(),
                when: None,
                pattern: bind(pattern, topic)?,
                forbidden: true,
            },
            Rule::Check(check) => {
                let Some(definition) = find(ground.checks, &check.name) else {
                    return Ok(Watching::Off);
                };
                let mut with = Map::new();
                for (name, term) in &check.with {
                    with.insert(name.clone(), term.bind(bindings)?);
                }
                known.world.reads(definition.reads);
                let time = ground.time.with_own(&with).map(Box::new);
                Watching::Check {
                    running: (definition.start)(&context(ground, &with, time.as_deref(), known)),
                    listens: Listens::to(definition.listens),
                    with,
                    time,
                }
            }
        })
    }

    /// The kinds of records it has to be shown: what its rule is about, and what it awaits.
    pub(super) fn listens(&self) -> Listens {
        let rule = match &self.rule {
            Watching::Pattern { topic, .. } => of_subject(topic),
            Watching::Check { listens, .. } => *listens,
            Watching::Off => Listens::default(),
        };
        let awaited = self.unseen.iter().map(|awaited| of_subject(&awaited.topic));
        awaited.fold(rule, Listens::and)
    }

    /// A test begins.
    pub(super) fn test_begins(&mut self) {
        self.broken = None;
    }

    /// Shows it one record, and says whether it found something.
    pub fn observe(
        &mut self,
        record: &Observation<'_>,
        subject: Option<&str>,
        ground: &Ground,
        known: &Knowledge,
    ) -> bool {
        let entry = record.entry;
        self.see(entry, subject);
        let mut found = Vec::new();
        match &mut self.rule {
            Watching::Off => {}
            Watching::Check {
                running,
                listens,
                with,
                time,
            } => {
                if !listens.hears(record.kind()) {
                    return false;
                }
                let context = context(ground, with, time.as_deref(), known);
                if running.observe(record, &context, &mut found) {
                    self.judged += 1;
                }
            }
            Watching::Pattern {
                topic,
                when,
                pattern,
                forbidden,
            } => {
                // What was stored before the run is not this run's evidence.
                let stale = matches!(entry.event(), Event::Message { retain: true, .. });
                if subject != Some(topic.as_str()) || stale {
                    return false;
                }
                let Some(message) = entry.subject() else {
                    return false;
                };
                if when.as_ref().is_some_and(|when| !when.matches(&message, None)) {
                    return false;
                }
                self.judged += 1;
                if pattern.matches(&message, None) == *forbidden {
                    found.push(CheckFinding {
                        requirement: None,
                        verdict: None,
                        seq: entry.seq(),
                        message: miss(pattern, &message, *forbidden),
                        element: None,
                    });
                }
            }
        }
        let has_found = !found.is_empty();
        self.keep(found, ground);
        has_found
    }

    /// Notes what came by of what requirements are about.
    fn see(&mut self, entry: &Entry, subject: Option<&str>) {
        let (false, Some(subject)) = (self.unseen.is_empty(), subject) else {
            return;
        };
        if matches!(entry.event(), Event::Message { retain: true, .. }) {
            return;
        }
        let Some(message) = entry.subject() else { return };
        self.unseen
            .retain(|awaited| awaited.topic != subject || !awaited.pattern.matches(&message, None));
    }

    /// The requirements of this version that it is bound to and had something to judge of.
    pub(super) fn judged(&self) -> Vec<String> {
        if self.judged == 0 {
            return Vec::new();
        }
        let is_seen = |id: &&String| !self.unseen.iter().any(|awaited| awaited.requirement == **id);
        self.owed.iter().filter(is_seen).cloned().collect()
    }

    /// Takes what was found since it was taken last.
    pub(super) fn take(&mut self) -> Vec<MonitorFinding> {
        std::mem::take(&mut self.findings)
    }

    /// Why nothing of it can be judged, though it should be.
    pub(super) fn open(&self) -> Option<&str> {
        self.open.as_deref()
    }

    /// The run has ended.
    pub fn finish(&mut self, end: &End, ground: &Ground, known: &Knowledge) {
        let mut found = Vec::new();
        if let Watching::Check {
            running, with, time, ..
        } = &mut self.rule
        {
            running.finish(end, &context(ground, with, time.as_deref(), known), &mut found);
        }
        self.keep(found, ground);
    }

    fn keep(&mut self, found: Vec<CheckFinding>, ground: &Ground) {
        for finding in found {
            let own = || self.monitor.checks.first().map(|binding| &binding.requirement);
            let id = match (&finding.requirement, &self.monitor.instead_of) {
                (Some(id), Some(replaced)) if *id != replaced.requirement => continue,
                (_, Some(_)) | (None, None) => own(),
                (Some(id), None) => Some(id),
            };
            let Some(id) = id else { continue };
            let Some((requirement, mood)) = mood(&ground.catalogue, &ground.pack, id.as_str()) else {
                continue;
            };
            let verdict = finding.verdict.unwrap_or_else(|| mood.broken());
            if verdict == Verdict::Pass {
                continue;
            }
            let (verdict, message) = match &ground.interference {
                Some(why) if verdict == Verdict::Fail || ground.is_interrupted => (
                    Verdict::Inconclusive,
                    format!("cannot be told, since {why}; {}", finding.message),
                ),
                _ => (verdict, finding.message),
            };
            if verdict == Verdict::Fail && !self.monitor.hides.is_empty() {
                let broken = self.broken.get_or_insert_with(|| Broken {
                    requirement: id.as_str().to_owned(),
                    seq: finding.seq,
                    elements: Some(BTreeSet::new()),
                });
                broken.also(finding.element.as_ref());
                self.accuses.get_or_insert_with(|| id.as_str().to_owned());
            }
            let is_full = self.findings.len() >= DIFFERENT;
            let is_apart = self.apart && !is_full;
            let known = self.findings.iter_mut().find(|known| {
                known.requirement == id.as_str() && known.verdict == verdict && (!is_apart || known.message == message)
            });
            if let Some(known) = known {
                known.count += 1;
                if known.first.len() < FIRST && !known.first.contains(&finding.seq) {
                    known.first.push(finding.seq);
                }
            // No requirement goes without a word because another one is broken in many ways.
            } else if !is_full || self.apart {
                self.findings.push(MonitorFinding {
                    requirement: id.as_str().to_owned(),
                    verdict,
                    count: 1,
                    first: vec![finding.seq],
                    message,
                    interpretation: requirement.interpretation.clone(),
                });
            }
        }
    }

    /// How many entries it has judged.
    pub(super) fn count(&self) -> u64 {
        self.judged
    }

    /// What it has to say.
    pub fn result(&self) -> MonitorResult {
        let mut verdict: Accumulated = self.findings.iter().map(|finding| finding.verdict).collect();
        if self.judged > 0 {
            verdict.add(Verdict::Pass);
        }
        if self.open.is_some() {
            verdict.add(Verdict::Inconclusive);
        }
        MonitorResult {
            id: self.monitor.id.clone(),
            title: self.monitor.title.clone(),
            verdict: verdict.get(),
            judged: self.judged,
            findings: self.findings.clone(),
        }
    }

    /// What shows nothing in the running test for what was found in it.
    pub(super) fn hidden(&self) -> Vec<Hidden> {
        let Some(broken) = &self.broken else {
            return Vec::new();
        };
        let decides = self.monitor.checks.iter();
        let decides: Vec<String> = decides.map(|binding| binding.requirement.as_str().to_owned()).collect();
        let members = self.monitor.hides.iter();
        members
            .map(|member| Hidden {
                member: member.clone(),
                monitor: self.monitor.id.clone(),
                requirement: broken.requirement.clone(),
                decides: decides.clone(),
                seq: broken.seq,
                lasting: false,
                elements: broken.elements.clone(),
            })
            .collect()
    }

    /// The members that show nothing for what was found in this run, with the requirement.
    pub(super) fn accused(&self) -> Vec<(String, String)> {
        let Some(requirement) = &self.accuses else {
            return Vec::new();
        };
        let members = self.monitor.hides.iter();
        members.map(|member| (member.clone(), requirement.clone())).collect()
    }

    /// The monitor.
    pub fn monitor(&self) -> &Arc<Monitor> {
        &self.monitor
    }
}

/// The kinds of records with this subject that are not stale.
fn of_subject(subject: &str) -> Listens {
    if subject.contains(['/', '@']) {
        return Listens::to(&[Listen::Everything]);
    }
    let topic = Topic::of_name(subject);
    Listens::to(&[Listen::Delivered(topic), Listen::Sent(topic)])
}

fn miss(pattern: &Bound, message: &serde_json::Value, forbidden: bool) -> String {
    if forbidden {
        return format!("{}, which must not be", pattern.conditions());
    }
    match pattern.examine(message, None).misses.first() {
        Some(miss) => format!(
            "{} is {}, expected {}",
            shown_path(&miss.path),
            miss.found,
            miss.expected
        ),
        None => format!("it does not show that {}", pattern.conditions()),
    }
}

fn context<'a>(
    ground: &'a Ground,
    with: &'a Map<String, serde_json::Value>,
    time: Option<&'a TimeLimits>,
    known: &'a Knowledge,
) -> CheckContext<'a> {
    let mut setting = ground.setting();
    setting.time = time.unwrap_or(setting.time);
    CheckContext {
        setting,
        with,
        world: &known.world,
        shared: &known.shared,
    }
}
