//! Deviations of the header: what names the vehicle, counts its messages, and tells time and version (section 6.4).

use super::prelude::*;

records! {
    fault "header-without-manufacturer" ["HDR-01", "HDR-05"] "Leaves the manufacturer out of the header of its states."
        => header(|_, head, h| if head.name == "state" { h.unset("manufacturer") });
    fault "header-nested" ["HDR-01", "CONN-10"] "Packs the header of connection messages into an object of its own."
        => header(|_, head, h| if head.name == "connection" && head.counts {
            let inner = std::mem::take(h);
            h.set("header", Value::Object(inner));
        });
    fault "visualization-without-header" ["VIS-01", "HDR-01"] "Publishes the visualization without a header."
        => header(|_, head, h| if head.name == "visualization" { h.clear() });
    fault "factsheet-without-header" ["HDR-01"] "Publishes the factsheet without a header."
        => header(|_, head, h| if head.name == "factsheet" { h.clear() });
    fault "manufacturer-empty" ["HDR-05"] "Leaves the manufacturer empty in its states."
        => header(|_, head, h| if head.name == "state" { h.set("manufacturer", "") });
    fault "manufacturer-with-slash" ["TOPIC-06", "TOPIC-04"] "Writes its manufacturer with a slash in the header."
        => header(|_, _, h| text(h, "manufacturer", |own| format!("{own}/agv")));
    fault "factsheet-names-company" ["HDR-05", "TOPIC-04"] "It writes its manufacturer with the legal form of the company in the header of the factsheet, unlike in the topic and in all other messages."
        => header(|_, head, h| if head.name == "factsheet" { text(h, "manufacturer", |own| format!("{own} GmbH")) });
    fault "other-serial-number" ["TOPIC-04", "HDR-05"] "Names another serial number in the header than in the topic." because "Which of topic and header is wrong cannot be told; TOPIC-04, that they agree, is a recommendation."
        => header(|_, _, h| text(h, "serialNumber", |own| format!("{own}0")));
    fault "serial-number-with-space" ["TOPIC-05", "HDR-05"] "Writes its serial number with a space in the header."
        => header(|_, _, h| text(h, "serialNumber", |own| format!("No. {own}")));
    fault "visualization-names-computer" ["HDR-05", "TOPIC-04", "VIS-01"] "The serialNumber in its visualization is the host name of its computer."
        => header(|_, head, h| if head.name == "visualization" { h.set("serialNumber", "localhost") });
    fault "connection-serial-upper-case" ["HDR-05", "TOPIC-04"] "The header of the connection messages gives the serial number in other case than the topic."
        => header(|_, head, h| if head.name == "connection" { text(h, "serialNumber", other_case) });
    fault "header-id-constant" ["HDR-02"] "Sends every state with the same headerId."
        => header(|_, head, h| if head.name == "state" { h.set("headerId", 0) });
    fault "static-factsheet-header" ["HDR-02", "FACT-02"] "It sends the factsheet from a file: the headerId is the same in every factsheet."
        => header(|_, head, h| if head.name == "factsheet" { h.set("headerId", 0) });
    fault "visualization-header-id-zero" ["HDR-02", "VIS-01"] "The headerId of every visualization message is 0."
        => header(|_, head, h| if head.name == "visualization" { h.set("headerId", 0) });
    fault "header-id-shared" ["HDR-02"] "Counts one headerId over all topics."
        => header(|agv, head, h| {
            let next = agv.connection.header_ids.entry("all").or_default();
            h.set("headerId", *next);
            *next += u32::from(head.counts);
        });
    fault "header-id-as-text" ["JSON-06", "HDR-02"] "Sends the headerId as a string."
        => header(|_, _, h| h.change("headerId", |id| *id = Value::String(id.to_string())));
    fault "answer-repeats-header-id" ["HDR-02", "ACT-26"] "The state that answers a stateRequest has the headerId of the state before it."
        => header(|agv, head, h| {
            let id = h.get("headerId").and_then(Value::as_u64).unwrap_or_default();
            if head.name == "state" && head.counts && id > 0 && agv.report.answers_request() {
                h.set("headerId", id - 1);
                agv.connection.repeat_header_id("state");
            }
        });
    fault "timestamp-local" ["HDR-03"] "Gives its timestamps in local time with an offset."
        => header(|agv, _, h| h.set("timestamp", in_an_hour(agv).replace('Z', "+01:00")));
    fault "timestamp-local-as-utc" ["HDR-03"] "Writes its local time with a Z."
        => header(|agv, _, h| h.set("timestamp", in_an_hour(agv)));
    fault "timestamp-without-zone" ["HDR-03"] "Gives its timestamps without the Z."
        => header(|_, _, h| text(h, "timestamp", |time| time.replace('Z', "")));
    fault "timestamp-unix" ["HDR-03", "JSON-06"] "Gives its timestamps as seconds since 1970."
        => header(|agv, _, h| h.set("timestamp", agv.now.utc.as_second()));
    fault "timestamp-stands-still" ["HDR-03"] "Gives every message the time at which it was switched on."
        => keep::<Option<Value>>().heads(|first, _, _, h| h.change("timestamp", |time| *time = first.get_or_insert(time.clone()).clone()));
    fault "factsheet-dated" ["HDR-03", "JSON-10"] "The timestamp of its factsheet is a date without a time."
        => header(|_, head, h| if head.name == "factsheet" { text(h, "timestamp", |time| time.split('T').next().unwrap_or_default().to_owned()) });
    fault "connection-timestamp-spaced" ["HDR-03"] "The timestamp of the connection messages has a blank instead of the T between date and time."
        => header(|_, head, h| if head.name == "connection" { text(h, "timestamp", |time| time.replace('T', " ")) });
    fault "state-timestamp-decimal-comma" ["HDR-03", "JSON-10"] "It writes the fraction of a second in the timestamp of its states behind a comma."
        => header(|_, head, h| if head.name == "state" { text(h, "timestamp", |time| time.replace('.', ",")) });
    fault "timestamp-trailing-zeros-trimmed" ["HDR-03"] "It leaves out trailing zeros of the fraction of a second, so that one timestamp in ten has only one digit."
        because "The ruling of HDR-03 makes another number of digits of the fraction a warning."
        => header(|_, _, h| text(h, "timestamp", without_zeros));
    fault "timestamp-milliseconds" ["HDR-03"] "Gives the fraction of a second with three digits."
        because "The ruling of HDR-03 makes another number of digits of the fraction a warning."
        => header(|agv, _, h| h.set("timestamp", format!("{:.3}", agv.now.utc)));
    fault "clock-drifts" ["HDR-03"] "Its clock is ten minutes ahead, and gains a second in a hundred."
        because "A clock that is far from that of the harness is a warning by HDR-03."
        => header(|agv, _, h| h.set("timestamp", drifting(agv)));
    fault "version-short" ["HDR-04"] "Gives the protocol version without the patch number."
        => header(|_, _, h| text(h, "version", |own| own.rsplit_once('.').map_or(own, |(short, _)| short).to_owned()));
    fault "factsheet-version-prefixed" ["HDR-04"] "The version in the header of its factsheet begins with the letter V."
        => header(|_, head, h| if head.name == "factsheet" { text(h, "version", |own| format!("V{own}")) });
}

/// The time an hour from now.
fn in_an_hour(agv: &Agv) -> String {
    let hour = jiff::SignedDuration::from_hours(1);
    format!("{:.2}", agv.now.utc.checked_add(hour).unwrap_or(agv.now.utc))
}

/// The time of a clock that is ten minutes ahead, and gains a second in a hundred.
fn drifting(agv: &Agv) -> String {
    let gained = agv.now.moment.since(tck_base::clock::Moment::START).as_secs() / 100;
    let ahead = jiff::SignedDuration::from_secs(600 + i64::try_from(gained).unwrap_or_default());
    format!("{:.2}", agv.now.utc.checked_add(ahead).unwrap_or(agv.now.utc))
}

/// A text in upper case, or in lower case where it is in upper case already.
fn other_case(text: &str) -> String {
    let upper = text.to_ascii_uppercase();
    if upper == text {
        text.to_ascii_lowercase()
    } else {
        upper
    }
}

/// A timestamp without the zeros at the end of its fraction.
fn without_zeros(time: &str) -> String {
    match time.strip_suffix('Z').filter(|digits| digits.contains('.')) {
        Some(digits) => format!("{}Z", digits.trim_end_matches('0').trim_end_matches('.')),
        None => time.to_owned(),
    }
}
