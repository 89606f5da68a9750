//! How work is divided: evenly by how long it takes, and the same on every machine.

use super::Shard;

/// A piece of work that is not divided any further.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Piece {
    /// Its name, unique among all pieces.
    pub name: String,
    /// How long it takes, in milliseconds.
    pub millis: u64,
}

/// Which part each piece belongs to, counted from 1, in the order of the pieces: the longest first, each to the part that has
/// least to do so far. It depends on the names and times alone, and not on the order. Where there are fewer pieces than
/// parts, the last parts stay empty.
#[must_use]
pub fn divided(pieces: &[Piece], of: usize) -> Vec<usize> {
    let mut order: Vec<usize> = (0..pieces.len()).collect();
    order.sort_by(|one, other| {
        let (one, other) = (&pieces[*one], &pieces[*other]);
        other.millis.cmp(&one.millis).then_with(|| one.name.cmp(&other.name))
    });
    let mut loads = vec![0_u64; of.max(1)];
    let mut parts = vec![1; pieces.len()];
    for at in order {
        let lightest = loads.iter().enumerate().min_by_key(|(place, load)| (**load, *place));
        let part = lightest.map_or(0, |(place, _)| place);
        // No piece weighs nothing, so that none joins another one while a part is empty.
        loads[part] = loads[part].saturating_add(pieces[at].millis.max(1));
        parts[at] = part + 1;
    }
    parts
}

/// Whether something of this name belongs to a part, where not all of it is known beforehand: by its name alone (FNV-1a).
#[must_use]
pub fn dealt(name: &str, shard: Shard) -> bool {
    let hash = name.bytes().fold(0xcbf2_9ce4_8422_2325_u64, |hash, byte| {
        (hash ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3)
    });
    // The low bits of names that differ in their last letter only follow one another.
    let mixed = hash ^ (hash >> 32);
    let of = u64::try_from(shard.of.max(1)).unwrap_or(u64::MAX);
    usize::try_from(mixed % of).is_ok_and(|part| part + 1 == shard.index)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn pieces(times: &[u64]) -> Vec<Piece> {
        let named = times.iter().enumerate();
        let named = named.map(|(at, millis)| Piece {
            name: format!("p{at}"),
            millis: *millis,
        });
        named.collect()
    }

    #[test]
    fn long_pieces_are_spread_and_the_last_parts_are_those_that_stay_empty() {
        let parts = divided(&pieces(&[10, 90, 10, 80, 70, 10]), 3);
        let mut loads = [0; 3];
        for (part, millis) in parts.iter().zip([10, 90, 10, 80, 70, 10]) {
            loads[part - 1] += millis;
        }
        loads.sort_unstable();
        assert_eq!(loads, [90, 90, 90]);
        let mut few = divided(&pieces(&[0, 0, 0]), 16);
        few.sort_unstable();
        assert_eq!(few, [1, 2, 3]);
    }

    proptest! {
        #[test]
        fn every_piece_has_one_part_whatever_their_order(times in prop::collection::vec(0_u64..5_000, 1..60), of in 1_usize..17) {
            let all = pieces(&times);
            let parts = divided(&all, of);
            prop_assert!(parts.iter().all(|part| (1..=of).contains(part)));
            let filled: std::collections::BTreeSet<usize> = parts.iter().copied().collect();
            prop_assert_eq!(filled.len(), of.min(all.len()));
            let mut turned = all.clone();
            turned.reverse();
            let mut again = divided(&turned, of);
            again.reverse();
            prop_assert_eq!(&parts, &again);
            // No part has more to do than the lightest and one piece together.
            let mut loads = vec![0; of];
            for (part, piece) in parts.iter().zip(&all) {
                loads[part - 1] += piece.millis.max(1);
            }
            let longest = all.iter().map(|piece| piece.millis.max(1)).max().unwrap_or(1);
            let (least, most) = (loads.iter().min().copied().unwrap_or(0), loads.iter().max().copied().unwrap_or(0));
            prop_assert!(most <= least + longest);
        }

        #[test]
        fn a_name_belongs_to_exactly_one_part(name in ".{0,40}", of in 1_usize..17) {
            let parts = (1..=of).filter(|index| dealt(&name, Shard { index: *index, of })).count();
            prop_assert_eq!(parts, 1);
        }
    }

    #[test]
    fn names_that_count_are_spread() {
        for index in 1..=8 {
            let own = (0..800).filter(|number| dealt(&format!("ACME/agv-{number:04}"), Shard { index, of: 8 }));
            let count = own.count();
            assert!((60..=140).contains(&count), "part {index} has {count} of 800");
        }
    }
}
