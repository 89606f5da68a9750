//! Fingerprints of contents.

/// A fingerprint of a JSON value: equal for equal content, whatever the order of members, and however a number is
/// written (`1` and `1.0`).
///
/// It is made to tell one error or action from another, not to withstand somebody who looks for two that collide.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Print(pub(crate) u64);

impl Print {
    /// The number, for a table of one's own.
    #[must_use]
    pub const fn bits(self) -> u64 {
        self.0
    }
}

/// Mixes two numbers.
const fn fold(a: u64, b: u64) -> u64 {
    let product = (a as u128) * (b as u128);
    #[expect(clippy::cast_possible_truncation, reason = "both halves are taken")]
    let folded = (product as u64) ^ ((product >> 64) as u64);
    folded
}

const K1: u64 = 0x9e37_79b9_7f4a_7c15;
const K2: u64 = 0xd6e8_feb8_6659_fd93;
const K3: u64 = 0xa076_1d64_78bd_642f;

/// Of bytes, in order.
pub(crate) fn of_bytes(bytes: &[u8]) -> u64 {
    let mut state = K1 ^ (bytes.len() as u64);
    let (words, rest) = bytes.as_chunks::<8>();
    for word in words {
        state = fold(state ^ u64::from_le_bytes(*word), K2);
    }
    let tail = rest.iter().rev().fold(0_u64, |tail, byte| tail << 8 | u64::from(*byte));
    fold(state ^ tail, K3)
}

const fn tagged(tag: u64, bits: u64) -> Print {
    Print(fold(bits ^ K3, K1 ^ tag))
}

pub(crate) const NULL: Print = tagged(1, 0);

pub(crate) const fn of_flag(flag: bool) -> Print {
    tagged(2, flag as u64)
}

pub(crate) fn of_number(number: crate::Number) -> Print {
    // Zero and minus zero are one number.
    tagged(3, (number.float() + 0.0).to_bits())
}

pub(crate) fn of_text(text: &str) -> Print {
    tagged(4, of_bytes(text.as_bytes()))
}

/// Of a list, element by element.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Sequence(u64);

impl Sequence {
    pub(crate) const fn new() -> Self {
        Self(K2)
    }

    pub(crate) const fn add(&mut self, element: Print) {
        self.0 = fold(self.0 ^ element.0, K3).wrapping_add(K1);
    }

    pub(crate) const fn done(self) -> Print {
        tagged(5, self.0)
    }
}

/// Of an object, whatever the order of its members.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Members(u64);

impl Members {
    /// Adds a member by the fingerprint of its name.
    pub(crate) const fn add(&mut self, name: u64, value: Print) {
        self.0 = self.0.wrapping_add(fold(name ^ K1, value.0 ^ K2));
    }

    /// These members and others.
    pub(crate) const fn with(self, others: Self) -> Self {
        Self(self.0.wrapping_add(others.0))
    }

    /// These members without some of them.
    pub(crate) const fn without(self, some: Self) -> Self {
        Self(self.0.wrapping_sub(some.0))
    }

    pub(crate) const fn done(self) -> Print {
        tagged(6, self.0)
    }
}
