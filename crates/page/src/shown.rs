//! Texts as they may be shown: bounded, and without characters that change what stands around them.

/// The longest text that is shown of a name, in characters.
pub(crate) const NAME: usize = 200;
/// The longest sentence.
pub(crate) const SENTENCE: usize = 2_000;
/// How much of a message stands in the list of messages.
pub(crate) const EXCERPT: usize = 400;
/// How much of a record is shown when it is asked for.
pub(crate) const RECORD: usize = 64 * 1024;

/// A text cut to a length. What it was longer is said, and what steers a terminal or turns the direction of text is escaped.
pub(crate) fn shown(text: &str, limit: usize) -> String {
    let mut kept = String::with_capacity(text.len().min(limit));
    for (count, letter) in text.chars().enumerate() {
        if count == limit {
            let left = text.chars().skip(limit).count();
            kept.push_str(&format!(" … ({left} more characters)"));
            break;
        }
        if is_harmless(letter) {
            kept.push(letter);
        } else {
            kept.extend(letter.escape_unicode());
        }
    }
    kept
}

/// Whether a character is only itself. Marks of direction, separators of lines and controls do something to what is beside them.
fn is_harmless(letter: char) -> bool {
    let turns = matches!(letter, '\u{200b}'..='\u{200f}' | '\u{2028}'..='\u{202e}' | '\u{2060}'..='\u{206f}')
        || matches!(letter, '\u{61c}' | '\u{feff}' | '\u{fff9}'..='\u{fffb}');
    !turns && (!letter.is_control() || matches!(letter, '\n' | '\t'))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_text_is_cut_and_what_does_something_is_escaped() {
        assert_eq!(shown("plain <b>text</b>\n\tä", 99), "plain <b>text</b>\n\tä");
        assert_eq!(shown("a\u{202e}b\u{1b}[2J\u{0}", 99), "a\\u{202e}b\\u{1b}[2J\\u{0}");
        assert_eq!(shown("äöüß", 2), "äö … (2 more characters)");
        assert_eq!(shown("äö", 2), "äö");
    }
}
