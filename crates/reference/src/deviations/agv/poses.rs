//! Deviations of downloads and of finding its position (section 6.7 and ACT-23 to ACT-25).

use crate::Output;
use crate::agv::motion::Pose;

use super::prelude::*;

records! {
    fault "manual-enable-unreported" ["MAP-26", "STATE-10"] "Does not report a map enabled on the vehicle."
        => forbidding(|_, what| matches!(what, Permission::EnableByHand));
    fault "download-never-running" ["MAP-17"] "Keeps downloadMap INITIALIZING while it downloads."
        => when(Event::DownloadRunning, |agv| downloads(agv, Status::Initializing));
    fault "download-finished-early" ["MAP-18", "MAP-21", "MAP-17"] "Reports downloadMap FINISHED when the first byte arrives."
        => when(Event::DownloadRunning, |agv| downloads(agv, Status::Finished));
    fault "hash-ignored" ["MAP-34"] "Does not verify the hash of a map." because "It breaks a recommendation only."
        => forbidding(|_, what| matches!(what, Permission::CheckHash));
    fault "init-position-taken-anyway" ["ACT-25"] "Changes its map although it fails an initPosition."
        => keep::<Option<String>>()
            .raises(|map, agv, cause, _| {
                if let Cause::Failure(Some(action)) = cause
                    && is(action, Effect::InitPosition)
                    && !agv.maps.on_board(action.text("mapId"))
                {
                    *map = Some(action.text("mapId").to_owned());
                }
                true
            })
            .happens(|map, _, event| if event == Event::Begun {
                *map = None;
            })
            .says(|map, _, part, m| {
                if let (Some(map), Part::Position) = (map, part) {
                    m.set("mapId", map.clone());
                }
                true
            });
    fault "init-position-unchecked" ["ACT-25"] "Takes over a pose on a map it does not have."
        => instead(Effect::InitPosition, |agv, action| {
            let idle = action.of_order() || agv.order.nodes.is_empty() && !agv.actions.order_unfinished();
            idle.then(|| take_pose(agv, action)).flatten()
        });
    fault "init-position-any-map" ["ACT-25"] "It reports initPosition FINISHED for a map that it does not have."
        => instead(Effect::InitPosition, |agv, action| {
            let idle = action.of_order() || agv.order.nodes.is_empty() && !agv.actions.order_unfinished();
            let unknown = !agv.maps.on_board(action.text("mapId"));
            (idle && unknown).then(|| take_pose(agv, action)).flatten()
        });
    tolerance "init-position-resets-sequence" ["ACT-24", "STATE-MSG-04"] "An initPosition sets its lastNodeSequenceId to 0."
        => succeeded(Effect::InitPosition, |agv, action| if !action.of_order() {
            agv.order.last_sequence = 0;
        });
    tolerance "enabled-unused-map-not-deleted" ["MAP-29", "MAP-32"] "It refuses to delete a map that is enabled though neither its position nor its order needs it."
        => instead(Effect::DeleteMap, |agv, action| {
            let enabled = agv.maps.is_enabled(action.text("mapId"), action.text("mapVersion"));
            enabled.then(|| Outcome::Failed(Problem::map(action, "the map is in use")))
        });
    tolerance "map-delisted-next" ["MAP-29"] "It removes the entry of a deleted map in the state after the one that reports the deleteMap FINISHED."
        => instead(Effect::DeleteMap, |agv, action| {
            let before = agv.maps.clone();
            match agv.delete_map(action) {
                Ok(()) => {
                    let after = std::mem::replace(&mut agv.maps, before);
                    agv.finish(&action.request.id, None);
                    agv.flush();
                    agv.maps = after;
                    Some(Outcome::Open)
                }
                refused => Some(refused.into()),
            }
        });
    tolerance "map-listed-next" ["MAP-20", "MAP-21"] "It lists a downloaded map in the state after the one that reports the downloadMap FINISHED."
        => when(Event::Downloaded, |agv| {
            downloads(agv, Status::Finished);
            agv.flush();
        });
    tolerance "download-runs-at-once" ["MAP-17"] "It reports a downloadMap RUNNING as soon as it asks for the file, without INITIALIZING."
        => after(Effect::DownloadMap, |agv, action, outcome| {
            if matches!(outcome, Outcome::Open) && let Some(action) = agv.actions.get_mut(&action.request.id) {
                action.status = Status::Running;
            }
            outcome
        });
    tolerance "lib-download-queued" ["MAP-17"] "It shows downloadMap INITIALIZING for some seconds before the download starts."
        => keep::<Vec<(Moment, Output)>>()
            .ends(|waiting, agv, action, outcome| {
                if is(action, Effect::DownloadMap) && matches!(outcome, Outcome::Open) {
                    let due = agv.moment() + Duration::from_secs(3);
                    let (fetches, others): (Vec<Output>, Vec<Output>) = std::mem::take(&mut agv.pending).into_iter().partition(|output| matches!(output, Output::Fetch { .. }));
                    agv.pending = others;
                    waiting.extend(fetches.into_iter().map(|fetch| (due, fetch)));
                    if let Some(action) = agv.actions.get_mut(&action.request.id) {
                        action.due = action.due.map(|due| due + Duration::from_secs(3));
                    }
                }
                outcome
            })
            .happens(|waiting, agv, event| match event {
                Event::PowerCycled => waiting.clear(),
                Event::Woken => {
                    let now = agv.moment();
                    let due = waiting.extract_if(.., |(due, _)| *due <= now);
                    agv.pending.extend(due.map(|(_, fetch)| fetch));
                }
                _ => {}
            })
            .due(|waiting, _| waiting.iter().map(|(due, _)| *due).min());
    tolerance "loads-identified" ["STATE-MSG-07"] "It reads the loadId of a picked load itself where the order does not name one."
        => keep::<String>()
            .does(|site, agv, action| {
                *site = agv.site(action);
                None
            })
            .ends(|site, agv, action, outcome| {
                let unnamed = is(action, Effect::Pick) && action.request.parameter("loadId").is_none();
                if unnamed && matches!(outcome, Outcome::Done(_)) {
                    agv.loads.iter_mut().for_each(|load| load.id = format!("RFID-{site}"));
                }
                outcome
            });
}

/// What becomes of downloads that run.
fn downloads(agv: &mut Agv, status: Status) {
    let of_maps = |action: &&mut Action| is(action, Effect::DownloadMap) && action.status.is_active();
    for action in agv.actions.iter_mut().filter(of_maps) {
        action.status = status;
    }
}

/// Takes a pose over, whatever its map.
fn take_pose(agv: &mut Agv, action: &Action) -> Option<Outcome> {
    let number = |key: &str| action.number(key).filter(|number| number.is_finite());
    let pose = Pose {
        x: number("x")?,
        y: number("y")?,
        theta: number("theta")?.clamp(-std::f64::consts::PI, std::f64::consts::PI),
        map_id: action.text("mapId").to_owned(),
    };
    agv.take_pose(pose, action.text("lastNodeId"));
    Some(Outcome::Done(None))
}
