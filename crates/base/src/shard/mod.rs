//! Parts of something that several processes share: which one this is, who says so, and how work is divided among them.

mod scheduler;
mod split;

use std::fmt;
use std::str::FromStr;

pub use scheduler::{ChosenShard, Count, Numbering, SCHEDULERS, SHARDS, Scheduler, SchedulerError, chosen};
pub use split::{Piece, dealt, divided};

/// The most parts that something can be divided into.
pub const MOST: usize = 10_000;

/// One part of something that several processes share.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Shard {
    /// Which part, counted from 1.
    pub index: usize,
    /// Of how many.
    pub of: usize,
}

impl Shard {
    /// Part `index` of `of`; `None` when there is no such part.
    #[must_use]
    pub fn new(index: usize, of: usize) -> Option<Self> {
        ((1..=of).contains(&index) && of <= MOST).then_some(Self { index, of })
    }

    /// Whether it is all there is.
    #[must_use]
    pub fn is_whole(self) -> bool {
        self.of == 1
    }
}

impl fmt::Display for Shard {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/{}", self.index, self.of)
    }
}

impl FromStr for Shard {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let parts = text
            .split_once('/')
            .and_then(|(index, of)| Some((index.parse::<usize>().ok()?, of.parse::<usize>().ok()?)));
        match parts {
            Some((_, 0)) => Err("there is at least one part".to_owned()),
            Some((_, of)) if of > MOST => Err(format!("there are at most {MOST} parts")),
            Some((index, of)) => Self::new(index, of).ok_or_else(|| format!("there is no part {index} of {of}")),
            None => Err("a part is written like 2/4: the second of four".to_owned()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_part_is_read_as_it_is_written() {
        assert_eq!("2/4".parse(), Ok(Shard { index: 2, of: 4 }));
        assert_eq!(Shard { index: 2, of: 4 }.to_string(), "2/4");
        for wrong in ["0/4", "5/4", "1/0", "2", "a/b", "1/10001", "-1/2", "1/2/3"] {
            assert!(wrong.parse::<Shard>().is_err(), "{wrong}");
        }
    }
}
