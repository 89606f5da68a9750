//! Why a test is undecided, does not apply, or was left out.
//!
//! Whoever advises, groups or plans matches on the variants; people read the sentence that a variant displays.

use std::fmt;

use serde::{Deserialize, Deserializer, Serialize};

/// Why a test decides nothing, or does not apply.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case", rename_all_fields = "camelCase")]
pub enum Reason {
    /// The device does not connect through the tap.
    NoTap,
    /// The profile has no such hook.
    NoHook {
        /// Its name.
        hook: String,
    },
    /// The hook is a prompt, and there is no terminal.
    NobodyToAsk {
        /// Its name.
        hook: String,
    },
    /// The profile says that the device has nothing for the hook.
    NothingForHook {
        /// Its name.
        hook: String,
    },
    /// The profile does not name a sample of what the device can do.
    NoSample {
        /// Its name below `device`.
        sample: String,
        /// What it is to be.
        what: String,
    },
    /// The profile says that the device has nothing of the kind of a sample.
    SampleDenied {
        /// Its name below `device`.
        sample: String,
    },
    /// The profile leaves out a statement about the device.
    NotStated {
        /// Its name below `device`.
        statement: String,
    },
    /// The profile says that the device is otherwise.
    StatedFalse {
        /// The name of the statement below `device`.
        statement: String,
    },
    /// The first state shows no enabled map on which the vehicle stands.
    NoActiveMap,
    /// The map server can be reached from no other machine.
    MapServerUnreachable {
        /// The host in the links of maps.
        host: String,
    },
    /// The map server cannot be reached from where the device connects to.
    MapServerElsewhere {
        /// The host in the links of maps.
        host: String,
        /// The host that the device connects to.
        device: String,
    },
    /// The bench serves no files over TLS that the device would trust.
    NoSecuredFiles,
    /// The profile names no map file.
    NoMapFile,
    /// The profile names one vehicle for a master control.
    OneVehicle,
    /// The profile does not allow motion.
    MotionNotAllowed,
    /// Motion was ruled out for this run.
    MotionRuledOut,
    /// The profile has no layout.
    NoLayout,
    /// The factsheet does not list a capability.
    NotListed {
        /// Its name, such as `action pick NODE`.
        capability: String,
    },
    /// The factsheet lists an action with other blocking types only.
    BlockingTypeNotListed {
        /// The type of the action.
        action: String,
        /// The blocking type that is needed.
        blocking: String,
    },
    /// The profile says that the device lacks a capability.
    Denied {
        /// Its name.
        capability: String,
    },
    /// The factsheet lists a capability, and the profile says that the device lacks it.
    ListedAndDenied {
        /// Its name.
        capability: String,
    },
    /// The factsheet does not list a capability, and the profile says that the device has it.
    ClaimedAndNotListed {
        /// Its name.
        capability: String,
    },
    /// The factsheet has no list in which a capability would stand.
    NoList {
        /// Its name.
        capability: String,
    },
    /// There is no factsheet that could list a capability.
    NoFactsheet {
        /// Its name.
        capability: String,
    },
    /// There is no factsheet that could say what the device cannot do without.
    NoFactsheetOfNeeds {
        /// The path of the optional parameter.
        parameter: String,
    },
    /// The device cannot do without a parameter that the test leaves out.
    Required {
        /// The path of the parameter.
        parameter: String,
    },
    /// The device has what the test needs to be absent.
    Present {
        /// The name of the capability.
        capability: String,
    },
    /// The factsheet limits an array to fewer elements than the test needs.
    ArrayLimit {
        /// The name that factsheets have for the array.
        array: String,
        /// How many it may have.
        limit: u64,
        /// How many are needed.
        needed: u64,
    },
    /// The factsheet limits ids to fewer characters than the test needs.
    IdLimit {
        /// How many an id may have.
        limit: u64,
        /// How many may be needed.
        needed: u64,
    },
    /// The factsheet allows ids of digits only, and the test needs letters.
    NumericalIds,
    /// Another test has failed, and the run was to end there.
    AfterFailure {
        /// The test that failed.
        test: String,
    },
    /// The time that the run may take was used up, or the test would have taken more than was left of it.
    OverBudget {
        /// How long the run may take, in seconds.
        budget: u64,
    },
    /// Several tests before did not reach this precondition.
    SetAside {
        /// File and line of the precondition.
        place: String,
        /// The tests that did not reach it.
        tests: Vec<String>,
    },
    /// A precondition was looked for and not seen.
    PreconditionMissed {
        /// Title or path of the step.
        step: String,
        /// File and line of the step.
        place: String,
        /// Whether other tests share it: it stands in a file of its own.
        shared: bool,
        /// What was seen instead.
        seen: String,
        /// What the vehicle itself says is wrong, the newest first.
        #[serde(default, skip_serializing_if = "Vec::is_empty")]
        errors: Vec<OwnError>,
    },
    /// Device or operator did not do what a precondition asks for.
    PreconditionRefused {
        /// Path of the step.
        step: String,
        /// What they did instead.
        seen: String,
    },
    /// The run ended before the test began.
    RunEnded,
    /// What was observed in the run, told for this one time.
    Observed {
        /// The sentence.
        text: String,
    },
}

/// An error that a vehicle reports.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct OwnError {
    /// Its level and its type.
    pub error: String,
    /// What it refers to: key and value.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub references: Vec<String>,
}

impl Reason {
    /// What was observed, in words that nobody matches on.
    #[must_use]
    pub fn observed(text: impl Into<String>) -> Self {
        Self::Observed { text: text.into() }
    }

    /// Itself where its kind says more than its sentence.
    #[must_use]
    pub fn typed(self) -> Option<Self> {
        (!matches!(self, Self::Observed { .. })).then_some(self)
    }

    /// Whether the device itself may still take it away, once it is there.
    #[must_use]
    pub fn is_said_by_the_device(&self) -> bool {
        matches!(
            self,
            Self::NoFactsheet { .. } | Self::NoFactsheetOfNeeds { .. } | Self::NoActiveMap
        )
    }

    /// Reads a reason of a plan. Older journals have the sentence alone.
    pub(super) fn or_sentence<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        #[derive(Deserialize)]
        #[serde(untagged)]
        enum Written {
            Sentence(String),
            Reason(Reason),
        }
        Ok(match Written::deserialize(deserializer)? {
            Written::Sentence(text) => Self::Observed { text },
            Written::Reason(reason) => reason,
        })
    }
}

impl fmt::Display for Reason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NoTap => f.write_str("it needs the device to connect through the tap"),
            Self::NoHook { hook } => write!(f, "the profile has no hook `{hook}` ([hooks.{hook}])"),
            Self::NobodyToAsk { hook } => write!(
                f,
                "hook `{hook}` is a prompt, and nobody can be asked: standard input or standard error is no terminal"
            ),
            Self::NothingForHook { hook } => {
                write!(f, "the profile says that the device has nothing for the hook `{hook}`")
            }
            Self::NoSample { sample, what } => write!(f, "the profile does not name `device.{sample}`: {what}"),
            Self::SampleDenied { sample } => write!(f, "the profile says that the device has no `{sample}`"),
            Self::NotStated { statement } => {
                write!(f, "the profile does not say whether the device is `{statement}`")
            }
            Self::StatedFalse { statement } => write!(f, "`device.{statement}` is false in the profile"),
            Self::OneVehicle => f.write_str("it needs a second vehicle, and the profile names one"),
            Self::NoActiveMap => f.write_str("the first state shows no enabled map on which the vehicle stands"),
            Self::MapServerUnreachable { host } => write!(
                f,
                "no device can fetch a map from {host} ([bench] maps-host is the name of this machine as the device \
                 knows it)"
            ),
            Self::MapServerElsewhere { host, device } => write!(
                f,
                "a device that connects to {device} cannot fetch a map from {host} ([bench] maps-listen and maps-host)"
            ),
            Self::NoSecuredFiles => f.write_str(
                "the bench has no certificate with which it could serve files over TLS ([bench] tls-cert and tls-key)",
            ),
            Self::NoMapFile => f.write_str("the profile names no map file that the device can read ([maps] files)"),
            Self::MotionNotAllowed => f.write_str("the profile does not allow motion ([motion] allowed = true)"),
            Self::MotionRuledOut => f.write_str("motion was ruled out by --no-motion"),
            Self::NoLayout => {
                f.write_str("the profile has no layout, and this test needs nodes ([layout] lif or nodes)")
            }
            Self::NotListed { capability } => write!(f, "the factsheet does not list: {capability}"),
            Self::BlockingTypeNotListed { action, blocking } => write!(
                f,
                "the factsheet does not list: action {action} with the blocking type {blocking}"
            ),
            Self::Denied { capability } => {
                write!(f, "the profile says that the device does not have: {capability}")
            }
            Self::ListedAndDenied { capability } => write!(
                f,
                "the factsheet lists what the profile says the device does not have: {capability}"
            ),
            Self::ClaimedAndNotListed { capability } => write!(
                f,
                "the factsheet does not list what the profile says the device has: {capability}"
            ),
            Self::NoList { capability } => write!(
                f,
                "the factsheet has no list that could say whether it has: {capability}"
            ),
            Self::NoFactsheet { capability } => {
                write!(f, "there is no factsheet that could say whether it has: {capability}")
            }
            Self::NoFactsheetOfNeeds { parameter } => {
                write!(f, "there is no factsheet that could say whether it needs: {parameter}")
            }
            Self::Required { parameter } => write!(f, "the factsheet lists as required: {parameter}"),
            Self::Present { capability } => {
                write!(f, "the device has what this test needs to be absent: {capability}")
            }
            Self::ArrayLimit { array, limit, needed } => write!(
                f,
                "the factsheet says that {array} has {limit} elements at most, and {needed} are needed"
            ),
            Self::IdLimit { limit, needed } => write!(
                f,
                "the factsheet says that an id has {limit} characters at most, and up to {needed} are needed"
            ),
            Self::NumericalIds => {
                f.write_str("the factsheet says that ids are numbers, and one with letters is needed")
            }
            Self::AfterFailure { test } => write!(f, "left out, because {test} failed (--fail-fast)"),
            Self::OverBudget { budget } => write!(f, "not carried out: budget (--budget {})", in_units(*budget)),
            Self::SetAside { place, tests } => write!(
                f,
                "set aside: the precondition at {place} was not reached in {}",
                tests.join(", ")
            ),
            Self::PreconditionMissed {
                step,
                place,
                seen,
                errors,
                ..
            } => {
                write!(f, "the precondition was not reached: {step} ({place}): {seen}")?;
                for (at, error) in errors.iter().enumerate() {
                    let before = if at == 0 {
                        "; the vehicle itself reports"
                    } else {
                        " and"
                    };
                    write!(f, "{before} {error}")?;
                }
                Ok(())
            }
            Self::PreconditionRefused { step, seen } => {
                write!(f, "the precondition was not reached: {step}: {seen}")
            }
            Self::RunEnded => f.write_str("the run ended before this test"),
            Self::Observed { text } => f.write_str(text),
        }
    }
}

/// A time as it is given on the command line: `90s`, `20m`, `2h`.
fn in_units(seconds: u64) -> String {
    match seconds {
        0 => "0s".to_owned(),
        whole if whole % 3_600 == 0 => format!("{}h", whole / 3_600),
        whole if whole % 60 == 0 => format!("{}m", whole / 60),
        whole => format!("{whole}s"),
    }
}

impl fmt::Display for OwnError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.error)?;
        if self.references.is_empty() {
            return Ok(());
        }
        write!(f, " ({})", self.references.join(", "))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::event::Gate;

    #[test]
    fn a_plan_keeps_the_kind_and_an_older_one_its_sentence() {
        let gate = Gate::Unobservable(Reason::NoHook {
            hook: "set-mode".to_owned(),
        });
        let text = serde_json::to_string(&gate).unwrap();
        assert_eq!(text, r#"{"unobservable":{"kind":"no-hook","hook":"set-mode"}}"#);
        assert_eq!(serde_json::from_str::<Gate>(&text).unwrap(), gate);
        let older: Gate = serde_json::from_str(r#"{"not-applicable":"the factsheet does not list: x"}"#).unwrap();
        let sentence = Reason::observed("the factsheet does not list: x");
        assert_eq!(older, Gate::NotApplicable(sentence));
    }

    #[test]
    fn a_budget_is_told_as_it_is_given() {
        let told = |budget| Reason::OverBudget { budget }.to_string();
        assert_eq!(told(90), "not carried out: budget (--budget 90s)");
        assert_eq!(told(1_200), "not carried out: budget (--budget 20m)");
        assert_eq!(told(7_200), "not carried out: budget (--budget 2h)");
    }

    #[test]
    fn what_the_vehicle_itself_says_comes_last_in_the_sentence() {
        let error = |error: &str, references: &[&str]| OwnError {
            error: error.to_owned(),
            references: references.iter().map(|one| (*one).to_owned()).collect(),
        };
        let missed = |errors: Vec<OwnError>| Reason::PreconditionMissed {
            step: "It rests".to_owned(),
            place: "suites/agv/x.yaml:4".to_owned(),
            shared: false,
            seen: "none matches".to_owned(),
            errors,
        };
        let short = "the precondition was not reached: It rests (suites/agv/x.yaml:4): none matches";
        assert_eq!(missed(Vec::new()).to_string(), short);
        let both = missed(vec![error("WARNING noRoute", &["mapId x"]), error("FATAL lost", &[])]);
        let expected = format!("{short}; the vehicle itself reports WARNING noRoute (mapId x) and FATAL lost");
        assert_eq!(both.to_string(), expected);
    }
}
