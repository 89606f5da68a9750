//! The one way a text leaves for a rendering: hostile characters made visible, length bounded.
//!
//! A device chooses most of the strings a report shows. Control characters and ANSI escapes would take over
//! a terminal, some characters may not stand in XML at all, and direction marks can make one text look like
//! another. Nothing is dropped: each such character is shown as what it is. Escaping for a format (`&lt;`)
//! is left to the writer of that format.

use std::borrow::Cow;

/// Longest text of one line (a message, an id, a value) in characters.
pub const LINE_LIMIT: usize = 2_000;
/// Longest text of many lines (an explanation, a payload) in characters.
pub const BLOCK_LIMIT: usize = 40_000;

/// What stands in for a character that must not leave as it is; `None` when it may.
fn visible(character: char) -> Option<Cow<'static, str>> {
    let code = u32::from(character);
    match character {
        // Control Pictures: U+2400 shows U+0000, and so on.
        '\u{0}'..='\u{1f}' => char::from_u32(0x2400 + code).map(|picture| Cow::Owned(picture.to_string())),
        '\u{7f}' => Some(Cow::Borrowed("\u{2421}")),
        // C1 controls; marks that change the direction or the joining of what follows; line and paragraph
        // separators; characters without width; tags; surrogates cannot occur in a `char`.
        '\u{80}'..='\u{9f}'
        | '\u{61c}'
        | '\u{180e}'
        | '\u{200b}'..='\u{200f}'
        | '\u{2028}'..='\u{202e}'
        | '\u{2060}'..='\u{206f}'
        | '\u{feff}'
        | '\u{fff9}'..='\u{fffb}'
        | '\u{e0000}'..='\u{e007f}'
        // Non-characters; the last two of every plane come below.
        | '\u{fdd0}'..='\u{fdef}' => Some(Cow::Owned(format!("\\u{{{code:x}}}"))),
        _ if code & 0xfffe == 0xfffe => Some(Cow::Owned(format!("\\u{{{code:x}}}"))),
        _ => None,
    }
}

fn replace(text: &str, keep: impl Fn(char) -> bool) -> Cow<'_, str> {
    let hostile = |character: char| !keep(character) && visible(character).is_some();
    if !text.contains(hostile) {
        return Cow::Borrowed(text);
    }
    let mut clean = String::with_capacity(text.len() + 16);
    for character in text.chars() {
        match visible(character) {
            Some(shown) if !keep(character) => clean.push_str(&shown),
            _ => clean.push(character),
        }
    }
    Cow::Owned(clean)
}

/// The text with hostile characters made visible; line breaks and tabs too.
#[must_use]
pub fn line(text: &str) -> Cow<'_, str> {
    bounded(replace(text, |_| false), LINE_LIMIT)
}

/// The text with hostile characters made visible; line feeds and tabs stay.
#[must_use]
pub fn block(text: &str) -> Cow<'_, str> {
    bounded(characters(text), BLOCK_LIMIT)
}

/// As [`block`], without a limit: for texts whose length was bounded before.
#[must_use]
pub fn characters(text: &str) -> Cow<'_, str> {
    replace(text, |character| matches!(character, '\n' | '\t'))
}

/// At most `limit` characters, and how many were left out.
#[must_use]
pub fn bounded(text: Cow<'_, str>, limit: usize) -> Cow<'_, str> {
    let Some((cut, _)) = text.char_indices().nth(limit) else {
        return text;
    };
    let left_out = text[cut..].chars().count();
    Cow::Owned(format!("{}… ({left_out} more characters)", &text[..cut]))
}

/// At most `limit` characters, the last one being `…` when something was left out: for places where every
/// character counts.
#[must_use]
pub fn short(text: &str, limit: usize) -> Cow<'_, str> {
    if text.char_indices().nth(limit).is_none() {
        return Cow::Borrowed(text);
    }
    let kept: String = text.chars().take(limit.saturating_sub(1)).collect();
    Cow::Owned(kept + "…")
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn an_ansi_escape_becomes_visible_and_harmless() {
        assert_eq!(line("\u{1b}[31mred\u{7}"), "␛[31mred␇");
    }

    #[test]
    fn a_direction_override_cannot_make_a_text_look_like_another() {
        assert_eq!(line("AGV\u{202e}7-"), "AGV\\u{202e}7-");
    }

    #[test]
    fn a_line_stays_a_line_and_a_block_keeps_its_lines() {
        assert_eq!(line("a\nb\tc"), "a␊b␉c");
        assert_eq!(block("a\nb\tc\r"), "a\nb\tc␍");
    }

    #[test]
    fn what_is_too_long_says_how_much_is_missing() {
        let long = "ä".repeat(LINE_LIMIT + 5);
        assert!(line(&long).ends_with("ä… (5 more characters)"));
        assert_eq!(short("abcdef", 4), "abc…");
        assert_eq!(short("abcd", 4), "abcd");
    }

    proptest! {
        #[test]
        fn no_character_that_xml_forbids_survives(text in any::<String>()) {
            for character in block(&text).chars() {
                let allowed = matches!(character,
                    '\t' | '\n' | '\u{20}'..='\u{d7ff}' | '\u{e000}'..='\u{fffd}' | '\u{10000}'..='\u{10ffff}');
                prop_assert!(allowed && (!character.is_control() || matches!(character, '\t' | '\n')));
            }
        }

        #[test]
        fn a_clean_text_is_left_alone(text in "[ -~äöüß€]{0,60}") {
            prop_assert_eq!(line(&text), text.as_str());
        }
    }
}
