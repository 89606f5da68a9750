//! Faults that end in a warning, and why.
//!
//! They prove clauses like the others. But the text, or a ruling of the catalogue, makes what they break less than an
//! obligation: no vehicle is failed for it.

/// Name of a fault, and why it is no more than a lapse.
pub const LAPSES: &[(&str, &str)] = &[
    (
        "edge-ends-unchecked",
        "No sentence obliges a vehicle to check startNodeId and endNodeId; a remark.",
    ),
    (
        "sequence-unchecked",
        "Gaps and repetitions of sequenceIds are for the master control to avoid; no vehicle has to refuse them.",
    ),
    (
        "unsupported-field-ignored",
        "Whether a vehicle ignores a field that its factsheet does not list, or honours it, cannot be seen; the ruling of \
         OPT-02 is a warning.",
    ),
    ("horizon-actions-stay", "It breaks a recommendation only."),
    ("cancel-lets-run", "It breaks a recommendation only."),
    ("cancel-fails-early", "It breaks a recommendation only."),
    (
        "max-rotation-speed-ignored",
        "The turn takes place while the edge is entered; whether it belongs to the edge yet is a matter of reading.",
    ),
    ("trajectory-cut", "It breaks a recommendation only."),
    (
        "corridor-contour-ignored",
        "CORR-03 is a recommendation, and by the kinematic centre CORR-01 is kept.",
    ),
    ("hash-ignored", "It breaks a recommendation only."),
    ("undescribed-status", "It breaks a recommendation only."),
    ("field-does-not-pause", "It breaks a recommendation only."),
    ("state-bursts", "It breaks a recommendation only."),
    ("own-error-cleared-by-order", "It breaks a recommendation only."),
    (
        "traversal-split",
        "Two states of one moment are remarked on; tests that look at single states are not reached.",
    ),
];

/// Why this fault is a lapse; `None` for one that fails.
#[must_use]
pub fn lapse(fault: &str) -> Option<&'static str> {
    LAPSES.iter().find(|(name, _)| *name == fault).map(|(_, why)| *why)
}
