//! Conversations at random, which are the same for the same seed and the same answers, and turn to what was not tried yet.

use super::broken::family;
use super::chain::Chain;
use super::coverage::Coverage;
use super::grammar::{Grammar, Stimulus};
use super::model::Model;

/// A small generator of numbers that look random and are the same in every run.
#[derive(Clone, Debug)]
pub struct Random(u64);

impl Random {
    /// One that begins with a seed.
    #[must_use]
    pub fn new(seed: u64) -> Self {
        Self(seed)
    }

    /// One for the so manyth of several things that one seed begins: it does not depend on those before.
    #[must_use]
    pub fn of_number(seed: u64, number: u64) -> Self {
        // Two generators whose beginnings are near each other would give the same numbers, one behind the other.
        let first = Self::new(seed).below(u64::MAX).wrapping_add(number);
        Self(Self::new(first).below(u64::MAX))
    }

    /// A number below `bound`, which is not zero.
    pub fn below(&mut self, bound: u64) -> u64 {
        // SplitMix64, by Sebastiano Vigna.
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut mixed = self.0;
        mixed = (mixed ^ (mixed >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        (mixed ^ (mixed >> 31)) % bound
    }

    /// Puts things into another order.
    pub(super) fn shuffle<T>(&mut self, all: &mut [T]) {
        for last in (1..all.len()).rev() {
            let other = self.below(last as u64 + 1);
            all.swap(last, usize::try_from(other).unwrap_or(last));
        }
    }
}

/// A conversation of at most `length` stimuli, noted in `coverage`. It ends early where nothing more may be said.
#[must_use]
pub fn draw(grammar: &Grammar, random: &mut Random, length: usize, coverage: &mut Coverage) -> Chain {
    let mut model = Model::begin(grammar);
    let mut names = Vec::new();
    while names.len() < length {
        let may: Vec<(&String, &Stimulus, u64)> = grammar
            .stimuli
            .iter()
            .filter(|(_, stimulus)| model.allows(stimulus))
            .map(|(name, stimulus)| {
                let worth = coverage.worth(&model.situation, family(name));
                (name, stimulus, u64::from(stimulus.weight.max(1)) * worth)
            })
            .collect();
        let sum: u64 = may.iter().map(|(_, _, weight)| weight).sum();
        if sum == 0 {
            break;
        }
        let mut at = random.below(sum);
        let drawn = may.into_iter().find(|(_, _, weight)| {
            let hit = at < *weight;
            at = at.saturating_sub(*weight);
            hit
        });
        let Some((name, stimulus, _)) = drawn else { break };
        coverage.note(&model.situation, family(name));
        model.hear(stimulus, String::new());
        names.push(name.clone());
    }
    Chain::allowed(names)
}
