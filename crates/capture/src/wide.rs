//! Texts in UTF-16, as programs on Windows write them, read as UTF-8.

use std::io::{self, Read};

/// How much is read at once.
const PIECE: usize = 1 << 15;

/// The order of the two bytes of a unit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Order {
    Little,
    Big,
}

impl Order {
    /// What the first bytes of a text say; `None` when it is not UTF-16. Without a mark, a bracket of JSON tells it.
    pub fn of(begin: &[u8]) -> Option<Self> {
        match begin {
            [0xff, 0xfe, ..] | [b'{' | b'[', 0, ..] => Some(Self::Little),
            [0xfe, 0xff, ..] | [0, b'{' | b'[', ..] => Some(Self::Big),
            _ => None,
        }
    }
}

/// Texts in UTF-16, as programs on Windows write them, read as UTF-8.
pub(super) struct Wide<R> {
    raw: R,
    order: Order,
    /// Bytes that are no unit yet, or a unit that is no character yet.
    rest: Vec<u8>,
    text: Vec<u8>,
    given: usize,
}

impl<R: Read> Wide<R> {
    pub fn new(raw: R, order: Order) -> Self {
        Self {
            raw,
            order,
            rest: Vec::new(),
            text: Vec::new(),
            given: 0,
        }
    }

    /// Reads the next piece; says whether there was one. What is no character becomes the sign for that.
    fn advance(&mut self) -> io::Result<bool> {
        let mut bytes = std::mem::take(&mut self.rest);
        let before = bytes.len();
        let limit = u64::try_from(PIECE).unwrap_or(u64::MAX);
        self.raw.by_ref().take(limit).read_to_end(&mut bytes)?;
        let at_end = bytes.len() - before < PIECE;
        let unit = |pair: &[u8]| {
            let pair = [pair[0], pair[1]];
            match self.order {
                Order::Little => u16::from_le_bytes(pair),
                Order::Big => u16::from_be_bytes(pair),
            }
        };
        let mut units: Vec<u16> = bytes.chunks_exact(2).map(unit).collect();
        let mut whole = units.len() * 2;
        // The second half of a character may come with the next piece.
        if !at_end && units.last().is_some_and(|last| (0xd800..0xdc00).contains(last)) {
            units.pop();
            whole -= 2;
        }
        self.rest = bytes.split_off(whole);
        if at_end {
            self.rest.clear();
        }
        let text: String = char::decode_utf16(units)
            .map(|found| found.unwrap_or(char::REPLACEMENT_CHARACTER))
            .collect();
        self.text = text.into_bytes();
        self.given = 0;
        Ok(!self.text.is_empty())
    }
}

impl<R: Read> Read for Wide<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        if self.given == self.text.len() && !self.advance()? {
            return Ok(0);
        }
        let rest = &self.text[self.given..];
        let length = rest.len().min(buffer.len());
        buffer[..length].copy_from_slice(&rest[..length]);
        self.given += length;
        Ok(length)
    }
}
