//! What is seen and found, in OpenMetrics text.

use std::fmt::Write as _;

use super::Watch;
use super::vehicle_status::{BUCKETS, VehicleStatus};
use tck_report::clean::line;

/// The type of the text.
pub(super) const CONTENT_TYPE: &str = "application/openmetrics-text; version=1.0.0; charset=utf-8";

/// How the connection to the broker went.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Contact {
    /// Whether there is one.
    pub connected: bool,
    /// How often it was lost.
    pub lost: u64,
    /// Seconds without it since the first one.
    pub unseen: f64,
}

/// Writes metrics one after the other.
struct Page(String);

impl Page {
    fn family(&mut self, name: &str, kind: &str, help: &str) {
        let _ = writeln!(self.0, "# TYPE {name} {kind}\n# HELP {name} {help}");
    }

    fn sample(&mut self, name: &str, labels: &[(&str, &str)], value: impl std::fmt::Display) {
        self.0.push_str(name);
        for (number, (label, text)) in labels.iter().enumerate() {
            self.0.push(if number == 0 { '{' } else { ',' });
            let _ = write!(self.0, "{label}=\"{}\"", escaped(text));
        }
        let _ = writeln!(self.0, "{} {value}", if labels.is_empty() { "" } else { "}" });
    }
}

/// A text as the value of a label.
fn escaped(text: &str) -> String {
    let mut safe = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '\\' => safe.push_str("\\\\"),
            '"' => safe.push_str("\\\""),
            '\n' => safe.push_str("\\n"),
            // What would take over a terminal is shown as what it is.
            c => safe.push_str(&line(c.encode_utf8(&mut [0; 4]))),
        }
    }
    safe
}

/// The labels by which a vehicle is known.
fn named(glance: &VehicleStatus) -> [(&'static str, &str); 2] {
    [
        ("manufacturer", &glance.manufacturer),
        ("serial_number", &glance.serial_number),
    ]
}

/// The page that a scraper reads.
pub(super) fn page(watch: &Watch<'_>, contact: Contact) -> String {
    let mut page = Page(String::new());
    page.family(
        "vda5050_broker_connected",
        "gauge",
        "Whether there is a connection to the broker.",
    );
    page.sample("vda5050_broker_connected", &[], u8::from(contact.connected));
    page.family(
        "vda5050_broker_connection_lost",
        "counter",
        "How often the connection was lost.",
    );
    page.sample("vda5050_broker_connection_lost_total", &[], contact.lost);
    page.family(
        "vda5050_unseen_seconds",
        "counter",
        "Time in which nothing could be seen.",
    );
    page.sample("vda5050_unseen_seconds_total", &[], format!("{:.3}", contact.unseen));
    page.family(
        "vda5050_other_messages",
        "counter",
        "Messages on topics of no vehicle that is watched.",
    );
    page.sample("vda5050_other_messages_total", &[], watch.elsewhere());
    let vehicles: Vec<&VehicleStatus> = watch.glances().collect();
    page.family("vda5050_messages", "counter", "Messages by vehicle and topic.");
    for glance in &vehicles {
        for (topic, count) in &glance.messages {
            let labels = [&named(glance)[..], &[("topic", topic)]].concat();
            page.sample("vda5050_messages_total", &labels, count);
        }
    }
    page.family(
        "vda5050_last_message_timestamp_seconds",
        "gauge",
        "When the vehicle, or what is said to it, was heard last.",
    );
    for glance in &vehicles {
        if let Some(heard) = glance.heard {
            let seconds = heard.utc.as_microsecond() as f64 / 1e6;
            page.sample(
                "vda5050_last_message_timestamp_seconds",
                &named(glance),
                format!("{seconds:.3}"),
            );
        }
    }
    page.family(
        "vda5050_last_state_timestamp_seconds",
        "gauge",
        "When the last state of the vehicle came live: neither what is said to it nor what a broker has kept.",
    );
    for glance in &vehicles {
        if let Some(state) = glance.last_state() {
            let seconds = state.utc.as_microsecond() as f64 / 1e6;
            page.sample(
                "vda5050_last_state_timestamp_seconds",
                &named(glance),
                format!("{seconds:.3}"),
            );
        }
    }
    page.family(
        "vda5050_vehicle_silent",
        "gauge",
        "Whether the connection topic of the vehicle says ONLINE, and no state comes.",
    );
    for glance in &vehicles {
        page.sample("vda5050_vehicle_silent", &named(glance), u8::from(glance.is_silent()));
    }
    page.family(
        "vda5050_vehicle_online",
        "gauge",
        "Whether the connection topic of the vehicle says ONLINE.",
    );
    for glance in &vehicles {
        if let Some(connection) = &glance.connection {
            page.sample(
                "vda5050_vehicle_online",
                &named(glance),
                u8::from(connection == "ONLINE"),
            );
        }
    }
    page.family("vda5050_vehicle_errors", "gauge", "Errors in the last state.");
    for glance in &vehicles {
        page.sample("vda5050_vehicle_errors", &named(glance), glance.errors.len());
    }
    page.family("vda5050_findings", "counter", "What the monitors found.");
    for glance in &vehicles {
        for kind in glance.kinds.values() {
            let more = [
                ("side", kind.role.as_str()),
                ("requirement", &kind.requirement),
                ("monitor", &kind.monitor),
                ("verdict", kind.verdict.word()),
            ];
            let labels = [&named(glance)[..], &more[..]].concat();
            page.sample("vda5050_findings_total", &labels, kind.count);
        }
    }
    let help = "Time from a command to the first state that shows it.";
    page.family("vda5050_reaction_seconds", "histogram", help);
    for glance in &vehicles {
        for (topic, reactions) in &glance.reactions {
            let labels = [&named(glance)[..], &[("topic", *topic)]].concat();
            for (end, count) in BUCKETS.iter().zip(reactions.up_to) {
                let end = format!("{end:?}");
                let labels = [&labels[..], &[("le", end.as_str())]].concat();
                page.sample("vda5050_reaction_seconds_bucket", &labels, count);
            }
            let all = [&labels[..], &[("le", "+Inf")]].concat();
            page.sample("vda5050_reaction_seconds_bucket", &all, reactions.count);
            page.sample("vda5050_reaction_seconds_count", &labels, reactions.count);
            page.sample("vda5050_reaction_seconds_sum", &labels, format!("{:.6}", reactions.sum));
        }
    }
    page.0.push_str("# EOF\n");
    page.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_text_of_a_label_cannot_end_it() {
        let mut page = Page(String::new());
        page.sample("a_total", &[("n", "x\"} 1\n\\"), ("m", "")], 2);
        page.sample("b", &[], 0.5);
        assert_eq!(escaped("\u{1b}[2J\u{202e}"), "\u{241b}[2J\\u{202e}");
        assert_eq!(page.0, "a_total{n=\"x\\\"} 1\\n\\\\\",m=\"\"} 2\nb 0.5\n");
    }
}
