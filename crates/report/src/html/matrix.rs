//! The requirement matrix: every requirement of the role and version, by chapter, gaps visible.

use super::Anchors;
use super::view::{Badge, in_parts};
use crate::sources::{HowDecided, RequirementText, Sources};
use crate::statement::Counts;
use tck_base::verdict::Verdict;
use tck_result::{NotDecided, RequirementResult, RunResult};

/// One chapter.
pub struct ChapterView {
    pub anchor: String,
    pub title: String,
    pub decided: usize,
    /// Whether the table is shown unfolded.
    pub open: bool,
    pub rows: Vec<RequirementView>,
}

/// One requirement.
pub struct RequirementView {
    pub anchor: String,
    pub badge: Badge,
    pub id: String,
    pub section: String,
    /// Where the section can be read.
    pub text_link: Option<String>,
    pub mood: String,
    pub text: String,
    /// How the catalogue says it can be decided.
    pub how: &'static str,
    /// Tests and monitors, with the ids they have in the page.
    pub deciders: Vec<(String, Option<String>)>,
    /// Every verdict and how many gave it, where they disagree.
    pub verdicts: Option<String>,
    /// Whether a test that decided it rests on a person's word.
    pub on_word: bool,
    /// In which of the parts that were joined.
    pub parts: Option<String>,
    /// Why nothing decided it.
    pub gap: Option<String>,
    pub interpretation: Option<String>,
    pub deviation: Option<String>,
}

pub fn chapters(result: &RunResult, sources: &Sources, anchors: &Anchors) -> Vec<ChapterView> {
    let mut chapters: Vec<ChapterView> = Vec::new();
    for requirement in &result.requirements {
        let known = sources.requirement(&requirement.id);
        let title = known.map_or_else(|| group(&requirement.id), |known| known.chapter.clone());
        let row = row(requirement, known, result, anchors);
        let known_chapter = chapters.iter().position(|chapter| chapter.title == title);
        let at = known_chapter.unwrap_or(chapters.len());
        if known_chapter.is_none() {
            let anchor = format!("chapter-{}", at + 1);
            chapters.push(ChapterView {
                anchor,
                title,
                decided: 0,
                open: false,
                rows: Vec::new(),
            });
        }
        let chapter = &mut chapters[at];
        chapter.rows.push(row);
        chapter.decided += Counts::of([requirement.verdict]).decided();
        chapter.open |= requirement.verdict.is_some_and(|verdict| verdict != Verdict::Pass);
    }
    chapters
}

/// `ORD-REJ` of `ORD-REJ-12`, where the catalogue has no title.
fn group(id: &str) -> String {
    match id.rsplit_once('-') {
        Some((group, _)) if !group.is_empty() => group.to_owned(),
        _ => "Other requirements".to_owned(),
    }
}

/// `warning in 1, inconclusive in 2, pass in 60`, where not all say the same.
fn disagreement(requirement: &RequirementResult) -> Option<String> {
    let words = requirement.verdicts.iter().map(|given| match given.by.as_slice() {
        [one] if given.verdict != Verdict::Pass => format!("{} in {one}", given.verdict),
        by => format!("{} in {}", given.verdict, by.len()),
    });
    let words: Vec<String> = words.collect();
    (!words.is_empty()).then(|| words.join(", "))
}

/// What never came without which nothing decides a requirement, where that is known.
fn never_came(requirement: &RequirementResult, result: &RunResult) -> Option<String> {
    let mut undecided = result.message_coverage.iter().flat_map(|known| &known.undecided);
    let found = undecided.find(|one| one.requirements.contains(&requirement.id))?;
    Some(found.missing())
}

fn row(
    requirement: &RequirementResult,
    known: Option<&RequirementText>,
    result: &RunResult,
    anchors: &Anchors,
) -> RequirementView {
    let gap = requirement
        .not_decided
        .clone()
        .filter(|_| requirement.verdict.is_none());
    // The reason of the catalogue is the better one where the result only has the word.
    let reason = match (known.map(|known| &known.decided), gap) {
        (Some(HowDecided::NotTestable(why)), Some(NotDecided::NotTestable(own))) if own.is_empty() => {
            Some(NotDecided::NotTestable(why.clone()))
        }
        (_, gap) => gap,
    };
    let reason = reason.map(|why| match never_came(requirement, result) {
        Some(missing) => format!("{why}; never came: {missing}"),
        None => why.to_string(),
    });
    RequirementView {
        anchor: anchors.requirement(&requirement.id).unwrap_or_default(),
        badge: Badge::of_requirement(requirement),
        id: requirement.id.clone(),
        section: known.map(|known| known.section.clone()).unwrap_or_default(),
        text_link: known.and_then(|known| known.link.clone()),
        mood: known.map(|known| known.mood.clone()).unwrap_or_default(),
        text: known.map(|known| known.text.clone()).unwrap_or_default(),
        how: match known.map(|known| &known.decided) {
            Some(HowDecided::Active) => "by stimulus",
            Some(HowDecided::Passive) => "by observation",
            Some(HowDecided::Operator) => "with an operator",
            Some(HowDecided::NotTestable(_)) => "not testable",
            None => "",
        },
        deciders: requirement
            .decided_by
            .iter()
            .map(|id| (id.clone(), anchors.decider(id)))
            .collect(),
        verdicts: disagreement(requirement),
        on_word: requirement.verdict.is_some()
            && result
                .on_word
                .iter()
                .any(|one| requirement.decided_by.contains(&one.test)),
        parts: in_parts(requirement),
        gap: reason.or_else(|| requirement.verdict.is_none().then(|| "no reason given".to_owned())),
        interpretation: known.and_then(|known| known.interpretation.clone()),
        deviation: result.deviations.get(&requirement.id).cloned(),
    }
}
