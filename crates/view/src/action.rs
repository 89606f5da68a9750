//! Actions, as they are ordered.

use crate::{Json, List, Text};

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

impl ActionView {
    /// The value of the first parameter with this key; `None` where there is none, or it is null or absent.
    ///
    /// This is the one reader of action parameters; use [`Json::text`], [`Json::number`], [`Json::flag`] on what it gives.
    #[must_use]
    pub fn parameter(&self, key: &str) -> Option<&Json> {
        self.action_parameters
            .iter()
            .find(|parameter| parameter.key.is(key))?
            .value
            .there()
    }
}
