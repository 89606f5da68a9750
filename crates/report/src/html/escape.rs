//! The escaper of every HTML and SVG template (`askama.toml` names it).

use std::fmt::{self, Write};

use askama::filters::{Escaper, Html};

use crate::clean;

/// Makes hostile characters visible, then escapes for HTML, XHTML and SVG, text and attributes alike.
#[derive(Clone, Copy, Debug, Default)]
pub struct Escape;

impl Escaper for Escape {
    fn write_escaped_str<W: Write>(&self, dest: W, string: &str) -> fmt::Result {
        Html.write_escaped_str(dest, &clean::characters(string))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn markup_quotes_and_control_characters_are_shown_and_never_live() {
        let mut out = String::new();
        let hostile = "<script>alert(1)</script>\"'&\u{0}\u{1b}";
        assert!(Escape.write_escaped_str(&mut out, hostile).is_ok());
        assert!(!out.contains(['<', '>', '"', '\'', '\u{0}', '\u{1b}']));
        assert!(out.ends_with("␀␛"));
    }
}
