//! Instant actions.

use crate::{ActionView, List};

view! {
    /// Actions to be done at once.
    message InstantActionsView as "instantActions" {
        /// The actions.
        actions: List<ActionView> = "actions",
        /// The actions by the name that 1.1 had for the list, and careless senders still have.
        misnamed_actions: List<ActionView> = "instantActions",
    }
}

impl InstantActionsView {
    /// Every action, whichever name its list goes by.
    pub fn all_actions(&self) -> impl Iterator<Item = &ActionView> {
        self.actions.iter().chain(self.misnamed_actions.iter())
    }

    /// The actions of the list `actions`, or, where that is no list, those of the list with the older name: what must not come does
    /// not become right by a wrong name.
    pub fn commanded(&self) -> impl Iterator<Item = &ActionView> {
        if self.actions.is_there() {
            self.actions.iter()
        } else {
            self.misnamed_actions.iter()
        }
    }
}
