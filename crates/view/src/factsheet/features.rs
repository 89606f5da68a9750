//! What the vehicle supports.

use crate::{List, Member, Text};

view! {
    /// Optional parameters and actions.
    ProtocolFeatures as "protocolFeatures" {
        /// Optional parameters it supports or needs.
        optional_parameters: List<OptionalParameter> = "optionalParameters",
        /// Actions it offers.
        actions: List<OfferedAction> = "agvActions",
    }
}

view! {
    /// An optional parameter of the protocol.
    OptionalParameter as "optionalParameter" {
        /// Its path: `order.nodes.nodePosition.allowedDeviationTheta`.
        parameter: Text = "parameter",
        /// `SUPPORTED` or `REQUIRED`.
        support: Text = "support",
        /// For people.
        description: Text = "description",
    }
}

view! {
    /// An action the vehicle offers.
    OfferedAction as "offeredAction" {
        /// What it does.
        action_type: Text = "actionType",
        /// For people.
        action_description: Text = "actionDescription",
        /// Where it can be done.
        action_scopes: List<Member<Text>> = "actionScopes",
        /// What it needs to know.
        action_parameters: List<OfferedParameter> = "actionParameters",
        /// What it gives back.
        result_description: Text = "resultDescription",
        /// How it may block.
        blocking_types: List<Member<Text>> = "blockingTypes",
        /// Whether it can be paused.
        pause_allowed: bool = later "pauseAllowed",
        /// Whether it can be cancelled.
        cancel_allowed: bool = later "cancelAllowed",
    }
}

view! {
    /// A parameter of an action the vehicle offers.
    OfferedParameter as "offeredParameter" {
        /// Its name.
        key: Text = "key",
        /// Its type.
        value_data_type: Text = "valueDataType",
        /// For people.
        description: Text = "description",
        /// Whether it may be left out.
        is_optional: bool = "isOptional",
    }
}
