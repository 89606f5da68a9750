//! The order in which tests run: what needs nothing of a vehicle comes first, and what may strand or block it last.

use tck_pack::{HookRisk, Hooks};
use tck_profile::SampleKind;
use tck_suite::model::{Test, Verb};

/// What a test may do to a vehicle at worst; more is later.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Risk {
    /// It is only looked at.
    Nothing,
    /// It is driven, and stopped.
    Driven,
    /// It handles loads, or charges.
    Loaded,
    /// Its connection is disturbed.
    Connection,
    /// Something is done to it by hand.
    ByHand,
    /// Its maps or its place on them change.
    Maps,
    /// Its mode, its pause or its safety is changed.
    Modes,
    /// A fault is brought about.
    Faults,
    /// It is switched off.
    Power,
}

/// The tests by what they may do to the vehicle; where that is the same, as they stood.
pub(super) fn by_risk(tests: &mut [std::sync::Arc<Test>], hooks: &Hooks) {
    // Once for each test: the texts of its steps are searched.
    tests.sort_by_cached_key(|test| risk(test, hooks));
}

fn risk(test: &Test, hooks: &Hooks) -> Risk {
    let mut worst = if test.moves { Risk::Driven } else { Risk::Nothing };
    if test
        .course
        .stations()
        .any(|station| SampleKind::of_variable(station).is_some())
    {
        worst = worst.max(Risk::Loaded);
    }
    for step in test.sections().into_iter().flat_map(|(_, steps)| steps) {
        let own = match &*step.verb {
            Verb::Link(_) => Risk::Connection,
            Verb::Operator(operator) => {
                let hook = hooks.find(&operator.hook, test.device);
                hook.map_or(Risk::ByHand, |hook| hook.risk.into())
            }
            Verb::Serve(_) => Risk::Maps,
            Verb::Send(_) => of_text(step.span.text()),
            _ => Risk::Nothing,
        };
        worst = worst.max(own);
    }
    worst
}

impl From<HookRisk> for Risk {
    fn from(risk: HookRisk) -> Self {
        match risk {
            HookRisk::ByHand => Self::ByHand,
            HookRisk::Maps => Self::Maps,
            HookRisk::Modes => Self::Modes,
            HookRisk::Faults => Self::Faults,
            HookRisk::Power => Self::Power,
        }
    }
}

fn of_text(text: &str) -> Risk {
    let maps = ["initPosition", "enableMap", "downloadMap", "deleteMap"];
    if maps.iter().any(|word| text.contains(word)) {
        Risk::Maps
    } else if text.contains("startPause") {
        Risk::Modes
    } else {
        Risk::Nothing
    }
}
