//! Numbers of a message.

use std::fmt;

/// A number as JSON has it: whole or with a fraction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Number {
    /// Written without fraction or exponent, zero or more.
    Whole(u64),
    /// Written without fraction or exponent, below zero.
    Negative(i64),
    /// Written with a fraction or an exponent, or too big for 64 bits.
    Float(f64),
}

impl Default for Number {
    fn default() -> Self {
        Self::Whole(0)
    }
}

impl Number {
    /// The value as a floating-point number; always finite, since JSON knows no other.
    #[must_use]
    pub const fn float(self) -> f64 {
        match self {
            Self::Whole(number) => number as f64,
            Self::Negative(number) => number as f64,
            Self::Float(number) => number,
        }
    }

    /// The value where it is a whole number that is not negative; `2.0` is one, too.
    #[must_use]
    pub fn whole(self) -> Option<u64> {
        const EXACT: f64 = 9_007_199_254_740_992.0;
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "range and fraction are checked"
        )]
        let of_float = |float: f64| (float.fract() == 0.0 && (0.0..=EXACT).contains(&float)).then_some(float as u64);
        match self {
            Self::Whole(number) => Some(number),
            Self::Negative(_) => None,
            Self::Float(number) => of_float(number),
        }
    }

    /// Whether it is written as a whole number: `2`, but not `2.0`.
    #[must_use]
    pub const fn is_written_whole(self) -> bool {
        !matches!(self, Self::Float(_))
    }
}

impl fmt::Display for Number {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Whole(number) => number.fmt(f),
            Self::Negative(number) => number.fmt(f),
            Self::Float(number) => serde_json::Number::from_f64(*number).map_or(Err(fmt::Error), |shown| shown.fmt(f)),
        }
    }
}
