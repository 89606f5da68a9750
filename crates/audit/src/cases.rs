//! An audit for build servers: a case for each requirement that was decided, and a failure for each mistake.

use super::join::restricted;
use super::mistakes::Mistake;
use super::result::{AuditResult, FindingResult, SideResult, VehicleResult};
use tck_base::verdict::Verdict;
use tck_report::cases::Elsewhere;
use tck_report::junit::Plain;
use tck_report::statement::times;

/// A side of a vehicle, for people.
pub(super) fn named(vehicle: &VehicleResult, side: &SideResult) -> String {
    let VehicleResult {
        manufacturer, protocol, ..
    } = vehicle;
    let called = vehicle.called();
    let version = protocol.as_deref().unwrap_or("unknown");
    format!("{manufacturer} {called}, {} ({version})", side.role)
}

/// A case for each requirement that was decided, by vehicle and side.
pub(super) fn cases(result: &AuditResult) -> Vec<Plain> {
    let mut all = Vec::new();
    for vehicle in &result.vehicles {
        for side in &vehicle.sides {
            let suite = named(vehicle, side);
            let mistakes = side.mistakes();
            all.extend(side.requirements.iter().map(|decided| {
                let findings = side.findings.iter().filter(|finding| finding.requirement == decided.id);
                let texts: Vec<String> = findings.map(|finding| sentence(finding, result)).collect();
                let cause = cause_of(&decided.id, &mistakes);
                Plain {
                    suite: suite.clone(),
                    name: decided.id.clone(),
                    // A build server counts mistakes, so what follows from one is shown beside it and counts for none.
                    verdict: decided.verdict,
                    elsewhere: cause.map(|_| Elsewhere::Cause),
                    text: match cause {
                        Some(cause) => format!("follows from {cause}: {}", texts.join("\n")),
                        None => texts.join("\n"),
                    },
                }
            }));
        }
    }
    if result.verdict.is_none() {
        all.push(Plain {
            suite: "audit".to_owned(),
            name: "something was judged".to_owned(),
            verdict: Verdict::Error,
            elsewhere: None,
            text: "nothing was judged".to_owned(),
        });
    }
    for (name, verdict, text) in restricted(result) {
        all.push(Plain {
            suite: "audit".to_owned(),
            name: name.to_owned(),
            verdict,
            elsewhere: None,
            text,
        });
    }
    all
}

/// The requirement from which all follows that was found of this one; none where something else was found of it.
fn cause_of<'m>(id: &str, mistakes: &[Mistake<'m>]) -> Option<&'m str> {
    let is_own = |mistake: &Mistake<'_>| mistake.requirements.first() == Some(&id);
    let names = |mistake: &&Mistake<'_>| {
        mistake.requirements.contains(&id) || mistake.follows.iter().any(|finding| finding.requirement == id)
    };
    let mut mistakes = mistakes.iter();
    if mistakes.clone().any(is_own) {
        return None;
    }
    mistakes
        .find(names)
        .and_then(|mistake| mistake.requirements.first().copied())
}

fn sentence(finding: &FindingResult, result: &AuditResult) -> String {
    let place = place(finding, result);
    format!(
        "{} at {place}, first {}, last {}: {}",
        times(finding.count),
        finding.first,
        finding.last,
        finding.text
    )
}

/// Where the first message stands that shows it.
pub(super) fn place(finding: &FindingResult, result: &AuditResult) -> String {
    let recording = finding.recording.and_then(|file| result.recordings.get(file));
    match recording.zip(finding.line) {
        Some((recording, line)) => format!("{}:{line}", recording.name),
        None => format!("message {}", finding.message),
    }
}
