//! What actions do: their stages, their effect on the vehicle, and how a failure is reported (sections 6.8.2, 6.9 and
//! 7.1).
//!
//! lastNodeId of initPosition goes to the root of the state (the ruling of ACT-24), and a pose on no map or an unknown
//! one is refused (that of ACT-25). A failed action is named by its actionId (that of BP-03), an instant action that
//! cannot be performed is FAILED with an error (that of IACT-06), and a map that was deleted before cannot be deleted
//! (that of MAP-33).

use std::f64::consts::PI;
use std::time::Duration;

use super::Agv;
use super::action_kinds::{ActionKind, Effect};
use super::actions::{Action, Origin, Status};
use super::errors::{ActiveError, Life};
use super::hook_points::{Event, Permission, Span};
use super::motion::Pose;

/// Coordinates beyond this are no place on any map of the site, in metres.
const FARTHEST: f64 = 10_000.0;

/// Kind of problem with an action, and so the error it raises.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Area {
    InstantAction,
    Map,
    DuplicateMap,
    ZoneSet,
    DuplicateZoneSet,
    Localization,
    Load,
    Charging,
}

/// Why an action failed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Problem {
    pub(crate) area: Area,
    pub(crate) reason: String,
    pub(crate) references: Vec<(String, String)>,
}

impl Problem {
    /// A problem with an action.
    pub(crate) fn new(area: Area, action: &Action, reason: &str) -> Self {
        let reference = |key: &str, value: &str| (key.to_owned(), value.to_owned());
        let references = vec![
            reference("actionId", &action.request.id),
            reference("actionType", &action.request.action_type),
        ];
        Self {
            area,
            reason: reason.to_owned(),
            references,
        }
    }

    /// A problem with the map an action is about.
    pub(crate) fn map(action: &Action, reason: &str) -> Self {
        let mut problem = Self::new(Area::Map, action, reason);
        for key in ["mapId", "mapVersion"] {
            problem.references.push((key.to_owned(), action.text(key).to_owned()));
        }
        problem
    }

    /// A map that is on board already.
    pub(crate) fn duplicate_map(action: &Action, reason: &str) -> Self {
        Self {
            area: Area::DuplicateMap,
            ..Self::map(action, reason)
        }
    }

    /// A problem with the zone set an action is about.
    pub(crate) fn zone_set(action: &Action, reason: &str) -> Self {
        let mut problem = Self::new(Area::ZoneSet, action, reason);
        let named = ("zoneSetId".to_owned(), action.text("zoneSetId").to_owned());
        problem.references.push(named);
        problem
    }

    /// A zone set that is on board already.
    pub(crate) fn duplicate_zone_set(action: &Action, reason: &str) -> Self {
        Self {
            area: Area::DuplicateZoneSet,
            ..Self::zone_set(action, reason)
        }
    }

    /// An instant action that cannot be performed.
    pub(crate) fn unable(action: &Action, reason: &str) -> Self {
        Self::new(Area::InstantAction, action, reason)
    }
}

/// Result of the effect of an action.
pub(crate) enum Outcome {
    Done(Option<String>),
    Failed(Problem),
    /// Something else ends the action.
    Open,
}

impl From<Result<(), Problem>> for Outcome {
    fn from(result: Result<(), Problem>) -> Self {
        result.map_or_else(Self::Failed, |()| Self::Done(None))
    }
}

impl Agv {
    /// An action of the order begins, with its preparation if it has one (ASTATE-03).
    pub(crate) fn begin_action(&mut self, id: &str) {
        let Some(action) = self.actions.get(id).filter(|action| action.status == Status::Waiting) else {
            return;
        };
        let prepares = action.kind.map(|kind| self.allows(Permission::Prepare, kind.prepares));
        let due = self.moment() + self.lasts(Span::Action(action), self.working_time(action)) / 3;
        match (prepares, self.actions.get_mut(id)) {
            (Some(true), Some(action)) => {
                action.status = Status::Initializing;
                action.due = Some(due);
            }
            (Some(false), _) => self.run_action(id),
            (None, Some(action)) => action.end(Status::Failed),
            _ => {}
        }
    }

    /// An action does its work now.
    pub(crate) fn run_action(&mut self, id: &str) {
        let Some(lasts) = self.actions.get(id).map(|action| self.duration_of(action)) else {
            return;
        };
        let moment = self.moment();
        if let Some(action) = self.actions.get_mut(id) {
            action.status = Status::Running;
            action.due = (lasts < Duration::MAX).then(|| moment + lasts);
        }
    }

    /// How long an action runs; something else ends what waits for a trigger, or for the end of an edge.
    fn duration_of(&self, action: &Action) -> Duration {
        let endless = |kind: &ActionKind| matches!(kind.effect, Effect::WaitForTrigger | Effect::WarningLights);
        let usual = match action.kind.is_some_and(endless) {
            true => Duration::MAX,
            false => self.working_time(action),
        };
        self.lasts(Span::Action(action), usual)
    }

    /// As long as the action asks for, or as actions of its type take.
    fn working_time(&self, action: &Action) -> Duration {
        let asked = action.number("duration");
        match asked.filter(|seconds| (0.0..=86_400.0).contains(seconds)) {
            Some(seconds) => Duration::from_secs_f64(seconds),
            None => {
                let by_type = self.config.action_durations.get(&action.request.action_type);
                by_type.copied().unwrap_or(self.config.action_duration)
            }
        }
    }

    /// A stage of an action has ended.
    pub(crate) fn stage_finished(&mut self, id: &str) {
        let proceeds = self
            .actions
            .get(id)
            .map(|action| self.allows(Permission::Proceed(action), true));
        let Some(action) = self.actions.get_mut(id) else { return };
        action.due = None;
        if proceeds != Some(true) {
            return;
        }
        let fetches = |kind: &ActionKind| {
            matches!(
                kind.effect,
                Effect::DownloadMap | Effect::DownloadZoneSet | Effect::UpdateCertificate
            )
        };
        if action.kind.is_some_and(fetches) {
            self.download_failed(id, "the server did not deliver in time");
            return;
        }
        match action.status {
            Status::Initializing => self.run_action(id),
            Status::Running => self.complete(id),
            _ => {}
        }
    }

    /// An action has worked for as long as it takes: its effect shows.
    pub(crate) fn complete(&mut self, id: &str) {
        let Some(action) = self.actions.get(id).cloned() else {
            return;
        };
        let outcome = match self.does(&action) {
            Some(outcome) => outcome,
            None => {
                let outcome = self.effect(&action);
                self.ends(&action, outcome)
            }
        };
        self.conclude(id, outcome);
    }

    /// An action comes to this.
    pub(crate) fn conclude(&mut self, id: &str, outcome: Outcome) {
        match outcome {
            Outcome::Done(result) => self.finish(id, result),
            Outcome::Failed(problem) => self.fail(id, &problem),
            Outcome::Open => {}
        }
    }

    /// Ends an action with success.
    pub(crate) fn finish(&mut self, id: &str, result: Option<String>) {
        if let Some(action) = self.actions.get_mut(id) {
            action.end(Status::Finished);
            action.result = result;
        }
    }

    /// Ends an action without success, and says why (IACT-06, BP-03).
    pub(crate) fn fail(&mut self, id: &str, problem: &Problem) {
        let tried_again = |action: &Action| action.request.retriable && action.status == Status::Running;
        let retriable = self.config.has("retry") && self.actions.get(id).is_some_and(tried_again);
        match self.actions.get_mut(id).filter(|_| retriable) {
            Some(action) => action.end(Status::Retriable),
            None => self.end_failed(id),
        }
        self.report_failure(id, problem);
    }

    /// An action waits until it is decided whether it is tried again.
    pub(crate) fn waits_for_retry(&mut self, id: &str) {
        if let Some(action) = self.actions.get_mut(id) {
            action.end(Status::Retriable);
        }
    }

    /// Ends an action without success.
    pub(crate) fn end_failed(&mut self, id: &str) {
        if let Some(action) = self.actions.get_mut(id) {
            action.end(Status::Failed);
        }
    }

    fn report_failure(&mut self, id: &str, problem: &Problem) {
        let names = &self.config.errors;
        let name = match problem.area {
            Area::InstantAction => &names.instant_action,
            Area::Map => &names.map,
            Area::DuplicateMap => &names.duplicate_map,
            Area::ZoneSet => &names.zone_set,
            Area::DuplicateZoneSet => &names.duplicate_zone_set,
            Area::Localization => &names.localization,
            Area::Load => &names.load,
            Area::Charging => &names.charging,
        };
        // A version that has an error for instant actions has it for all that cannot be performed.
        let is_instant = self.actions.get(id).is_some_and(|action| !action.of_order());
        let name = match is_instant && self.config.error_rules.contains_key(&names.instant_action) {
            true if !matches!(problem.area, Area::DuplicateMap | Area::DuplicateZoneSet) => &names.instant_action,
            _ => name,
        };
        let lasts = match problem.area {
            Area::DuplicateZoneSet => self.time_to_notice(),
            _ => self.config.error_duration,
        };
        let error = ActiveError {
            error_type: name.clone(),
            fatal: false,
            references: problem.references.clone(),
            description: problem.reason.clone(),
            life: Life::Until(self.moment() + lasts),
        };
        let action = self.actions.get(id).cloned();
        self.raise_failure(action.as_ref(), error);
    }

    fn effect(&mut self, action: &Action) -> Outcome {
        let Some(kind) = action.kind else { return Outcome::Open };
        match kind.effect {
            Effect::StartPause => self.start_pause(action),
            Effect::StopPause => self.stop_pause(action),
            Effect::StartCharging => self.start_charging(action).into(),
            Effect::StopCharging => self.stop_charging(action).into(),
            Effect::InitPosition => self.init_position(action).into(),
            Effect::EnableMap => {
                let result = self.maps.enable(action.text("mapId"), action.text("mapVersion"));
                result.map_err(|reason| Problem::map(action, reason)).into()
            }
            Effect::DeleteMap => self.delete_map(action).into(),
            Effect::EnableZoneSet => self.enable_zone_set(action).into(),
            Effect::DeleteZoneSet => self.delete_zone_set(action).into(),
            Effect::StateRequest => {
                self.report.requested = true;
                Outcome::Done(None)
            }
            Effect::LogReport => {
                self.logs += 1;
                let name = format!("log-{}.txt", self.logs);
                Outcome::Done(Some(name))
            }
            Effect::Pick => self.pick(action).into(),
            Effect::Drop => self.put_down(action).into(),
            Effect::DetectObject => self.detect(action),
            Effect::FinePositioning => self.align(action).into(),
            Effect::FactsheetRequest => {
                self.connection.factsheet_asked = true;
                self.publish_factsheet();
                self.connection.factsheet_asked = false;
                Outcome::Done(None)
            }
            Effect::Trigger => self.trigger_by_fleet(action),
            Effect::StartHibernation => self.start_hibernation(action),
            Effect::StopHibernation => self.stop_hibernation(action),
            Effect::Shutdown => self.shutdown_asked(action),
            Effect::UpdateCertificate => self.update_certificate(action),
            Effect::WaitForTrigger | Effect::WarningLights | Effect::Beep | Effect::Calibrate => Outcome::Done(None),
            Effect::CancelOrder => {
                self.cancel_order(&action.request.id);
                Outcome::Open
            }
            Effect::DownloadMap => self.begin_download(&action.request.id),
            Effect::DownloadZoneSet => self.begin_zone_set_download(action),
            Effect::ClearZoneActions => {
                let stays = |action: &Action| !action.of_zone() || !action.status.is_terminal();
                self.actions.retain(stays);
                Outcome::Done(None)
            }
            Effect::ClearInstantActions => {
                let stays = |action: &Action| action.origin != Origin::Instant || !action.status.is_terminal();
                self.actions.retain(stays);
                Outcome::Done(None)
            }
            Effect::Retry => self.decide_retriable(action, Status::Running),
            Effect::SkipRetry => self.decide_retriable(action, Status::Failed),
        }
    }

    /// Fleet control says what becomes of an action that may be tried again.
    fn decide_retriable(&mut self, action: &Action, becomes: Status) -> Outcome {
        let id = action.text("actionId").to_owned();
        if self
            .actions
            .get(&id)
            .is_none_or(|named| named.status != Status::Retriable)
        {
            return Outcome::Failed(Problem::unable(action, "no such action waits for a retry"));
        }
        match becomes {
            Status::Failed => self.end_failed(&id),
            _ => self.run_action(&id),
        }
        Outcome::Done(None)
    }

    /// Whether a switch forbids what a message asks for (ACT-16).
    fn is_pause_blocked(&self) -> bool {
        self.allows(Permission::HeedSwitch, self.pause_blocked)
    }

    fn start_pause(&mut self, action: &Action) -> Outcome {
        if self.is_pause_blocked() {
            return Outcome::Failed(Problem::unable(action, "a switch keeps the vehicle from pausing"));
        }
        self.set_holds(|holds| holds.pause = true);
        Outcome::Done(None)
    }

    /// A pause made with the button is lifted with the button (ACT-16).
    fn stop_pause(&mut self, action: &Action) -> Outcome {
        if self.is_pause_blocked() {
            return Outcome::Failed(Problem::unable(action, "a switch keeps the vehicle paused"));
        }
        if self.allows(Permission::HeedSwitch, self.holds.button || self.holds.emergency) {
            return Outcome::Failed(Problem::unable(action, "the vehicle is stopped by hand"));
        }
        self.set_holds(|holds| holds.pause = false);
        Outcome::Done(None)
    }

    /// Changes what holds the vehicle; actions are held and go on with it (ACT-15, ACT-18).
    pub(crate) fn set_holds(&mut self, change: impl FnOnce(&mut super::Holds)) {
        let before = self.holds;
        change(&mut self.holds);
        let moment = self.moment();
        match (before.any(), self.holds.any()) {
            (false, true) if self.allows(Permission::HoldActions, true) => {
                self.actions.hold(moment);
                self.happens(Event::Held);
            }
            (true, false) => {
                self.happens(Event::Resuming);
                if self.allows(Permission::ResumeActions(before), true) {
                    self.actions.resume(moment);
                }
            }
            _ => {}
        }
    }

    /// Finds itself where it is told that it is (ACT-23, ACT-24), if that can be (ACT-25).
    pub(crate) fn init_position(&mut self, action: &Action) -> Result<(), Problem> {
        let invalid = |reason: &str| Err(Problem::new(Area::Localization, action, reason));
        let number = |key: &str| action.number(key).filter(|number| number.is_finite());
        let (Some(x), Some(y), Some(theta)) = (number("x"), number("y"), number("theta")) else {
            return invalid("the pose is not complete");
        };
        if x.abs() > FARTHEST || y.abs() > FARTHEST || theta.abs() > PI + 0.01 {
            return invalid("the pose is on no map");
        }
        let map_id = action.text("mapId");
        if !self.maps.on_board(map_id) {
            return invalid("the map is not on board");
        }
        if action.origin == Origin::Instant && (!self.order.nodes.is_empty() || self.actions.order_unfinished()) {
            return invalid("an order is active");
        }
        let pose = Pose {
            x,
            y,
            theta: theta.clamp(-PI, PI),
            map_id: map_id.to_owned(),
        };
        self.take_pose(pose, action.text("lastNodeId"));
        Ok(())
    }

    /// Takes a pose over, and the node it is on.
    pub(crate) fn take_pose(&mut self, pose: Pose, node: &str) {
        self.happens(Event::Placed);
        self.find_position();
        self.maps.enable_any(&pose.map_id);
        self.motion.place(pose);
        node.clone_into(&mut self.order.last_node);
    }

    /// Deletes a map that is not in use (MAP-29, MAP-32, MAP-33).
    pub(crate) fn delete_map(&mut self, action: &Action) -> Result<(), Problem> {
        let here = self.motion.pose(self.moment()).map_id;
        let needed: Vec<String> = self.order.nodes.iter().map(|stop| stop.place.map_id.clone()).collect();
        let used = |map_id: &str| here == map_id || needed.iter().any(|needed| needed == map_id);
        let result = self.maps.delete(action.text("mapId"), action.text("mapVersion"), used);
        result.map_err(|reason| Problem::map(action, reason))
    }
}
