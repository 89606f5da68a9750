//! What a test says to the device, one after the other, when it is a conversation that was written down.

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
}

/// A member of a message that was broken on purpose.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct BrokenMember {
    /// Its path in the message.
    pub member: String,
    /// How it was broken, in a word that suites have for it.
    pub way: String,
}
