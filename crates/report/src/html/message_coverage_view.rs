//! Message coverage on the page: what never came stands first, and each member with its count is unfolded.

use super::Anchors;
use tck_result::{ActionCoverage, MessageCoverage, TopicCoverage};

/// Most requirements that are named in one row.
const NAMED: usize = 12;

/// Which members, words and action types came by, and which never did.
pub struct CoverageView<'a> {
    pub topics: Vec<TopicView<'a>>,
    pub actions: &'a [ActionCoverage],
    pub undecided: Vec<UndecidedRow<'a>>,
    /// The actions that were done and are declared in no factsheet.
    pub undeclared: Vec<&'a str>,
}

/// The messages of a topic.
pub struct TopicView<'a> {
    pub topic: &'a TopicCoverage,
    /// Who publishes it, in words.
    pub publisher: &'static str,
    /// The mandatory members that never came.
    pub mandatory: Vec<&'a str>,
    /// The optional members that never came.
    pub optional: Vec<&'a str>,
    /// The words that never came, by member.
    pub words: Vec<(&'a str, String)>,
}

/// What is undecided because something never came.
pub struct UndecidedRow<'a> {
    pub by: &'a str,
    pub link: Option<String>,
    /// The requirements, with the ids they have in the page.
    pub requirements: Vec<(&'a str, Option<String>)>,
    /// How many more there are.
    pub more: usize,
    pub missing: String,
}

impl<'a> CoverageView<'a> {
    /// Of a result, whose things have these ids in the page.
    pub fn of(coverage: &'a MessageCoverage, anchors: &Anchors) -> Self {
        let undecided = coverage.undecided.iter().map(|one| {
            let named = one.requirements.iter().take(NAMED);
            UndecidedRow {
                by: &one.by,
                link: anchors.decider(&one.by),
                requirements: named.map(|id| (id.as_str(), anchors.requirement(id))).collect(),
                more: one.requirements.len().saturating_sub(NAMED),
                missing: one.missing(),
            }
        });
        Self {
            topics: coverage.topics.iter().map(TopicView::of).collect(),
            actions: &coverage.actions,
            undeclared: coverage.undeclared().map(|known| known.action.as_str()).collect(),
            undecided: undecided.collect(),
        }
    }
}

impl<'a> TopicView<'a> {
    fn of(topic: &'a TopicCoverage) -> Self {
        let never = topic.never();
        let named = |mandatory: bool| {
            let all = never.iter().filter(|member| member.mandatory == mandatory);
            all.map(|member| member.member.as_str()).collect()
        };
        let mut words: Vec<(&str, String)> = Vec::new();
        for (member, word) in topic.unseen_words() {
            match words.last_mut() {
                Some((known, all)) if *known == member => all.push_str(&format!(", {word}")),
                _ => words.push((member, word.to_owned())),
            }
        }
        Self {
            publisher: match topic.publisher.as_str() {
                "agv" => "from the vehicle",
                _ => "to the vehicle",
            },
            mandatory: named(true),
            optional: named(false),
            words,
            topic,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tck_result::MemberCoverage;

    #[test]
    fn what_never_came_is_told_apart_by_whether_it_is_mandatory() {
        let member = |name: &str, mandatory: bool, messages: u64, words: &[&str]| MemberCoverage {
            member: name.to_owned(),
            mandatory,
            messages,
            words: words.iter().map(|word| ((*word).to_owned(), 0)).collect(),
        };
        let topic = TopicCoverage {
            topic: "order".to_owned(),
            publisher: "master-control".to_owned(),
            messages: 3,
            members: vec![
                member("/a", true, 0, &[]),
                member("/b", false, 0, &[]),
                member("/b/*", false, 0, &[]),
                member("/c", true, 3, &["X", "Y"]),
            ],
            ..TopicCoverage::default()
        };
        let view = TopicView::of(&topic);
        assert_eq!((view.mandatory, view.optional), (vec!["/a"], vec!["/b"]));
        assert_eq!(view.words, [("/c", "X, Y".to_owned())]);
        assert_eq!(view.publisher, "to the vehicle");
    }
}
