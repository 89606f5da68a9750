//! Findings, and how values of a device are shown in them.

use std::fmt::Display;

use tck_base::verdict::Verdict;
use tck_check::CheckFinding;
use tck_pack::RequirementId;
use tck_view::{Member, Shown};

/// A number of a device: one that would take many digits in powers of ten.
pub(crate) fn number(value: f64) -> String {
    if value == 0.0 || (1e-6..1e15).contains(&value.abs()) {
        format!("{value}")
    } else {
        format!("{value:e}")
    }
}

/// A finding on `requirement` that follows its mood.
pub(crate) fn broken(requirement: &str, seq: u64, message: impl Into<String>) -> CheckFinding {
    CheckFinding {
        requirement: Some(RequirementId::from(requirement)),
        verdict: None,
        seq,
        message: message.into(),
        element: None,
    }
}

/// A finding that a ruling of the catalogue makes a warning.
pub(crate) fn remark(requirement: &str, seq: u64, message: impl Into<String>) -> CheckFinding {
    CheckFinding {
        verdict: Some(Verdict::Warning),
        ..broken(requirement, seq, message)
    }
}

/// A fact that cannot be observed from here.
pub(crate) fn unclear(requirement: &str, seq: u64, message: impl Into<String>) -> CheckFinding {
    CheckFinding {
        verdict: Some(Verdict::Inconclusive),
        ..broken(requirement, seq, message)
    }
}

/// A value of a device, escaped and cut to a readable length.
pub(crate) fn show(value: &impl Display) -> String {
    shorten(&value.to_string())
}

/// A member of a device as [`show`] shows it, or that it is missing.
pub(crate) fn missing_or<T: Shown>(member: &Member<T>) -> String {
    if member.is_absent() {
        "missing".to_owned()
    } else {
        show(member)
    }
}

/// A text of a device in quotes, escaped and cut to a readable length.
pub(crate) fn quote(text: &str) -> String {
    shorten(&format!("{:?}", text.chars().take(100).collect::<String>()))
}

fn shorten(text: &str) -> String {
    let mut short: String = text.chars().take(80).collect();
    if short.len() < text.len() {
        short.push('…');
    }
    short
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_number_is_short_whatever_it_is() {
        let shown = [0.0, 4.0, -3.25, 1e300, 1e-300, f64::MIN_POSITIVE].map(number);
        assert_eq!(shown[..5], ["0", "4", "-3.25", "1e300", "1e-300"]);
        assert!(shown[5].len() < 30, "{}", shown[5]);
    }
}
