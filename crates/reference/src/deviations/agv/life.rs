//! Deviations of going to sleep, waking up and leaving, and of the triggers that actions wait for (section 6.2.3.1 of 3.0).

use super::prelude::*;
use crate::Output;
use crate::agv::certificate_set::Flaw;
use crate::agv::report::Telling;

records! {
    fault "sleeps-without-a-word" ["HIB-01"] "It goes to hibernation while its last state still says that startHibernation is RUNNING."
        => action(|_, action, m| {
            if is(action, Effect::StartHibernation) && action.status == Status::Finished {
                m.set("actionStatus", "RUNNING");
            }
            true
        });
    fault "hibernating-not-said" ["HIB-02"] "It goes silent on startHibernation, and its connection topic goes on saying ONLINE."
        => unsaid(|_, name, body| name == "connection" && body.says("connectionState", "HIBERNATING"));
    fault "hibernating-not-retained" ["HIB-02"] "It says HIBERNATING without the retain flag, so that the broker keeps ONLINE."
        => sending(|_, out| if out.message.says("connectionState", "HIBERNATING") { out.retain = false });
    fault "hibernates-disconnected" ["HIB-03"] "It disconnects when it goes to hibernation, and comes back a while later."
        => when(Event::FallenAsleep, |agv| {
            agv.shut_down();
            let back = agv.moment() + Duration::from_secs(1);
            agv.connection.wanted_at(back);
        });
    fault "hibernation-breaks-the-link" ["HIB-03", "HIB-11"] "It closes its connection without a DISCONNECT when it goes to hibernation, and hears nothing any more."
        => when(Event::FallenAsleep, |agv| {
            agv.pending.push(Output::Drop);
            agv.connection.stays_away();
        });
    fault "hibernates-with-its-order" ["HIB-04", "ORD-CLEAR-02", "HIB-05"] "It keeps its order in hibernation."
        => forbidding(|_, what| matches!(what, Permission::ClearForSleep));
    fault "sleepwalks" ["HIB-05"] "It is on another node after its hibernation."
        => when(Event::FallenAsleep, |agv| {
            let other = agv.config.nodes.iter().find(|node| node.id != agv.order.last_node).map(|node| node.id.clone());
            agv.order.last_node = other.unwrap_or_default();
        });
    fault "obeys-in-its-sleep" ["HIB-06"] "It takes orders and instant actions in hibernation, and shows them when it wakes."
        => letting(|_, what| matches!(what, Permission::HeedAsleep));
    fault "answers-in-its-sleep" ["HIB-06"] "It answers a stateRequest or a factsheetRequest in hibernation, and sleeps on."
        => plain().hears(|(), agv, name, payload| {
            if agv.sleep.asleep && name == "instantActions" {
                answer_asleep(agv, payload);
            }
            true
        });
    fault "takes-up-what-it-slept-through" ["HIB-06"] "It works off what it was sent in hibernation as soon as it wakes."
        => keep::<Vec<Vec<u8>>>()
            .hears(|missed, agv, name, payload| {
                if agv.overhears() && name == "instantActions" {
                    missed.push(payload.to_vec());
                }
                true
            })
            .happens(|missed, agv, event| if event == Event::Awoken {
                for payload in std::mem::take(missed) {
                    agv.instant_actions_received(&payload);
                }
            });
    fault "chatters-in-its-sleep" ["HIB-07"] "It goes on sending states in hibernation." because "The text lets it; the table of connection states does not."
        => letting(|_, what| matches!(what, Permission::SpeakAsleep));
    fault "wakes-without-online" ["HIB-10"] "It goes on sending states after stopHibernation, and its connection topic still says HIBERNATING."
        => unsaid(|agv, name, body| name == "connection" && body.says("connectionState", "ONLINE") && agv.states_sent > 0 && agv.connection.sessions == 1);
    fault "wakes-without-finishing" ["HIB-10"] "It leaves stopHibernation RUNNING for ever when it has woken up."
        => action(|_, action, m| {
            if is(action, Effect::StopHibernation) && action.status == Status::Finished {
                m.set("actionStatus", "RUNNING");
            }
            true
        });
    fault "sleeps-for-ever" ["HIB-11", "HIB-10"] "It hears nothing at all in hibernation, and is never awake again."
        => plain().hears(|(), agv, _, _| !agv.sleep.asleep);
    fault "sleeps-despite-the-switch" ["HIB-12"] "It goes to hibernation although a switch forbids that."
        => forbidding(|agv, what| agv.sleep.blocked && matches!(what, Permission::HeedSwitch));
    fault "shuts-down-mid-order" ["SHUT-01"] "It shuts down although it has an order."
        => forbidding(|_, what| matches!(what, Permission::RefuseShutdown));
    fault "refused-shutdown-done" ["SHUT-01"] "It says that shutdown has failed while it has an order, and is off a moment later."
        => failed(Effect::Shutdown, |agv, _| agv.shut_down());
    fault "offline-on-refused-shutdown" ["SHUT-01"] "It refuses a shutdown while it has an order, and says OFFLINE all the same."
        => failed(Effect::Shutdown, |agv, _| agv.publish_connection("OFFLINE"));
    fault "shutdown-ends-the-order" ["SHUT-01"] "It refuses to shut down while it has an order, and gives the order up all the same."
        => failed(Effect::Shutdown, |agv, _| agv.give_up_order());
    fault "shutdown-is-a-word" ["SHUT-02"] "It reports shutdown FINISHED and stays where it is."
        => instead(Effect::Shutdown, |_, _| Some(Outcome::Done(None)));
    fault "shutdown-breaks-the-link" ["SHUT-02", "CONN-07", "CONN-08"] "On shutdown it closes its connection without OFFLINE and without a DISCONNECT, so that its last will is published."
        => keep::<bool>()
            .ends(|leaves, _, action, outcome| {
                *leaves |= is(action, Effect::Shutdown) && matches!(outcome, Outcome::Done(_));
                outcome
            })
            .happens(|leaves, _, event| *leaves &= event != Event::Connected)
            .allows(|leaves, _, what, usual| usual && !(*leaves && match what {
                Permission::Disconnect => true,
                Permission::Say("connection", body) => body.says("connectionState", "OFFLINE"),
                _ => false,
            }));
    fault "shuts-down-without-a-word" ["SHUT-02"] "It shuts down before a state says that shutdown is FINISHED." because "By the ruling of SHUT-02 a missing last state is a warning."
        => action(|_, action, m| {
            if is(action, Effect::Shutdown) && action.status == Status::Finished {
                m.set("actionStatus", "RUNNING");
            }
            true
        });

    fault "node-kept-when-driven-away" ["MODE-14"] "It goes on naming its last node when it was driven away from it by hand."
        => forbidding(|_, what| matches!(what, Permission::ForgetNode));
    fault "hard-instant-ignored" ["IACT-09"] "It passes over an instant action whose blockingType is not NONE." because "It breaks a recommendation only."
        => plain().reads_instants(|(), _, actions| actions.retain(|action| action["blockingType"] == "NONE"));
    fault "retries-whatever-fails" ["RETRY-02"] "It lets an action wait for a retry that was not sent as retriable."
        => action(|_, action, m| {
            let failed = action.of_order() && action.status == Status::Failed && !action.request.retriable;
            if failed && is(action, Effect::Pick) {
                m.set("actionStatus", "RETRIABLE");
            }
            true
        });
    fault "failed-retriable-keeps-running" ["RETRY-01"] "An action that may be tried again stays RUNNING when it has failed." because "To wait for a retry is a permission; what is neither is remarked on."
        => action(|_, action, m| {
            if action.request.retriable && matches!(action.status, Status::Retriable | Status::Failed) {
                m.set("actionStatus", "RUNNING");
            }
            true
        });
    fault "retriable-survives-cancel" ["ORD-CANCEL-27", "RETRY-06"] "An action that waits for a retry goes on waiting when its order is cancelled."
        => breaking(|_, action, usual| usual.filter(|_| action.status != Status::Retriable));
    fault "pause-lingers" ["STATE-18"] "It goes on saying that it is paused for five seconds after the pause has ended."
        => keep::<Option<Moment>>()
            .happens(|until, agv, event| if event == Event::Resuming { *until = Some(agv.moment() + Duration::from_secs(5)) })
            .says(|until, agv, part, m| {
                if until.is_some_and(|until| agv.moment() < until) && matches!(part, Part::State) {
                    m.set("paused", true);
                }
                true
            });
    fault "flags-without-state" ["STATE-18", "STATE-19"] "It sends no state of its own when paused or safetyState changes."
        => plain().tells(|(), _, changes, _| match changes.other && !changes.actions && !changes.error {
            true => Telling::Later,
            false => Telling::Now,
        });
    fault "factsheet-without-pause" ["FACT-18"] "Its factsheet lists neither startPause nor stopPause." because "By the ruling of FACT-18 it is a warning where they work."
        => factsheet(|_, m| m.part("protocolFeatures", |f| f.keep("agvActions", |a| !matches!(a.text("actionType"), "startPause" | "stopPause"))));
    fault "trigger-is-a-word" ["TRIG-01"] "trigger is FINISHED, and what waits for it goes on waiting."
        => instead(Effect::Trigger, |_, _| Some(Outcome::Done(None)));
    fault "trigger-never-finished" ["TRIG-01"] "It leaves trigger RUNNING for ever when it has released what waited for it."
        => action(|_, action, m| {
            if is(action, Effect::Trigger) && action.status == Status::Finished {
                m.set("actionStatus", "RUNNING");
            }
            true
        });
    fault "trigger-in-vain-finished" ["TRIG-02"] "trigger is FINISHED although nothing waited for it." because "It breaks a recommendation only."
        => after(Effect::Trigger, |_, _, _| Outcome::Done(None));
    fault "any-trigger-will-do" ["ACT-37"] "A button on the vehicle ends what waits for the fleet control alone." because "The text does not say that nothing else may end it."
        => letting(|_, what| matches!(what, Permission::HeedTrigger(action) if action.status == Status::Running));
    fault "certificate-fetched-in-clear" ["CERT-03", "CERT-02"] "It fetches key and certificate over plain HTTP, and takes them over."
        => forbidding(|_, what| matches!(what, Permission::RefusePlainLink | Permission::RefuseCertificate(Flaw::Unreadable)));
    fault "certificate-not-downloaded" ["CERT-01", "CERT-02"] "It reports updateCertificate FINISHED without having fetched a file."
        => forbidding(|_, what| matches!(what, Permission::FetchForCertificate(_)));
    fault "certificate-key-kept" ["CERT-01", "CERT-02"] "It fetches a new certificate, and goes on with the key it has."
        => forbidding(|_, what| matches!(what, Permission::FetchForCertificate("keyDownloadLink")));
    fault "old-certificate-kept" ["CERT-01"] "It fetches a new key, and goes on with the certificate it has."
        => forbidding(|_, what| matches!(what, Permission::FetchForCertificate("certificateDownloadLink")));
    fault "certificate-authority-kept" ["CERT-01", "CERT-04"] "It does not fetch the authority that a new certificate comes with." because "The parameter is optional: a warning."
        => forbidding(|_, what| matches!(what, Permission::FetchForCertificate("certificateAuthorityDownloadLink")));
    fault "certificate-never-active" ["CERT-01"] "It leaves updateCertificate RUNNING for ever when it has all files."
        => action(|_, action, m| {
            if is(action, Effect::UpdateCertificate) && action.status == Status::Finished {
                m.set("actionStatus", "RUNNING");
            }
            true
        });
    fault "certificate-taken-for-broken" ["CERT-01"] "It fetches a certificate with its key, and reports updateCertificate FAILED however good they are."
        => after(Effect::UpdateCertificate, |_, action, outcome| match outcome {
            Outcome::Done(_) => Outcome::Failed(Problem::unable(action, "the certificate cannot be used")),
            other => other,
        });
    fault "broken-certificate-activated" ["CERT-02"] "It takes a file over that is no certificate, and reports updateCertificate FINISHED."
        => forbidding(|_, what| matches!(what, Permission::RefuseCertificate(Flaw::Unreadable)));
    fault "other-key-activated" ["CERT-02"] "It takes a key over that does not belong to the certificate, and reports updateCertificate FINISHED."
        => forbidding(|_, what| matches!(what, Permission::RefuseCertificate(Flaw::OtherKey)));
    fault "certificate-chain-unchecked" ["CERT-04"] "It takes a certificate over that does not lead to the authority it came with." because "It breaks a recommendation only."
        => forbidding(|_, what| matches!(what, Permission::RefuseCertificate(Flaw::Stray)));
    tolerance "failed-download-waits-for-a-retry" ["MAP-19", "ZSET-18", "RETRY-02"] "A download that has failed is RETRIABLE until retry or skipRetry comes."
        => keep::<Vec<String>>()
            .ends(|failed, agv, action, outcome| {
                let fetches = is(action, Effect::DownloadMap) || is(action, Effect::DownloadZoneSet);
                let begun = action.status != Status::Waiting && agv.config.has("retry");
                if fetches && begun && matches!(outcome, Outcome::Failed(_)) {
                    failed.push(action.id());
                }
                outcome
            })
            .raises(|failed, agv, cause, _| {
                if let Cause::Failure(Some(action)) = cause && failed.contains(&action.request.id) {
                    agv.waits_for_retry(&action.request.id);
                }
                true
            })
            .does(|failed, agv, action| {
                let named = action.text("actionId").to_owned();
                let waits = agv.actions.get(&named).is_some_and(|named| named.status == Status::Retriable);
                let again = is(action, Effect::Retry) && waits && failed.contains(&named);
                again.then(|| {
                    failed.retain(|id| *id != named);
                    agv.complete(&named);
                    Outcome::Done(None)
                })
            });
    tolerance "sleeps-as-another-client" ["HIB-11", "HIB-03", "CONN-11"] "In hibernation another client of the vehicle holds the connection, and says HIBERNATING again whenever it connects."
        => keep::<(bool, Option<Moment>)>()
            .connects(|(asleep, _), _, options| if *asleep {
                options.client_id.push_str(".asleep");
            })
            .happens(|(asleep, wakes_at), agv, event| match event {
                Event::FallenAsleep if !*asleep => {
                    (*asleep, *wakes_at) = (true, agv.sleep.wakes_at);
                    agv.pending.push(Output::Disconnect);
                    let next = agv.moment() + Duration::from_millis(100);
                    agv.connection.dropped(next);
                }
                Event::Connected if *asleep => {
                    (agv.sleep.asleep, agv.sleep.wakes_at) = (true, *wakes_at);
                    agv.publish_connection("HIBERNATING");
                }
                Event::Awoken | Event::PowerCycled => *asleep = false,
                _ => {}
            })
            .allows(|(asleep, _), _, what, usual| {
                usual && !(*asleep && matches!(what, Permission::SayOnline | Permission::SayFactsheet))
            });
    tolerance "wakes-for-its-battery" ["HIB-08"] "It wakes after five seconds of hibernation because its battery runs low, and says so in an error."
        => keep::<Option<Moment>>()
            .happens(|low, agv, event| match event {
                Event::FallenAsleep => *low = Some(agv.moment() + Duration::from_secs(5)),
                Event::Awoken | Event::Connected | Event::PowerCycled => *low = None,
                Event::Woken if low.take_if(|low| *low <= agv.moment()).is_some() && agv.sleep.asleep => {
                    agv.errors.raise(ActiveError {
                        error_type: "batteryLow".to_owned(),
                        fatal: false,
                        references: Vec::new(),
                        description: "the battery has to be charged".to_owned(),
                        life: Life::Until(agv.moment() + Duration::from_secs(30)),
                    });
                    agv.wakes_up();
                }
                _ => {}
            })
            .due(|low, _| *low);
    tolerance "never-waits-for-a-retry" ["RETRY-01"] "A retriable action that fails is FAILED at once."
        => failure(|agv, action, _| {
            if action.status == Status::Retriable {
                agv.end_failed(&action.request.id);
            }
            true
        });
}

/// Takes the requests for a state and a factsheet out of an instantActions message, and answers them.
fn answer_asleep(agv: &mut Agv, payload: &[u8]) {
    let Ok(mut message) = serde_json::from_slice::<Value>(payload) else {
        return;
    };
    if let Some(actions) = message.get_mut("actions").and_then(Value::as_array_mut) {
        actions.retain(|action| matches!(action["actionType"].as_str(), Some("stateRequest" | "factsheetRequest")));
        if !actions.is_empty() {
            agv.sleep.speaks = true;
            agv.instant_actions_received(message.to_string().as_bytes());
        }
    }
}
