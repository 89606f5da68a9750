//! Connection messages.

use crate::Text;

view! {
    /// Whether a vehicle is connected.
    message ConnectionView as "connection" {
        /// `ONLINE`, `OFFLINE`, `CONNECTIONBROKEN`; also `HIBERNATING` from 3.0 on.
        connection_state: Text = "connectionState",
    }
}

impl ConnectionView {
    /// Whether it says that the vehicle is online.
    #[must_use]
    pub fn is_online(&self) -> bool {
        self.connection_state.is("ONLINE")
    }

    /// Whether it says that the vehicle has left in order.
    #[must_use]
    pub fn is_offline(&self) -> bool {
        self.connection_state.is("OFFLINE")
    }

    /// Whether it says that the vehicle is not connected any more.
    #[must_use]
    pub fn is_gone(&self) -> bool {
        self.is_offline() || self.is_broken()
    }

    /// Whether it says that the vehicle sleeps, and hears nothing but what wakes it.
    #[must_use]
    pub fn is_hibernating(&self) -> bool {
        self.connection_state.is("HIBERNATING")
    }

    /// Whether it says that the connection is broken; with or without underscore, depending on the version.
    #[must_use]
    pub fn is_broken(&self) -> bool {
        let letters = self.connection_state.or_empty().bytes().filter(|byte| *byte != b'_');
        letters.eq(b"CONNECTIONBROKEN".iter().copied())
    }
}
