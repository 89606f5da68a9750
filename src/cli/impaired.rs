//! How many faults of a generated fleet an audit finds, by what a recorder made of the messages.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;

use super::problem::Problem;
use tck_audit::{Audit, Options};
use tck_base::verdict::Verdict;
use tck_capture::{Message, SourcePosition};
use tck_judge::{Library, Rules};
use tck_simulate::{Impairment, Injected, Recorded, Site, SiteMessage};

/// What came out for one kind of recording.
struct Measured {
    impairment: Impairment,
    messages: usize,
    /// Faults whose message was recorded.
    recorded: usize,
    /// Found in their message, as what they break.
    named: usize,
    /// Found in their message, as something else.
    otherwise: usize,
    /// The kinds that were missed, and how often.
    missed: BTreeMap<(&'static str, &'static str), usize>,
    /// What is found in the recording of the same fleet without a fault.
    accused: usize,
}

/// The table, and below it which kinds of faults were missed.
pub(super) fn table(site: Site) -> Result<String, Problem> {
    let library = crate::assets::library(None)?;
    let told: Vec<SiteMessage> = site.messages().collect();
    let faultless: Vec<SiteMessage> = Site { faults: 0, ..site }.messages().collect();
    let mut all = Vec::new();
    for impairment in Impairment::ALL {
        all.push(measured(&library, impairment, &told, &faultless, site.seed)?);
    }
    Ok(shown(&all))
}

fn measured(
    library: &Library,
    impairment: Impairment,
    told: &[SiteMessage],
    faultless: &[SiteMessage],
    seed: u64,
) -> Result<Measured, Problem> {
    let recording = impairment.of(told, seed);
    let messages = recording.len();
    let injected = |one: &Recorded| one.message.injected.clone();
    let faults: Vec<Option<Injected>> = recording.iter().map(injected).collect();
    let mut seen: BTreeMap<u64, BTreeSet<String>> = BTreeMap::new();
    for (message, requirement) in found(&library.rules, recording)? {
        let at = usize::try_from(message.saturating_sub(1)).unwrap_or(usize::MAX);
        if let Some(Some(fault)) = faults.get(at) {
            seen.entry(fault.message).or_default().insert(requirement);
        }
    }
    let recorded: BTreeMap<u64, Injected> = faults
        .into_iter()
        .flatten()
        .map(|fault| (fault.message, fault))
        .collect();
    let mut measured = Measured {
        impairment,
        messages,
        recorded: recorded.len(),
        named: 0,
        otherwise: 0,
        missed: BTreeMap::new(),
        accused: found(&library.rules, impairment.of(faultless, seed))?.len(),
    };
    for fault in recorded.values() {
        match seen.get(&fault.message) {
            Some(found) if found.contains(fault.requirement) => measured.named += 1,
            Some(_) => measured.otherwise += 1,
            None => *measured.missed.entry((fault.kind, fault.requirement)).or_default() += 1,
        }
    }
    Ok(measured)
}

/// The messages at which something is wrong, with the requirement.
fn found(rules: &Rules, recording: Vec<Recorded>) -> Result<Vec<(u64, String)>, Problem> {
    let mut audit = Audit::new(rules, Options::default())?.live();
    let mut all = Vec::new();
    for one in recording {
        audit.observe(Message {
            at: Some(one.message.at),
            topic: one.message.topic,
            payload: one.message.payload.into(),
            qos: Some(one.message.qos),
            retain: Some(one.retain),
            place: SourcePosition::default(),
            after_gap: false,
            carried: None,
        });
        let news = audit.news().into_iter();
        let wrong = news.filter(|found| matches!(found.verdict, Verdict::Fail | Verdict::Warning));
        all.extend(wrong.map(|found| (found.message, found.requirement)));
    }
    Ok(all)
}

fn shown(all: &[Measured]) -> String {
    let mut text =
        "| recording | messages | faults in it | found as what they break | found as something else | missed | \
                    accused without a fault |\n|---|---|---|---|---|---|---|\n"
            .to_owned();
    let missed = |one: &Measured| one.missed.values().sum::<usize>();
    for one in all {
        let share = 100 * one.named / one.recorded.max(1);
        let _ = writeln!(
            text,
            "| {} | {} | {} | {} ({share} %) | {} | {} | {} |",
            one.impairment.name(),
            one.messages,
            one.recorded,
            one.named,
            one.otherwise,
            missed(one),
            one.accused
        );
    }
    for one in all.iter().filter(|one| missed(one) > 0) {
        let kinds = one
            .missed
            .iter()
            .map(|((kind, requirement), count)| format!("{kind} ({requirement}) {count}"));
        let _ = writeln!(
            text,
            "\n{}: {}",
            one.impairment.name(),
            kinds.collect::<Vec<_>>().join(", ")
        );
    }
    text
}
