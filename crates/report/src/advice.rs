//! What can be done so that more is decided: for a cause, what to write into the profile or to do at the bench.

/// What to do about a reason why tests decided nothing; the reason itself when only looking at the device helps.
#[must_use]
pub fn advice(reason: &str) -> String {
    if let Some(hook) = between(reason, "the profile has no hook `", "`") {
        return format!("[hooks.{hook}]: tell how it is done (`vda5050-tck explain {hook}`)");
    }
    if let Some(name) = between(reason, "the profile does not name `", "`") {
        let what = reason.split_once("`: ").map_or("", |(_, what)| what);
        return format!("{name} = …: name it in the profile{}", said(what));
    }
    if let Some(name) = between(reason, "the profile does not say whether the device is `", "`") {
        return format!("device.{name} = true or false: say it in the profile");
    }
    if reason.contains("[motion] allowed = true") {
        return "[motion] allowed = true: let the vehicle drive, where the floor is free".to_owned();
    }
    if reason.contains("--no-motion") {
        return "leave out --no-motion, where the floor is free".to_owned();
    }
    if reason.contains("[maps] files") {
        return "[maps] files = […]: name a map file that the device can read".to_owned();
    }
    if reason.contains("maps-host") {
        return "[bench] maps-listen and maps-host: let the device reach the map server".to_owned();
    }
    if reason.contains("through the tap") {
        return "connect the device to the address of [bench] listen, and leave `tap = false` out".to_owned();
    }
    if let Some(name) = reason
        .strip_prefix("there is no factsheet that could say whether it has: ")
        .or_else(|| reason.strip_prefix("the factsheet has no list that could say whether it has: "))
    {
        if name.starts_with("limit ") {
            return format!("[device] claims = [\"{name} = …\"]: say it, or let its factsheet say it");
        }
        return format!("[device] claims = [\"{name}\"], or [\"no {name}\"]: say it, or let its factsheet say it");
    }
    reason.to_owned()
}

fn said(what: &str) -> String {
    match what {
        "" => String::new(),
        what => format!(" ({what})"),
    }
}

fn between<'a>(text: &'a str, before: &str, after: &str) -> Option<&'a str> {
    let (_, rest) = text.split_once(before)?;
    let (found, _) = rest.split_once(after)?;
    Some(found)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cause_says_what_to_write_and_anything_else_is_quoted() {
        let hook = "the profile has no hook `set-mode` ([hooks.set-mode])";
        assert!(advice(hook).starts_with("[hooks.set-mode]: "));
        let sample = "the profile does not name `device.long-action`: it takes some seconds";
        assert_eq!(
            advice(sample),
            "device.long-action = …: name it in the profile (it takes some seconds)"
        );
        let statement = "the profile does not say whether the device is `node-bound`";
        assert!(advice(statement).starts_with("device.node-bound = true or false"));
        let motion = "the profile does not allow motion ([motion] allowed = true)";
        assert!(advice(motion).starts_with("[motion] allowed = true: "));
        let capability = "there is no factsheet that could say whether it has: action pick NODE";
        assert!(
            advice(capability).starts_with("[device] claims = [\"action pick NODE\"], or [\"no action pick NODE\"]")
        );
        assert_eq!(advice("the vehicle stood in the way"), "the vehicle stood in the way");
    }
}
