//! What can be done so that more is decided: for a cause, what to write into the profile or to do at the bench.

use tck_journal::Reason;

/// What to do about a reason why tests decided nothing; the reason itself when only looking at the device helps.
#[must_use]
pub fn advice(reason: &Reason) -> String {
    remedy(reason).unwrap_or_else(|| reason.to_string())
}

/// What to write into the profile or to do at the bench; `None` when only looking at the device helps.
pub(super) fn remedy(reason: &Reason) -> Option<String> {
    Some(match reason {
        Reason::NoHook { hook } => {
            format!("[hooks.{hook}]: tell how it is done (`vda5050-tck explain {hook}`)")
        }
        Reason::NoSample { sample, what } => format!("device.{sample} = …: name it in the profile ({what})"),
        Reason::NotStated { statement } => format!("device.{statement} = true or false: say it in the profile"),
        Reason::MotionNotAllowed => {
            "[motion] allowed = true: let the vehicle drive, where the floor is free".to_owned()
        }
        Reason::MotionRuledOut => "leave out --no-motion, where the floor is free".to_owned(),
        Reason::NoMapFile => "[maps] files = […]: name a map file that the device can read".to_owned(),
        Reason::MapServerUnreachable { .. } | Reason::MapServerElsewhere { .. } => {
            "[bench] maps-listen and maps-host: let the device reach the map server".to_owned()
        }
        Reason::NoSecuredFiles => {
            "[bench] tls-cert and tls-key: name a certificate of this machine that the device trusts".to_owned()
        }
        Reason::OneVehicle => {
            "[vehicles] serial-numbers = […, …]: name another vehicle that the master control knows".to_owned()
        }
        Reason::NoTap => "connect the device to the address of [bench] listen, and leave `tap = false` out".to_owned(),
        Reason::NoFactsheet { capability } | Reason::NoList { capability } => {
            let claims = if capability.starts_with("limit ") {
                format!("[\"{capability} = …\"]")
            } else {
                format!("[\"{capability}\"], or [\"no {capability}\"]")
            };
            format!("[device] claims = {claims}: say it, or let its factsheet say it")
        }
        Reason::OverBudget { .. } => {
            "give the run more time (--budget), or go on with what is left (--resume)".to_owned()
        }
        Reason::NobodyToAsk { .. } => "answer at a terminal, or over HTTP (--questions)".to_owned(),
        Reason::RunEnded => "go on with what is left (--resume)".to_owned(),
        Reason::NothingForHook { .. }
        | Reason::SampleDenied { .. }
        | Reason::StatedFalse { .. }
        | Reason::NoActiveMap
        | Reason::NoLayout
        | Reason::NotListed { .. }
        | Reason::BlockingTypeNotListed { .. }
        | Reason::Denied { .. }
        | Reason::ListedAndDenied { .. }
        | Reason::ClaimedAndNotListed { .. }
        | Reason::NoFactsheetOfNeeds { .. }
        | Reason::Required { .. }
        | Reason::Present { .. }
        | Reason::ArrayLimit { .. }
        | Reason::IdLimit { .. }
        | Reason::NumericalIds
        | Reason::AfterFailure { .. }
        | Reason::SetAside { .. }
        | Reason::PreconditionMissed { .. }
        | Reason::PreconditionRefused { .. }
        | Reason::Observed { .. } => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cause_says_what_to_write_and_anything_else_is_quoted() {
        let hook = Reason::NoHook {
            hook: "set-mode".to_owned(),
        };
        assert!(advice(&hook).starts_with("[hooks.set-mode]: "));
        let sample = Reason::NoSample {
            sample: "long-action".to_owned(),
            what: "it takes some seconds".to_owned(),
        };
        assert_eq!(
            advice(&sample),
            "device.long-action = …: name it in the profile (it takes some seconds)"
        );
        let statement = Reason::NotStated {
            statement: "node-bound".to_owned(),
        };
        assert!(advice(&statement).starts_with("device.node-bound = true or false"));
        assert!(advice(&Reason::MotionNotAllowed).starts_with("[motion] allowed = true: "));
        let seen = "the vehicle stood in the way, and [motion] allowed = true";
        assert_eq!(advice(&Reason::observed(seen)), seen);
        let capability = Reason::NoFactsheet {
            capability: "action pick NODE".to_owned(),
        };
        assert!(
            advice(&capability).starts_with("[device] claims = [\"action pick NODE\"], or [\"no action pick NODE\"]")
        );
    }
}
