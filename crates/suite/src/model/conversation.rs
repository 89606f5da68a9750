//! What a test says to the device, one after the other, when it is a conversation that was written down.

use super::{Step, Test, Verb};

/// One stimulus of a conversation.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ConversationPart {
    /// The situation in which it was said.
    pub situation: String,
    /// Its name in the grammar of conversations.
    pub stimulus: String,
    /// What was wrong with the message on purpose, when one member of it was broken.
    pub broken: Option<BrokenMember>,
    /// How many steps of the body belong to it.
    pub steps: usize,
    /// Whether all is afterwards as it was before, so that the next stimulus may come even where this one was refused.
    pub stays: bool,
}

/// The place in the body that a path such as `steps[6].assert` begins with.
#[must_use]
pub fn place_in_body(path: &str) -> Option<usize> {
    path.strip_prefix("steps[")?.split_once(']')?.0.parse().ok()
}

impl Test {
    /// The place of the step behind a stimulus that was refused at a step of this path, where the conversation goes on
    /// without it: the stimulus changes nothing, and nothing of it was done before.
    #[must_use]
    pub fn goes_on_at(&self, path: &str) -> Option<usize> {
        let at = place_in_body(path)?;
        let mut end = 0;
        let part = self.conversation.iter().find(|part| {
            end += part.steps;
            at < end
        })?;
        let own = end - part.steps..at;
        let mut before = self
            .steps
            .iter()
            .filter(|step| place_in_body(&step.path).is_some_and(|at| own.contains(&at)));
        let does = |step: &Step| {
            let only_hears = matches!(
                *step.verb,
                Verb::Expect(_) | Verb::Never(_) | Verb::Always(_) | Verb::Action(_) | Verb::Retained(_)
            );
            !only_hears
        };
        (part.stays && !before.any(does)).then_some(end)
    }
}

/// A member of a message that was broken on purpose.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct BrokenMember {
    /// Its path in the message.
    pub member: String,
    /// How it was broken, in a word that suites have for it.
    pub way: String,
}
