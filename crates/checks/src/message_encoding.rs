//! `message/encoding`: whether the bytes of a message are one JSON object.

use crate::finding::{broken, quote, remark};
use tck_check::{Check, CheckContext, CheckFinding, Running};
use tck_journal::json::JsonProblem;
use tck_world::{Listen, Observation};

/// `message/encoding`.
pub(super) const ENCODING: Check = Check {
    name: "message/encoding",
    decides: &["MQTT-02", "JSON-03", "JSON-08", "JSON-10"],
    doc: "Every payload is one JSON object in UTF-8 without NaN, Infinity or numbers beyond all limits. A byte order \
          mark and a member that occurs twice are warnings. Clearing a retained topic with nothing is no finding.",
    arguments: &[],
    listens: &[Listen::AnyDelivered, Listen::AnyPublished],
    reads: &[],
    needs: &[],
    start: |_| Box::new(Encoding),
};

struct Encoding;

impl Running for Encoding {
    fn observe(&mut self, record: &Observation<'_>, _: &CheckContext<'_>, findings: &mut Vec<CheckFinding>) -> bool {
        let Some(message) = record.published() else {
            return false;
        };
        let (Some(parsed), Some(payload)) = (record.parsed(), record.payload()) else {
            return false;
        };
        let (topic, seq) = (message.name, record.seq());
        let mut judged = true;
        for problem in parsed.problems().iter().take(8) {
            let text = format!("{topic}: {}", quote(&problem.to_string()));
            match problem {
                // Too big to be kept and too deep to be parsed are limits of ours.
                JsonProblem::TooBig { .. } | JsonProblem::TooDeep => judged = false,
                // Nothing, retained, clears a topic; a subscriber does not see which it was.
                JsonProblem::Empty if message.retain.unwrap_or(matches!(topic, "connection" | "factsheet")) => {
                    judged = false;
                }
                JsonProblem::Empty | JsonProblem::NotAnObject => findings.push(broken("MQTT-02", seq, text)),
                JsonProblem::NotUtf8 { .. } => {
                    findings.push(broken("JSON-03", seq, text.clone()));
                    findings.push(broken("MQTT-02", seq, text));
                }
                JsonProblem::ByteOrderMark => findings.push(remark("JSON-03", seq, text)),
                JsonProblem::DuplicateMember(_) => findings.push(remark("JSON-10", seq, text)),
                JsonProblem::Syntax(reason) => {
                    if reason.contains("number out of range") || names_no_number(payload.bytes()) {
                        findings.push(broken("JSON-08", seq, text.clone()));
                    }
                    findings.push(broken("MQTT-02", seq, text));
                }
            }
        }
        judged
    }
}

/// Whether NaN or Infinity stands somewhere outside of a string.
fn names_no_number(bytes: &[u8]) -> bool {
    let (mut quoted, mut escaped) = (false, false);
    for (at, byte) in bytes.iter().enumerate() {
        match byte {
            _ if escaped => escaped = false,
            b'\\' if quoted => escaped = true,
            b'"' => quoted = !quoted,
            b'N' | b'I' if !quoted => {
                let rest = &bytes[at..];
                if rest.starts_with(b"NaN") || rest.starts_with(b"Infinity") {
                    return true;
                }
            }
            _ => {}
        }
    }
    false
}

#[cfg(test)]
mod tests {
    use super::super::trace::Trace;

    fn encoded(bytes: &[u8]) -> Vec<String> {
        let mut trace = Trace::subscriber();
        trace.bytes("state", bytes);
        trace.judge("message/encoding").summary()
    }

    #[test]
    fn one_object_in_utf8_is_right() {
        assert!(encoded("{\"x\":\"Nürnberg NaN\"}".as_bytes()).is_empty());
    }

    #[test]
    fn what_is_no_json_object_in_utf8_is_found() {
        assert_eq!(encoded(b""), ["MQTT-02"]);
        assert_eq!(encoded(b"[1]"), ["MQTT-02"]);
        assert_eq!(encoded(b"{\"a\":1} {}"), ["MQTT-02"]);
        assert_eq!(encoded(b"{\"a\":\"\xff\"}"), ["JSON-03", "MQTT-02"]);
        assert_eq!(encoded(b"\xef\xbb\xbf{}"), ["JSON-03 warning"]);
        assert_eq!(encoded(b"{\"a\":1,\"a\":2}"), ["JSON-10 warning"]);
        assert_eq!(encoded(b"{\"a\":NaN}"), ["JSON-08", "MQTT-02"]);
        assert_eq!(encoded(b"{\"a\":-Infinity}"), ["JSON-08", "MQTT-02"]);
        assert_eq!(encoded(b"{\"a\":1e999}"), ["JSON-08", "MQTT-02"]);
    }

    #[test]
    fn clearing_a_retained_topic_is_no_finding() {
        let mut trace = Trace::subscriber();
        trace.bytes("connection", b"");
        let outcome = trace.judge("message/encoding");
        assert!(outcome.findings.is_empty() && outcome.judged == 0);
    }
}
