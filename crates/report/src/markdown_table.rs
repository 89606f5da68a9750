//! Tables in Markdown.

use super::clean::{line, short};

/// How many characters of a text stand in a cell.
const LENGTH: usize = 600;

/// A column, by its title.
#[derive(Clone, Copy, Debug)]
pub enum Column<'a> {
    /// Of texts.
    Text(&'a str),
    /// Of numbers, which stand at its right side.
    Number(&'a str),
}

/// A table. A cell stands in it as it is: [`cell`] makes one of a text.
#[must_use]
pub fn table<const N: usize>(columns: [Column<'_>; N], rows: impl IntoIterator<Item = [String; N]>) -> String {
    let titles = columns.map(|column| match column {
        Column::Text(title) | Column::Number(title) => title,
    });
    let sides = columns.map(|column| match column {
        Column::Text(_) => "---|",
        Column::Number(_) => "---:|",
    });
    let mut text = format!("| {} |\n|{}\n", titles.join(" | "), sides.concat());
    for row in rows {
        text.push_str(&format!("| {} |\n", row.join(" | ")));
    }
    text
}

/// One line that is no markup, whatever a device wrote into it.
#[must_use]
pub fn cell(text: &str) -> String {
    let text = short(&line(text), LENGTH).into_owned();
    let mut safe = String::with_capacity(text.len());
    for character in text.chars() {
        match character {
            '&' => safe.push_str("&amp;"),
            '<' => safe.push_str("&lt;"),
            '>' => safe.push_str("&gt;"),
            '\\' | '`' | '*' | '_' | '[' | ']' | '|' | '#' | '!' | '~' | '@' => {
                safe.push('\\');
                safe.push(character);
            }
            _ => safe.push(character),
        }
    }
    safe
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_text_leaves_its_cell() {
        let hostile = cell("a | b\n| <script> `c` \u{1b}[1m");
        let text = table(
            [Column::Text("What"), Column::Number("Times")],
            [[hostile, 3.to_string()]],
        );
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(lines[..2], ["| What | Times |", "|---|---:|"]);
        assert_eq!(lines.len(), 3, "{text}");
        assert_eq!(lines[2].replace("\\|", "").matches('|').count(), 3, "{text}");
        assert!(!text.contains('<') && !text.contains('\u{1b}'), "{text}");
    }
}
