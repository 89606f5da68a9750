//! One row of the diagram, and the lanes it runs between.

/// A vertical line of the diagram.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Lane {
    Harness,
    Broker,
    Device,
}

impl Lane {
    pub const ALL: [Self; 3] = [Self::Harness, Self::Broker, Self::Device];

    pub fn x(self) -> usize {
        match self {
            Self::Harness => 240,
            Self::Broker => 560,
            Self::Device => 880,
        }
    }

    pub fn name(self) -> &'static str {
        match self {
            Self::Harness => "harness",
            Self::Broker => "broker, tap",
            Self::Device => "device",
        }
    }
}

/// One row before it is placed.
#[derive(Clone, Debug)]
pub struct Row {
    /// Number of the record; 0 where there is none.
    pub seq: u64,
    /// Seconds since the window began.
    pub time: Option<f64>,
    pub what: What,
    pub title: String,
    pub detail: String,
    pub class: &'static str,
    /// Whether the step set the mark.
    pub mark: bool,
    pub count: u32,
    pub last: u64,
    pub headline: String,
    pub topic: Option<String>,
    pub stimulus: bool,
}

/// The shape of a row.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum What {
    /// From one lane to another; `unseen` is the part of the way nobody watched.
    Arrow {
        from: Lane,
        to: Lane,
        unseen: Option<(Lane, Lane)>,
    },
    /// Something that happened on a lane.
    Box(Lane),
    /// A step began.
    Step,
    /// Rows were left out.
    Gap,
}
