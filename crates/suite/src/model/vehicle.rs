//! What a test says to a mock vehicle, and which one is meant.

use std::borrow::Cow;

use super::{Always, Expect, Extent, Never, Until, Verb};
use tck_base::pattern::Term;

/// `vehicle:`.
#[derive(Clone, Debug)]
pub struct VehicleStep {
    /// One of [`tck_profile::VEHICLE_WORDS`].
    pub what: String,
    /// Parameters.
    pub with: Vec<(String, Term)>,
    /// Which vehicle.
    pub of: Which,
}

/// One of the mock vehicles.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Which {
    /// The only one in most tests.
    #[default]
    First,
    /// The other one.
    Second,
}

impl Which {
    /// What the judge files a topic of this vehicle under: `order`, `order@second`.
    #[must_use]
    pub fn subject(self, topic: &str) -> Cow<'_, str> {
        match self {
            Self::First => Cow::Borrowed(topic),
            Self::Second => Cow::Owned(format!("{topic}@{}", self.word())),
        }
    }

    /// The word used in suites.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::First => "first",
            Self::Second => "second",
        }
    }
}

macro_rules! subject {
    ($($step:ident),*) => {$(
        impl $step {
            /// What the judge looks under for the messages of this step.
            #[must_use]
            pub fn subject(&self) -> Cow<'_, str> {
                self.of.subject(&self.topic)
            }
        }
    )*};
}

subject!(Expect, Never, Always, Until);

impl Verb {
    /// Whether it speaks to, or of, a second mock vehicle.
    #[must_use]
    pub fn concerns_second_vehicle(&self) -> bool {
        let of = match self {
            Self::Expect(expect) => expect.of,
            Self::Never(never) => never.of,
            Self::Always(always) => match &always.extent {
                Extent::Until(until) if until.of == Which::Second => until.of,
                _ => always.of,
            },
            Self::Vehicle(vehicle) => vehicle.of,
            _ => Which::First,
        };
        let with: &[(String, Term)] = match self {
            Self::Operator(operator) => &operator.with,
            Self::Vehicle(vehicle) => &vehicle.with,
            _ => &[],
        };
        let mut names = with.iter().flat_map(|(_, term)| term.variables());
        of == Which::Second || names.any(|name| name.split('.').next() == Some(Which::Second.word()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_second_vehicle_has_subjects_of_its_own() {
        assert_eq!(Which::First.subject("order"), "order");
        assert_eq!(Which::Second.subject("order"), "order@second");
    }
}
