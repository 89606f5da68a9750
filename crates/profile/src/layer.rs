//! Where settings come from, and laying one source over another.

use std::collections::BTreeMap;
use std::time::Duration;

use super::hook_action::Hook;
use super::value::Value;
use super::{Deviation, KnownFailure, LayoutList, VehicleGroup};
use tck_base::diagnostic::Span;

/// Where a value came from.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Origin {
    Default,
    File(String),
    Environment,
    Flag,
}

impl std::fmt::Display for Origin {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Default => super::Setting::DEFAULT,
            Self::File(name) => name,
            Self::Environment => "environment",
            Self::Flag => "flag",
        })
    }
}

/// One value, where it came from and where it is written.
#[derive(Clone, Debug)]
pub(super) struct Setter {
    pub value: Value,
    pub origin: Origin,
    pub span: Option<Span>,
}

/// What one source says.
#[derive(Debug, Default)]
pub(super) struct Layer {
    pub values: BTreeMap<&'static str, Setter>,
    pub list: Option<(LayoutList, Origin)>,
    pub others: Option<(Vec<VehicleGroup>, Origin)>,
    pub hooks: BTreeMap<String, (Hook, Origin)>,
    pub deviations: Vec<(Deviation, Origin)>,
    pub known: Vec<(KnownFailure, Origin)>,
    /// What test management calls a requirement, test or monitor, by its id.
    pub issue_keys: BTreeMap<String, (String, Origin)>,
}

impl Layer {
    /// Lays `upper` over this one.
    pub(super) fn under(mut self, upper: Self) -> Self {
        let has = |path: &str| upper.values.contains_key(path);
        // Two ways of saying one thing: the upper layer's way replaces the lower layer's other way.
        if upper.list.is_some() && !has("layout.lif") {
            self.values.remove("layout.lif");
            self.values.remove("layout.vehicle-type");
        }
        if has("layout.lif") && upper.list.is_none() {
            self.list = None;
        }
        if has("bench.password-env") && !has("bench.password-file") {
            self.values.remove("bench.password-file");
        }
        if has("bench.password-file") && !has("bench.password-env") {
            self.values.remove("bench.password-env");
        }
        self.values.extend(upper.values);
        self.list = upper.list.or(self.list);
        self.others = upper.others.or(self.others);
        self.hooks.extend(upper.hooks);
        for (deviation, origin) in upper.deviations {
            self.deviations
                .retain(|(lower, _)| lower.requirement != deviation.requirement);
            self.deviations.push((deviation, origin));
        }
        for (known, origin) in upper.known {
            self.known.retain(|(lower, _)| lower.id != known.id);
            self.known.push((known, origin));
        }
        self.issue_keys.extend(upper.issue_keys);
        self
    }

    fn duration(&self, path: &str) -> Option<Duration> {
        match self.values.get(path)?.value {
            Value::Duration(duration) => Some(duration),
            _ => None,
        }
    }

    /// Fits the default of a limit to the limit it belongs to, if only the latter was set: whoever asks for
    /// a reaction within 4 s means that there is nothing to warn about before.
    pub(super) fn fit_defaults(mut self) -> Self {
        for (shorter, longer) in [("time.slow", "time.react"), ("time.event", "time.event-warning")] {
            let (Some(short), Some(long)) = (self.duration(shorter), self.duration(longer)) else {
                continue;
            };
            if short <= long {
                continue;
            }
            for (path, fitted) in [(shorter, long), (longer, short)] {
                if let Some(setter) = self.values.get_mut(path)
                    && setter.origin == Origin::Default
                {
                    setter.value = Value::Duration(fitted);
                }
            }
        }
        self
    }
}
