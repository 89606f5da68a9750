//! Writing to standard output so that `| head` is no failure, and so that a text cannot drive the terminal.

use std::io::{self, Write};

/// A stream of lines. When the reader has gone, the rest is swallowed and that is success.
#[derive(Debug)]
pub struct Output<W> {
    sink: W,
    closed: bool,
}

impl Output<io::Stdout> {
    /// Standard output.
    #[must_use]
    pub fn stdout() -> Self {
        Self::to(io::stdout())
    }
}

impl<W: Write> Output<W> {
    /// Lines to `sink`.
    pub fn to(sink: W) -> Self {
        Self { sink, closed: false }
    }

    /// Writes a line and passes it on at once.
    ///
    /// # Errors
    /// What the system says, but never that the reader has gone.
    pub fn line(&mut self, text: &str) -> io::Result<()> {
        self.text(&format!("{text}\n"))
    }

    /// Writes a text as it is and passes it on at once.
    ///
    /// # Errors
    /// What the system says, but never that the reader has gone.
    pub fn text(&mut self, text: &str) -> io::Result<()> {
        if self.closed {
            return Ok(());
        }
        match self.sink.write_all(text.as_bytes()).and_then(|()| self.sink.flush()) {
            Err(error) if error.kind() == io::ErrorKind::BrokenPipe => {
                self.closed = true;
                Ok(())
            }
            other => other,
        }
    }

    /// Whether the reader has gone, so that nobody will see what is written from now on.
    #[must_use]
    pub fn is_closed(&self) -> bool {
        self.closed
    }
}

/// How many characters of a foreign text are shown on a line.
const LONGEST: usize = 300;

/// A foreign text on one line: control characters, and those that turn the direction of writing, as escapes.
#[must_use]
pub fn escaped(text: &str) -> String {
    let mut safe = String::with_capacity(text.len().min(LONGEST));
    for (count, c) in text.chars().enumerate() {
        if count == LONGEST {
            safe.push('…');
            break;
        }
        match c {
            '\u{200b}'..='\u{200f}' | '\u{2028}'..='\u{202e}' | '\u{2066}'..='\u{2069}' | '\u{feff}' => {
                safe.extend(c.escape_unicode());
            }
            c if c.is_control() => safe.extend(c.escape_default()),
            c => safe.push(c),
        }
    }
    safe
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A sink whose reader leaves after some bytes, with this error.
    struct Leaving(usize, io::ErrorKind);

    impl Write for Leaving {
        fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
            if self.0 < bytes.len() {
                return Err(self.1.into());
            }
            self.0 -= bytes.len();
            Ok(bytes.len())
        }

        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }

    #[test]
    fn a_reader_that_has_gone_is_success() {
        let mut output = Output::to(Leaving(4, io::ErrorKind::BrokenPipe));
        assert!(output.line("one").is_ok() && !output.is_closed());
        assert!(output.line("two").is_ok() && output.is_closed());
        assert!(output.line("three").is_ok());
    }

    #[test]
    fn a_full_disk_is_not() {
        assert!(Output::to(Leaving(0, io::ErrorKind::StorageFull)).line("one").is_err());
    }

    #[test]
    fn a_text_cannot_drive_the_terminal() {
        let hostile = "a\x1b[2J\r\nb\u{202e}c\u{9b}31m\0";
        let safe = escaped(hostile);
        assert_eq!(safe, "a\\u{1b}[2J\\r\\nb\\u{202e}c\\u{9b}31m\\u{0}");
        assert_eq!(escaped("Grüße, 你好"), "Grüße, 你好");
        assert_eq!(escaped(&"x".repeat(1000)).chars().count(), LONGEST + 1);
    }
}
