//! Parts of something that several processes share: which one this is, who says so, and how work is divided among them.

mod scheduler;
mod split;

use std::fmt;
use std::ops::Range;
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

    /// Which of so many things in a row are in this part. Parts differ by one thing at most; with fewer things than parts the last
    /// ones have none.
    #[must_use]
    pub fn of_many(self, count: usize) -> Range<usize> {
        let filled = self.of.min(count).max(1);
        let before = |index: usize| count * index.min(filled) / filled;
        before(self.index.saturating_sub(1))..before(self.index)
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
    fn things_in_a_row_are_divided_without_a_gap() {
        for (count, of) in [(40, 4), (10, 3), (3, 8), (0, 2), (5_000, 16)] {
            let parts: Vec<Range<usize>> = (1..=of).map(|index| Shard { index, of }.of_many(count)).collect();
            let all: Vec<usize> = parts.iter().flat_map(Clone::clone).collect();
            assert_eq!(all, (0..count).collect::<Vec<usize>>());
            let filled = of.min(count);
            let (least, most) = (count / filled.max(1), count.div_ceil(filled.max(1)));
            for part in &parts[..filled] {
                assert!((least..=most).contains(&part.len()), "{count} in {of}: {parts:?}");
            }
        }
    }

    #[test]
    fn a_part_is_read_as_it_is_written() {
        assert_eq!("2/4".parse(), Ok(Shard { index: 2, of: 4 }));
        assert_eq!(Shard { index: 2, of: 4 }.to_string(), "2/4");
        for wrong in ["0/4", "5/4", "1/0", "2", "a/b", "1/10001", "-1/2", "1/2/3"] {
            assert!(wrong.parse::<Shard>().is_err(), "{wrong}");
        }
    }
}
