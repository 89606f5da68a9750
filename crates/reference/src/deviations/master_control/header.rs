//! Deviations of the header: what names the vehicle, counts the messages, and tells time and version (section 6.4).

use super::prelude::*;

records! {
    fault "version-missing" ["HDR-01", "HDR-04"] "Leaves the version out of its orders."
        => order(|m| m.unset("version"));
    fault "timestamp-missing" ["HDR-01", "HDR-03"] "Leaves the timestamp out of its instant actions."
        => instant(|m| m.unset("timestamp"));
    fault "header-nested" ["HDR-01"] "Puts the header into an object of its own."
        => sending(|_, _, out| {
            let (header, body) = std::mem::take(&mut out.message).into_iter().partition(|(key, _)| HEADER.contains(&key.as_str()));
            out.message = body;
            out.message.set("header", Value::Object(header));
        });
    fault "header-id-constant" ["HDR-02"] "Never raises the headerId."
        => every(|m| m.set("headerId", 0));
    fault "header-id-shared" ["HDR-02"] "Counts the headerId over all topics together."
        => keep::<u32>().sends(|next, _, _, out| {
            out.message.set("headerId", *next);
            *next += 1;
            true
        });
    fault "header-id-counts-fleet" ["HDR-02"] "It counts headerId per topic name over all vehicles, so that a vehicle sees jumps as soon as another one is commanded."
        because "The numbers a vehicle sees still rise; the ruling of HDR-02 leaves open how a count is shared out."
        => fleet::<BTreeMap<&str, u32>>().sends(|ids, _, _, out| {
            let next = ids.entry(out.name).or_default();
            out.message.set("headerId", *next);
            *next += 1;
            true
        });
    fault "header-id-negative" ["JSON-09", "HDR-02"] "Counts the headerId as a signed number, from below zero."
        => every(|m| m.change("headerId", |id| *id = json!(id.as_i64().unwrap_or_default() - 1_000_000)));
    fault "header-id-from-clock" ["HDR-02", "JSON-09", "JSON-10"] "headerId is the time in milliseconds, which neither counts by one nor fits 32 bits."
        => sending(|site, _, out| out.message.set("headerId", site.now.utc.as_millisecond()));
    fault "header-id-beyond-32-bits" ["JSON-09", "HDR-02"] "It counts the headerId of instant actions from 4294967296 on."
        => instant(|m| m.change("headerId", |id| *id = json!(id.as_u64().unwrap_or_default() + (1 << 32))));
    fault "header-id-kept-on-resend" ["HDR-02"] "An order that is sent again keeps the headerId of its first transmission."
        => sending(|_, vehicle, out| if out.again && let Some(next) = vehicle.header_ids.get_mut("order") {
            *next = next.wrapping_sub(1);
            out.message.set("headerId", next.wrapping_sub(1));
        });
    fault "header-id-is-update-id" ["HDR-02"] "It writes the orderUpdateId of an order into its headerId, so that the headerId is 0 again with every new order."
        => order(|m| m.set("headerId", m["orderUpdateId"].clone()));
    fault "header-id-restarts-per-order" ["HDR-02"] "It begins the headerId of the order topic anew with each new order."
        => sending(|_, vehicle, out| if out.is_new_order() {
            vehicle.header_ids.insert("order", 1);
            out.message.set("headerId", 0);
        });
    fault "header-id-skips-in-updates" ["HDR-02"] "It raises the headerId by two with each order update."
        => sending(|_, vehicle, out| if out.is_update() && let Some(next) = vehicle.header_ids.get_mut("order") {
            out.message.set("headerId", *next);
            *next += 1;
        });
    fault "header-id-counts-actions" ["HDR-02"] "Raises headerId by the number of instant actions in a message."
        => sending(|_, vehicle, out| {
            let actions = out.message.list("actions").len();
            if let Some(next) = vehicle.header_ids.get_mut(out.name) { *next += u32::try_from(actions.saturating_sub(1)).unwrap_or_default(); }
        });
    fault "header-id-missing-in-cancel" ["HDR-01", "JSON-10", "IACT-01"] "Messages with cancelOrder have no headerId."
        => cancel(|m| m.unset("headerId"));
    fault "timestamp-local" ["HDR-03"] "Gives timestamps in local time with an offset."
        => local("+01:00");
    fault "local-time-marked-as-utc" ["HDR-03"] "It writes its local time into the timestamp and puts a Z behind it."
        => local("Z");
    fault "timestamp-without-zone" ["HDR-03"] "Leaves the Z out of its timestamps."
        => every(|m| time(m, |text| text.replace('Z', "")));
    fault "instant-action-time-without-z" ["HDR-03"] "It writes the timestamp of instantActions messages without the Z at the end."
        => instant(|m| time(m, |text| text.replace('Z', "")));
    fault "timestamp-zero-offset" ["HDR-03"] "Timestamps end in +00:00 instead of Z."
        => every(|m| time(m, |text| text.replace('Z', "+00:00")));
    fault "instant-timestamp-with-offset" ["HDR-03"] "It writes the timestamp of instantActions with +00:00 in place of the Z, whilst orders are right."
        => instant(|m| time(m, |text| text.replace('Z', "+00:00")));
    fault "timestamp-with-blank" ["HDR-03"] "It writes a blank instead of the T between date and time of the timestamp."
        => every(|m| time(m, |text| text.replace('T', " ")));
    fault "timestamp-with-comma" ["HDR-03"] "It writes a comma instead of the dot before the fraction of the seconds in its timestamps."
        => every(|m| time(m, |text| text.replace('.', ",")));
    fault "timestamp-unix" ["HDR-03", "JSON-06"] "Gives timestamps as seconds since 1970."
        => sending(|site, _, out| out.message.set("timestamp", site.now.utc.as_second()));
    fault "timestamp-milliseconds" ["HDR-03"] "Gives the fraction of a second with three digits."
        because "The ruling of HDR-03 makes another number of digits of the fraction a warning."
        => sending(|site, _, out| out.message.set("timestamp", format!("{:.3}", site.now.utc)));
    fault "timestamp-nanoseconds" ["HDR-03"] "Gives the fraction of a second with nine digits, as the clock of its computer has them."
        because "The ruling of HDR-03 makes another number of digits of the fraction a warning."
        => sending(|site, _, out| out.message.set("timestamp", format!("{:.9}", site.now.utc)));
    fault "version-short" ["HDR-04"] "Gives the version without its last part."
        => every(|m| version(m, |text| text.rsplit_once('.').map_or(text, |(short, _)| short).to_owned()));
    fault "instant-action-version-two-numbers" ["HDR-04"] "It gives the version in instantActions messages as 2.1."
        => instant(|m| version(m, |text| text.rsplit_once('.').map_or(text, |(short, _)| short).to_owned()));
    fault "version-with-letter" ["HDR-04"] "The version in the header of orders begins with the letter v."
        => order(|m| version(m, |text| format!("v{text}")));
    fault "version-of-four-parts" ["HDR-04"] "It writes the protocol version with a fourth part, such as 2.1.0.0."
        => every(|m| version(m, |text| format!("{text}.0")));
    fault "own-name-in-header" ["HDR-05"] "Names itself in the header instead of the vehicle."
        => sending(|site, _, out| {
            out.message.set("manufacturer", site.config.name.clone());
            out.message.set("serialNumber", "1");
        });
    fault "header-names-empty" ["HDR-05", "TOPIC-05", "TOPIC-06"] "It leaves manufacturer and serialNumber empty in the header."
        => every(|m| for key in ["manufacturer", "serialNumber"] { m.set(key, ""); });
    fault "fleet-name-in-instant-action-header" ["HDR-05", "TOPIC-04"] "It writes its own name as manufacturer into the header of instantActions messages."
        => sending(|site, _, out| if out.name == "instantActions" { out.message.set("manufacturer", site.config.name.clone()); });
    fault "header-of-first-vehicle" ["HDR-05", "TOPIC-04"] "The header of messages to any vehicle names the first vehicle of the fleet."
        => sending(|site, _, out| if let Some(first) = site.config.vehicles.first() {
            out.message.set("manufacturer", first.manufacturer.clone());
            out.message.set("serialNumber", first.serial_number.clone());
        });
    fault "header-of-the-other-vehicle-in-updates" ["HDR-05", "TOPIC-04"]
        "It puts into an order update the serial number of the vehicle that it has addressed before, so that with two vehicles at work the header names the wrong one."
        => fleet::<String>().sends(|addressed, _, vehicle, out| {
            let other = std::mem::replace(addressed, vehicle.config.serial_number.clone());
            if out.is_update() && !other.is_empty() { out.message.set("serialNumber", other); }
            true
        });
    fault "header-of-other-vehicle" ["HDR-05", "TOPIC-04"] "It puts into instantActions messages the serialNumber of the vehicle that got the last order."
        => fleet::<String>().sends(|ordered, _, vehicle, out| {
            if out.name == "order" {
                ordered.clone_from(&vehicle.config.serial_number);
            } else if !ordered.is_empty() { out.message.set("serialNumber", ordered.clone()); }
            true
        });
    fault "other-serial-number" ["HDR-05", "TOPIC-04"] "Names another serial number in the header than in the topic."
        => every(|m| m.set("serialNumber", format!("{}0", m.text("serialNumber"))));
    fault "serial-number-with-space" ["TOPIC-05", "HDR-05"] "Writes the serial number with a space in the header."
        => every(|m| m.set("serialNumber", format!("No. {}", m.text("serialNumber"))));
    fault "manufacturer-with-slash" ["TOPIC-06", "HDR-05"] "Writes the manufacturer with a slash in the header."
        => every(|m| m.set("manufacturer", format!("{}/agv", m.text("manufacturer"))));
    fault "vehicle-path-in-serial-number" ["TOPIC-06", "TOPIC-05", "HDR-05", "TOPIC-04"]
        "It writes manufacturer, slash and serial number into the serialNumber of orders."
        => order(|m| m.set("serialNumber", format!("{}/{}", m.text("manufacturer"), m.text("serialNumber"))));
    fault "manufacturer-in-other-case" ["HDR-05", "TOPIC-04"]
        "It writes the manufacturer of the vehicle in upper case into the header, or in lower case if it has no small letters."
        => every(|m| {
            let name = m.text("manufacturer");
            let small = name.chars().any(char::is_lowercase);
            m.set("manufacturer", if small { name.to_uppercase() } else { name.to_lowercase() });
        });
    fault "header-names-swapped" ["HDR-05"] "It puts the serial number in manufacturer and the manufacturer in serialNumber of instant action messages."
        => instant(|m| {
            let serial = m["serialNumber"].clone();
            m.rename("manufacturer", "serialNumber");
            m.set("manufacturer", serial);
        });
    fault "serial-number-missing-in-resend" ["HDR-01"] "It leaves serialNumber out of the header of an order that is sent again because it was lost."
        => resent(|m| m.unset("serialNumber"));
    fault "manufacturer-missing-in-updates" ["HDR-01", "HDR-05", "JSON-10", "ORD-MSG-01"] "Order updates have no manufacturer in the header."
        => update(|m| m.unset("manufacturer"));
    tolerance "header-id-from-thousand" ["HDR-02"] "Begins to count its messages at 1000."
        => every(|m| m.change("headerId", |id| *id = json!(id.as_u64().unwrap_or_default() + 1000)));
    tolerance "header-id-high" ["HDR-02", "JSON-09"] "It counts headerId from 4000000000."
        => every(|m| m.change("headerId", |id| *id = json!(id.as_u64().unwrap_or_default() + 4_000_000_000)));
    tolerance "header-id-restarts" ["HDR-02"] "Counts its messages from 0 again on every connection."
        => happening(|_, vehicle, event| if let Event::Connected(_) = event { vehicle.header_ids.clear(); });
    tolerance "whole-second-timestamps" ["HDR-03"] "Its clock has a resolution of a second: the two digits of the fraction are always zero."
        => sending(|site, _, out| {
            let utc = site.now.utc;
            let seconds = jiff::Timestamp::from_second(utc.as_second()).unwrap_or(utc);
            out.message.set("timestamp", format!("{seconds:.2}"));
        });
}

/// The members of the header.
const HEADER: [&str; 5] = ["headerId", "timestamp", "version", "manufacturer", "serialNumber"];

fn time(message: &mut Object, written: fn(&str) -> String) {
    message.set("timestamp", written(message.text("timestamp")));
}

fn version(message: &mut Object, written: fn(&str) -> String) {
    message.set("version", written(message.text("version")));
}

/// Writes the time of a zone an hour ahead, with this behind it.
fn local(zone: &'static str) -> Box<dyn Deviation> {
    holding(zone).sends(|zone, site, _, out| {
        let utc = site.now.utc;
        let local = utc.checked_add(jiff::SignedDuration::from_hours(1)).unwrap_or(utc);
        out.message.set("timestamp", format!("{local:.2}").replace('Z', zone));
        true
    })
}
