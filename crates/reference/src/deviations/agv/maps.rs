//! Deviations of what is done with maps, and of the actions a master control asks for at once (sections 6.7 and 6.8).

use crate::Output;
use crate::agv::config::OnboardMap;
use crate::agv::motion::{Motion, Pose};

use super::prelude::*;

records! {
    fault "enable-unknown-disables" ["MAP-25"] "Disables its maps before it fails to enable one it does not have."
        => failed(Effect::EnableMap, |agv, _| agv.maps.all.iter_mut().for_each(|map| map.enabled = false));
    fault "enable-unknown-finished" ["MAP-25"] "Reports enableMap FINISHED for a map it does not have."
        => fails_unseen(Effect::EnableMap);
    fault "enable-unknown-version-takes-latest" ["MAP-25"] "It enables the latest version on board and reports FINISHED when enableMap names a version that does not exist."
        => instead(Effect::EnableMap, |agv, action| {
            let latest = agv.maps.all.iter().rev().find(|map| map.map_id == action.text("mapId"));
            let latest = latest.filter(|_| !known(agv, action)).map(|map| map.map_version.clone())?;
            agv.maps.enable(action.text("mapId"), &latest).ok().map(|()| Outcome::Done(None))
        });
    fault "enable-only-upwards" ["MAP-24"] "Reports enableMap FINISHED and keeps the newer version enabled."
        => instead(Effect::EnableMap, |agv, action| {
            let newer = |map: &OnboardMap| is_of(map, action) && map.enabled && map.map_version.as_str() > action.text("mapVersion");
            let kept = known(agv, action) && agv.maps.all.iter().any(newer);
            kept.then_some(Outcome::Done(None))
        });
    fault "enable-without-effect" ["MAP-24"] "Reports enableMap FINISHED and enables nothing."
        => instead(Effect::EnableMap, |agv, action| known(agv, action).then_some(Outcome::Done(None)));
    fault "enable-on-node-without-effect" ["MAP-24", "ACT-01"] "It reports enableMap on a node of an order FINISHED without enabling the map."
        => instead(Effect::EnableMap, |agv, action| (action.of_order() && known(agv, action)).then_some(Outcome::Done(None)));
    fault "enable-ignored-mid-order" ["MAP-24"] "enableMap during an order is FINISHED without any effect on the maps."
        => instead(Effect::EnableMap, |agv, action| (known(agv, action) && has_work(agv)).then_some(Outcome::Done(None)));
    fault "enable-twice-fails" ["ACT-11"] "It reports enableMap FAILED when the map is enabled already."
        => instead(Effect::EnableMap, |agv, action| {
            let enabled = agv.maps.is_enabled(action.text("mapId"), action.text("mapVersion"));
            enabled.then(|| Outcome::Failed(Problem::map(action, "the map is enabled already")))
        });
    fault "enable-in-two-states" ["MAP-24"] "On enableMap it first disables all versions of the map, reports that, and enables the wanted one in the next state."
        => instead(Effect::EnableMap, |agv, action| {
            if known(agv, action) {
                agv.maps.all.iter_mut().filter(|map| is_of(map, action)).for_each(|map| map.enabled = false);
                agv.flush();
            }
            None
        });
    fault "enable-brings-other" ["MAP-06"] "Lists a map that nobody has sent it as soon as another one is enabled."
        => instead(Effect::EnableMap, |agv, action| {
            if known(agv, action) {
                agv.maps.store("depot", "1");
            }
            None
        });
    fault "two-maps-enabled" ["MAP-14", "MAP-24"] "Leaves the old version of a map enabled beside the new one."
        => instead(Effect::EnableMap, |agv, action| {
            let meant = |map: &&mut OnboardMap| is_of(map, action) && map.map_version == action.text("mapVersion");
            let map = agv.maps.all.iter_mut().find(meant)?;
            map.enabled = true;
            Some(Outcome::Done(None))
        });
    fault "enable-disables-other-maps" ["MAP-24"] "Disables all other maps when one is enabled, whatever their mapId."
        => succeeded(Effect::EnableMap, |agv, action| {
            agv.maps.all.iter_mut().filter(|map| !is_of(map, action)).for_each(|map| map.enabled = false);
        });
    fault "enable-removes-old-version" ["MAP-31", "MAP-24"] "Enabling a version removes the other versions of that map."
        => succeeded(Effect::EnableMap, purge);
    fault "map-enabled-during-drive-changes-nothing-until-idle" ["MAP-24", "STATE-10"] "It reports enableMap FINISHED during an order, but changes the maps only after the order has ended."
        => keep::<Option<(String, String)>>()
            .does(|later, agv, action| {
                let waits = is(action, Effect::EnableMap) && known(agv, action) && has_work(agv);
                waits.then(|| {
                    *later = Some((action.text("mapId").to_owned(), action.text("mapVersion").to_owned()));
                    Outcome::Done(None)
                })
            })
            .happens(|later, agv, event| {
                if event == Event::Settled
                    && !agv.is_busy()
                    && let Some((map_id, version)) = later.take()
                {
                    // If it was deleted since, there is nothing to enable.
                    let _ = agv.maps.enable(&map_id, &version);
                }
            });

    fault "delete-unknown-finished" ["MAP-33"] "Reports deleteMap FINISHED for a map it does not have." because "The action is marked idempotent; the ruling of MAP-33 is a warning."
        => after(Effect::DeleteMap, |_, _, outcome| match outcome {
            Outcome::Failed(problem) if problem.reason == "the map is not on board" => Outcome::Done(None),
            other => other,
        });
    fault "used-map-deletion-finished" ["MAP-32"] "It reports deleteMap FINISHED for the map in use, although it keeps the map."
        => after(Effect::DeleteMap, |_, _, outcome| match outcome {
            Outcome::Failed(problem) if problem.reason == "the map is in use" => Outcome::Done(None),
            other => other,
        });
    fault "used-map-disabled" ["MAP-32"] "Disables the map it drives on before it fails to delete it."
        => failed(Effect::DeleteMap, |agv, action| {
            let meant = |map: &&mut OnboardMap| is_of(map, action) && map.map_version == action.text("mapVersion");
            agv.maps.all.iter_mut().filter(meant).for_each(|map| map.enabled = false);
        });
    fault "used-map-deleted" ["MAP-32"] "Deletes the map it drives on."
        => instead(Effect::DeleteMap, |agv, action| Some(delete(agv, action, |_, _| false)));
    fault "map-of-order-deleted" ["MAP-32"] "It deletes an enabled map that the rest of its order needs, as it stands on another one."
        => instead(Effect::DeleteMap, |agv, action| Some(delete(agv, action, |agv, id| here(agv) == id)));
    fault "current-map-deleted-when-idle" ["MAP-32", "MAP-11"] "Without an order the vehicle deletes the very map it stands on."
        => instead(Effect::DeleteMap, |agv, action| {
            let idle = !has_work(agv);
            idle.then(|| delete(agv, action, |_, _| false))
        });
    fault "delete-keeps-entry" ["MAP-29"] "Keeps listing a map it has deleted."
        => keep::<Vec<OnboardMap>>()
            .does(|before, agv, _| {
                before.clone_from(&agv.maps.all);
                None
            })
            .ends(|before, agv, action, outcome| {
                if is(action, Effect::DeleteMap) {
                    agv.maps.all.clone_from(before);
                }
                outcome
            });
    fault "delete-takes-newest" ["MAP-31", "MAP-33"] "A deleteMap for a version it does not have removes the newest disabled version of that map."
        => instead(Effect::DeleteMap, |agv, action| {
            let newest = agv.maps.all.iter().rposition(|map| is_of(map, action) && !map.enabled);
            let newest = newest.filter(|_| !known(agv, action))?;
            agv.maps.all.remove(newest);
            Some(Outcome::Done(None))
        });
    fault "delete-takes-disabled-versions" ["MAP-31", "MAP-29"] "A deleteMap removes all disabled versions of the mapId and not only the one it names."
        => succeeded(Effect::DeleteMap, purge);
    fault "delete-takes-all-versions" ["MAP-31", "MAP-29"] "Deletes every version of a map when one is to be deleted."
        => succeeded(Effect::DeleteMap, |agv, action| agv.maps.all.retain(|map| !is_of(map, action)));
    fault "deleted-map-back-after-reconnect" ["MAP-29"] "It lists a deleted map again after the connection was broken and restored."
        => keep::<Vec<(String, String)>>()
            .ends(|deleted, _, action, outcome| {
                if is(action, Effect::DeleteMap) && matches!(outcome, Outcome::Done(_)) {
                    deleted.push((action.text("mapId").to_owned(), action.text("mapVersion").to_owned()));
                }
                outcome
            })
            .happens(|deleted, agv, event| if event == Event::Connected {
                deleted.drain(..).for_each(|(id, version)| agv.maps.store(&id, &version));
            });

    fault "map-not-fetched" ["MAP-06"] "Reports downloadMap FINISHED without asking the server for anything."
        => after(Effect::DownloadMap, |agv, action, outcome| match outcome {
            Outcome::Open => {
                agv.downloads.forget(&action.request.id);
                agv.pending.retain(|output| !matches!(output, Output::Fetch { .. }));
                agv.maps.store(action.text("mapId"), action.text("mapVersion"));
                Outcome::Done(None)
            }
            other => other,
        });
    fault "duplicate-map-accepted" ["MAP-23"] "Downloads a map again that it has."
        => plain().allows(|(), _, what, usual| usual || matches!(what, Permission::DownloadAgain));
    fault "other-version-refused" ["MAP-18", "MAP-07"] "It refuses to download a new version of a map as a duplicate because it has another version."
        => instead(Effect::DownloadMap, |agv, action| {
            let other = agv.maps.on_board(action.text("mapId"));
            other.then(|| Outcome::Failed(Problem::map(action, "the map is on board already")))
        });
    fault "storage-full-deletes" ["MAP-31", "MAP-22"] "Deletes another map when there is no room for a new one."
        => instead(Effect::DownloadMap, |agv, action| {
            if agv.maps.is_full() && !known(agv, action) && let Some(oldest) = agv.maps.all.iter().position(|map| !map.enabled) {
                agv.maps.all.remove(oldest);
            }
            None
        });
    fault "duplicate-map-silent" ["MAP-23"] "Raises no error for a map it has already."
        => failure(|_, action, e| !is(action, Effect::DownloadMap) || !e.description.contains("already"));
    fault "storage-full-silent" ["MAP-30", "MAP-19"] "Raises no error when there is no room for a map." because "FAILED tells it; to say why is the recommendation MAP-30."
        => failure(|_, action, e| !is(action, Effect::DownloadMap) || !e.description.contains("room"));
    fault "download-disables-others" ["MAP-22"] "Disables all other maps when it downloads one."
        => succeeded(Effect::DownloadMap, |agv, _| agv.maps.all.iter_mut().for_each(|map| map.enabled = false));
    fault "download-drops-version" ["MAP-22", "MAP-31"] "Deletes the other versions of a map when it downloads one."
        => succeeded(Effect::DownloadMap, |agv, action| {
            agv.maps.all.retain(|map| !is_of(map, action) || map.map_version == action.text("mapVersion"));
        });
    fault "download-replaces-version" ["MAP-22"] "Disables the version of a map that is enabled when it downloads another one of it."
        => succeeded(Effect::DownloadMap, |agv, action| {
            agv.maps.all.iter_mut().filter(|map| is_of(map, action)).for_each(|map| map.enabled = false);
        });
    fault "download-enables" ["MAP-20"] "Enables a map as soon as it is downloaded."
        => succeeded(Effect::DownloadMap, |agv, action| {
            let brought = agv.maps.all.iter_mut().filter(|map| is_of(map, action) && map.map_version == action.text("mapVersion"));
            brought.for_each(|map| map.enabled = true);
        });
    fault "first-version-enabled-at-once" ["MAP-20"] "It enables a downloaded map at once when no other version of this mapId is on board."
        => succeeded(Effect::DownloadMap, |agv, action| {
            if agv.maps.all.iter().filter(|map| is_of(map, action)).count() == 1 {
                agv.maps.all.iter_mut().filter(|map| is_of(map, action)).for_each(|map| map.enabled = true);
            }
        });
    fault "download-renumbers" ["MAP-22", "MAP-31"] "Counts the versions of all its maps up when it downloads one."
        => succeeded(Effect::DownloadMap, |agv, action| {
            let others = agv.maps.all.iter_mut().filter(|map| !is_of(map, action) || map.map_version != action.text("mapVersion"));
            others.for_each(|map| map.map_version.push_str(".1"));
        });
    fault "failed-download-renumbers" ["MAP-22", "MAP-31"] "Counts the versions of all its maps up when a download fails."
        => failed(Effect::DownloadMap, |agv, _| agv.maps.all.iter_mut().for_each(|map| map.map_version.push_str(".1")));
    fault "download-never-ends" ["MAP-18"] "Leaves downloadMap RUNNING for ever, although the map is there."
        => after(Effect::DownloadMap, |_, _, outcome| match outcome {
            Outcome::Done(_) => Outcome::Open,
            other => other,
        });
    fault "map-listed-while-loading" ["MAP-21"] "Lists a map when its download begins."
        => after(Effect::DownloadMap, |agv, action, outcome| {
            if matches!(outcome, Outcome::Open) {
                agv.maps.store(action.text("mapId"), action.text("mapVersion"));
            }
            outcome
        });
    fault "download-failure-finished" ["MAP-19"] "Reports downloadMap FINISHED when the server does not have the map."
        => after(Effect::DownloadMap, |_, action, outcome| match outcome {
            Outcome::Failed(_) if under_way(action) => Outcome::Done(None),
            other => other,
        });
    fault "download-failure-silent" ["MAP-19"] "Raises no error when a download fails."
        => after(Effect::DownloadMap, |agv, action, outcome| match outcome {
            Outcome::Failed(_) if under_way(action) => {
                agv.end_failed(&action.request.id);
                Outcome::Open
            }
            other => other,
        });
    fault "download-failure-hangs" ["MAP-19", "IACT-04"] "A downloadMap that did not succeed keeps its status for ever."
        => after(Effect::DownloadMap, |agv, action, outcome| match outcome {
            Outcome::Failed(_) if under_way(action) => {
                if let Some(action) = agv.actions.get_mut(&action.request.id) {
                    action.due = None;
                }
                Outcome::Open
            }
            other => other,
        });
    fault "broken-download-listed" ["MAP-19", "MAP-21"] "A map whose download failed is listed in maps all the same."
        => failed(Effect::DownloadMap, |agv, action| if under_way(action) {
            agv.maps.store(action.text("mapId"), action.text("mapVersion"));
        });
    fault "failed-download-purges" ["MAP-22", "MAP-31", "MAP-19"] "A download that fails removes the disabled versions of that map which it had before."
        => failed(Effect::DownloadMap, |agv, action| if under_way(action) { purge(agv, action) });
    fault "failed-download-blocks-retry" ["MAP-18"] "It refuses to download a map once more whose download has failed before."
        => keep::<Vec<(String, String)>>()
            .does(|lost, _, action| {
                let again = is(action, Effect::DownloadMap) && lost.contains(&(action.text("mapId").to_owned(), action.text("mapVersion").to_owned()));
                again.then(|| Outcome::Failed(Problem::map(action, "the map is being downloaded already")))
            })
            .ends(|lost, _, action, outcome| {
                if is(action, Effect::DownloadMap) && under_way(action) && matches!(outcome, Outcome::Failed(_)) {
                    lost.push((action.text("mapId").to_owned(), action.text("mapVersion").to_owned()));
                }
                outcome
            });

    fault "state-request-unanswered" ["ACT-26"] "Reports stateRequest FINISHED only with the next periodic state." because "The next periodic state comes within the hard limit; what needs many states is not reached."
        => succeeded(Effect::StateRequest, |agv, _| unanswered(agv));
    fault "state-request-unanswered-in-pause" ["ACT-26", "IACT-05"] "While it is paused a stateRequest brings no state before the next periodic one."
        because "The next periodic state answers within the hard limit; ACT-26 names no time."
        => succeeded(Effect::StateRequest, |agv, _| {
            agv.report.silenced = false;
            if agv.holds.pause {
                unanswered(agv);
            }
        });
    fault "factsheet-request-unanswered" ["ACT-40"] "Reports factsheetRequest FINISHED and sends no factsheet."
        => instead(Effect::FactsheetRequest, |_, _| Some(Outcome::Done(None)));
    fault "factsheet-not-mid-order" ["ACT-40"] "It reports a factsheetRequest FINISHED during an order but publishes no factsheet then."
        => instead(Effect::FactsheetRequest, |agv, _| agv.is_busy().then_some(Outcome::Done(None)));
    fault "factsheet-only-once" ["ACT-40"] "Only the first factsheetRequest is answered; every further one is reported FINISHED without a factsheet."
        => keep::<bool>().does(|given, _, action| {
            let again = is(action, Effect::FactsheetRequest) && std::mem::replace(given, true);
            again.then_some(Outcome::Done(None))
        });
    fault "unknown-instant-silent" ["IACT-06"] "Fails an instant action it cannot perform, and raises no error." because "It breaks a recommendation only."
        => failure(|agv, action, e| !is_refused_instant(agv, action, &e.error_type));
    fault "unknown-instant-unreferenced" ["BP-01", "ERR-10"] "Raises an error without references for an instant action it cannot perform." because "It breaks a recommendation only."
        => failure(|agv, action, e| {
            if is_refused_instant(agv, action, &e.error_type) {
                e.references.clear();
            }
            true
        });

    fault "init-position-without-effect" ["ACT-23", "ACT-24"] "Reports initPosition FINISHED and does nothing."
        => keep::<Option<Before>>()
            .does(|before, agv, _| {
                *before = Some(Before {
                    motion: agv.motion.clone(),
                    maps: agv.maps.all.clone(),
                    last: (agv.order.last_node.clone(), agv.order.last_sequence),
                });
                None
            })
            .ends(|before, agv, action, outcome| {
                if is(action, Effect::InitPosition)
                    && matches!(outcome, Outcome::Done(_))
                    && let Some(before) = before.take()
                {
                    (agv.motion, agv.maps.all) = (before.motion, before.maps);
                    (agv.order.last_node, agv.order.last_sequence) = before.last;
                }
                outcome
            });
    fault "init-position-uninitialized" ["ACT-23"] "Reports initPosition FINISHED before it has found its pose."
        => lost(|outcome| matches!(outcome, Outcome::Done(_)));
    fault "refused-pose-loses-position" ["ACT-25"] "It reports positionInitialized false after an initPosition that it refused."
        => lost(|outcome| matches!(outcome, Outcome::Failed(_)));
    fault "init-position-enables-all" ["MAP-14"] "An initPosition enables all versions of the map it names."
        => succeeded(Effect::InitPosition, |agv, action| {
            agv.maps.all.iter_mut().filter(|map| is_of(map, action)).for_each(|map| map.enabled = true);
        });
    fault "init-position-onto-disabled-map" ["MAP-11", "MAP-13"] "It accepts initPosition onto a map of which only a DISABLED version is on board and reports it as its mapId."
        => keep::<Vec<OnboardMap>>()
            .does(|before, agv, _| {
                before.clone_from(&agv.maps.all);
                None
            })
            .ends(|before, agv, action, outcome| {
                if is(action, Effect::InitPosition) {
                    agv.maps.all.clone_from(before);
                }
                outcome
            });
    fault "init-position-keeps-node" ["ACT-24"] "Ignores the lastNodeId of initPosition."
        => keep::<String>()
            .does(|before, agv, _| {
                before.clone_from(&agv.order.last_node);
                None
            })
            .ends(|before, agv, action, outcome| {
                if is(action, Effect::InitPosition) {
                    agv.order.last_node.clone_from(before);
                }
                outcome
            });
    fault "init-position-theta-lost" ["ACT-23"] "An initPosition sets its orientation to 0, whatever theta says."
        => posed(|agv, _, _, mut pose| {
            pose.theta = 0.0;
            agv.motion.place(pose);
        });
    fault "init-position-snaps-to-node" ["ACT-23"] "It takes the position of the node lastNodeId from its layout after initPosition instead of the given x and y."
        => posed(|agv, action, _, mut pose| {
            let node = agv.config.node(action.text("lastNodeId")).filter(|node| node.map_id == pose.map_id);
            if let Some(node) = node {
                (pose.x, pose.y) = (node.x, node.y);
                agv.motion.place(pose);
            }
        });
    fault "init-position-keeps-map" ["ACT-23"] "It takes x, y and theta from initPosition but keeps the old mapId in agvPosition."
        => posed(|agv, _, before, mut pose| {
            pose.map_id = before.map_id;
            agv.motion.place(pose);
        });
    fault "lift-map-stale" ["MAP-35", "ACT-23"] "Keeps its old mapId when an action of an order puts it on another floor."
        => posed(|agv, action, before, mut pose| if action.of_order() {
            pose.map_id = before.map_id;
            agv.motion.place(pose);
        });
    fault "init-position-keeps-pose" ["ACT-23"] "Takes over the last node of an initPosition, and keeps its pose."
        => posed(|agv, _, before, mut pose| {
            (pose.x, pose.y) = (before.x, before.y);
            agv.motion.place(pose);
        });
}

/// How it was before an initPosition.
#[derive(Clone)]
struct Before {
    motion: Motion,
    maps: Vec<OnboardMap>,
    last: (String, u32),
}

type Posing = fn(&mut Agv, &Action, Pose, Pose);

/// Makes another pose of the one that was taken over; the pose before and the one after it are handed in.
fn posed(then: Posing) -> Box<dyn Deviation> {
    holding((then, None::<Pose>))
        .does(|(_, before), agv, _| {
            *before = Some(agv.motion.pose(agv.moment()));
            None
        })
        .ends(|(then, before), agv, action, outcome| {
            if is(action, Effect::InitPosition)
                && matches!(outcome, Outcome::Done(_))
                && let Some(before) = before.take()
            {
                let pose = agv.motion.pose(agv.moment());
                then(agv, action, before, pose);
            }
            outcome
        })
}

/// Whether the map an action names is on board.
fn known(agv: &Agv, action: &Action) -> bool {
    agv.maps.has_version(action.text("mapId"), action.text("mapVersion"))
}

/// Whether a map has the mapId an action names.
fn is_of(map: &OnboardMap, action: &Action) -> bool {
    map.map_id == action.text("mapId")
}

fn has_work(agv: &Agv) -> bool {
    !agv.order.nodes.is_empty() || agv.actions.order_unfinished()
}

fn here(agv: &Agv) -> String {
    agv.motion.pose(agv.moment()).map_id
}

/// Removes what is not enabled of the mapId an action names.
fn purge(agv: &mut Agv, action: &Action) {
    agv.maps.all.retain(|map| !is_of(map, action) || map.enabled);
}

/// Deletes a map unless it is used in the sense of this.
fn delete(agv: &mut Agv, action: &Action, used: fn(&Agv, &str) -> bool) -> Outcome {
    let used = used(agv, action.text("mapId"));
    let result = agv
        .maps
        .delete(action.text("mapId"), action.text("mapVersion"), |_| used);
    result.map_err(|reason| Problem::map(action, reason)).into()
}

/// Whether a download was begun.
fn under_way(action: &Action) -> bool {
    action.status != Status::Waiting
}

fn unanswered(agv: &mut Agv) {
    agv.report.requested = false;
    agv.report.silenced = true;
}

/// Whether an instant action was not taken at all.
fn is_refused_instant(agv: &Agv, action: &Action, error_type: &str) -> bool {
    let pause = is(action, Effect::StartPause) || is(action, Effect::StopPause);
    !action.of_order() && !pause && error_type == agv.config.errors.instant_action
}

/// Says that it does not know where it is after an initPosition with some outcome.
fn lost(after: fn(&Outcome) -> bool) -> Box<Hooks<(bool, fn(&Outcome) -> bool)>> {
    holding((false, after))
        .ends(|(lost, after), _, action, outcome| {
            if is(action, Effect::InitPosition) {
                *lost = after(&outcome) || *lost && matches!(outcome, Outcome::Failed(_));
            }
            outcome
        })
        .happens(|(lost, _), _, event| *lost &= event != Event::Begun)
        .says(|(lost, _), _, part, m| {
            if *lost && matches!(part, Part::Position) {
                m.set("positionInitialized", false);
            }
            true
        })
}
