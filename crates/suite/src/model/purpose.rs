//! What a state is for.

/// What the steps of a state are for. In a postamble it decides whether they are performed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Purpose {
    /// They cancel what is left of an order: passed over when nothing would come of it.
    Cancels,
    /// They call off what a master control still wants: passed over when it wants nothing.
    CallsOff,
    /// They wait for the vehicle to drive what was released to it: passed over when it is gone.
    DrivesOn,
    /// They give time, also inside a state that is passed over.
    Waits,
    /// They put back what a test has changed.
    Undoes,
}

impl Purpose {
    /// Every purpose, by its word.
    pub const WORDS: [(&'static str, Self); 5] = [
        ("cancels", Self::Cancels),
        ("calls-off", Self::CallsOff),
        ("drives-on", Self::DrivesOn),
        ("waits", Self::Waits),
        ("undoes", Self::Undoes),
    ];
}
