//! What becomes of messages on their way into a recording.

use serde_json::Value;

use super::{Dice, SiteMessage};

/// A day, in microseconds.
const DAY: i64 = 86_400_000_000;

/// What a recorder did to the messages of a fleet.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Impairment {
    /// Nothing.
    Whole,
    /// One in twenty was lost.
    Lost,
    /// One in ten came twice.
    Twice,
    /// Each came up to 80 milliseconds late, so that they stand in another order.
    Late,
    /// Two recorders heard the same, one 30 milliseconds after the other, and each lost one in twenty.
    TwoRecorders,
    /// Before the first message stands what every vehicle had left on the broker the day before.
    Yesterday,
    /// The first half is missing.
    Middle,
}

/// A message in a recording.
#[derive(Clone, Debug)]
pub struct Recorded {
    /// The message, at the time at which it was recorded.
    pub message: SiteMessage,
    /// Whether it came out of the store of the broker.
    pub retain: bool,
}

impl Impairment {
    /// All of them.
    pub const ALL: [Self; 7] = [
        Self::Whole,
        Self::Lost,
        Self::Twice,
        Self::Late,
        Self::TwoRecorders,
        Self::Yesterday,
        Self::Middle,
    ];

    /// What it is called.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Whole => "whole",
            Self::Lost => "one in twenty lost",
            Self::Twice => "one in ten twice",
            Self::Late => "up to 80 ms late",
            Self::TwoRecorders => "two recorders, each loses one in twenty",
            Self::Yesterday => "with what was retained the day before",
            Self::Middle => "begun in the middle",
        }
    }

    /// The recording of what was told; the same for the same seed.
    #[must_use]
    pub fn of(self, told: &[SiteMessage], seed: u64) -> Vec<Recorded> {
        let mut dice = Dice(seed ^ 0x5eed);
        let heard = |message: &SiteMessage, late: u64| {
            let mut message = message.clone();
            message.at = later(message.at, i64::try_from(late).unwrap_or_default());
            Recorded { message, retain: false }
        };
        let mut recorded = Vec::new();
        if self == Self::Yesterday {
            recorded.extend(left_behind(told));
        }
        let begin = if self == Self::Middle { told.len() / 2 } else { 0 };
        for message in &told[begin..] {
            let recorders: &[u64] = if self == Self::TwoRecorders { &[0, 30_000] } else { &[0] };
            for behind in recorders {
                let is_lossy = matches!(self, Self::Lost | Self::TwoRecorders);
                if is_lossy && dice.below(20) == 0 {
                    continue;
                }
                let late = if self == Self::Late {
                    dice.below(80_000)
                } else {
                    *behind
                };
                recorded.push(heard(message, late));
                if self == Self::Twice && dice.below(10) == 0 {
                    recorded.push(heard(message, dice.below(50_000)));
                }
            }
        }
        recorded.sort_by_key(|one| one.message.at);
        recorded
    }
}

fn later(at: jiff::Timestamp, microseconds: i64) -> jiff::Timestamp {
    let late = at.as_microsecond().saturating_add(microseconds);
    jiff::Timestamp::from_microsecond(late).unwrap_or(at)
}

/// The last messages of the connections of all vehicles, as they were left a day before.
fn left_behind(told: &[SiteMessage]) -> Vec<Recorded> {
    let Some(first) = told.first().map(|message| message.at) else {
        return Vec::new();
    };
    let mut seen = std::collections::BTreeSet::new();
    let last = told.iter().rev().filter(|message| {
        let is_kept = message.topic.ends_with("/connection") && message.injected.is_none();
        is_kept && seen.insert(message.topic.clone())
    });
    let stored = last.filter_map(|message| {
        let mut payload: Value = serde_json::from_slice(&message.payload).ok()?;
        let said = later(message.at, -DAY);
        let members = payload.as_object_mut()?;
        members.insert("timestamp".to_owned(), format!("{said:.2}").into());
        let message = SiteMessage {
            at: first,
            payload: payload.to_string().into_bytes(),
            ..message.clone()
        };
        Some(Recorded { message, retain: true })
    });
    stored.collect()
}

#[cfg(test)]
mod tests {
    use super::super::Site;
    use super::*;

    #[test]
    fn each_impairment_does_what_it_says() {
        let site = Site {
            seed: 3,
            vehicles: 4,
            messages: 1_000,
            faults: 0,
        };
        let told: Vec<SiteMessage> = site.messages().collect();
        let counts = Impairment::ALL.map(|impairment| impairment.of(&told, 3).len());
        let [whole, lost, twice, late, two, yesterday, middle] = counts;
        assert_eq!((whole, late, yesterday, middle), (1_000, 1_000, 1_004, 500));
        assert!((900..1_000).contains(&lost) && (1_050..1_200).contains(&twice) && (1_800..2_000).contains(&two));
        let stored = Impairment::Yesterday.of(&told, 3);
        assert_eq!(stored.iter().filter(|one| one.retain).count(), 4);
        let late = Impairment::Late.of(&told, 3);
        assert!(
            late.iter()
                .zip(&told)
                .any(|(one, other)| one.message.topic != other.topic)
        );
    }
}
