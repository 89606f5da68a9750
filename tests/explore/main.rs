//! What `explore` finds on the built-in devices: nothing on a good one, and a short conversation on a faulty one.
#![expect(clippy::unwrap_used, reason = "a test that cannot go on has failed")]

mod liberties;
#[path = "../seed/mod.rs"]
mod seed;
mod shrinking;

use vda5050_tck::explore::{Chain, ConversationFile, Finding, Grammar, findings};
use vda5050_tck::judge::Library;
use vda5050_tck::pack::Role;
use vda5050_tck::run::{Selection, VirtualRun, run_silently};

/// The allocator of the program: a run is a million small trees.
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

/// What may be said to a device of this role.
fn grammar(library: &Library, role: Role) -> Grammar {
    let pack = library.rules.packs.latest();
    Grammar::load(&library.assets, role).unwrap().only(pack, |_, _| true)
}

/// What conversations find of a built-in device, which `change` may change first.
fn found(
    library: &mut Library,
    role: Role,
    conversations: &[(Chain, ConversationFile)],
    change: impl FnOnce(&mut VirtualRun),
) -> Vec<Finding> {
    let pack = library.rules.packs.latest().clone();
    let places = conversations
        .iter()
        .map(|(_, file)| (file.place(role.word()), file.text.clone()));
    let tests = library.add(&places.collect::<Vec<_>>()).unwrap_or_default();
    assert_eq!(tests.len(), conversations.len(), "every conversation is a test");
    let mut run = VirtualRun::of_role(role, library, &pack);
    run.tests = Selection::some(tests);
    run.draw = None;
    change(&mut run);
    findings(&run_silently(library, &pack, run).unwrap().result, conversations)
}
