//! Deviations of what is done at a station: picking, dropping, detecting, aligning, charging (section 6.8).

use crate::agv::Load;
use crate::agv::action_effect::Area;
use crate::agv::config::LOAD_POSITIONS;

use super::prelude::*;

records! {
    fault "pick-without-load" ["ACT-28"] "Reports pick FINISHED and no load."
        => succeeded(Effect::Pick, |agv, action| {
            agv.loads.clear();
            let site = agv.site(action);
            agv.stations.insert(site, true);
        });
    fault "pick-failure-finished" ["ACT-29"] "Reports pick FINISHED although there was nothing to pick."
        => fails_unseen(Effect::Pick);
    fault "pick-reported-late" ["ACT-28", "STATE-04", "STATE-MSG-06"] "It reports a load it has picked two seconds after the pick is FINISHED."
        => keep::<Option<Moment>>()
            .ends(|hidden, agv, action, outcome| {
                if is(action, Effect::Pick) && matches!(outcome, Outcome::Done(_)) {
                    *hidden = Some(agv.moment() + Duration::from_secs(2));
                }
                outcome
            })
            .happens(|hidden, agv, event| if event == Event::Woken {
                *hidden = hidden.filter(|hidden| *hidden > agv.moment());
            })
            .says(|hidden, _, part, m| {
                if hidden.is_some() && matches!(part, Part::State) {
                    m.set("loads", json!([]));
                }
                true
            })
            .due(|hidden, _| *hidden);
    fault "drop-failure-finished" ["ACT-29"] "Reports drop FINISHED although the place was taken."
        => after(Effect::Drop, |_, _, outcome| match outcome {
            Outcome::Failed(problem) if problem.reason == "the place is taken" => Outcome::Done(None),
            other => other,
        });
    fault "drop-without-load-finished" ["ACT-29"] "It reports drop FINISHED although it carries no load."
        => instead(Effect::Drop, |agv, _| agv.loads.is_empty().then_some(Outcome::Done(None)));
    fault "drop-reported-late" ["ACT-28"] "Shows its load for another second after drop is FINISHED."
        => dropping_late(|_| Duration::from_secs(1));
    fault "drop-finished-before-load-gone" ["ACT-28"] "It reports drop FINISHED while loads still lists the load, which goes one state later."
        => dropping_late(brief);
    fault "failure-changes-load" ["ACT-29"] "Changes the load it shows although its pick or drop has failed."
        => keep::<()>().ends(|(), agv, action, outcome| {
            if matches!(outcome, Outcome::Failed(_)) && is(action, Effect::Pick) && agv.loads.is_empty() {
                agv.loads.push(Load {
                    id: String::new(),
                    kind: action.text("loadType").to_owned(),
                    position: LOAD_POSITIONS[0].to_owned(),
                });
            } else if matches!(outcome, Outcome::Failed(_)) && is(action, Effect::Drop) {
                agv.loads.clear();
            }
            outcome
        });
    fault "failure-unreferenced" ["BP-03"] "Does not say in its error which pick or drop has failed." because "It breaks a recommendation only."
        => failure(|_, action, e| {
            let all = is(action, Effect::Pick) || is(action, Effect::Drop);
            e.references.retain(|(key, _)| key != "actionId" && !all);
            true
        });
    fault "failure-silent" ["ACT-30", "BP-03"] "Raises no error when a pick, a drop or charging fails." because "It breaks a recommendation only."
        => failure(|_, action, _| {
            let silent = [Effect::Pick, Effect::Drop, Effect::StartCharging, Effect::StopCharging];
            !silent.into_iter().any(|effect| is(action, effect))
        });
    fault "failure-blames-first-action" ["BP-03"] "It references the first action of the order in the error about a failed one, whichever failed."
        because "BP-03, that the failed action is referenced, is a recommendation."
        => failure(|agv, action, e| {
            if let Some(first) = agv.actions.iter().find(|other| other.of_order() && action.of_order()) {
                let named = e.references.iter_mut().filter(|(key, _)| key == "actionId");
                named.for_each(|(_, id)| id.clone_from(&first.request.id));
            }
            true
        });
    fault "failed-pick-retried" ["ASTATE-06", "ASTATE-05"] "It reports a pick or drop FAILED, tries it once more as RUNNING, and reports FAILED again."
        => keep::<Vec<String>>().raises(|tried, agv, cause, _| match cause {
            Cause::Failure(Some(action)) if action.of_order() && (is(action, Effect::Pick) || is(action, Effect::Drop)) && !tried.contains(&action.request.id) => {
                tried.push(action.request.id.clone());
                agv.flush();
                agv.run_action(&action.request.id);
                false
            }
            _ => true,
        });
    fault "detection-fails" ["ACT-35"] "Reports detectObject FAILED although the object is there."
        => instead(Effect::DetectObject, |_, action| Some(Outcome::Failed(Problem::new(Area::Load, action, "there is no object"))));
    fault "detection-failure-finished" ["ACT-35"] "Reports detectObject FINISHED although there is no object."
        => after(Effect::DetectObject, |_, action, outcome| match outcome {
            Outcome::Failed(_) => {
                let object = Some(action.text("objectType")).filter(|object| !object.is_empty());
                Outcome::Done(Some(format!("{} detected", object.unwrap_or("object"))))
            }
            other => other,
        });
    fault "detection-undescribed" ["STATE-MSG-12"] "Does not describe what it has detected, as its factsheet promises." because "To leave the result out is a warning by the ruling of STATE-MSG-12."
        => undescribed(Effect::DetectObject);
    fault "log-name-missing" ["ACT-27", "STATE-MSG-12"] "Does not name the log it stored." because "The ruling of ACT-27 and STATE-MSG-12 is a warning."
        => undescribed(Effect::LogReport);
    fault "positioning-fails" ["ACT-36"] "Reports finePositioning FAILED although it has reached the target."
        => instead(Effect::FinePositioning, |_, action| Some(Outcome::Failed(Problem::new(Area::Localization, action, "there is no target"))));
    fault "positioning-failure-finished" ["ACT-36"] "Reports finePositioning FINISHED although there is no target."
        => fails_unseen(Effect::FinePositioning);

    fault "charging-failure-finished" ["ACT-20"] "Reports startCharging FINISHED although there is no charger."
        => fails_unseen(Effect::StartCharging);
    fault "charging-shown-anyway" ["ACT-20"] "Reports that it charges although startCharging failed."
        => failed(Effect::StartCharging, |agv, _| agv.charging = true);
    fault "charging-twice-fails" ["ACT-11"] "Fails a startCharging while it charges." because "Whether charging cannot be started where it is under way is a matter of reading; the ruling of ACT-11 is a warning."
        => instead(Effect::StartCharging, |agv, action| {
            let again = at_charger(agv) && agv.charging;
            again.then(|| Outcome::Failed(Problem::new(Area::Charging, action, "the vehicle charges already")))
        });
    fault "charging-toggled" ["ACT-11"] "Ends its charging when startCharging comes a second time."
        => succeeded_again(Effect::StartCharging, |was| !was);
    fault "charging-unreported" ["ACT-19"] "Does not report that it charges."
        => succeeded(Effect::StartCharging, |agv, _| agv.charging = false);
    fault "charging-reported-late" ["ACT-19"] "It reports startCharging FINISHED two seconds before charging becomes true."
        => charging_late(|_| Duration::from_secs(2));
    fault "charging-flag-lags" ["ACT-19"] "It reports startCharging FINISHED one state before charging becomes true."
        => charging_late(brief);
    fault "charging-end-failure-finished" ["ACT-20", "ACT-19"] "Reports stopCharging FINISHED although it cannot leave the charger."
        => fails_unseen(Effect::StopCharging);
    fault "charging-end-shown-anyway" ["ACT-20"] "Reports that it does not charge any more although stopCharging failed."
        => failed(Effect::StopCharging, |agv, _| agv.charging = false);
    fault "charging-end-unreported" ["ACT-19"] "Reports that it charges after stopCharging is FINISHED."
        => succeeded_again(Effect::StopCharging, |was| was);
    fault "charging-end-toggled" ["ACT-11"] "Begins to charge again when stopCharging comes a second time."
        => succeeded_again(Effect::StopCharging, |was| !was);
    fault "charging-ends-early" ["ACT-22"] "Reports that it does not charge any more while it cannot take orders yet."
        => keep::<(bool, Option<Moment>)>()
            .does(|(was, _), agv, _| {
                *was = agv.charging;
                None
            })
            .ends(|(was, until), agv, action, outcome| {
                if *was && is(action, Effect::StopCharging) && matches!(outcome, Outcome::Done(_)) {
                    *until = Some(agv.moment() + Duration::from_secs(40));
                }
                outcome
            })
            .objects(|(_, until), agv, _, relation| {
                let refused = relation != Relation::Known && until.is_some_and(|until| until > agv.moment());
                refused.then(|| Refusal::new(Rule::OtherOrderActive, "the vehicle is still at the charger"))
            });
    fault "node-stop-charging-unreported" ["ACT-19"] "A stopCharging on a node is FINISHED while charging stays true."
        => keep::<bool>()
            .does(|was, agv, _| {
                *was = agv.charging;
                None
            })
            .ends(|was, agv, action, outcome| {
                if action.of_order() && is(action, Effect::StopCharging) && matches!(outcome, Outcome::Done(_)) {
                    agv.charging = *was;
                }
                outcome
            });
    fault "second-stop-charging-fails" ["ACT-11"] "It reports stopCharging FAILED when it is not charging."
        because "Of actions that are marked idempotent some have cases of FAILED; the ruling of ACT-11 leaves a warning."
        => instead(Effect::StopCharging, |agv, action| {
            let idle = !agv.charging;
            idle.then(|| Outcome::Failed(Problem::new(Area::Charging, action, "the vehicle does not charge")))
        });
    fault "stop-charging-flag-late" ["ACT-19"] "It reports stopCharging FINISHED while batteryState.charging is still true for some seconds."
        => keep::<Option<Moment>>()
            .does(|due, agv, action| {
                if is(action, Effect::StartCharging) {
                    *due = None;
                }
                let longer = is(action, Effect::StopCharging) && agv.charging && !agv.charger_locked;
                longer.then(|| {
                    *due = Some(agv.moment() + Duration::from_secs(3));
                    Outcome::Done(None)
                })
            })
            .happens(|due, agv, event| if event == Event::Woken && due.take_if(|due| *due <= agv.moment()).is_some() {
                agv.charging = false;
            })
            .due(|due, _| *due);
}

/// Says nothing about the result.
fn undescribed(effect: Effect) -> Box<dyn Deviation> {
    after(effect, |_, _, outcome| match outcome {
        Outcome::Done(_) => Outcome::Done(None),
        other => other,
    })
}

fn at_charger(agv: &Agv) -> bool {
    !agv.motion.is_moving() && agv.config.chargers.contains(&agv.order.last_node)
}

type Lasting = fn(&Agv) -> Duration;

/// Shows a load for a while that was put down.
fn dropping_late(lasts: Lasting) -> Box<dyn Deviation> {
    #[derive(Clone)]
    struct Late {
        lasts: Lasting,
        before: Option<Load>,
        shadow: Option<(Moment, Load)>,
    }
    holding(Late {
        lasts,
        before: None,
        shadow: None,
    })
    .does(|late, agv, _| {
        late.before = agv.loads.first().cloned();
        None
    })
    .ends(|late, agv, action, outcome| {
        if is(action, Effect::Drop) && matches!(outcome, Outcome::Done(_)) && agv.loads.is_empty() {
            let until = agv.moment() + (late.lasts)(agv);
            late.shadow = late.before.take().map(|load| (until, load));
        }
        outcome
    })
    .happens(|late, agv, event| {
        if event == Event::Woken {
            late.shadow.take_if(|(until, _)| *until <= agv.moment());
        }
    })
    .says(|late, _, part, m| {
        if let (Part::State, Some((_, load))) = (part, &late.shadow) {
            m.add("loads", Agv::load_picture(load));
        }
        true
    })
    .due(|late, _| late.shadow.as_ref().map(|(until, _)| *until))
}

/// Shows after a while that it charges.
fn charging_late(lasts: Lasting) -> Box<dyn Deviation> {
    holding((lasts, None))
        .does(|(lasts, due), agv, action| {
            if is(action, Effect::StopCharging) {
                *due = None;
            }
            let begins = is(action, Effect::StartCharging) && at_charger(agv) && !agv.charging;
            begins.then(|| {
                *due = Some(agv.moment() + lasts(agv));
                Outcome::Done(None)
            })
        })
        .happens(|(_, due), agv, event| {
            if agv.motion.is_moving() {
                *due = None;
            }
            if event == Event::Woken && due.take_if(|due| *due <= agv.moment()).is_some() {
                agv.charging = true;
            }
        })
        .due(|(_, due), _| *due)
}

/// Shows what it makes of whether it charged before.
fn succeeded_again(effect: Effect, shown: fn(bool) -> bool) -> Box<dyn Deviation> {
    holding((effect, shown, false))
        .does(|(.., charged), agv, _| {
            *charged = agv.charging;
            None
        })
        .ends(|(effect, shown, charged), agv, action, outcome| {
            if is(action, *effect) && matches!(outcome, Outcome::Done(_)) {
                agv.charging = shown(*charged);
            }
            outcome
        })
}
