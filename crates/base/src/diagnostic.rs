//! Places in a text and what is wrong there.
//!
//! Every mistake a user can make in a suite, a profile or a capture becomes a [`Diagnostic`] with file,
//! line, caret and hint. This module renders them; finding them is left to the layers above.

use std::sync::Arc;

use annotate_snippets::{AnnotationKind, Group, Level, Renderer, Snippet};

/// A text with a name, usually a file.
#[derive(Debug, PartialEq, Eq)]
pub struct Source {
    /// Path as the user would type it, or the path inside the embedded suites.
    pub name: String,
    /// The whole text.
    pub text: String,
}

impl Source {
    /// A shared source.
    pub fn new(name: impl Into<String>, text: impl Into<String>) -> Arc<Self> {
        Arc::new(Self {
            name: name.into(),
            text: text.into(),
        })
    }
}

/// A byte range in a source.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Span {
    /// The text the range lies in.
    pub source: Arc<Source>,
    /// First byte.
    pub start: usize,
    /// One past the last byte.
    pub end: usize,
}

impl Span {
    /// A span over `start..end`, clamped to the text and to character boundaries.
    #[must_use]
    pub fn new(source: &Arc<Source>, start: usize, end: usize) -> Self {
        let floor = |mut at: usize| {
            at = at.min(source.text.len());
            while !source.text.is_char_boundary(at) {
                at -= 1;
            }
            at
        };
        let start = floor(start);
        Self {
            source: Arc::clone(source),
            start,
            end: floor(end).max(start),
        }
    }

    /// The text of the range.
    #[must_use]
    pub fn text(&self) -> &str {
        &self.source.text[self.start..self.end]
    }

    /// Line, counted from 1.
    #[must_use]
    pub fn line(&self) -> usize {
        self.source.text[..self.start].matches('\n').count() + 1
    }

    /// Column in characters, counted from 1.
    #[must_use]
    pub fn column(&self) -> usize {
        let before = &self.source.text[..self.start];
        let line = before.rfind('\n').map_or(0, |at| at + 1);
        before[line..].chars().count() + 1
    }

    /// `file:line`.
    #[must_use]
    pub fn place(&self) -> String {
        format!("{}:{}", self.source.name, self.line())
    }
}

/// One mistake of a user, with the place and what to do about it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Diagnostic {
    /// Short stable name of the kind of mistake, such as `unknown-key`.
    pub code: &'static str,
    /// What is wrong, in one line.
    pub title: String,
    /// Where; absent when a whole file is meant.
    pub span: Option<Span>,
    /// What stands at the caret.
    pub label: String,
    /// What to do about it.
    pub hint: Option<String>,
}

impl Diagnostic {
    /// A diagnostic at a place.
    pub fn new(code: &'static str, span: Span, title: impl Into<String>, label: impl Into<String>) -> Self {
        Self {
            code,
            title: title.into(),
            span: Some(span),
            label: label.into(),
            hint: None,
        }
    }

    /// A diagnostic about a whole file or flag.
    pub fn whole(code: &'static str, title: impl Into<String>) -> Self {
        Self {
            code,
            title: title.into(),
            span: None,
            label: String::new(),
            hint: None,
        }
    }

    /// Adds what to do about it.
    #[must_use]
    pub fn hint(mut self, hint: impl Into<String>) -> Self {
        self.hint = Some(hint.into());
        self
    }

    /// Names the file otherwise, if `name` has another name for it.
    #[must_use]
    pub fn renamed(mut self, name: &dyn Fn(&str) -> Option<String>) -> Self {
        if let Some(span) = &mut self.span
            && let Some(name) = name(&span.source.name)
        {
            span.source = Source::new(name, span.source.text.as_str());
        }
        self
    }

    /// Only the place with its caret, without title.
    #[must_use]
    pub fn render_place(&self) -> String {
        let text = self.render(false);
        let first = text.lines().position(|line| line.contains("-->")).unwrap_or(0);
        text.lines().skip(first).collect::<Vec<_>>().join("\n")
    }

    /// The diagnostic as rustc would show it.
    #[must_use]
    pub fn render(&self, color: bool) -> String {
        let renderer = if color { Renderer::styled() } else { Renderer::plain() };
        let title = Level::ERROR.primary_title(self.title.as_str()).id(self.code);
        let mut group = match &self.span {
            Some(span) => title.element(
                Snippet::source(span.source.text.as_str())
                    .path(span.source.name.as_str())
                    .line_start(1)
                    .annotation(
                        AnnotationKind::Primary
                            .span(span.start..span.end)
                            .label(self.label.as_str()),
                    ),
            ),
            None => Group::with_title(title),
        };
        if let Some(hint) = &self.hint {
            group = group.element(Level::HELP.message(hint.as_str()));
        }
        renderer.render(&[group])
    }
}

impl std::fmt::Display for Diagnostic {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.render(false))
    }
}

/// The candidate most like `word`, if one is close enough to be a slip.
#[must_use]
pub fn closest<'a>(word: &str, candidates: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    candidates
        .into_iter()
        .map(|candidate| {
            let same_but_for_case =
                candidate.eq_ignore_ascii_case(word) || unpadded(candidate).eq_ignore_ascii_case(&unpadded(word));
            (
                candidate,
                if same_but_for_case {
                    1.0
                } else {
                    strsim::jaro_winkler(word, candidate)
                },
            )
        })
        .filter(|(_, likeness)| *likeness > 0.8)
        .max_by(|a, b| a.1.total_cmp(&b.1))
        .map(|(candidate, _)| candidate)
}

/// Without the leading zeros of its last number: `ORD-REJ-3` for `ORD-REJ-03`.
fn unpadded(word: &str) -> String {
    let start = word.trim_end_matches(|c: char| c.is_ascii_digit());
    let number = word.strip_prefix(start).unwrap_or_default();
    format!("{start}{}", number.trim_start_matches('0'))
}

/// "did you mean `x`?", or the list of what is allowed.
#[must_use]
pub fn did_you_mean<'a>(word: &str, candidates: impl IntoIterator<Item = &'a str> + Clone) -> String {
    if let Some(candidate) = closest(word, candidates.clone()) {
        return format!("did you mean `{candidate}`?");
    }
    let all: Vec<_> = candidates.into_iter().collect();
    if all.is_empty() {
        "nothing is allowed here".to_owned()
    } else {
        format!("allowed here: {}", all.join(", "))
    }
}
