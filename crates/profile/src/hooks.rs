//! Hooks: what a person or a machine does to the device when a test asks for it. [`HOOKS`] is the one set of names.

use tck_pack::Role;

/// A hook a test may ask for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct HookInfo {
    /// Name, as in `[hooks.NAME]` and `operator: NAME`.
    pub name: &'static str,
    /// Which side it is for.
    pub role: Role,
    /// Names of the parameters a test hands over.
    pub parameters: &'static [&'static str],
    /// What to do, as an order to a person.
    pub doc: &'static str,
    /// Whether the program of the device may end by it.
    pub ends: bool,
}

/// Marks a hook by which the program of the device may end.
const fn ending(hook: HookInfo) -> HookInfo {
    HookInfo { ends: true, ..hook }
}

const fn agv(name: &'static str, parameters: &'static [&'static str], doc: &'static str) -> HookInfo {
    HookInfo {
        name,
        role: Role::Agv,
        parameters,
        doc,
        ends: false,
    }
}

const fn master_control(name: &'static str, parameters: &'static [&'static str], doc: &'static str) -> HookInfo {
    HookInfo {
        name,
        role: Role::MasterControl,
        parameters,
        doc,
        ends: false,
    }
}

/// Every hook there is, by role.
pub const HOOKS: &[HookInfo] = &[
    agv(
        "after-start",
        &[],
        "Give the vehicle what it needs after every start, before anything else: a position, a login.",
    ),
    ending(agv("power-cycle", &[], "Switch the vehicle off hard and on again.")),
    ending(agv(
        "shutdown",
        &[],
        "Shut the vehicle down, or end its communication, in good order.",
    )),
    agv("start", &[], "Start the vehicle after a shutdown."),
    agv(
        "set-mode",
        &["mode"],
        "Switch the operating mode at the vehicle; in SEMIAUTOMATIC set its speed there, too.",
    ),
    agv("drive-manually", &[], "Drive the vehicle by hand for a short way."),
    agv(
        "move-to",
        &["nodeId"],
        "Bring the vehicle to a node, and let it know where it is.",
    ),
    agv("push-out", &[], "Move the vehicle off the way it was given."),
    agv(
        "shift-position",
        &[],
        "Shift the position that the vehicle believes in aside by more than half a metre, such as with its service tool.",
    ),
    agv("emergency-stop", &[], "Press an emergency stop."),
    agv(
        "release-emergency-stop",
        &[],
        "Release the emergency stop, and acknowledge it.",
    ),
    agv(
        "enter-field",
        &[],
        "Enter the protective field, or put something into it.",
    ),
    agv("leave-field", &[], "Leave the protective field."),
    agv("place-obstacle", &["edgeId"], "Put an obstacle on an edge."),
    agv("remove-obstacle", &["edgeId"], "Take the obstacle away."),
    agv("trigger", &["actionId"], "Give the trigger that the vehicle waits for."),
    agv(
        "place-load",
        &["loadType"],
        "Put a load on the vehicle, or where it picks next.",
    ),
    agv(
        "remove-load",
        &["loadType"],
        "Take the load off the vehicle, or away from where it picks next.",
    ),
    agv("press-pause", &[], "Press the pause button at the vehicle."),
    agv("release-pause", &[], "End the pause at the vehicle."),
    agv(
        "block-pause",
        &[],
        "Make startPause and stopPause fail, e.g. by a switch.",
    ),
    agv("unblock-pause", &[], "Let startPause and stopPause succeed again."),
    agv(
        "lock-charger",
        &[],
        "Make stopCharging fail, e.g. by a mechanical latch.",
    ),
    agv("unlock-charger", &[], "Let stopCharging succeed again."),
    agv(
        "use-lift",
        &["mapId"],
        "Bring the lift with the vehicle in it to the floor of a map.",
    ),
    agv(
        "enable-map",
        &["mapId", "mapVersion"],
        "Enable a map version at the vehicle.",
    ),
    agv(
        "provoke-error",
        &["errorLevel"],
        "Bring about a real fault of the vehicle.",
    ),
    agv("clear-error", &[], "Clear the fault."),
    agv("confirm", &["question"], "Look, and answer the question with yes."),
    master_control(
        "after-start",
        &[],
        "Give the master control what it needs before anything else, such as a login.",
    ),
    master_control(
        "dispatch",
        &["vehicle", "from", "to", "loadType", "action", "parameters"],
        "Order a transport.",
    ),
    master_control(
        "reroute",
        &["vehicle", "to"],
        "Give the running transport another destination.",
    ),
    master_control("cancel", &["vehicle"], "Call off the running transport."),
    master_control("pause", &["vehicle"], "Tell the vehicle to pause."),
    master_control("resume", &["vehicle"], "Tell the vehicle to go on."),
    master_control(
        "instant-action",
        &["vehicle", "action"],
        "Send an instant action to the vehicle.",
    ),
    master_control(
        "request-factsheet",
        &["vehicle"],
        "Ask for the factsheet of the vehicle.",
    ),
    master_control("request-state", &["vehicle"], "Ask for the state of the vehicle."),
    master_control(
        "init-position",
        &["vehicle", "nodeId", "x", "y", "theta", "mapId"],
        "Tell the vehicle where it stands.",
    ),
    master_control(
        "download-map",
        &["vehicle", "mapId", "mapVersion", "mapDownloadLink"],
        "Begin the roll-out of a map version to the vehicle.",
    ),
    master_control(
        "enable-map",
        &["vehicle", "mapId", "mapVersion"],
        "Enable a map version on the vehicle.",
    ),
    master_control(
        "delete-map",
        &["vehicle", "mapId", "mapVersion"],
        "Delete a map version from the vehicle.",
    ),
    master_control(
        "block-edge",
        &["vehicle", "from", "to"],
        "Close a way for the vehicle in the layout.",
    ),
    master_control("unblock-edge", &["vehicle", "from", "to"], "Open the way again."),
    ending(master_control(
        "configure",
        &["vehicle", "what"],
        "Set the master control up for what comes next.",
    )),
    master_control("start", &["vehicle"], "Start the master control."),
    ending(master_control(
        "shutdown",
        &["vehicle"],
        "Shut the master control down.",
    )),
    master_control(
        "confirm",
        &["vehicle", "question"],
        "Look, and answer the question with yes.",
    ),
];

/// The hook of that name for that side.
#[must_use]
pub fn find(name: &str, role: Role) -> Option<&'static HookInfo> {
    HOOKS.iter().find(|hook| hook.name == name && hook.role == role)
}

/// Whether the program of a device may end by a hook of that name.
#[must_use]
pub fn ends_the_device(name: &str) -> bool {
    HOOKS.iter().any(|hook| hook.name == name && hook.ends)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_unique_for_a_role_and_documented() {
        for (at, hook) in HOOKS.iter().enumerate() {
            assert!(
                HOOKS[at + 1..]
                    .iter()
                    .all(|other| (other.name, other.role) != (hook.name, hook.role))
            );
            assert!(hook.doc.ends_with('.'), "{}", hook.name);
        }
    }
}
