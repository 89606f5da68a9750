//! What actions do: their stages, their effect on the vehicle, and how a failure is reported.

use std::f64::consts::PI;
use std::time::Duration;

use super::Agv;
use super::action_kinds::Deed;
use super::actions::{Action, Origin, Status};
use super::faults::FaultName as F;
use super::motion::Pose;
use super::order_message::Blocking;
use super::tolerances::ToleranceName as T;

/// Coordinates beyond this are no place on any map of the site, in metres.
const FARTHEST: f64 = 10_000.0;

/// Which error a failed action raises.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Area {
    InstantAction,
    Map,
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
    /// What went wrong with an action.
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

    /// An instant action that cannot be performed.
    pub(crate) fn unable(action: &Action, reason: &str) -> Self {
        Self::new(Area::InstantAction, action, reason)
    }
}

/// How a deed went.
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

/// How long what was held takes to go on (`resumes-in-a-moment`).
const RESUMING: Duration = Duration::from_millis(500);

impl Agv {
    /// An action of the order begins.
    pub(crate) fn begin_action(&mut self, id: &str) {
        let moment = self.moment();
        let Some(action) = self.actions.get(id).filter(|action| action.status == Status::Waiting) else {
            return;
        };
        let duration = self.duration_of(action);
        let Some(action) = self.actions.get_mut(id) else { return };
        match action.kind {
            Some(kind) if kind.deed == Deed::WaitForTrigger && self.faults.has(F::TriggerSkipped) => {
                action.end(Status::Finished);
            }
            None => action.end(Status::Failed),
            Some(kind)
                if kind.prepares && !self.config.tolerances.has(T::R1NeverPrepares)
                    || self.config.tolerances.has(T::PreparesEverything) =>
            {
                action.status = Status::Initializing;
                action.due = Some(moment + duration / 3);
            }
            Some(_) => self.run_action(id),
        }
    }

    /// An action does its work now.
    pub(crate) fn run_action(&mut self, id: &str) {
        let moment = self.moment();
        let Some(duration) = self.actions.get(id).map(|action| self.duration_of(action)) else {
            return;
        };
        let given_up = self.faults.has(F::TriggerGivenUp);
        let times_out = self.faults.has(F::R1TriggerTimesOut);
        let awaits = !given_up && !times_out && !self.faults.has(F::TriggerNotAwaited);
        let stuck = self.faults.has(F::InstantActionStuck);
        let Some(action) = self.actions.get_mut(id) else { return };
        action.status = Status::Running;
        let waits = action.kind.is_some_and(|kind| kind.deed == Deed::WaitForTrigger);
        let duration = match waits {
            true if given_up => Duration::from_millis(1_500),
            true if times_out => Duration::from_secs(5),
            true => super::cancel::MOMENT,
            false => duration,
        };
        let awaits = awaits && waits || action.kind.is_some_and(|kind| kind.deed == Deed::WarningLights);
        let endless = awaits || (stuck && !action.of_order());
        action.due = (!endless).then(|| moment + duration);
    }

    /// A stage of an action has ended.
    pub(crate) fn stage_finished(&mut self, id: &str) {
        let missed = !self.connection.online && self.faults.has(F::ActionEndMissedOffline);
        let Some(action) = self.actions.get_mut(id) else { return };
        action.due = None;
        if missed && action.of_order() {
            return;
        }
        if action.kind.is_some_and(|kind| kind.deed == Deed::DownloadMap) {
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
        if let Some(error_type) = self.persona.failure_of(&action.request.action_type, action.of_order()) {
            self.fail_as_told(&action, error_type);
            return;
        }
        let outcome = match self.does(&action) {
            Some(outcome) => outcome,
            None => {
                let outcome = self.deed(&action);
                self.turned_out(&action, outcome)
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
        let stuck = self.faults.has(F::InstantActionStuck);
        let requests_stay = self.faults.has(F::StateRequestStuck);
        self.forget_pause_after(id);
        let late = self.takes(T::R3DrivesOnLate) && !self.book.nodes.is_empty();
        let stops = |action: &Action| action.of_order() && action.request.blocking != Blocking::None;
        if late && self.actions.get(id).is_some_and(stops) {
            self.lingers_until = Some(self.moment() + RESUMING);
        }
        if let Some(action) = self.actions.get_mut(id) {
            let stuck = stuck || (requests_stay && action.request.action_type == "stateRequest");
            let stuck = stuck && action.origin == Origin::Instant;
            action.end(if stuck { Status::Running } else { Status::Finished });
            action.result = result;
        }
        self.forget_if_faulty(id);
    }

    /// Ends an action without success, and says why (IACT-06, BP-03).
    pub(crate) fn fail(&mut self, id: &str, problem: &Problem) {
        self.end_failed(id, problem);
        self.report_failure(id, problem);
    }

    /// Ends an action without success.
    pub(crate) fn end_failed(&mut self, id: &str, problem: &Problem) {
        if let Some(action) = self.actions.get_mut(id) {
            action.end(Status::Failed);
            if self.config.tolerances.has(T::R2FailuresDescribed) {
                action.result = Some(problem.reason.clone());
            }
        }
    }

    fn report_failure(&mut self, id: &str, problem: &Problem) {
        let names = &self.config.errors;
        let name = match problem.area {
            Area::InstantAction => &names.instant_action,
            Area::Map => &names.map,
            Area::Localization => &names.localization,
            Area::Load => &names.load,
            Area::Charging => &names.charging,
        };
        let error = self.warning(name.clone(), problem.references.clone(), problem.reason.clone());
        let action = self.actions.get(id).cloned();
        self.raise_failure(action.as_ref(), error);
    }

    /// Ends an action without success because a test wants that.
    pub(crate) fn fail_as_told(&mut self, action: &Action, error_type: String) {
        let problem = Problem::unable(action, "the action did not succeed");
        if let Some(action) = self.actions.get_mut(&action.request.id) {
            action.end(Status::Failed);
        }
        self.warn(error_type, problem.references, problem.reason);
    }

    fn forget_if_faulty(&mut self, id: &str) {
        let faults = self.faults;
        self.actions.retain(|action| {
            let forgotten = faults.has(F::FinishedActionsRemoved)
                || (faults.has(F::FinishedInstantForgotten) && !action.of_order());
            action.request.id != id || !forgotten
        });
    }

    fn deed(&mut self, action: &Action) -> Outcome {
        let Some(kind) = action.kind else { return Outcome::Open };
        match kind.deed {
            Deed::StartPause => self.start_pause(action),
            Deed::StopPause => self.stop_pause(action),
            Deed::StartCharging => self.start_charging(action).into(),
            Deed::StopCharging => self.stop_charging(action).into(),
            Deed::InitPosition => {
                let result = self.init_position(action);
                self.third.posed |= result.is_ok() && !action.of_order();
                result.into()
            }
            Deed::EnableMap => {
                let result = self.maps.enable(action.text("mapId"), action.text("mapVersion"));
                result.map_err(|reason| Problem::map(action, reason)).into()
            }
            Deed::DeleteMap if self.takes(T::R1MapDelistedNext) => {
                let before = self.maps.clone();
                match self.delete_map(action) {
                    Ok(()) => {
                        let after = std::mem::replace(&mut self.maps, before);
                        self.finish(&action.request.id, None);
                        self.flush();
                        self.maps = after;
                        Outcome::Open
                    }
                    refused => refused.into(),
                }
            }
            Deed::DeleteMap => self.delete_map(action).into(),
            Deed::StateRequest => {
                self.report.requested = true;
                Outcome::Done(None)
            }
            Deed::LogReport => {
                self.logs += 1;
                let name = format!("log-{}.txt", self.logs);
                if self.tells_logs() {
                    self.last_log = Some((action.request.id.clone(), name));
                    return Outcome::Done(None);
                }
                Outcome::Done(Some(name))
            }
            Deed::Pick => self.pick(action).into(),
            Deed::Drop => self.put_down(action).into(),
            Deed::DetectObject => self.detect(action),
            Deed::FinePositioning => self.align(action).into(),
            Deed::FactsheetRequest => {
                self.connection.factsheet_asked = true;
                self.publish_factsheet();
                self.connection.factsheet_asked = false;
                Outcome::Done(None)
            }
            Deed::WaitForTrigger | Deed::WarningLights | Deed::Beep | Deed::Calibrate => Outcome::Done(None),
            Deed::CancelOrder => {
                self.cancel_order(&action.request.id);
                Outcome::Open
            }
            Deed::DownloadMap => self.begin_download(&action.request.id),
        }
    }

    /// Whether the name of a log is in the information instead of the result of its action.
    pub(crate) fn tells_logs(&self) -> bool {
        self.takes(T::R2LogNameInInformation)
            && !self.takes(T::R1InformationOmitted)
            && !self.takes(T::R4OptionalStateFieldsLeftOut)
    }

    /// Whether a switch forbids what a message asks for (ACT-16).
    fn is_pause_blocked(&self) -> bool {
        self.pause_blocked && !self.faults.has(F::ButtonPauseOverridden)
    }

    fn start_pause(&mut self, action: &Action) -> Outcome {
        self.end_braking();
        if self.is_pause_blocked() {
            if self.faults.has(F::BlockedPauseTaken) {
                self.set_holds(|holds| holds.pause = true);
            }
            return Outcome::Failed(Problem::unable(action, "a switch keeps the vehicle from pausing"));
        }
        if self.has_nothing_to_pause() {
            return Outcome::Failed(Problem::unable(action, "there is no order to pause"));
        }
        self.pauses += u32::from(self.faults.has(F::PausesCounted));
        if self.holds.pause && self.faults.has(F::PauseTwiceFails) {
            return Outcome::Failed(Problem::unable(action, "the vehicle is paused already"));
        }
        if self.holds.pause && self.faults.has(F::R6SecondStartPauseResumes) {
            self.set_holds(|holds| holds.pause = false);
            return Outcome::Done(None);
        }
        if self.faults.has(F::R1PauseCutsHorizon) {
            let gone = self.book.drop_horizon();
            self.actions.retain(|action| match action.origin {
                Origin::Node(id) | Origin::Edge(id) => !gone.contains(&id),
                Origin::Instant => true,
            });
        }
        if self.faults.has(F::PauseDropsOrder) {
            self.give_up_order();
        }
        if self.motion.is_moving() && self.faults.has(F::R3PauseFinishedBeforeStanding) {
            self.third.braking = Some(self.moment() + Duration::from_secs(1));
        }
        if !self.holds.pause && self.faults.has(F::R2PausedFlagLate) {
            self.pause_hidden_until = Some(self.moment() + Duration::from_millis(1_500));
        }
        self.set_holds(|holds| holds.pause = true);
        Outcome::Done(None)
    }

    /// A pause made with the button is lifted with the button (ACT-16).
    fn stop_pause(&mut self, action: &Action) -> Outcome {
        if self.is_pause_blocked() {
            if self.faults.has(F::BlockedPauseTaken) {
                self.set_holds(|holds| holds.pause = false);
            }
            return Outcome::Failed(Problem::unable(action, "a switch keeps the vehicle paused"));
        }
        if !self.holds.pause && self.faults.has(F::R1StopPauseTwiceFails) {
            return Outcome::Failed(Problem::unable(action, "the vehicle is not paused"));
        }
        if (self.holds.button || self.holds.emergency) && !self.faults.has(F::ButtonPauseOverridden) {
            return Outcome::Failed(Problem::unable(action, "the vehicle is stopped by hand"));
        }
        if !self.holds.pause && self.faults.has(F::StopPauseIdleFails) {
            return Outcome::Failed(Problem::unable(action, "the vehicle is not paused"));
        }
        self.pauses = self.pauses.saturating_sub(1);
        if self.pauses > 0 {
            return Outcome::Done(None);
        }
        if self.pause_outlives {
            return Outcome::Done(None);
        }
        if self.faults.has(F::PauseNotLifted) {
            self.set_holds(|holds| holds.stuck |= holds.pause);
        }
        let waits = self.book.nodes.front().is_some_and(|stop| !stop.node.released);
        self.book.unbound |= waits && self.holds.pause && self.faults.has(F::R1HorizonDrivenAfterPause);
        self.book.hurried |= self.book.entered && self.holds.pause && self.faults.has(F::R1MaxSpeedForgottenInPause);
        self.book.heedless = false;
        self.book.unblocked |= self.holds.pause && self.faults.has(F::R2BlockingForgottenAfterPause);
        if self.holds.pause && self.faults.has(F::R2PauseForgetsQueue) {
            self.actions.drop_lists();
        }
        self.set_holds(|holds| holds.pause = false);
        if self.faults.has(F::PausedOrderSurvivesCancel)
            && let Some(order) = self.remembered.take()
        {
            self.book = order;
        }
        Outcome::Done(None)
    }

    /// What was held goes on at the next cycle (`resumes-in-a-moment`).
    pub(crate) fn resume_if_due(&mut self) {
        let moment = self.moment();
        if self.resumes_at.take_if(|at| *at <= moment).is_some() && !self.holds.any() {
            self.actions.resume(moment, self.faults);
        }
    }

    /// Changes what holds the vehicle; actions are held and go on with it (ACT-15, ACT-18).
    pub(crate) fn set_holds(&mut self, change: impl FnOnce(&mut super::Holds)) {
        let before = self.holds.any();
        let field = self.holds.field;
        let paused = self.holds.pause;
        change(&mut self.holds);
        let moment = self.moment();
        let by_message = self.holds.pause && !self.holds.button && !self.holds.emergency && !self.holds.field;
        let only_field = !(self.holds.pause || self.holds.button || self.holds.emergency);
        match (before, self.holds.any()) {
            (false, true) if only_field && self.faults.has(F::FieldDoesNotPause) => {}
            (true, false) if paused && self.faults.has(F::R3PausedActionsStayPaused) => {}
            (true, false) if field && self.faults.has(F::FieldPauseStuck) => {}
            (false, true) if by_message && self.takes(T::R1ActionsRunOnInPause) => {}
            (false, true) => self.actions.hold(moment, self.faults),
            (true, false) if self.takes(T::ResumesInAMoment) => self.resumes_at = Some(moment + RESUMING),
            (true, false) => {
                self.note_what_waits_again();
                self.actions.resume(moment, self.faults);
            }
            _ => {}
        }
    }

    fn init_position(&mut self, action: &Action) -> Result<(), Problem> {
        let invalid = |reason: &str| Err(Problem::new(Area::Localization, action, reason));
        let number = |key: &str| action.number(key).filter(|number| number.is_finite());
        let (Some(x), Some(y), Some(theta)) = (number("x"), number("y"), number("theta")) else {
            return invalid("the pose is not complete");
        };
        let y = if self.faults.has(F::AxesMirrored) { -y } else { y };
        let unchecked = self.faults.has(F::InitPositionUnchecked);
        if !unchecked && (x.abs() > FARTHEST || y.abs() > FARTHEST || theta.abs() > PI + 0.01) {
            return invalid("the pose is on no map");
        }
        let map_id = action.text("mapId");
        let any_map = unchecked || self.faults.has(F::R6InitPositionAnyMap);
        if !any_map && !self.maps.on_board(map_id) {
            self.take_map_anyway(action);
            return invalid("the map is not on board");
        }
        if action.origin == Origin::Instant && (!self.book.nodes.is_empty() || self.actions.order_unfinished()) {
            return invalid("an order is active");
        }
        self.lost = false;
        self.persona.lost = false;
        self.maps.enable_any(map_id);
        self.motion.place(Pose {
            x,
            y,
            theta: theta.clamp(-PI, PI),
            map_id: map_id.to_owned(),
        });
        action.text("lastNodeId").clone_into(&mut self.book.last_node);
        if !action.of_order() && self.takes(T::R1InitPositionResetsSequence) {
            self.book.last_sequence = 0;
        }
        Ok(())
    }

    /// `init-position-taken-anyway`: the map of a pose that is refused.
    pub(crate) fn take_map_anyway(&mut self, action: &Action) {
        let init = action.kind.is_some_and(|kind| kind.deed == Deed::InitPosition);
        if init && self.faults.has(F::InitPositionTakenAnyway) {
            self.claimed_map = Some(action.text("mapId").to_owned());
        }
    }

    fn delete_map(&mut self, action: &Action) -> Result<(), Problem> {
        let here = self.motion.pose(self.moment()).map_id;
        let needed: Vec<String> = self.book.nodes.iter().map(|stop| stop.place.map_id.clone()).collect();
        let kept = self.takes(T::R4EnabledUnusedMapNotDeleted);
        let used = |map_id: &str| kept || here == map_id || needed.iter().any(|needed| needed == map_id);
        let result = self.maps.delete(action.text("mapId"), action.text("mapVersion"), used);
        result.map_err(|reason| Problem::map(action, reason))
    }
}
