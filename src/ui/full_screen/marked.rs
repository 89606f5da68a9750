//! A message, line by line, with the members a finding names marked.

use serde_json::Value;

use tck_journal::place;
use tck_report::clean::line;

/// One line of a message.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Line {
    pub text: String,
    pub is_marked: bool,
}

/// The lines of a message; of one that is no JSON, the text as it is.
pub(super) fn lines(payload: &[u8], topic: &str, finding: &str) -> Vec<Line> {
    let Ok(message) = serde_json::from_slice::<Value>(payload) else {
        let text = String::from_utf8_lossy(payload);
        let plain = |text: &str| Line {
            text: line(text).into_owned(),
            is_marked: false,
        };
        return text.lines().map(plain).collect();
    };
    let name = topic.rsplit('/').next().unwrap_or_default();
    let mut wanted = place::named(finding, name, &message);
    for pointer in &mut wanted {
        // Of what is missing, the object that lacks it.
        while message.pointer(pointer).is_none() {
            let Some((holder, _)) = pointer.rsplit_once('/') else {
                break;
            };
            *pointer = holder.to_owned();
        }
    }
    let mut pretty = Pretty {
        wanted,
        lines: Vec::new(),
    };
    pretty.value(&message, "", "", "", 0);
    pretty.lines
}

struct Pretty {
    wanted: Vec<String>,
    lines: Vec<Line>,
}

impl Pretty {
    fn push(&mut self, depth: usize, text: &str, pointer: &str) {
        self.lines.push(Line {
            text: format!("{}{}", "  ".repeat(depth), line(text)),
            is_marked: self.wanted.iter().any(|wanted| wanted == pointer),
        });
    }

    fn value(&mut self, value: &Value, pointer: &str, name: &str, comma: &str, depth: usize) {
        match value {
            Value::Object(members) if !members.is_empty() => {
                self.push(depth, &format!("{name}{{"), pointer);
                let last = members.len() - 1;
                for (number, (member, inner)) in members.iter().enumerate() {
                    let below = format!("{pointer}/{}", member.replace('~', "~0").replace('/', "~1"));
                    let comma = if number == last { "" } else { "," };
                    self.value(
                        inner,
                        &below,
                        &format!("{}: ", Value::from(member.as_str())),
                        comma,
                        depth + 1,
                    );
                }
                self.push(depth, &format!("}}{comma}"), "\0");
            }
            Value::Array(all) if !all.is_empty() => {
                self.push(depth, &format!("{name}["), pointer);
                let last = all.len() - 1;
                for (number, inner) in all.iter().enumerate() {
                    let comma = if number == last { "" } else { "," };
                    self.value(inner, &format!("{pointer}/{number}"), "", comma, depth + 1);
                }
                self.push(depth, &format!("]{comma}"), "\0");
            }
            plain => self.push(depth, &format!("{name}{plain}{comma}"), pointer),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn marked(payload: &str, finding: &str) -> Vec<String> {
        let lines = lines(payload.as_bytes(), "a/v2/m/s/state", finding);
        let marked = lines.into_iter().filter(|line| line.is_marked);
        marked.map(|line| line.text.trim().to_owned()).collect()
    }

    #[test]
    fn the_member_that_is_wrong_is_marked() {
        let message = r#"{"driving":"no","nodeStates":[{"nodeId":"a"},{"nodeId":"b"}],"errors":[]}"#;
        assert_eq!(
            marked(message, "state/driving: \"no\" is not of type boolean"),
            ["\"driving\": \"no\","]
        );
        assert_eq!(
            marked(message, "nodeStates[1].nodeId is unknown"),
            ["\"nodeId\": \"b\""]
        );
        assert_eq!(
            marked(message, "state/nodeStates/0/released: `released` is missing"),
            ["{"]
        );
        assert_eq!(marked(message, "anything else"), Vec::<String>::new());
        assert_eq!(lines(b"\x1b[2J", "t", "x")[0].text, "␛[2J");
    }
}
