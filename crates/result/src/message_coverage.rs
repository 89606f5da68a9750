//! Message coverage: which members, words and action types of the standard came by, and which nobody has seen.

use std::collections::BTreeMap;
use std::fmt;

use serde::{Deserialize, Serialize};

/// Which members, words and action types of the standard came by in a run or a recording.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MessageCoverage {
    /// Each topic of the protocol, whether something came or not.
    pub topics: Vec<TopicCoverage>,
    /// The predefined actions, and those that were declared, sent or reported, by name.
    pub actions: Vec<ActionCoverage>,
    /// What is undecided because something never came.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub undecided: Vec<NeverShown>,
}

/// The messages of a topic.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TopicCoverage {
    /// Name of the topic.
    pub topic: String,
    /// Who publishes it: `agv` or `master-control`.
    pub publisher: String,
    /// How many messages came.
    pub messages: u64,
    /// How many members came at least once.
    pub shown: usize,
    /// How many members the standard has.
    pub of: usize,
    /// The members, in the order of the schema. Where only what is missing is kept, those that never came, and those of
    /// which a word never came.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub members: Vec<MemberCoverage>,
    /// Members that the standard does not have, as far as they are kept.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub others: Vec<String>,
}

/// A member of the messages of a topic.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MemberCoverage {
    /// Where it stands, as a JSON pointer in which `*` is any element of a list.
    pub member: String,
    /// Whether the object around it needs it.
    pub mandatory: bool,
    /// In how many messages it came, with something else than null.
    pub messages: u64,
    /// The words that it can be, and in how many messages it was each.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub words: BTreeMap<String, u64>,
}

/// An action type.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ActionCoverage {
    /// The action type.
    pub action: String,
    /// Whether the standard predefines it.
    pub predefined: bool,
    /// In how many factsheets it was declared.
    pub declared: u64,
    /// In how many messages to a vehicle it came.
    pub sent: u64,
    /// In how many messages of a vehicle it came.
    pub reported: u64,
    /// In how many of them it was done.
    pub finished: u64,
}

/// What is undecided because something never came.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NeverShown {
    /// The test or monitor that would have decided.
    pub by: String,
    /// What it would have decided.
    pub requirements: Vec<String>,
    /// What never came.
    pub missing: Vec<Unseen>,
}

/// Something that never came.
#[derive(Clone, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Unseen {
    /// Topic.
    pub topic: String,
    /// The member; absent where no message came at all.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub member: Option<String>,
    /// The word; absent where the member never came, whatever it was.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub word: Option<String>,
}

impl fmt::Display for Unseen {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match (&self.member, &self.word) {
            (None, _) => write!(f, "any message on {}", self.topic),
            (Some(member), None) => write!(f, "{member} of {}", self.topic),
            (Some(member), Some(word)) => write!(f, "{word} as {member} of {}", self.topic),
        }
    }
}

impl NeverShown {
    /// What never came, in one line.
    #[must_use]
    pub fn missing(&self) -> String {
        let all: Vec<String> = self.missing.iter().map(ToString::to_string).collect();
        all.join(", ")
    }
}

impl MemberCoverage {
    /// The words that never came, of a member that did.
    pub fn unseen_words(&self) -> impl Iterator<Item = &str> {
        let never = self.words.iter().filter(|(_, count)| self.messages > 0 && **count == 0);
        never.map(|(word, _)| word.as_str())
    }
}

impl TopicCoverage {
    /// The members that never came. What stands in one of them is not named beside it.
    #[must_use]
    pub fn never(&self) -> Vec<&MemberCoverage> {
        let mut all: Vec<&MemberCoverage> = Vec::new();
        for member in self.members.iter().filter(|member| member.messages == 0) {
            let rest = all.last().and_then(|outer| member.member.strip_prefix(&outer.member));
            if !rest.is_some_and(|rest| rest.starts_with('/')) {
                all.push(member);
            }
        }
        all
    }

    /// The words that never came, with the member that can be them, of members that came.
    pub fn unseen_words(&self) -> impl Iterator<Item = (&str, &str)> {
        let all = self.members.iter();
        all.flat_map(|member| member.unseen_words().map(|word| (member.member.as_str(), word)))
    }

    /// Adds what came elsewhere.
    fn add(&mut self, other: &Self) {
        self.messages += other.messages;
        for (own, more) in self.members.iter_mut().zip(&other.members) {
            own.messages += more.messages;
            for (word, count) in &more.words {
                *own.words.entry(word.clone()).or_default() += count;
            }
        }
        self.shown = self.members.iter().filter(|member| member.messages > 0).count();
        self.others.extend(other.others.iter().cloned());
        self.others.sort();
        self.others.dedup();
    }
}

impl MessageCoverage {
    /// The messages of a topic.
    #[must_use]
    pub fn topic(&self, name: &str) -> Option<&TopicCoverage> {
        self.topics.iter().find(|topic| topic.topic == name)
    }

    /// The actions that a vehicle has done and that no factsheet of it declares, where one came.
    pub fn undeclared(&self) -> impl Iterator<Item = &ActionCoverage> {
        let mut declared = self.actions.iter().map(|action| action.declared);
        let has_list = declared.any(|count| count > 0);
        let all = self.actions.iter();
        all.filter(move |action| has_list && action.finished > 0 && action.declared == 0)
    }

    /// What never came, without what did: of many vehicles that is all there is room for.
    #[must_use]
    pub fn only_missing(mut self) -> Self {
        for topic in &mut self.topics {
            let never: Vec<String> = topic.never().iter().map(|member| member.member.clone()).collect();
            let is_silent = topic.messages == 0;
            topic.members.retain(|member| {
                let has_word = member.unseen_words().next().is_some();
                !is_silent && (has_word || never.contains(&member.member))
            });
            for member in &mut topic.members {
                member.words.retain(|_, count| *count == 0);
            }
        }
        let is_known = |action: &ActionCoverage| action.declared + action.sent + action.reported > 0;
        self.actions.retain(is_known);
        self
    }

    /// Puts together what came in two parts of a run, of the same version. What is undecided in both stays so as long as
    /// the other part did not show it.
    #[must_use]
    pub fn and(mut self, other: Self) -> Self {
        for topic in &mut self.topics {
            if let Some(more) = other.topic(&topic.topic) {
                topic.add(more);
            }
        }
        for action in other.actions {
            match self.actions.iter_mut().find(|known| known.action == action.action) {
                Some(known) => {
                    known.declared += action.declared;
                    known.sent += action.sent;
                    known.reported += action.reported;
                    known.finished += action.finished;
                }
                None => self.actions.push(action),
            }
        }
        self.actions.sort_by(|one, more| one.action.cmp(&more.action));
        let mut undecided = std::mem::take(&mut self.undecided);
        for one in other.undecided {
            if !undecided.contains(&one) {
                undecided.push(one);
            }
        }
        for one in &mut undecided {
            one.missing.retain(|missing| self.lacks(missing));
        }
        undecided.retain(|one| !one.missing.is_empty());
        self.undecided = undecided;
        self
    }

    /// Whether something never came.
    fn lacks(&self, missing: &Unseen) -> bool {
        let Some(topic) = self.topic(&missing.topic) else {
            return true;
        };
        let Some(name) = &missing.member else {
            return topic.messages == 0;
        };
        let member = topic.members.iter().find(|member| member.member == *name);
        member.is_none_or(|member| match &missing.word {
            None => member.messages == 0,
            Some(word) => member.words.get(word).is_none_or(|count| *count == 0),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn member(name: &str, messages: u64, words: &[(&str, u64)]) -> MemberCoverage {
        MemberCoverage {
            member: name.to_owned(),
            mandatory: false,
            messages,
            words: words.iter().map(|(word, count)| ((*word).to_owned(), *count)).collect(),
        }
    }

    fn state(messages: u64, members: Vec<MemberCoverage>) -> MessageCoverage {
        MessageCoverage {
            topics: vec![TopicCoverage {
                topic: "state".to_owned(),
                publisher: "agv".to_owned(),
                messages,
                shown: members.iter().filter(|member| member.messages > 0).count(),
                of: members.len(),
                members,
                others: Vec::new(),
            }],
            ..MessageCoverage::default()
        }
    }

    fn unseen(member: &str, word: Option<&str>) -> Unseen {
        Unseen {
            topic: "state".to_owned(),
            member: Some(member.to_owned()),
            word: word.map(str::to_owned),
        }
    }

    #[test]
    fn what_stands_in_a_member_that_never_came_is_not_named_beside_it() {
        let one = state(
            2,
            vec![
                member("/loads", 0, &[]),
                member("/loads/*", 0, &[]),
                member("/loadsMore", 0, &[]),
                member("/mode", 2, &[("A", 2), ("B", 0)]),
                member("/stop", 0, &[("C", 0)]),
            ],
        );
        let never: Vec<&str> = one.topics[0].never().iter().map(|one| one.member.as_str()).collect();
        assert_eq!(never, ["/loads", "/loadsMore", "/stop"]);
        let words: Vec<(&str, &str)> = one.topics[0].unseen_words().collect();
        assert_eq!(words, [("/mode", "B")]);
        let kept = one.only_missing();
        let names: Vec<&str> = kept.topics[0].members.iter().map(|one| one.member.as_str()).collect();
        assert_eq!(names, ["/loads", "/loadsMore", "/mode", "/stop"]);
        assert_eq!((kept.topics[0].shown, kept.topics[0].of), (1, 5));
    }

    #[test]
    fn what_came_in_one_part_is_missing_no_more() {
        let undecided = |missing: Vec<Unseen>| NeverShown {
            by: "monitor".to_owned(),
            requirements: vec!["X-01".to_owned()],
            missing,
        };
        let mut one = state(1, vec![member("/a", 0, &[]), member("/m", 1, &[("A", 1), ("B", 0)])]);
        one.undecided = vec![
            undecided(vec![unseen("/a", None)]),
            undecided(vec![unseen("/m", Some("B"))]),
        ];
        let mut other = state(2, vec![member("/a", 2, &[]), member("/m", 2, &[("A", 2), ("B", 0)])]);
        other.actions.push(ActionCoverage {
            action: "pick".to_owned(),
            sent: 1,
            ..ActionCoverage::default()
        });
        let both = one.and(other);
        assert_eq!((both.topics[0].messages, both.topics[0].shown), (3, 2));
        assert_eq!(both.topics[0].members[1].words["A"], 3);
        assert_eq!(both.undecided, [undecided(vec![unseen("/m", Some("B"))])]);
        assert_eq!(both.actions[0].sent, 1);
    }

    #[test]
    fn what_never_came_is_said_in_words() {
        assert_eq!(unseen("/a", None).to_string(), "/a of state");
        assert_eq!(unseen("/m", Some("B")).to_string(), "B as /m of state");
        let silent = Unseen {
            member: None,
            ..unseen("", None)
        };
        assert_eq!(silent.to_string(), "any message on state");
    }
}
