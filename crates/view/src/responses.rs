//! Responses to requests of a vehicle, from 3.0 on.

use crate::{List, Text};

view! {
    /// Answers to requests of a vehicle.
    message ResponsesView as "responses" {
        /// The answers.
        responses: List<Response> = "responses",
    }
}

view! {
    /// An answer to one request.
    Response as "response" {
        /// The request it answers.
        request_id: Text = "requestId",
        /// `GRANTED`, `QUEUED`, `REVOKED` or `REJECTED`.
        grant_type: Text = "grantType",
        /// When a grant ends.
        lease_expiry: Text = "leaseExpiry",
    }
}
