//! A watch as plain lines: one for each finding with its message below, and from time to time one for each vehicle.

use std::io::Write;
use std::time::{Duration, Instant};

use console::Style;
use serde_json::{Value, json};

use super::output::Output;
use tck_base::verdict::Verdict;
use tck_report::clean::{line, short};
use tck_watch::alarm::Alarmed;
use tck_watch::session::{Contact, Happening, Viewer};
use tck_watch::vehicle_status::VehicleStatus;
use tck_watch::{Notice, Watch};

/// How much of a message is shown beside a finding, in characters.
const MESSAGE: usize = 400;

/// What is written.
#[derive(Clone, Copy, Debug, Default)]
pub struct LineOptions {
    /// Every finding, and not only the first of a kind and those that make it ten times as many.
    pub every: bool,
    /// For programs: an object a line.
    pub json: bool,
    /// How often each vehicle is summed up.
    pub summary: Option<Duration>,
    /// Whether to colour.
    pub color: bool,
}

/// A watch as plain lines: one for each finding with its message below, and from time to time one for each vehicle.
pub struct Lines<W: Write, E: Write> {
    findings: Output<W>,
    notes: Output<E>,
    options: LineOptions,
    known: usize,
    summed_up: Instant,
}

impl Lines<std::io::Stdout, std::io::Stderr> {
    /// Findings to standard output, what happens to the watch to standard error.
    #[must_use]
    pub fn of_process(options: LineOptions) -> Self {
        Self::to(std::io::stdout(), std::io::stderr(), options)
    }
}

impl<W: Write, E: Write> Lines<W, E> {
    /// Findings and notes to these.
    pub fn to(findings: W, notes: E, options: LineOptions) -> Self {
        Self {
            findings: Output::to(findings),
            notes: Output::to(notes),
            options,
            known: 0,
            summed_up: Instant::now(),
        }
    }

    /// Whether nobody reads any more.
    pub fn is_closed(&self) -> bool {
        self.findings.is_closed()
    }

    fn write(&mut self, text: &str) {
        // A full disk behind the pipe loses the line, not the watch: the journal has what it needs.
        let _ = self.findings.line(text);
    }
}

impl<W: Write, E: Write> Viewer for Lines<W, E> {
    fn found(&mut self, notice: &Notice) {
        let counts = matches!(notice.found.verdict, Verdict::Fail | Verdict::Warning);
        if !counts || !(self.options.every || notice.is_told()) {
            return;
        }
        if self.options.json {
            self.write(&object(notice).to_string());
        } else {
            self.write(&finding(notice, self.options.color));
        }
    }

    fn happened(&mut self, happening: &Happening, at: jiff::Timestamp) {
        if self.options.json {
            let (kind, more) = match happening {
                Happening::Tap(address) => ("tap", json!(address.to_string())),
                Happening::Metrics(address) => ("metrics", json!(address.to_string())),
                Happening::Connected => ("connected", Value::Null),
                Happening::Again(unseen) => ("connected", json!({ "unseenSeconds": unseen.as_secs_f64() })),
                Happening::Lost(why) => ("lost", json!(why)),
                Happening::NotRecorded(why) => ("not-recorded", json!(why)),
            };
            self.write(&json!({ "kind": kind, "at": format!("{at:.3}"), "detail": more }).to_string());
        }
        let text = match happening {
            Happening::Tap(address) => format!("vehicles are expected at mqtt://{address}"),
            Happening::Metrics(address) => format!("metrics are served at http://{address}/metrics"),
            Happening::Connected => "watching; Ctrl-C ends it".to_owned(),
            Happening::Again(unseen) => format!(
                "{at:.3} connected again; what happened in {:.1} s was not seen, and judging begins anew",
                unseen.as_secs_f64()
            ),
            Happening::Lost(why) => format!("{at:.3} the connection is lost, and tried again: {}", line(why)),
            Happening::NotRecorded(why) => format!(
                "{at:.3} nothing is recorded any more, and what is heard is judged as before: {}",
                line(why)
            ),
        };
        let _ = self.notes.line(&text);
    }

    fn alarmed(&mut self, alarmed: &Alarmed) {
        let Alarmed {
            manufacturer,
            serial_number,
            at,
            alarm,
        } = alarmed;
        if self.options.json {
            let object = json!({ "kind": "alarm", "at": format!("{at:.3}"), "manufacturer": manufacturer,
                "serialNumber": serial_number, "alarm": alarm.word(), "text": alarm.to_string() });
            self.write(&object.to_string());
            return;
        }
        let style = Style::new().red().force_styling(self.options.color);
        self.write(&format!(
            "{at:.3} {} {} {}: {}",
            style.apply_to("ALARM"),
            line(manufacturer),
            line(serial_number),
            line(&alarm.to_string())
        ));
    }

    fn tick(&mut self, watch: &Watch<'_>, _contact: Contact) -> bool {
        let heard = watch.glances().len();
        if heard > self.known {
            let _ = self.notes.line(&format!(
                "{heard} vehicle{} heard by now",
                if heard == 1 { "" } else { "s" }
            ));
            self.known = heard;
        }
        let due = self
            .options
            .summary
            .is_some_and(|every| self.summed_up.elapsed() >= every);
        if due {
            self.summed_up = Instant::now();
            for glance in watch.worst_first() {
                if self.options.json {
                    self.write(&summary_object(glance).to_string());
                } else {
                    self.write(&summary(glance));
                }
            }
        }
        !self.is_closed()
    }
}

/// Who is meant by a role.
#[must_use]
pub fn side(role: &str) -> &'static str {
    match role {
        "agv" => "vehicle",
        _ => "master control",
    }
}

fn finding(notice: &Notice, color: bool) -> String {
    let found = &notice.found;
    let (tag, style) = match found.verdict {
        Verdict::Fail => ("FAIL", Style::new().red().bold()),
        _ => ("WARN", Style::new().yellow()),
    };
    let times = match found.count {
        1 => String::new(),
        count => format!(", {count} times by now"),
    };
    let mut text = format!(
        "{} {} {} {}, {}: {} {}{times}: {}",
        found.at,
        style.force_styling(color).apply_to(tag),
        line(&found.manufacturer),
        line(&found.serial_number),
        side(&found.role),
        found.requirement,
        found.monitor,
        short(&line(&found.text), MESSAGE)
    );
    if let Some((topic, payload)) = &notice.message {
        let payload = String::from_utf8_lossy(payload);
        let shown = short(&line(&payload), MESSAGE).into_owned();
        text.push_str(&format!("\n    {} {shown}", line(topic)));
    }
    text
}

fn object(notice: &Notice) -> Value {
    let mut object = json!({ "kind": "finding" });
    if let (Value::Object(members), Ok(Value::Object(found))) = (&mut object, serde_json::to_value(&notice.found)) {
        members.extend(found);
        if let Some((topic, payload)) = &notice.message {
            members.insert("topic".to_owned(), topic.as_str().into());
            members.insert("payload".to_owned(), String::from_utf8_lossy(payload).into());
        }
    }
    object
}

/// How things are with a vehicle, on one line.
#[must_use]
pub fn summary(glance: &VehicleStatus) -> String {
    let known = |text: &Option<String>| line(text.as_deref().unwrap_or("-")).into_owned();
    let order = match &glance.order {
        None => "no order".to_owned(),
        Some((id, update)) => {
            let (base, horizon) = glance.nodes;
            format!("order {}/{update}, {base}+{horizon} nodes left", line(id))
        }
    };
    let messages: u64 = glance.messages.values().sum();
    format!(
        "{} {}: {}, {}, {order}, last node {}; {messages} messages, {} violations, {} warnings",
        line(&glance.manufacturer),
        line(&glance.serial_number),
        known(&glance.connection),
        known(&glance.mode),
        known(&glance.last_node),
        glance.found(Verdict::Fail),
        glance.found(Verdict::Warning)
    )
}

fn summary_object(glance: &VehicleStatus) -> Value {
    json!({
        "kind": "vehicle",
        "manufacturer": glance.manufacturer,
        "serialNumber": glance.serial_number,
        "protocol": glance.version,
        "connectionState": glance.connection,
        "operatingMode": glance.mode,
        "orderId": glance.order.as_ref().map(|(id, _)| id),
        "orderUpdateId": glance.order.as_ref().map(|(_, update)| update),
        "nodesLeft": { "base": glance.nodes.0, "horizon": glance.nodes.1 },
        "lastNodeId": glance.last_node,
        "heard": glance.heard.map(|at| format!("{:.3}", at.utc)),
        "messages": glance.messages,
        "violations": glance.found(Verdict::Fail),
        "warnings": glance.found(Verdict::Warning),
    })
}
