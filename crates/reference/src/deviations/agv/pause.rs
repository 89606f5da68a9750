//! Deviations of what holds the vehicle: pause, buttons and the protective field (section 6.8 and ACT-11 to ACT-18).

use super::prelude::*;

records! {
    fault "pause-stuck-after-cut" ["ACT-13"] "Reports stopPause FINISHED and stays paused when the link was lost in the pause."
        => keep::<bool>()
            .happens(|stuck, agv, event| *stuck |= event == Event::ConnectionLost && agv.holds.pause)
            .does(|stuck, agv, action| stays_paused(*stuck, agv, action));
    fault "pause-twice-fails" ["ACT-11"] "Fails a startPause while it is paused."
        => instead(Effect::StartPause, |agv, action| {
            let again = agv.holds.pause && !agv.pause_blocked;
            again.then(|| Outcome::Failed(Problem::unable(action, "the vehicle is paused already")))
        });
    fault "pauses-counted" ["ACT-13", "ACT-11"] "Counts its pauses, and ends them only with as many stopPause."
        => keep::<u32>().does(|pauses, agv, action| {
            if is(action, Effect::StartPause) && !agv.pause_blocked {
                *pauses += 1;
            }
            if is(action, Effect::StopPause) && lifts_pause(agv) {
                *pauses = pauses.saturating_sub(1);
                return (*pauses > 0).then_some(Outcome::Done(None));
            }
            None
        });
    fault "second-start-pause-resumes" ["ACT-11", "ACT-13"] "It treats startPause as a toggle: a second startPause ends the pause."
        => instead(Effect::StartPause, |agv, _| {
            let again = agv.holds.pause && !agv.pause_blocked;
            again.then(|| {
                agv.set_holds(|holds| holds.pause = false);
                Outcome::Done(None)
            })
        });
    fault "pause-fails-without-order" ["ACT-13", "ACT-11"] "It answers startPause with FAILED when it has no order."
        => instead(Effect::StartPause, |agv, action| {
            let idle = agv.order.nodes.is_empty() && !agv.actions.order_unfinished();
            idle.then(|| Outcome::Failed(Problem::unable(action, "there is no order to pause")))
        });
    fault "stop-pause-idle-fails" ["ACT-11"] "Fails a stopPause while it is not paused."
        => instead(Effect::StopPause, |agv, action| {
            let idle = !agv.holds.pause;
            idle.then(|| Outcome::Failed(Problem::unable(action, "the vehicle is not paused")))
        });
    fault "pause-drives-on" ["ACT-12", "ACT-15"] "Drives to the next node before it pauses."
        => drives(Hindrance::Hold, |agv| agv.order.entered && agv.holds.pause);
    fault "pauses-at-the-next-node" ["ACT-12", "ACT-15"] "It drives on to its next node before it pauses, and reports startPause RUNNING until then."
        => keep::<Vec<String>>()
            .does(|waiting, agv, action| {
                let drives = agv.order.entered && agv.motion.is_moving() && !agv.pause_blocked;
                (is(action, Effect::StartPause) && drives).then(|| {
                    waiting.push(action.id());
                    if let Some(action) = agv.actions.get_mut(&action.request.id) {
                        action.status = Status::Running;
                    }
                    Outcome::Open
                })
            })
            .happens(|waiting, agv, event| {
                let off_the_edge = event == Event::Settled && !agv.order.entered;
                if matches!(event, Event::NodePassed(_)) || off_the_edge {
                    for id in std::mem::take(waiting) {
                        agv.complete(&id);
                    }
                }
            });
    fault "pause-drops-order" ["ACT-14"] "Gives the order up when it is paused."
        => instead(Effect::StartPause, |agv, _| {
            if !agv.pause_blocked {
                agv.give_up_order();
            }
            None
        });
    fault "pause-not-lifted" ["ACT-18"] "Reports the end of a pause and does not drive on."
        => keep::<bool>()
            .does(|stuck, agv, action| {
                let lifted = is(action, Effect::StopPause) && lifts_pause(agv) && agv.holds.pause;
                lifted.then(|| {
                    *stuck = true;
                    agv.holds.pause = false;
                    Outcome::Done(None)
                })
            })
            .happens(|stuck, agv, event| if event == Event::Begun && std::mem::take(stuck) {
                agv.actions.resume(agv.moment());
            })
            .allows(|stuck, _, what, usual| usual && !(*stuck && matches!(what, Permission::Drive | Permission::Act)));
    fault "button-pause-overridden" ["ACT-16"] "Pauses and goes on by message although a switch or the button at the vehicle forbids it."
        => forbidding(|_, what| matches!(what, Permission::HeedSwitch));
    fault "blocked-pause-taken" ["ACT-16"] "Pauses and goes on by message although it says that it cannot."
        => plain().does(|(), agv, action| {
            if agv.pause_blocked && (is(action, Effect::StartPause) || is(action, Effect::StopPause)) {
                agv.set_holds(|holds| holds.pause = is(action, Effect::StartPause));
            }
            None
        });
    fault "pause-cuts-horizon" ["ACT-14", "STATE-12"] "A startPause makes it throw away the horizon of its order."
        => instead(Effect::StartPause, |agv, _| {
            if !agv.pause_blocked {
                let gone = agv.order.drop_horizon();
                agv.actions.retain(|action| match action.origin {
                    Origin::Node(id) | Origin::Edge(id) => !gone.contains(&id),
                    Origin::Instant | Origin::Zone(_) => true,
                });
            }
            None
        });
    fault "pause-finished-before-standing" ["ACT-15", "ACT-12"] "It reports startPause FINISHED while it still rolls for a second."
        => keep::<Option<Moment>>()
            .does(|braking, agv, action| {
                if is(action, Effect::StartPause) && !agv.pause_blocked && agv.motion.is_moving() {
                    *braking = Some(agv.moment() + Duration::from_secs(1));
                }
                None
            })
            .happens(|braking, agv, event| if event == Event::Woken {
                *braking = braking.filter(|braking| *braking > agv.moment());
            })
            .allows(|braking, agv, what, usual| {
                let holds = agv.holds;
                let stopped = holds.button || holds.emergency || holds.field || holds.defect;
                let rolls = braking.is_some() && holds.pause && !stopped;
                usual || rolls && matches!(what, Permission::DriveAgainst(Hindrance::Hold))
            })
            .due(|braking, _| *braking);
    fault "paused-flag-late" ["ACT-13"] "The flag paused becomes true only one and a half seconds after startPause is FINISHED."
        => keep::<Option<Moment>>()
            .does(|hidden, agv, action| {
                if is(action, Effect::StartPause) && !agv.pause_blocked && !agv.holds.pause {
                    *hidden = Some(agv.moment() + Duration::from_millis(1_500));
                }
                None
            })
            .happens(|hidden, agv, event| if event == Event::Woken {
                *hidden = hidden.filter(|hidden| *hidden > agv.moment());
            })
            .says(|hidden, agv, part, m| {
                if matches!(part, Part::State) && hidden.is_some() {
                    m.set("paused", agv.holds.button || agv.holds.emergency);
                }
                true
            })
            .due(|hidden, _| *hidden);
    fault "pause-forgets-queue" ["ACT-14", "ACT-18"] "Actions that wait behind another one on their node are never begun when the vehicle was paused in the meantime."
        => instead(Effect::StopPause, |agv, _| {
            if lifts_pause(agv) && agv.holds.pause {
                agv.actions.drop_lists();
            }
            None
        });
    fault "horizon-driven-after-pause" ["ORD-UPD-01", "ORD-07"] "A stopPause while it waits at the decision point makes it drive on into the horizon."
        => unbound()
            .does(|unbound, agv, action| {
                *unbound |= ends_pause(agv, action) && agv.waits_at_decision_point();
                None
            })
            .happens(|unbound, _, event| *unbound &= event != Event::Begun);
    fault "blocking-forgotten-after-pause" ["BLOCK-04", "BLOCK-03"] "After a pause the vehicle drives on although the SOFT or HARD action it was paused in is still running."
        => keep::<bool>()
            .does(|unblocked, agv, action| {
                *unblocked |= ends_pause(agv, action);
                None
            })
            .happens(|unblocked, _, event| *unblocked &= !matches!(event, Event::Begun | Event::NodeReached(_)))
            .allows(|unblocked, _, what, usual| usual || *unblocked && matches!(what, Permission::DriveAgainst(Hindrance::Action)));
    fault "pause-forgotten-after-node-action" ["ACT-12", "ACT-13"] "It drives on although paused when a node action that ran at the time of startPause has ended."
        => heedless()
            .ends(|heedless, agv, action, outcome| {
                let of_node = matches!(action.origin, Origin::Node(_));
                *heedless |= agv.holds.pause && of_node && matches!(outcome, Outcome::Done(_));
                outcome
            })
            .happens(|heedless, _, event| *heedless &= !matches!(event, Event::Begun | Event::Resuming));
    fault "paused-actions-fail" ["ACT-18", "ACT-34"] "Actions that were held by a pause or a violated field become FAILED when they could go on."
        => when(Event::Resuming, |agv| {
            let held = agv.actions.iter_mut().filter(|action| action.held.is_some());
            held.for_each(|action| action.end(Status::Failed));
        });
    fault "pause-to-waiting" ["ASTATE-05"] "Puts running actions back to WAITING in a pause."
        => when(Event::Held, |agv| {
            let held = agv.actions.iter_mut().filter(|action| action.status == Status::Paused);
            held.for_each(|action| action.status = Status::Waiting);
        });
    fault "paused-preparation-waits-again" ["ASTATE-05", "ASTATE-02"] "It sets an action that it prepares back to WAITING on startPause, and begins it anew after the pause."
        => when(Event::Held, |agv| {
            let prepares = |action: &&Action| {
                let held = action.held.as_ref().map(|(status, _)| *status);
                action.of_order() && held.unwrap_or(action.status) == Status::Initializing
            };
            let prepared: Vec<(String, Origin)> = agv.actions.iter().filter(prepares).map(|action| (action.id(), action.origin)).collect();
            for (id, origin) in prepared {
                if let Some(action) = agv.actions.get_mut(&id) {
                    action.end(Status::Waiting);
                }
                agv.actions.queue(origin, [vec![id]].into());
            }
        });
    fault "resumed-action-waits-again" ["ASTATE-05", "ACT-18"] "It sends an action that was PAUSED back to WAITING on stopPause and starts it anew."
        => keep::<(Vec<Origin>, Option<Moment>)>()
            .happens(|(places, due), agv, event| match event {
                Event::Begun | Event::PowerCycled => {
                    places.clear();
                    *due = None;
                }
                Event::Resuming => {
                    for action in agv.actions.iter_mut().filter(|action| action.of_order() && action.held.is_some()) {
                        action.end(Status::Waiting);
                        places.push(action.origin);
                    }
                    if !places.is_empty() {
                        *due = Some(agv.moment() + Duration::from_millis(300));
                    }
                }
                Event::Woken if due.take_if(|due| *due <= agv.moment()).is_some() && !agv.holds.any() => for origin in places.drain(..) {
                    agv.actions.drop_list(origin);
                    agv.trigger_actions(origin);
                },
                _ => {}
            })
            .allows(|(places, _), _, what, usual| usual && (places.is_empty() || !matches!(what, Permission::Drive)))
            .due(|(_, due), _| *due);
    fault "paused-actions-stay-paused" ["ACT-18"] "It leaves actions PAUSED that were held by a pause after stopPause."
        => forbidding(|_, what| matches!(what, Permission::ResumeActions(before) if before.pause));
    fault "field-does-not-pause" ["ACT-34"] "Goes on with its actions while its protective field is violated." because "It breaks a recommendation only."
        => forbidding(|agv, what| matches!(what, Permission::HoldActions) && !(agv.holds.pause || agv.holds.button || agv.holds.emergency));
    fault "field-pause-stuck" ["ACT-34", "ASTATE-04"] "Does not go on with its actions when its protective field is free again."
        => forbidding(|_, what| matches!(what, Permission::ResumeActions(before) if before.field));
    fault "e-stop-latched" ["STATE-MSG-17"] "After the emergency stop is released it reports the e-stop as active until the next order."
        => latched(|agv, event| event == Event::Releasing && agv.holds.emergency, |m| m.part("safetyState", |safety| safety.set("eStop", "MANUAL")));
    fault "field-violation-latched" ["STATE-MSG-17"] "After the safety field is free again fieldViolation stays true until the next order."
        => latched(|agv, event| event == Event::FieldFreed && agv.holds.field, |m| m.part("safetyState", |safety| safety.set("fieldViolation", true)));
    fault "pausable-actions-run-on" ["ACT-15", "ACT-43"] "It reports startPause FINISHED as soon as it stands, and running actions go on although it says that they can be paused."
        => forbidding(|agv, what| matches!(what, Permission::HoldActions) && agv.holds.pause && !agv.holds.button && !agv.holds.emergency && !agv.holds.field);
    fault "holds-what-cannot-be-paused" ["ACT-43"] "It reports actions PAUSED in a pause of which its factsheet says that they cannot be paused." because "The observation of ACT-43 is a warning."
        => action(|agv, action, m| {
            let bound = action.kind.is_some_and(|kind| !kind.pausable) && action.occupies();
            if agv.holds.pause && bound && action.status == Status::Running {
                m.set("actionStatus", "PAUSED");
            }
            true
        });
    tolerance "actions-run-on-in-pause" ["ACT-15", "ACT-18"] "Running actions go on while it is paused by startPause, as its factsheet says where the version asks for that."
        => forbidding(|agv, what| matches!(what, Permission::HoldActions) && agv.holds.pause && !agv.holds.button && !agv.holds.emergency && !agv.holds.field)
            .says(|_, _, part, m| {
                if matches!(part, Part::Factsheet) {
                    m.part("protocolFeatures", |features| features.each("agvActions", |action| if action.contains_key("pauseAllowed") {
                        action.set("pauseAllowed", false);
                    }));
                }
                true
            });
    tolerance "resumes-in-a-moment" ["ASTATE-04", "ACT-18"] "Lets held actions go on half a second after the pause has ended."
        => keep::<Option<Moment>>()
            .happens(|due, agv, event| match event {
                Event::Resuming => *due = Some(agv.moment() + Duration::from_millis(500)),
                Event::Woken if due.take_if(|due| *due <= agv.moment()).is_some() && !agv.holds.any() => agv.actions.resume(agv.moment()),
                _ => {}
            })
            .allows(|_, _, what, usual| usual && !matches!(what, Permission::ResumeActions(_)))
            .due(|due, _| *due);
    tolerance "brakes-long-on-pause" ["ACT-12", "ACT-13"] "It needs two seconds to come to a stop after startPause and reports it RUNNING meanwhile."
        => keep::<bool>()
            .allows(|_, agv, what, usual| usual || matches!(what, Permission::TakeTime(action) if is(action, Effect::StartPause) && agv.motion.is_moving()))
            .happens(|braking, agv, event| match event {
                // The rest of the leg is planned anew, slowly.
                Event::InstantBegun if pauses_next(agv) && agv.motion.is_moving() => {
                    agv.motion.halt(agv.moment());
                    *braking = true;
                }
                _ => {}
            })
            .does(|braking, agv, action| {
                if is(action, Effect::StartPause) && std::mem::take(braking) {
                    agv.motion.halt(agv.moment());
                }
                None
            })
            .plans(|braking, _, leg| if *braking {
                leg.own /= 20.0;
            })
            .lasts(|_, _, what, usual| match what {
                Span::Action(action) if is(action, Effect::StartPause) => Duration::from_secs(2),
                _ => usual,
            });
    tolerance "pause-takes-time" ["ACT-12", "ACT-15", "ACT-41"] "startPause and stopPause are RUNNING for a moment, in which the vehicle goes on as before, and then FINISHED."
        => letting(|_, what| matches!(what, Permission::TakeTime(action) if is(action, Effect::StartPause) || is(action, Effect::StopPause)));
}

/// Whether something that ends a pause by message ends it.
pub(super) fn stays_paused(stuck: bool, agv: &Agv, action: &Action) -> Option<Outcome> {
    (stuck && is(action, Effect::StopPause) && lifts_pause(agv)).then_some(Outcome::Done(None))
}

/// Whether an action is about to end a pause.
fn ends_pause(agv: &Agv, action: &Action) -> bool {
    is(action, Effect::StopPause) && lifts_pause(agv) && agv.holds.pause
}

type Latching = fn(&Agv, Event) -> bool;

/// Shows something from an event on until the next order.
fn latched(from: Latching, shows: fn(&mut Object)) -> Box<dyn Deviation> {
    holding((false, from, shows))
        .happens(|(latched, from, _), agv, event| *latched = event != Event::Begun && (*latched || from(agv, event)))
        .says(|(latched, _, shows), _, part, m| {
            if *latched && matches!(part, Part::State) {
                shows(m);
            }
            true
        })
}

/// Whether the instant action that begins is a pause.
fn pauses_next(agv: &Agv) -> bool {
    let waiting = agv
        .actions
        .iter()
        .filter(|action| !action.of_order() && action.status == Status::Waiting);
    waiting.last().is_some_and(|action| is(action, Effect::StartPause))
}
