//! `header/timestamp`, `header/identity`, `header/version`: the form and sense of header fields.
//!
//! That they are present and of the right type is left to `message/schema`, counting to `header/id-rises`.

use std::collections::BTreeMap;
use std::sync::LazyLock;
use std::time::Duration;

use regex::Regex;

use crate::finding::{broken, quote, remark, show};
use tck_base::clock::Moment;
use tck_check::{Check, CheckContext, CheckFinding, Running};
use tck_pack::Role;
use tck_view::Header;
use tck_world::{Listen, Observation};

/// How far the clock of a device may be off before it is remarked on.
const CLOCK_TOLERANCE: Duration = Duration::from_secs(300);

/// How long a time may be the same in all messages of a topic.
const STANDING: Duration = Duration::from_secs(5);
/// Time zones are whole half hours apart, but for a few; a clock is right to so many seconds.
const HALF_HOUR: u64 = 1800;
const ROUGHLY: u64 = 20;

/// `header/timestamp`.
pub(super) const TIMESTAMP: Check = Check {
    name: "header/timestamp",
    decides: &["HDR-03"],
    doc: "timestamp is a point in time in UTC, written with T and Z. Another number of fraction digits than the version writes is a \
          warning, once, as is a clock more than five minutes away from the harness's; the will is not held to the clock. \
          Message after message at whole half hours from the clock of the harness is local time, and a time that does \
          not change from message to message of a topic is none.",
    arguments: &[],
    listens: &[Listen::AnyDelivered],
    reads: &[],
    needs: &[Header::timestamp],
    start: |_| Box::new(Timestamp::default()),
};

/// `header/identity`.
pub(super) const IDENTITY: Check = Check {
    name: "header/identity",
    decides: &["HDR-05", "TOPIC-04", "TOPIC-05", "TOPIC-06"],
    doc: "manufacturer and serialNumber name the vehicle, the same one in every message. Empty, or other than in the \
          topic, is a warning; a master control that names anybody else than the vehicle it sends to breaks HDR-05. The \
          serial number keeps to its characters, and neither holds a slash.",
    arguments: &[],
    listens: &[Listen::AnyDelivered],
    reads: &[],
    needs: &[Header::manufacturer, Header::serial_number],
    start: |_| Box::new(Identity::default()),
};

/// `header/version`.
pub(super) const VERSION: Check = Check {
    name: "header/version",
    decides: &["HDR-04"],
    doc: "version is three numbers with dots, and its first two are those of the protocol version the device is \
          judged by.",
    arguments: &[],
    listens: &[Listen::AnyDelivered],
    reads: &[],
    needs: &[Header::version],
    start: |_| Box::new(Version),
};

static TIMESTAMP_FORM: LazyLock<Option<Regex>> =
    LazyLock::new(|| Regex::new(r"^\d{4}-\d{2}-\d{2}T\d{2}:\d{2}:\d{2}(?:\.(\d+))?Z$").ok());

#[derive(Default)]
struct Timestamp {
    /// By topic: the last time written, since when, in how many messages, and the last headerId.
    written: BTreeMap<String, Stood>,
    /// How many messages in a row were whole half hours off.
    local: u32,
    /// The number of fraction digits was remarked on.
    digits: bool,
}

/// A time that is written again and again.
struct Stood {
    text: String,
    since: Moment,
    messages: u32,
    id: Option<u64>,
}

impl Timestamp {
    /// Whether the time of this topic stands still: three messages of different number over more than five seconds.
    fn stands_still(&mut self, topic: &str, written: &str, id: Option<u64>, now: Moment) -> bool {
        let fresh = || Stood {
            text: written.chars().take(64).collect(),
            since: now,
            messages: 1,
            id,
        };
        let stood = self.written.entry(topic.to_owned()).or_insert_with(fresh);
        if stood.text != written {
            *stood = fresh();
            return false;
        }
        if id.is_none() || id != stood.id {
            stood.messages += 1;
            stood.id = id;
        }
        stood.messages == 3 && {
            let still = now.since(stood.since) > STANDING;
            // Not yet long enough: the next message will tell.
            stood.messages -= u32::from(!still);
            still
        }
    }

    /// Whether this is the third message in a row that is whole half hours off.
    fn is_local(&mut self, apart: Duration) -> bool {
        let off = apart.as_secs() % HALF_HOUR;
        let whole = apart > CLOCK_TOLERANCE && (off <= ROUGHLY || off >= HALF_HOUR - ROUGHLY);
        self.local = if whole { self.local + 1 } else { 0 };
        self.local == 3
    }
}

impl Running for Timestamp {
    fn observe(
        &mut self,
        record: &Observation<'_>,
        context: &CheckContext<'_>,
        findings: &mut Vec<CheckFinding>,
    ) -> bool {
        let Some(message) = record.delivered() else {
            return false;
        };
        let header = record.header().filter(|header| !header.timestamp.is_absent());
        let Some(header) = header else { return false };
        let Some(written) = header.timestamp.text() else {
            let shown = show(&header.timestamp);
            let text = format!("{}/timestamp: {shown} is no time in UTC", message.name);
            findings.push(broken("HDR-03", record.seq(), text));
            return true;
        };
        let form = TIMESTAMP_FORM.as_ref().and_then(|form| form.captures(written));
        let (Some(form), Ok(time)) = (form, written.parse::<jiff::Timestamp>()) else {
            let text = format!("timestamp {} on {} is no time in UTC", quote(written), message.name);
            findings.push(broken("HDR-03", record.seq(), text));
            return true;
        };
        let digits = form.get(1).map_or(0, |digits| digits.len());
        let due = context.pack.timestamp_digits();
        if digits != due && !std::mem::replace(&mut self.digits, true) {
            let text = format!(
                "timestamp {} has {digits} fraction digits: write {due}, as in {:.due$}",
                quote(written),
                record.at().utc
            );
            findings.push(remark("HDR-03", record.seq(), text));
        }
        let apart = time.duration_since(record.at().utc).unsigned_abs();
        // The broker sends the will long after it was written.
        if record.connection_message().is_some_and(|message| message.is_broken()) {
            return true;
        }
        let id = header.header_id.whole();
        if self.stands_still(message.name, written, id, record.at().moment) {
            let text = format!("timestamp {} stands still on {}", quote(written), message.name);
            findings.push(broken("HDR-03", record.seq(), text));
        }
        if self.is_local(apart) {
            let text = format!(
                "timestamp {} and those before it are whole half hours away from UTC: local time with a Z",
                quote(written)
            );
            findings.push(broken("HDR-03", record.seq(), text));
        } else if apart > CLOCK_TOLERANCE {
            let text = format!(
                "timestamp {} is {} s away from the clock of the harness",
                quote(written),
                apart.as_secs()
            );
            findings.push(remark("HDR-03", record.seq(), text));
        }
        true
    }
}

#[derive(Default)]
struct Identity {
    seen: Option<(String, String)>,
}

impl Running for Identity {
    fn observe(
        &mut self,
        record: &Observation<'_>,
        context: &CheckContext<'_>,
        findings: &mut Vec<CheckFinding>,
    ) -> bool {
        let Some(message) = record.delivered() else {
            return false;
        };
        let named = record
            .header()
            .and_then(|header| header.manufacturer.text().zip(header.serial_number.text()));
        let Some((manufacturer, serial)) = named else {
            return false;
        };
        let seq = record.seq();
        for (name, value, own) in [
            ("manufacturer", manufacturer, context.identity.0),
            ("serialNumber", serial, context.identity.1),
        ] {
            if value.is_empty() {
                findings.push(remark("HDR-05", seq, format!("{name} on {} is empty", message.name)));
            } else if value != own {
                let text = format!(
                    "{name} {} on {} is not the {} of the topic",
                    quote(value),
                    message.name,
                    quote(own)
                );
                findings.push(remark("TOPIC-04", seq, text.clone()));
                // The harness knows its own vehicles; only an AGV under test may be called otherwise in its topics.
                if context.role == Role::MasterControl {
                    findings.push(broken("HDR-05", seq, text));
                }
            }
            if value.contains('/') {
                findings.push(broken(
                    "TOPIC-06",
                    seq,
                    format!("{name} {} holds a slash", quote(value)),
                ));
            }
        }
        if !serial.bytes().all(serial_character) {
            let text = format!("serialNumber {} holds characters that are not allowed", quote(serial));
            findings.push(broken("TOPIC-05", seq, text));
        }
        let identity = (bounded(manufacturer), bounded(serial));
        match &self.seen {
            None => self.seen = Some(identity),
            Some(seen) if *seen != identity && context.role == Role::Agv => {
                let text = format!(
                    "{} on {} names {} {}, an earlier message named {} {}",
                    "the header",
                    message.name,
                    quote(manufacturer),
                    quote(serial),
                    quote(&seen.0),
                    quote(&seen.1)
                );
                findings.push(broken("HDR-05", seq, text));
            }
            Some(_) => {}
        }
        true
    }
}

/// Whether a serial number may hold this character.
pub(super) fn serial_character(byte: u8) -> bool {
    byte.is_ascii_alphanumeric() || matches!(byte, b'_' | b'.' | b':' | b'-')
}

fn bounded(text: &str) -> String {
    text.chars().take(256).collect()
}

struct Version;

impl Running for Version {
    fn observe(
        &mut self,
        record: &Observation<'_>,
        context: &CheckContext<'_>,
        findings: &mut Vec<CheckFinding>,
    ) -> bool {
        if record.delivered().is_none() {
            return false;
        }
        let Some(written) = record.header().and_then(|header| header.version.text()) else {
            return false;
        };
        let parts: Vec<Option<u64>> = written
            .split('.')
            .map(|part| {
                let digits = !part.is_empty() && part.bytes().all(|byte| byte.is_ascii_digit());
                digits.then(|| part.parse().ok()).flatten()
            })
            .take(4)
            .collect();
        let [Some(major), Some(minor), Some(_)] = parts[..] else {
            let text = format!("version {} is not three numbers with dots", quote(written));
            findings.push(broken("HDR-04", record.seq(), text));
            return true;
        };
        let expected = context.pack.version;
        if (major, minor) != (expected.major, expected.minor) {
            let text = format!(
                "version {} is another one than {}.{}, by which the device is judged",
                quote(written),
                expected.major,
                expected.minor
            );
            findings.push(broken("HDR-04", record.seq(), text));
        }
        true
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::super::trace::{Trace, pack};

    fn timestamps(all: &[&str]) -> Vec<String> {
        let mut trace = Trace::subscriber();
        for timestamp in all {
            trace.state(&json!({ "timestamp": timestamp }));
        }
        trace.judge("header/timestamp").summary()
    }

    #[test]
    fn a_time_in_utc_with_two_digits_is_right() {
        assert!(timestamps(&["2026-01-01T12:00:00.00Z", "2026-01-01T12:04:59.99Z"]).is_empty());
    }

    #[test]
    fn offsets_missing_zones_and_impossible_times_are_found() {
        let wrong = [
            "2026-01-01T12:00:00.00+00:00",
            "2026-01-01T12:00:00.00",
            "2026-01-01 12:00:00.00Z",
            "2026-13-01T12:00:00.00Z",
            "",
            "١٢٣٤-01-01T12:00:00.00Z",
        ];
        for timestamp in wrong {
            assert_eq!(timestamps(&[timestamp]), ["HDR-03"], "{timestamp}");
        }
    }

    #[test]
    fn other_digit_counts_and_a_clock_that_is_off_are_remarks() {
        assert_eq!(timestamps(&["2026-01-01T12:00:00.000Z"]), ["HDR-03 warning"]);
        assert_eq!(timestamps(&["2026-01-01T12:00:00Z"]), ["HDR-03 warning"]);
        assert_eq!(timestamps(&["2026-01-01T13:00:00.00Z"]), ["HDR-03 warning"]);
    }

    #[test]
    fn other_digit_counts_are_told_once() {
        let all = [
            "2026-01-01T12:00:00.000Z",
            "2026-01-01T12:00:01.000Z",
            "2026-01-01T12:00:02Z",
        ];
        assert_eq!(timestamps(&all), ["HDR-03 warning"]);
    }

    #[test]
    fn a_time_that_stands_still_and_local_time_with_a_z_are_found() {
        let mut trace = Trace::subscriber();
        for _ in 0..4 {
            trace
                .state(&json!({ "timestamp": "2026-01-01T12:00:00.00Z" }))
                .wait(4.0);
        }
        assert_eq!(trace.judge("header/timestamp").summary(), ["HDR-03"]);
        let mut trace = Trace::subscriber();
        for second in 0..3 {
            let local = format!("2026-01-01T13:00:0{second}.00Z");
            trace.state(&json!({ "timestamp": local })).wait(1.0);
        }
        assert_eq!(
            trace.judge("header/timestamp").summary(),
            ["HDR-03 warning", "HDR-03 warning", "HDR-03"]
        );
    }

    #[test]
    fn the_will_may_be_old() {
        let mut trace = Trace::subscriber();
        let will = json!({ "timestamp": "2020-01-01T00:00:00.00Z", "connectionState": "CONNECTIONBROKEN" });
        trace.message("connection", &will);
        let outcome = trace.judge("header/timestamp");
        assert!(outcome.findings.is_empty() && outcome.judged == 1);
    }

    fn identities(all: &[(&str, &str)]) -> Vec<String> {
        let mut trace = Trace::subscriber();
        for (manufacturer, serial) in all {
            trace.state(&json!({ "manufacturer": manufacturer, "serialNumber": serial }));
        }
        trace.judge("header/identity").summary()
    }

    #[test]
    fn the_identity_of_the_topic_is_right() {
        assert!(identities(&[("acme", "7"), ("acme", "7")]).is_empty());
    }

    #[test]
    fn another_an_empty_a_changing_and_a_malformed_identity_are_found() {
        assert_eq!(identities(&[("Acme", "7")]), ["TOPIC-04 warning"]);
        assert_eq!(identities(&[("", "7")]), ["HDR-05 warning"]);
        assert_eq!(
            identities(&[("acme", "7"), ("acme", "8")]),
            ["TOPIC-04 warning", "HDR-05"]
        );
        assert_eq!(identities(&[("acme", "7 b")]), ["TOPIC-04 warning", "TOPIC-05"]);
        assert_eq!(
            identities(&[("acme", "7/b")]),
            ["TOPIC-04 warning", "TOPIC-06", "TOPIC-05"]
        );
    }

    fn versions(version: &str) -> Vec<String> {
        let mut trace = Trace::subscriber();
        trace.state(&json!({ "version": version }));
        trace.judge("header/version").summary()
    }

    #[test]
    fn any_patch_of_the_version_judged_by_is_right() {
        let pack = pack();
        assert!(versions(&format!("{}.{}.7", pack.version.major, pack.version.minor)).is_empty());
    }

    #[test]
    fn another_form_and_another_version_are_found() {
        let pack = pack();
        let (major, minor) = (pack.version.major, pack.version.minor);
        for version in [
            format!("{major}.{minor}"),
            format!("v{major}.{minor}.0"),
            format!("{major}.{minor}.0-rc1"),
            format!("{major}.{minor}.0.0"),
            format!("{major}.{}.0", minor + 1),
            String::new(),
        ] {
            assert_eq!(versions(&version), ["HDR-04"], "{version}");
        }
    }
}
