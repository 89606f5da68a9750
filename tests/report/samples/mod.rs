//! Three runs as they could have happened, built by hand.

mod catalogue;
mod hostile;
mod parts;
mod record;
mod runs;

pub use catalogue::sources;
pub use hostile::{HOSTILE, hostile};
pub use parts::setting;
pub use record::{Recorder, order, state};
pub use runs::{fail, pass};
