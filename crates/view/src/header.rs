//! What every message begins with.

use crate::{Number, Text};

view! {
    /// The header of a message.
    Header as "header" {
        /// Number of the message, counted for each topic.
        header_id: Number = "headerId",
        /// When it was made.
        timestamp: Text = "timestamp",
        /// Version of the protocol.
        version: Text = "version",
        /// Who made the vehicle.
        manufacturer: Text = "manufacturer",
        /// Which of their vehicles it is.
        serial_number: Text = "serialNumber",
    }
}

impl Header {
    /// Whether a member differs in a message that is sent again.
    pub(crate) fn changes(index: u8) -> bool {
        [Self::header_id, Self::timestamp]
            .iter()
            .any(|field| field.index() == index)
    }
}
