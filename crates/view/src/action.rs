//! Actions, as they are ordered.

use crate::{Json, List, Member, Text};

view! {
    /// An action of an order or of instant actions.
    ActionView as "action" {
        /// Which action it is.
        action_id: Text = "actionId",
        /// What is to be done.
        action_type: Text = "actionType",
        /// For people.
        action_description: Text = "actionDescription" apart,
        /// `NONE`, `SOFT` or `HARD`; also `SINGLE` from 3.0 on.
        blocking_type: Text = "blockingType",
        /// What it needs to know.
        action_parameters: List<Parameter> = "actionParameters",
        /// Whether a vehicle may wait for a retry after it has failed.
        retriable: bool = later "retriable",
    }
}

view! {
    /// A parameter of an action.
    Parameter as "actionParameter" {
        /// Its name.
        key: Text = "key",
        /// Its value, of any type.
        value: Json = "value",
    }
}

/// The value of a parameter that is not there.
static NO_VALUE: Member<Json> = Member::Absent;

/// Whether the vehicle gives its order up for an action of this type.
pub(crate) fn clears_order(action_type: Option<&str>) -> bool {
    matches!(action_type, Some("cancelOrder" | "startHibernation"))
}

impl ActionView {
    /// Whether the vehicle gives its order up for it.
    #[must_use]
    pub fn clears_order(&self) -> bool {
        clears_order(self.action_type.text())
    }

    /// The value of the first parameter with this key: absent where there is none, or where it has no value.
    ///
    /// This is the one reader of action parameters; use `text`, `float`, `flag` on what it gives.
    #[must_use]
    pub fn argument(&self, key: &str) -> &Member<Json> {
        let mut all = self.action_parameters.iter();
        let found = all.find(|parameter| parameter.key.or_empty() == key);
        found.map_or(&NO_VALUE, |parameter| &parameter.value)
    }

    /// The value of the first parameter with this key; `None` where [`ActionView::argument`] is absent or null.
    #[must_use]
    pub fn parameter(&self, key: &str) -> Option<&Json> {
        self.argument(key).there()
    }
}
