//! Time as a value that is handed in.
//!
//! A [`Moment`] is monotonic time since the start of a run, a [`Stamp`] adds the wall clock. Only the
//! engine, the links and the command line may *read* a clock; everything below is given stamps.

use std::ops::{Add, Sub};
use std::time::Duration;

use serde::{Deserialize, Serialize};

/// Monotonic time since the start of the run, in microseconds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Moment(u64);

impl Moment {
    /// The start of the run.
    pub const START: Self = Self(0);

    /// `micros` microseconds after the start of the run.
    #[must_use]
    pub const fn from_micros(micros: u64) -> Self {
        Self(micros)
    }

    /// Microseconds since the start of the run.
    #[must_use]
    pub const fn micros(self) -> u64 {
        self.0
    }

    /// Seconds since the start of the run.
    #[must_use]
    pub fn seconds(self) -> f64 {
        self.since(Self::START).as_secs_f64()
    }

    /// The time from `earlier` to `self`; zero if `earlier` is later.
    #[must_use]
    pub fn since(self, earlier: Self) -> Duration {
        Duration::from_micros(self.0.saturating_sub(earlier.0))
    }
}

impl Add<Duration> for Moment {
    type Output = Self;

    fn add(self, duration: Duration) -> Self {
        let micros = u64::try_from(duration.as_micros()).unwrap_or(u64::MAX);
        Self(self.0.saturating_add(micros))
    }
}

impl Sub<Moment> for Moment {
    type Output = Duration;

    fn sub(self, earlier: Moment) -> Duration {
        self.since(earlier)
    }
}

/// One point in time on both clocks.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct Stamp {
    /// Monotonic time since the start of the run.
    #[serde(rename = "t")]
    pub moment: Moment,
    /// Wall clock in UTC.
    pub utc: jiff::Timestamp,
}

impl Stamp {
    /// The stamp `duration` later on both clocks.
    #[must_use]
    pub fn after(self, duration: Duration) -> Self {
        self.at(self.moment + duration)
    }

    /// The stamp of another moment of the same run, reckoned from this one.
    #[must_use]
    pub fn at(self, moment: Moment) -> Self {
        let micros = |m: Moment| i64::try_from(m.micros()).unwrap_or(i64::MAX);
        let shift = micros(moment).saturating_sub(micros(self.moment));
        let utc = self.utc.as_microsecond().saturating_add(shift);
        Self {
            moment,
            utc: jiff::Timestamp::from_microsecond(utc).unwrap_or(self.utc),
        }
    }
}

/// A wall clock with its origin at the start of the run.
#[derive(Clone, Copy, Debug)]
pub struct WallClock {
    origin: std::time::Instant,
    utc: jiff::Timestamp,
    first: Moment,
}

impl WallClock {
    /// Starts a run now.
    #[must_use]
    pub fn start() -> Self {
        Self {
            origin: std::time::Instant::now(),
            utc: jiff::Timestamp::now(),
            first: Moment::START,
        }
    }

    /// Goes on now with a run that broke off: its time begins with this moment.
    #[must_use]
    pub fn going_on(first: Moment) -> Self {
        Self { first, ..Self::start() }
    }

    /// The present moment. The wall clock part is derived from the start of the run, so that a
    /// clock set back in between cannot make evidence run backwards.
    #[must_use]
    pub fn now(&self) -> Stamp {
        self.origin_stamp().after(self.origin.elapsed())
    }

    /// The stamp of the start of the run.
    #[must_use]
    pub fn origin_stamp(&self) -> Stamp {
        Stamp {
            moment: self.first,
            utc: self.utc,
        }
    }

    /// The standard library instant of `moment`, for timers.
    #[must_use]
    pub fn instant(&self, moment: Moment) -> std::time::Instant {
        self.origin + moment.since(self.first)
    }
}
