//! Which messages of a test are shown, and which of them a diagram points out.

use std::collections::{BTreeMap, BTreeSet};

use super::messages::Gallery;
use crate::statement::many;
use tck_base::verdict::Verdict;
use tck_journal::Event;
use tck_result::TestResult;

/// Most messages shown of one test.
const MESSAGES: usize = 24;
/// Stimuli shown before and after each deciding message.
const STIMULI: usize = 3;

/// The records a diagram points out.
pub fn marked(test: &TestResult) -> BTreeMap<u64, String> {
    let mut worst: BTreeMap<u64, Verdict> = BTreeMap::new();
    let mut marked = BTreeMap::new();
    for decision in test.findings() {
        if let Some(nearest) = &decision.nearest {
            marked.insert(nearest.seq, "nearest miss".to_owned());
        }
        if let Some(witness) = decision.witness {
            let entry = worst.entry(witness).or_insert(decision.verdict());
            *entry = entry.join(decision.verdict());
        }
    }
    marked.extend(worst.into_iter().map(|(seq, verdict)| (seq, verdict.word().to_owned())));
    marked
}

/// Asks for the messages of a test: those that decided, the nearest misses, the stimuli around them. Says what
/// was left out.
pub fn choose(test: &TestResult, gallery: &mut Gallery<'_>) -> Option<String> {
    let journal = gallery.journal()?;
    // The most important first, because there is a limit.
    let pointed_out = marked(test);
    let mut places: BTreeMap<u64, Vec<&str>> = BTreeMap::new();
    for decision in test.findings() {
        if let Some(witness) = decision.witness {
            places.entry(witness).or_default();
        }
        if let Some(nearest) = &decision.nearest {
            places.entry(nearest.seq).or_default().push(&nearest.path);
        }
        if let Some(sent) = &decision.sent {
            let members = sent.members.iter().map(|member| member.path.as_str());
            places.entry(sent.seq).or_default().extend(members);
        }
    }
    for of_one in places.values_mut().filter(|places| places.is_empty()) {
        // Nothing to mark, but the message is shown unfolded.
        of_one.push("");
    }
    let mut wanted: Vec<(u64, &str)> = pointed_out.iter().map(|(seq, role)| (*seq, role.as_str())).collect();
    let mut centres: BTreeSet<u64> = pointed_out.keys().copied().collect();
    wanted.extend(
        test.findings()
            .filter_map(|finding| finding.waited.as_ref())
            .map(|w| (w.since, "stimulus")),
    );
    let of_findings = test.findings().filter_map(|finding| finding.sent.as_ref());
    wanted.extend(of_findings.map(|sent| (sent.seq, "stimulus")));
    let (first, last) = test.journal?;
    let (mut sent, mut recorded) = (Vec::new(), Vec::new());
    for entry in journal.entries().within((first, last)) {
        if matches!(entry.event(), Event::Sent { .. } | Event::Fault { .. }) {
            sent.push(entry.seq());
        }
        // What the tap saw of them is the same messages once more.
        if matches!(
            entry.event(),
            Event::Message { .. } | Event::Sent { .. } | Event::Retained { .. }
        ) {
            recorded.push(entry.seq());
        }
    }
    if centres.is_empty() {
        centres.insert(last);
    }
    for centre in &centres {
        let split = sent.partition_point(|seq| seq < centre);
        wanted.extend(sent[..split].iter().rev().take(STIMULI).map(|seq| (*seq, "stimulus")));
        wanted.extend(sent[split..].iter().take(1).map(|seq| (*seq, "stimulus")));
    }
    wanted.extend(
        test.steps
            .iter()
            .filter_map(|step| step.took)
            .map(|seq| (seq, "taken by a step")),
    );
    let mut asked = BTreeSet::new();
    for (seq, role) in wanted {
        if asked.len() >= MESSAGES && !asked.contains(&seq) {
            continue;
        }
        if gallery.show(seq, role, places.get(&seq).map_or(&[], Vec::as_slice)) {
            asked.insert(seq);
        }
    }
    let messages = recorded.len();
    let shown = recorded.iter().filter(|seq| gallery.shows(**seq)).count();
    (shown < messages).then(|| {
        format!(
            "{shown} of the {} recorded during this test; the journal has all of them.",
            many(messages, "message")
        )
    })
}
