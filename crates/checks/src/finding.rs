//! Findings, and how values of a device are shown in them.

use std::fmt::Display;

use tck_base::verdict::Verdict;
use tck_check::CheckFinding;
use tck_pack::RequirementId;
use tck_view::{Member, Shown};

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
