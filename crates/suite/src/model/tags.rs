//! What a test is filed under: by its author, and by what it does.

use std::collections::BTreeSet;

use super::{Maturity, Need, Test, Verb};

impl Test {
    /// The tags that follow from what a test does.
    pub const OWN_TAGS: [&'static str; 8] = [
        "drawn",
        "hook",
        "link",
        "maps",
        "moves",
        "reviewed",
        "stands",
        "watchlist",
    ];

    /// Everything it is filed under.
    #[must_use]
    pub fn tags(&self) -> BTreeSet<&str> {
        let mut tags: BTreeSet<&str> = self.tags.iter().map(String::as_str).collect();
        tags.insert(if self.moves { "moves" } else { "stands" });
        if self.drawn.is_some() {
            tags.insert("drawn");
        }
        match self.maturity {
            Maturity::Open => {}
            Maturity::Watchlist(_) => drop(tags.insert("watchlist")),
            Maturity::Reviewed(_) => drop(tags.insert("reviewed")),
        }
        if self.needs.contains(&Need::MapServer) {
            tags.insert("maps");
        }
        for step in self.sections().into_iter().flat_map(|(_, steps)| steps) {
            match *step.verb {
                Verb::Operator(_) => drop(tags.insert("hook")),
                Verb::Link(_) => drop(tags.insert("link")),
                Verb::Serve(_) => drop(tags.insert("maps")),
                _ => {}
            }
        }
        tags
    }

    /// The hooks it uses, once each.
    #[must_use]
    pub fn hooks(&self) -> BTreeSet<&str> {
        let steps = self.sections().into_iter().flat_map(|(_, steps)| steps);
        let used = steps.filter_map(|step| match &*step.verb {
            Verb::Operator(operator) => Some(operator.hook.as_str()),
            _ => None,
        });
        let needed = self.needs.iter().filter_map(|need| match need {
            Need::Hook(name) => Some(name.as_str()),
            _ => None,
        });
        used.chain(needed).collect()
    }
}
