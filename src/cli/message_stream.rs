//! Many messages in one file, read one after the other: the lines of JSON Lines, or the elements of an array. What is kept in
//! memory is one message at a time; of one that is larger than a message may be only the length is kept.

use std::io::{self, BufRead};

use tck_journal::event::PAYLOAD_LIMIT;

/// How messages stand in a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Form {
    /// One a line.
    Lines,
    /// Elements of one array.
    Array,
}

/// One message, and where it begins, counted from 1.
#[derive(Debug, PartialEq, Eq)]
pub struct Piece {
    pub line: usize,
    pub column: usize,
    pub content: Content,
}

/// What stands there.
#[derive(Debug, PartialEq, Eq)]
pub enum Content {
    /// The bytes of a message.
    Message(Vec<u8>),
    /// More bytes than a message may have.
    TooLarge(u64),
    /// No array any more; nothing is read behind it.
    Broken(&'static str),
}

/// Where the reader of an array is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum At {
    Begin,
    /// Behind the bracket.
    First,
    /// Behind an element.
    Behind,
    /// Behind a comma.
    Next,
    /// Behind the closing bracket.
    End,
}

/// Reads a file message by message.
pub struct Pieces<R> {
    input: R,
    form: Form,
    line: usize,
    column: usize,
    at: At,
    done: bool,
}

/// The bytes of a message as they come.
#[derive(Default)]
struct Kept {
    bytes: Vec<u8>,
    length: u64,
}

impl Kept {
    fn add(&mut self, part: &[u8]) {
        self.length += part.len() as u64;
        if self.is_too_large() {
            self.bytes = Vec::new();
        } else {
            self.bytes.extend_from_slice(part);
        }
    }

    fn is_too_large(&self) -> bool {
        self.length > PAYLOAD_LIMIT as u64
    }

    fn content(self) -> Content {
        if self.is_too_large() {
            Content::TooLarge(self.length)
        } else {
            Content::Message(self.bytes)
        }
    }
}

impl<R: BufRead> Pieces<R> {
    pub fn new(input: R, form: Form) -> Self {
        Self {
            input,
            form,
            line: 1,
            column: 1,
            at: At::Begin,
            done: false,
        }
    }

    /// The next message; `None` at the end.
    pub fn next(&mut self) -> io::Result<Option<Piece>> {
        if self.done {
            return Ok(None);
        }
        match self.form {
            Form::Lines => self.next_line(),
            Form::Array => self.next_element(),
        }
    }

    fn next_line(&mut self) -> io::Result<Option<Piece>> {
        loop {
            let (mut kept, mut blank, mut ended) = (Kept::default(), true, false);
            let mut any = false;
            while !ended {
                let chunk = self.input.fill_buf()?;
                if chunk.is_empty() {
                    break;
                }
                any = true;
                let end = chunk.iter().position(|byte| *byte == b'\n');
                let part = &chunk[..end.unwrap_or(chunk.len())];
                blank &= part.trim_ascii().is_empty();
                kept.add(part);
                ended = end.is_some();
                let used = part.len() + usize::from(ended);
                self.input.consume(used);
            }
            if !any {
                return Ok(None);
            }
            let line = self.line;
            self.line += 1;
            if !blank {
                let content = kept.content();
                return Ok(Some(Piece {
                    line,
                    column: 1,
                    content,
                }));
            }
        }
    }

    fn next_element(&mut self) -> io::Result<Option<Piece>> {
        loop {
            let Some(byte) = self.peek()? else {
                return Ok(match self.at {
                    At::End => None,
                    _ => Some(self.broken("the array is not closed")),
                });
            };
            match (self.at, byte) {
                (_, byte) if byte.is_ascii_whitespace() => {}
                (At::Begin, _) => self.at = At::First,
                (At::First | At::Behind, b']') => self.at = At::End,
                (At::Behind, b',') => self.at = At::Next,
                (At::End, _) => return Ok(Some(self.broken("something stands behind the array"))),
                (At::Behind, _) => return Ok(Some(self.broken("a comma or the end of the array is missing"))),
                (At::Next, b']') => return Ok(Some(self.broken("an element is missing behind a comma"))),
                (At::First | At::Next, _) => {
                    self.at = At::Behind;
                    return self.element().map(Some);
                }
            }
            self.advance(byte);
        }
    }

    /// What stands up to the comma or bracket behind it; whether it is JSON is not looked at.
    fn element(&mut self) -> io::Result<Piece> {
        let (line, column) = (self.line, self.column);
        let mut kept = Kept::default();
        let (mut depth, mut quoted, mut escaped) = (0_usize, false, false);
        while let Some(byte) = self.peek()? {
            if !quoted && depth == 0 && kept.length > 0 && matches!(byte, b',' | b']') {
                break;
            }
            kept.add(&[byte]);
            self.advance(byte);
            match byte {
                _ if escaped => escaped = false,
                b'\\' if quoted => escaped = true,
                b'"' => quoted = !quoted,
                b'{' | b'[' if !quoted => depth += 1,
                b'}' | b']' if !quoted => {
                    depth = depth.saturating_sub(1);
                    if depth == 0 {
                        break;
                    }
                }
                _ => {}
            }
        }
        Ok(Piece {
            line,
            column,
            content: kept.content(),
        })
    }

    fn broken(&mut self, why: &'static str) -> Piece {
        self.done = true;
        Piece {
            line: self.line,
            column: self.column,
            content: Content::Broken(why),
        }
    }

    fn peek(&mut self) -> io::Result<Option<u8>> {
        Ok(self.input.fill_buf()?.first().copied())
    }

    fn advance(&mut self, byte: u8) {
        self.input.consume(1);
        if byte == b'\n' {
            self.line += 1;
            self.column = 1;
        } else if byte & 0xc0 != 0x80 {
            // A character of several bytes is one column.
            self.column += 1;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn all(form: Form, text: &str) -> Vec<(usize, usize, Content)> {
        // A small buffer, so that every message is read in parts.
        let input = io::BufReader::with_capacity(3, text.as_bytes());
        let mut pieces = Pieces::new(input, form);
        let mut all = Vec::new();
        while let Some(piece) = pieces.next().expect("memory can be read") {
            all.push((piece.line, piece.column, piece.content));
        }
        all
    }

    fn message(text: &str) -> Content {
        Content::Message(text.as_bytes().to_vec())
    }

    #[test]
    fn lines_are_read_one_by_one_and_empty_ones_are_counted() {
        let found = all(Form::Lines, "{\"a\":1}\n\n  \n[2]\r\n{");
        assert_eq!(
            found,
            [
                (1, 1, message("{\"a\":1}")),
                (4, 1, message("[2]\r")),
                (5, 1, message("{"))
            ]
        );
    }

    #[test]
    fn elements_of_an_array_are_found_whatever_stands_in_them() {
        let found = all(Form::Array, " [{\"a]\": \"},\\\"\"},\n  {\"ä\":[{}]} , 7]\n");
        assert_eq!(
            found,
            [
                (1, 3, message("{\"a]\": \"},\\\"\"}")),
                (2, 3, message("{\"ä\":[{}]}")),
                (2, 16, message("7")),
            ]
        );
        assert_eq!(all(Form::Array, "[]"), []);
    }

    #[test]
    fn an_array_that_breaks_off_says_where() {
        for (text, line, why) in [
            ("[{}", 1, "the array is not closed"),
            ("[{},\n]", 2, "an element is missing behind a comma"),
            ("[{} {}]", 1, "a comma or the end of the array is missing"),
            ("[{}]\n\nx", 3, "something stands behind the array"),
        ] {
            let found = all(Form::Array, text);
            assert_eq!(found[0].2, message("{}"), "{text}");
            assert_eq!((found[1].0, &found[1].2), (line, &Content::Broken(why)), "{text}");
            assert_eq!(found.len(), 2, "{text}");
        }
    }

    #[test]
    fn of_what_is_too_large_the_length_is_kept() {
        let large = "x".repeat(PAYLOAD_LIMIT + 1);
        assert_eq!(
            all(Form::Lines, &format!("{large}\n{{}}")),
            [
                (1, 1, Content::TooLarge(PAYLOAD_LIMIT as u64 + 1)),
                (2, 1, message("{}"))
            ]
        );
        let array = all(Form::Array, &format!("[\"{large}\",{{}}]"));
        assert_eq!(array[0].2, Content::TooLarge(PAYLOAD_LIMIT as u64 + 3));
        assert_eq!(array[1].2, message("{}"));
    }
}
