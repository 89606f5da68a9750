//! `action`: the action sent under a name walks through these statuses.

use std::sync::Arc;

use super::{ClauseOutcome, Position, Progress, StepOutcome, Timing, backlog, bound_clauses, ids, limit, seconds};
use crate::eval_context::EvalContext;
use crate::limit::Limit;
use crate::repair::{StateRepair, is_lasting, status_meant};
use tck_base::clock::Moment;
use tck_base::diagnostic::Span;
use tck_journal::Entry;
use tck_journal::event::Waiver;
use tck_result::NearestMiss;
use tck_suite::model::{ActionWalk, Step, Walk};
use tck_view::{MessageView, Names, StateView, Topic};

/// The topic that reports action states.
const TOPIC: &str = "state";

pub(crate) struct Walking {
    verb: ActionWalk,
    span: Span,
    position: Position,
    id: String,
    limit: Limit,
    deadline: Moment,
    through: Track,
    tolerated: Option<Track>,
    walked: Vec<String>,
    last: Option<Arc<Entry>>,
    seen: u64,
    /// Actions that are known never to end, where nothing is decided.
    waivers: Vec<Waiver>,
    /// What the version calls the members of messages.
    names: Arc<Names>,
    /// What stands in the way of reading its status as it is.
    meant: Option<String>,
    /// It is one of them.
    lasting: bool,
}

/// Where on a walk an action can be.
struct Track {
    walk: Walk,
    /// Indices of the stations it may stand on; empty when it has left the walk.
    places: Vec<usize>,
    begun: bool,
}

impl Track {
    fn new(walk: &Walk) -> Self {
        Self {
            walk: walk.clone(),
            places: Vec::new(),
            begun: false,
        }
    }

    fn step(&mut self, status: &str) {
        let starts: Vec<usize> = if self.begun { self.places.clone() } else { vec![0] };
        let inclusive = !self.begun;
        self.begun = true;
        let mut next = Vec::new();
        for start in starts {
            let from = if inclusive { start } else { start + 1 };
            for at in from..self.walk.stations.len() {
                let station = &self.walk.stations[at];
                if station.statuses.iter().any(|allowed| allowed == status) && !next.contains(&at) {
                    next.push(at);
                }
                if !station.optional {
                    break;
                }
            }
        }
        self.places = next;
    }

    fn left(&self) -> bool {
        self.begun && self.places.is_empty()
    }

    fn done(&self) -> bool {
        self.places
            .iter()
            .any(|at| self.walk.stations[at + 1..].iter().all(|station| station.optional))
    }
}

impl Walking {
    pub(super) fn begin(
        verb: &ActionWalk,
        step: &Step,
        position: Position,
        scene: &EvalContext<'_>,
    ) -> Result<Self, String> {
        let name = &verb.name;
        let text = |what: &str| scene.bindings.get(&format!("{name}.{what}"));
        let id = text("id").and_then(|value| value.as_str().map(str::to_owned));
        let id = id.ok_or_else(|| format!("no action was sent as `{name}`"))?;
        let sent = text("sent")
            .and_then(serde_json::Value::as_u64)
            .unwrap_or(position.test);
        let limit = limit(&verb.within, scene)?;
        let mut this = Self {
            span: step.verb_span.clone(),
            position,
            id,
            limit,
            deadline: position.base + limit.hard,
            through: Track::new(&verb.through),
            tolerated: verb.tolerated.as_ref().map(Track::new),
            verb: verb.clone(),
            walked: Vec::new(),
            last: None,
            seen: 0,
            names: Arc::clone(scene.pack.names()),
            waivers: StateRepair::of(scene.waivers, TOPIC, &ids(&verb.checks)).into_waivers(),
            meant: None,
            lasting: false,
        };
        for entry in backlog(scene.timeline, TOPIC, sent) {
            this.look_at(&entry);
        }
        Ok(this)
    }

    pub(super) fn observe(&mut self, entry: &Arc<Entry>, subject: Option<&str>) {
        if subject == Some(TOPIC) {
            self.look_at(entry);
        }
    }

    fn look_at(&mut self, entry: &Arc<Entry>) {
        if self.decided() || entry.at().moment > self.deadline {
            return;
        }
        self.seen += 1;
        let names = Arc::clone(&self.names);
        let state = entry.view(Topic::State, &names).and_then(MessageView::state);
        let Some(action) = state.and_then(|state| state.action(&self.id)) else {
            return;
        };
        let status = action.action_status.text().unwrap_or("no status");
        if self.walked.last().is_some_and(|last| last == status) {
            return;
        }
        let mut shown = status.to_owned();
        shown.truncate(shown.char_indices().nth(40).map_or(shown.len(), |(at, _)| at));
        self.walked.push(shown);
        self.last = Some(Arc::clone(entry));
        let is_lasting = |state| is_lasting(state, &self.id, &self.waivers, &names);
        self.lasting = self.verb.checks.is_empty() && entry.json().is_some_and(is_lasting);
        let meant = status_meant(status, &self.waivers).map(|(meant, waiver)| (meant.to_owned(), waiver.why.clone()));
        let status = meant.as_ref().map_or(status, |(meant, _)| meant.as_str());
        self.through.step(status);
        if let Some(tolerated) = &mut self.tolerated {
            tolerated.step(status);
        }
        self.meant = meant.map(|(_, why)| why).or(self.meant.take());
    }

    /// What has become of the action, in words.
    fn became(&self) -> String {
        match self.walked.as_slice() {
            [] => "has shown no status".to_owned(),
            all => format!("became {}", all.join(", then ")),
        }
    }

    fn decided(&self) -> bool {
        let lost = self.through.left() && self.tolerated.as_ref().is_none_or(Track::left);
        self.through.done() || self.tolerated.as_ref().is_some_and(Track::done) || lost || self.lasting
    }

    #[expect(clippy::unnecessary_wraps, reason = "the other evaluators may have none")]
    pub(super) fn timing(&self) -> Option<Timing> {
        let (since, limit) = (self.position.base, self.limit.soft);
        match &self.last {
            Some(last) if self.decided() => {
                let at = last.at().moment;
                Some(Timing::Late { since, at, limit })
            }
            _ => Some(Timing::Missed(self.deadline)),
        }
    }

    pub(super) fn allowances(&self) -> Vec<String> {
        let told = format!("it is not waited for that this action ends, which {}", self.became());
        if self.lasting && !self.through.done() {
            vec![told]
        } else {
            self.meant.iter().cloned().collect()
        }
    }

    pub(super) fn progress(&self) -> Progress {
        if self.decided() {
            Progress::Decided
        } else {
            Progress::Pending(self.deadline)
        }
    }

    pub(super) fn end(self, at: Moment, cut_short: Option<&str>) -> StepOutcome {
        let seq = self.last.as_ref().map(|entry| entry.seq());
        let became = self.became();
        let waited = seconds(at.since(self.position.base));
        let arrived = self
            .last
            .as_ref()
            .map(|entry| entry.at().moment.since(self.position.base));
        // It stopped on its way, as opposed to walking another one.
        let stopped = !self.decided() && cut_short.is_none();
        let (holds, message) = if self.through.done() {
            match arrived.filter(|took| *took > self.limit.soft) {
                Some(took) => (
                    ClauseOutcome::HeldLate,
                    format!("the action {became}, after {}", seconds(took)),
                ),
                None => (ClauseOutcome::Held, format!("the action {became}")),
            }
        } else if self.lasting {
            (
                ClauseOutcome::Held,
                format!("the action {became}, and is known to go no further"),
            )
        } else if self.tolerated.as_ref().is_some_and(Track::done) {
            (
                ClauseOutcome::Warning,
                format!("the action {became}, which a ruling tolerates"),
            )
        } else if let (true, Some(meant)) = (self.decided(), &self.meant) {
            let why = format!("the action {became}, which cannot be told, since {meant}");
            (ClauseOutcome::Unobservable(why.clone()), why)
        } else if self.decided() {
            (ClauseOutcome::Violated, format!("the action {became}"))
        } else if let Some(why) = cut_short {
            (ClauseOutcome::Unobservable(why.to_owned()), why.to_owned())
        } else if self.walked.is_empty() {
            let message = format!(
                "the action never showed up in actionStates ({} states within {waited})",
                self.seen
            );
            (ClauseOutcome::Violated, message)
        } else {
            (
                ClauseOutcome::Violated,
                format!("the action {became} and went no further within {waited}"),
            )
        };
        let mut clauses = bound_clauses(&self.verb.checks, "checks", &self.span, &holds, seq, &message);
        for clause in &mut clauses {
            clause.label = format!("the action {became}");
            clause.expected = Some(format!("the action becomes {}", self.verb.through));
            clause.nearest = seq.filter(|_| stopped).map(|seq| NearestMiss {
                seq,
                path: self.names.name(StateView::action_states).unwrap_or_default().to_owned(),
                found: self.walked.join(", then "),
                expected: self.verb.through.to_string(),
            });
        }
        let message_json = self.last.as_ref().and_then(|entry| entry.json());
        let saves = self.verb.save.iter().filter_map(|(name, path)| {
            let value = path.of(message_json?, TOPIC, &self.names)?;
            Some((name.clone(), value.clone()))
        });
        let fine = matches!(
            holds,
            ClauseOutcome::Held | ClauseOutcome::HeldLate | ClauseOutcome::Warning
        );
        StepOutcome {
            reached: Some(if fine { Ok(()) } else { Err(message) }),
            took: seq,
            saves: saves.collect(),
            clauses,
            seen: self.seen,
            allowances: Vec::new(),
            timing: None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tck_suite::model::Station;

    fn walk(text: &str) -> Walk {
        let station = |part: &str| Station {
            optional: part.ends_with('?'),
            statuses: part
                .trim_end_matches('?')
                .split('|')
                .map(|one| one.trim().to_owned())
                .collect(),
        };
        Walk {
            stations: text.split("->").map(|part| station(part.trim())).collect(),
        }
    }

    fn track(text: &str, statuses: &[&str]) -> Track {
        let mut track = Track::new(&walk(text));
        for status in statuses {
            track.step(status);
        }
        track
    }

    #[test]
    fn optional_stations_may_be_skipped_and_others_not() {
        let text = "WAITING? -> INITIALIZING? -> RUNNING -> FINISHED | FAILED";
        assert!(track(text, &["RUNNING", "FINISHED"]).done());
        assert!(track(text, &["WAITING", "INITIALIZING", "RUNNING", "FAILED"]).done());
        assert!(track(text, &["WAITING", "FINISHED"]).left());
        assert!(!track(text, &["WAITING", "RUNNING"]).done());
        assert!(track(text, &["RUNNING", "WAITING"]).left());
    }

    #[test]
    fn a_walk_is_told_in_words() {
        let text = "WAITING? -> RUNNING -> FINISHED | FAILED";
        assert_eq!(
            walk(text).to_string(),
            "perhaps WAITING, then RUNNING, then FINISHED or FAILED"
        );
    }

    #[test]
    fn a_status_may_be_visited_twice_when_the_walk_says_so() {
        let text = "RUNNING -> PAUSED? -> RUNNING? -> FINISHED";
        assert!(track(text, &["RUNNING", "FINISHED"]).done());
        assert!(track(text, &["RUNNING", "PAUSED", "RUNNING", "FINISHED"]).done());
        assert!(track(text, &["RUNNING", "PAUSED", "FINISHED"]).done());
        assert!(track(text, &["PAUSED"]).left());
    }
}
