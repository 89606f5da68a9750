//! What a finding is about, whatever names and numbers stand in its sentence: findings of one cause are counted together.

/// How long a cause may be; what follows decides nothing.
const LONGEST: usize = 160;

/// The sentence with every number, and every text in quotes, replaced by a sign for it.
pub(super) fn of(text: &str) -> String {
    let mut cause = String::new();
    let mut rest = text.chars().peekable();
    while let Some(next) = rest.next() {
        if cause.len() >= LONGEST {
            break;
        }
        match next {
            '"' => {
                cause.push('"');
                let mut escaped = false;
                for inner in rest.by_ref() {
                    if inner == '"' && !escaped {
                        break;
                    }
                    escaped = inner == '\\' && !escaped;
                }
                cause.push('"');
            }
            _ if next.is_ascii_digit() => {
                while rest.next_if(|next| next.is_ascii_digit() || *next == '.').is_some() {}
                cause.push('#');
            }
            _ => cause.push(next),
        }
    }
    cause
}

#[cfg(test)]
mod tests {
    use super::of;

    #[test]
    fn names_and_numbers_make_no_other_cause() {
        assert_eq!(
            of("state/nodeStates/12/nodeId: \"a \\\"b\\\"\" is 3.5 long"),
            "state/nodeStates/#/nodeId: \"\" is # long"
        );
        assert_eq!(of("headerId falls from 20 to 3"), of("headerId falls from 7 to 19"));
        assert_ne!(
            of("state/driving: 1 is not a boolean"),
            of("state/paused: 1 is not a boolean")
        );
        assert_eq!(of("\"never closed"), "\"\"");
        assert!(of(&"x".repeat(1000)).len() <= 160);
    }
}
