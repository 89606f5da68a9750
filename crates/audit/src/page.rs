//! What an audit found, for people.

use std::fmt::Write as _;

use super::mistakes::Mistake;
use super::result::{AuditResult, SideResult, Stretch, VehicleResult, Whereabouts, Whole, WholeDecided};
use tck_base::verdict::Verdict;
use tck_report::clean::{line, short};
use tck_report::statement::many;

/// What was divided among the parts of an audit.
pub(super) const VEHICLES: &str = "vehicles was judged";

/// The page.
#[must_use]
pub fn page(result: &AuditResult) -> String {
    let mut text = String::new();
    for recording in &result.recordings {
        let _ = write!(
            text,
            "{}: {}",
            line(&recording.name),
            counted(recording.lines, &recording.unit)
        );
        if recording.skipped > 0 {
            let _ = write!(text, ", {} of them no message", recording.skipped);
        }
        text.push('\n');
        for (count, what) in [
            (recording.encrypted, "TLS"),
            (recording.web_socket, "MQTT over WebSocket"),
        ] {
            if count > 0 {
                let _ = writeln!(
                    text,
                    "      {count} of them {what}, and not read: record what a client subscribes to (mosquitto_sub -F %J), or use watch --listen"
                );
            }
        }
    }
    if let Some(shard) = &result.shard {
        let _ = writeln!(text, "{}", line(&shard.limit(VEHICLES)));
    }
    if let (Some(first), Some(last)) = (&result.first, &result.last) {
        let _ = writeln!(text, "from {first} to {last}");
    }
    for vehicle in &result.vehicles {
        text.push_str(&of_vehicle(vehicle, result));
    }
    if let Some(whole) = &result.master_control {
        text.push_str(&of_whole(whole));
    }
    text.push('\n');
    if result.elsewhere > 0 {
        let _ = writeln!(
            text,
            "{} on other topics, or of vehicles that were not asked for",
            counted(result.elsewhere, "message")
        );
    }
    if result.beyond > 0 {
        let _ = writeln!(
            text,
            "{} of further vehicles: too many to be judged at once",
            counted(result.beyond, "message")
        );
    }
    if result.others > 0 {
        let of = if result.cuts().is_some() { "" } else { " of vehicles" };
        let _ = writeln!(text, "{}{of} that other parts judge", counted(result.others, "message"));
    }
    if let Some(cuts) = result.cuts() {
        let _ = writeln!(text, "{}", super::stretched::lost(cuts));
    }
    for trouble in result.merged.iter().flat_map(|merged| &merged.troubles) {
        let _ = writeln!(text, "not the whole: {}", line(&trouble.text));
    }
    let _ = writeln!(text, "{}", conclusion(result));
    text
}

/// The master control over all vehicles.
fn of_whole(whole: &Whole) -> String {
    let kept = |known: &&WholeDecided| known.verdict == Verdict::Pass;
    let hold = whole.requirements.iter().filter(kept).count();
    let mut text = format!(
        "\n{}the master control of {}, {}: {} kept",
        tag(whole.verdict),
        many(whole.vehicles, "vehicle"),
        counted(whole.messages, "message"),
        many(hold, "requirement")
    );
    if hold < whole.requirements.len() {
        let _ = write!(text, ", {} not", whole.requirements.len() - hold);
    }
    text.push('\n');
    for known in whole.requirements.iter().filter(|known| !kept(known)) {
        let tag = tag(Some(known.verdict));
        let _ = writeln!(text, "      {tag}{} with {}", known.id, many(known.vehicles, "vehicle"));
    }
    text
}

fn conclusion(result: &AuditResult) -> String {
    let sides = || result.vehicles.iter().flat_map(|vehicle| &vehicle.sides);
    let kinds = |verdict: Verdict| {
        sides()
            .flat_map(SideResult::mistakes)
            .filter(|mistake| mistake.worst.verdict == verdict)
            .count()
    };
    let vehicles = many(result.count_vehicles(), "vehicle");
    match result.verdict {
        None if result.vehicles.is_empty() => "No message of VDA 5050 was found.".to_owned(),
        None => format!("{vehicles}; nothing could be judged."),
        Some(_) => format!(
            "{vehicles}; {}, {}. What a recording cannot show was not judged; --format json lists it.",
            many(kinds(Verdict::Fail), "violation"),
            many(kinds(Verdict::Warning), "warning")
        ),
    }
}

fn of_vehicle(vehicle: &VehicleResult, result: &AuditResult) -> String {
    let mut text = String::from("\n");
    let version = vehicle.protocol.as_deref().unwrap_or("of an unknown version");
    let _ = writeln!(
        text,
        "{} {} · VDA 5050 {version} · {}",
        line(&vehicle.manufacturer),
        line(&vehicle.called()),
        line(&vehicle.topics)
    );
    let topics: Vec<String> = vehicle
        .messages
        .iter()
        .map(|(name, count)| format!("{count} {name}"))
        .collect();
    let _ = writeln!(text, "      seen: {}", topics.join(", "));
    let mut left = Vec::new();
    for (count, one, more) in [
        (
            vehicle.holes,
            "place where messages are missing",
            "places where messages are missing",
        ),
        (vehicle.twice, "message recorded twice", "messages recorded twice"),
        (
            vehicle.retained,
            "message that may be an old one",
            "messages that may be old ones",
        ),
    ] {
        if count > 0 {
            left.push(format!("{count} {}", if count == 1 { one } else { more }));
        }
    }
    if !left.is_empty() {
        let _ = writeln!(text, "      not judged: {}", left.join(", "));
    }
    if let Some(why) = &vehicle.not_judged {
        let _ = writeln!(text, "n/a   {}", line(why));
    }
    for side in &vehicle.sides {
        text.push_str(&of_side(side, result));
    }
    for hint in &vehicle.hints {
        let first = &hint.first;
        let place = placed(result, first.recording, first.line, first.message);
        let _ = writeln!(
            text,
            "hint  {}, {}: {place}, {}",
            line(&hint.topic),
            times(hint.count),
            first.at
        );
        let _ = writeln!(text, "            {}", short(&line(&hint.text), 400));
    }
    text
}

fn of_side(side: &SideResult, result: &AuditResult) -> String {
    let who = match side.role.as_str() {
        "agv" => "the vehicle",
        _ => "its master control",
    };
    let held = |known: &&super::result::Decided| known.verdict == Verdict::Pass;
    let hold = side.requirements.iter().filter(held).count();
    let others = side.requirements.len() - hold;
    let mut text = format!("{}{who}, {}: ", tag(side.verdict), counted(side.messages, "message"));
    match &side.not_judged {
        Some(why) if others == 0 => text.push_str(why),
        Some(why) => {
            let _ = write!(text, "{why}; {} not kept", many(others, "requirement"));
        }
        None => {
            let _ = write!(text, "{} kept", many(hold, "requirement"));
            if others > 0 {
                let _ = write!(text, ", {others} not");
            }
        }
    }
    text.push('\n');
    text.push_str(&not_compared(side, result));
    for mistake in side.mistakes() {
        text.push_str(&of_mistake(&mistake, result));
    }
    for known in &side.information {
        let _ = writeln!(
            text,
            "      {} {}, {}: {}",
            known.requirement,
            known.monitor,
            times(known.count),
            short(&line(&known.text), 200)
        );
    }
    text
}

/// Where most of a recording was not compared, from where to where, and why.
fn not_compared(side: &SideResult, result: &AuditResult) -> String {
    const SHOWN: usize = 3;
    if side.not_judged.is_some() || side.not_compared <= side.compared {
        return String::new();
    }
    let mut text = format!(
        "      {} of {} {}\n",
        side.not_compared,
        counted(side.compared + side.not_compared, "message"),
        match side.not_compared {
            1 => "was not compared with what was before it",
            _ => "were not compared with those before them",
        }
    );
    let mut largest: Vec<&Stretch> = side.stretches.iter().collect();
    largest.sort_by_key(|stretch| std::cmp::Reverse(stretch.messages));
    for stretch in largest.into_iter().take(SHOWN) {
        let place = |whence: &Whereabouts| placed(result, whence.recording, whence.line, whence.message);
        let (from, to) = (place(&stretch.from), place(&stretch.to));
        let _ = writeln!(
            text,
            "            {from}, {}, to {to}, {}: {}",
            stretch.from.at, stretch.to.at, stretch.why
        );
    }
    if side.stretches.len() > SHOWN {
        let _ = writeln!(
            text,
            "            and {} more; --format json lists them",
            side.stretches.len() - SHOWN
        );
    }
    text
}

/// Where a message stands.
fn placed(result: &AuditResult, recording: Option<usize>, at: Option<u64>, message: u64) -> String {
    match (recording.and_then(|number| result.recordings.get(number)), at) {
        (Some(recording), Some(at)) => format!("{}:{at}", line(&recording.name)),
        _ => format!("message {message}"),
    }
}

fn of_mistake(mistake: &Mistake<'_>, result: &AuditResult) -> String {
    let worst = mistake.worst;
    let place = placed(result, worst.recording, worst.line, worst.message);
    let mut text = format!(
        "      {}{} {}, {}: {place}, {}\n",
        tag(Some(worst.verdict)),
        mistake.requirements.join(", "),
        worst.monitor,
        times(mistake.count),
        worst.first
    );
    let _ = writeln!(text, "            {}", short(&line(&worst.text), 400));
    for finding in &mistake.follows {
        let place = placed(result, finding.recording, finding.line, finding.message);
        let _ = writeln!(
            text,
            "            follows from it: {} {}, {}: {place}",
            finding.requirement,
            finding.monitor,
            times(finding.count)
        );
    }
    text
}

fn times(count: u64) -> String {
    match count {
        1 => "once".to_owned(),
        2 => "twice".to_owned(),
        _ => format!("{count} times"),
    }
}

fn counted(count: u64, one: &str) -> String {
    many(usize::try_from(count).unwrap_or(usize::MAX), one)
}

fn tag(verdict: Option<Verdict>) -> &'static str {
    match verdict {
        Some(Verdict::Pass) => "PASS  ",
        Some(Verdict::Warning) => "WARN  ",
        Some(Verdict::Inconclusive) => "INCONCLUSIVE ",
        Some(Verdict::Error) => "ERROR ",
        Some(Verdict::Fail) => "FAIL  ",
        None => "n/a   ",
    }
}
