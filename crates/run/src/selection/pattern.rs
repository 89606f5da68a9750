//! Which tests a pattern means.

use std::sync::Arc;

use tck_base::diagnostic::{self, Diagnostic};
use tck_suite::model::Test;

/// The tests that one of the patterns matches, in their order; all when there is no pattern.
///
/// # Errors
/// When a pattern matches nothing: a typo must not look like a small, green run.
pub fn select(all: &[Arc<Test>], patterns: &[String]) -> Result<Vec<Arc<Test>>, Diagnostic> {
    if patterns.is_empty() {
        return Ok(all.to_vec());
    }
    for pattern in patterns {
        if !all.iter().any(|test| matches(pattern, &test.id)) {
            let ids = all.iter().map(|test| test.id.as_str());
            let hint = match diagnostic::closest(pattern, ids) {
                Some(close) => format!("did you mean `{close}`?"),
                None => "`vda5050-tck list tests` shows them all; `*` stands for anything".to_owned(),
            };
            return Err(Diagnostic::whole("unknown-test", format!("no test matches `{pattern}`")).hint(hint));
        }
    }
    let wanted = |test: &&Arc<Test>| patterns.iter().any(|pattern| matches(pattern, &test.id));
    Ok(all.iter().filter(wanted).cloned().collect())
}

/// A pattern is an id, the group or table before a `/` or `[`, or has `*` for anything.
#[must_use]
pub fn matches(pattern: &str, id: &str) -> bool {
    let below = |separator: char| id.strip_prefix(pattern).is_some_and(|rest| rest.starts_with(separator));
    id == pattern || below('/') || below('[') || (pattern.contains('*') && glob(pattern.as_bytes(), id.as_bytes()))
}

fn glob(pattern: &[u8], text: &[u8]) -> bool {
    // Linear in both: only the last star can be widened.
    let (mut at, mut from, mut star) = (0, 0, None);
    while from < text.len() {
        if pattern.get(at) == Some(&b'*') {
            star = Some((at, from));
            at += 1;
        } else if pattern.get(at) == Some(&text[from]) {
            at += 1;
            from += 1;
        } else if let Some((place, tried)) = star {
            star = Some((place, tried + 1));
            at = place + 1;
            from = tried + 1;
        } else {
            return false;
        }
    }
    pattern[at..].iter().all(|byte| *byte == b'*')
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pattern_is_an_id_a_group_a_table_or_a_glob() {
        for pattern in ["order/a[x]", "order", "order/a", "order/*", "*[x]", "*", "o*/*x*"] {
            assert!(matches(pattern, "order/a[x]"), "{pattern}");
        }
        for pattern in ["orde", "order/b", "order/a[", "*y*", "a*"] {
            assert!(!matches(pattern, "order/a[x]"), "{pattern}");
        }
    }
}
