//! `conversation:` in the head of a test: what is said one after the other, and how many steps each part has.

use super::fields::{Fields, Problems};
use super::model::{BrokenMember, ConversationPart};

/// More steps than one stimulus has.
const MOST: u32 = 1_000;

/// What a conversation says, one after the other. The parts have as many steps as the body, except for those at its end
/// that judge the conversation as a whole.
pub(super) fn conversation(fields: &Fields<'_>, body: usize, problems: &mut Problems) -> Vec<ConversationPart> {
    let mut all = Vec::new();
    let nodes = fields.list("conversation", problems);
    for node in nodes {
        let Some(said) = Fields::of(node, problems) else {
            continue;
        };
        said.only(&[&["in", "say", "member", "way", "steps", "stays"]], problems);
        let member = said.text("member", problems).map(str::to_owned);
        let way = said.text("way", problems).map(str::to_owned);
        if member.is_some() != way.is_some() {
            problems.at(
                "half-broken",
                &node.span,
                "`member` and `way` come together",
                "says which member is broken, and how",
            );
        }
        let situation = said.need_text("in", &node.span, problems);
        let stimulus = said.need_text("say", &node.span, problems);
        said.need("steps", &node.span, problems);
        let steps = said.whole_number("steps", MOST, problems);
        let (Some(situation), Some(stimulus), Some(steps)) = (situation, stimulus, steps) else {
            continue;
        };
        all.push(ConversationPart {
            situation: situation.to_owned(),
            stimulus: stimulus.to_owned(),
            broken: member.zip(way).map(|(member, way)| BrokenMember { member, way }),
            steps: usize::try_from(steps).unwrap_or_default(),
            stays: said.flag("stays", problems),
        });
    }
    let steps: usize = all.iter().map(|said| said.steps).sum();
    if let Some(key) = fields.key("conversation").filter(|_| steps > body) {
        let title = format!("the conversation has {steps} steps, and the body {body}");
        problems.at(
            "too-many-steps",
            &key.span,
            title,
            "its parts share out the steps of the body",
        );
    }
    all
}
