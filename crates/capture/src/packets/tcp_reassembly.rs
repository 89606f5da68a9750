//! One direction of a TCP connection, put in order: what came twice is left out, what came early waits, and what never
//! came is a gap.

use std::collections::BTreeMap;
use std::time::Duration;

use jiff::Timestamp;

/// How many bytes wait for those before them.
const HELD: usize = 1 << 20;
/// In how many segments they may come.
const SEGMENTS: usize = 4096;
/// How long they wait.
const PATIENCE: Duration = Duration::from_secs(1);
/// What lies further away is of another connection.
const FAR: i64 = 64 << 20;

/// A part of the direction.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Part {
    /// The next bytes, as one segment brought them.
    Bytes(Vec<u8>),
    /// Bytes are missing here.
    Gap,
}

/// What came early.
struct Early {
    at: Option<Timestamp>,
    data: Vec<u8>,
    missing: u32,
}

/// One direction of a TCP connection, put in order: what came twice is left out, what came early waits, and what never
/// came is a gap.
#[derive(Default)]
pub(super) struct TcpReassembly {
    /// Sequence number of the next byte, once it is known.
    next: Option<u32>,
    /// How far that is from the beginning.
    position: u64,
    early: BTreeMap<u64, Early>,
    held: usize,
}

impl TcpReassembly {
    /// The direction begins with this sequence number.
    pub fn begin(&mut self, next: u32) {
        *self = Self {
            next: Some(next),
            ..Self::default()
        };
    }

    /// How many bytes wait.
    pub fn held(&self) -> usize {
        self.held
    }

    /// Takes in a segment; gives what is due.
    pub fn push(&mut self, seq: u32, at: Option<Timestamp>, data: Vec<u8>, missing: u32, due: &mut Vec<Part>) {
        if data.is_empty() && missing == 0 {
            self.hurry(at, due);
            return;
        }
        let next = *self.next.get_or_insert(seq);
        let away = i64::from(seq.wrapping_sub(next).cast_signed());
        if away.abs() > FAR {
            self.rest(due);
            self.begin(seq);
            due.push(Part::Gap);
            self.take(data, missing, due);
            return;
        }
        let Some(start) = self.position.checked_add_signed(away) else {
            return;
        };
        if start > self.position {
            self.hold(start, Early { at, data, missing });
        } else {
            self.late(start, data, missing, due);
            self.follow(due);
        }
        self.hurry(at, due);
    }

    /// Everything that waits, with the gaps before it.
    pub fn rest(&mut self, due: &mut Vec<Part>) {
        while self.skip(due) {}
    }

    /// A segment that begins at the next byte or before it.
    fn late(&mut self, start: u64, mut data: Vec<u8>, missing: u32, due: &mut Vec<Part>) {
        let known = usize::try_from(self.position - start).unwrap_or(usize::MAX);
        if known < data.len() {
            data.drain(..known);
            self.take(data, missing, due);
        } else {
            let beyond = u32::try_from(known - data.len()).unwrap_or(u32::MAX);
            self.take(Vec::new(), missing.saturating_sub(beyond), due);
        }
    }

    fn take(&mut self, data: Vec<u8>, missing: u32, due: &mut Vec<Part>) {
        let length = data.len() as u64 + u64::from(missing);
        self.position += length;
        #[expect(clippy::cast_possible_truncation, reason = "sequence numbers begin anew")]
        let step = length as u32;
        self.next = self.next.map(|next| next.wrapping_add(step));
        if !data.is_empty() {
            due.push(Part::Bytes(data));
        }
        if missing > 0 {
            due.push(Part::Gap);
        }
    }

    fn hold(&mut self, start: u64, early: Early) {
        let known = self.early.get(&start).map_or(0, |known| known.data.len());
        if self.early.contains_key(&start) && known >= early.data.len() {
            return;
        }
        self.held = self.held + early.data.len() - known;
        self.early.insert(start, early);
    }

    /// What follows the bytes that came.
    fn follow(&mut self, due: &mut Vec<Part>) {
        while let Some(first) = self.early.first_entry() {
            if *first.key() > self.position {
                return;
            }
            let (start, early) = first.remove_entry();
            self.held -= early.data.len();
            self.late(start, early.data, early.missing, due);
        }
    }

    /// Waits no longer for what is missing.
    fn hurry(&mut self, now: Option<Timestamp>, due: &mut Vec<Part>) {
        let is_old = |early: &Early| match (early.at, now) {
            (Some(at), Some(now)) => now.duration_since(at).unsigned_abs() > PATIENCE,
            _ => false,
        };
        while self.held > HELD || self.early.len() > SEGMENTS || self.early.values().next().is_some_and(is_old) {
            if !self.skip(due) {
                return;
            }
        }
    }

    /// Gives up what is missing before the first that waits.
    fn skip(&mut self, due: &mut Vec<Part>) -> bool {
        let Some(start) = self.early.keys().next().copied() else {
            return false;
        };
        let missing = start.saturating_sub(self.position);
        self.position = start;
        #[expect(clippy::cast_possible_truncation, reason = "sequence numbers begin anew")]
        let step = missing as u32;
        self.next = self.next.map(|next| next.wrapping_add(step));
        due.push(Part::Gap);
        self.follow(due);
        true
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn at(millis: i64) -> Option<Timestamp> {
        Timestamp::from_millisecond(1_700_000_000_000 + millis).ok()
    }

    /// What comes of these segments: sequence number, time and bytes.
    fn told(begin: u32, segments: &[(u32, i64, &str)]) -> String {
        let mut flow = TcpReassembly::default();
        flow.begin(begin);
        let mut due = Vec::new();
        for (seq, millis, text) in segments {
            flow.push(*seq, at(*millis), text.as_bytes().to_vec(), 0, &mut due);
        }
        flow.rest(&mut due);
        due.iter()
            .map(|part| match part {
                Part::Bytes(bytes) => String::from_utf8_lossy(bytes).into_owned(),
                Part::Gap => "~".to_owned(),
            })
            .collect()
    }

    #[test]
    fn segments_out_of_order_twice_and_overlapping_are_one_stream() {
        assert_eq!(told(10, &[(10, 0, "ab"), (14, 1, "ef"), (12, 2, "cd")]), "abcdef");
        assert_eq!(told(10, &[(10, 0, "abcd"), (10, 1, "ab"), (12, 2, "cdef")]), "abcdef");
        assert_eq!(told(u32::MAX, &[(u32::MAX, 0, "ab"), (1, 1, "cd")]), "abcd");
        // What keeps a connection alive repeats the byte before the next one.
        assert_eq!(told(10, &[(10, 0, "ab"), (11, 1, "x"), (12, 2, "c")]), "abc");
    }

    #[test]
    fn what_never_comes_is_a_gap_after_a_while() {
        assert_eq!(
            told(
                10,
                &[(10, 0, "ab"), (14, 1, "ef"), (16, 2_000, "gh"), (12, 2_001, "cd")]
            ),
            "ab~efgh"
        );
        assert_eq!(told(10, &[(12, 0, "ab")]), "~ab");
        assert_eq!(told(10, &[(10, 0, "ab"), (2_000_000_000, 1, "cd")]), "ab~cd");
    }

    #[test]
    fn a_segment_that_was_cut_off_leaves_a_gap() {
        let mut flow = TcpReassembly::default();
        let mut due = Vec::new();
        flow.push(5, at(0), b"ab".to_vec(), 3, &mut due);
        flow.push(10, at(1), b"f".to_vec(), 0, &mut due);
        let bytes = |text: &str| Part::Bytes(text.as_bytes().to_vec());
        assert_eq!(due, [bytes("ab"), Part::Gap, bytes("f")]);
    }

    proptest! {
        #[test]
        fn whatever_the_order_the_bytes_are_the_same(
            cuts in prop::collection::vec(1..20_usize, 1..30),
            order in prop::collection::vec(any::<prop::sample::Index>(), 0..60),
            begin in any::<u32>(),
        ) {
            let total: usize = cuts.iter().sum();
            let bytes: Vec<u8> = (0..total).map(|at| u8::try_from(at % 251).unwrap_or_default()).collect();
            let mut segments = Vec::new();
            let mut from = 0;
            for cut in cuts {
                segments.push((from, bytes[from..from + cut].to_vec()));
                from += cut;
            }
            // Some come early and come again.
            let mut sent: Vec<_> = order.iter().map(|index| segments[index.index(segments.len())].clone()).collect();
            sent.extend(segments);
            let mut flow = TcpReassembly::default();
            flow.begin(begin);
            let mut due = Vec::new();
            for (from, data) in sent {
                flow.push(begin.wrapping_add(u32::try_from(from).unwrap_or_default()), at(0), data, 0, &mut due);
            }
            let mut all = Vec::new();
            for part in due {
                match part {
                    Part::Bytes(bytes) => all.extend(bytes),
                    Part::Gap => prop_assert!(false, "nothing is missing"),
                }
            }
            prop_assert_eq!(all, bytes);
        }

        #[test]
        fn no_segments_make_it_panic(segments in prop::collection::vec((any::<u32>(), 0..5_000_i64, 0..40_usize, 0..50_u32), 0..60)) {
            let mut flow = TcpReassembly::default();
            let mut due = Vec::new();
            for (seq, millis, length, missing) in segments {
                flow.push(seq, at(millis), vec![0; length], missing, &mut due);
            }
            prop_assert!(flow.held() <= HELD + 40);
        }
    }
}
