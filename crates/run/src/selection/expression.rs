//! Which tests an expression means: `chapter(6.6) and not (moves or hook(set-mode))`.
//!
//! ```text
//! expression = conjunction { "or" conjunction }
//! conjunction = negation { "and" negation }
//! negation = "not" negation | "(" expression ")" | term
//! term = NAME "(" VALUE ")" | PATTERN
//! ```
//!
//! A value stands in quotes when it has a `)` in it. A pattern is what stands on the command line, too: an id, a group or
//! table, or `*` for anything. What matches no test at all is a mistake: a typo must not look like a small, green run.

use std::collections::BTreeSet;
use std::sync::Arc;

use super::pattern::matches;
use tck_base::diagnostic::{self, Diagnostic, Source, Span};
use tck_report::sources::Sources;
use tck_suite::model::Test;

/// What is asked of a test.
#[derive(Clone, Debug, PartialEq, Eq)]
enum Expression {
    /// One of both.
    Or(Box<Self>, Box<Self>),
    /// Both.
    And(Box<Self>, Box<Self>),
    /// The contrary.
    Not(Box<Self>),
    /// This.
    Term(Term, Place),
}

/// First and last byte.
type Place = (usize, usize);

/// One thing that is asked.
#[derive(Clone, Debug, PartialEq, Eq)]
enum Term {
    /// `test(PATTERN)`, or the pattern alone.
    Test(String),
    /// `requirement(ID)`: it decides this requirement, or one of those whose ids begin so.
    Requirement(String),
    /// `chapter(6.6)` or `chapter(TEXT)`: it decides a requirement of this section, or of a chapter with this in its title.
    Chapter(String),
    /// `tag(WORD)`.
    Tag(String),
    /// `hook(NAME)`: it uses this hook.
    Hook(String),
}

/// The names of terms, as they are typed.
const TERMS: [&str; 5] = ["chapter", "hook", "requirement", "tag", "test"];

/// The deepest nesting: an expression is typed by a person.
const DEEPEST: usize = 64;

/// The tests that an expression means, in their order.
///
/// # Errors
/// When it cannot be read, or a part of it means no test at all.
pub fn meant(
    text: &str,
    all: &[Arc<Test>],
    among: &[Arc<Test>],
    quoted: &Sources,
) -> Result<Vec<Arc<Test>>, Diagnostic> {
    let source = Source::new("--filter", text);
    let expression = parse(&source)?;
    let ground = ExpressionContext { all, quoted, source };
    ground.check(&expression)?;
    let holds = |test: &&Arc<Test>| ground.holds(&expression, test);
    Ok(among.iter().filter(holds).cloned().collect())
}

struct ExpressionContext<'a> {
    all: &'a [Arc<Test>],
    quoted: &'a Sources,
    source: Arc<Source>,
}

impl ExpressionContext<'_> {
    fn holds(&self, expression: &Expression, test: &Test) -> bool {
        match expression {
            Expression::Or(one, other) => self.holds(one, test) || self.holds(other, test),
            Expression::And(one, other) => self.holds(one, test) && self.holds(other, test),
            Expression::Not(other) => !self.holds(other, test),
            Expression::Term(term, _) => self.is(term, test),
        }
    }

    fn is(&self, term: &Term, test: &Test) -> bool {
        match term {
            Term::Test(pattern) => matches(pattern, &test.id),
            Term::Tag(tag) => test.tags().contains(tag.as_str()),
            Term::Hook(hook) => test.hooks().contains(hook.as_str()),
            Term::Requirement(pattern) => {
                let decided = test.requirements();
                let begins = |id: &str| {
                    id.strip_prefix(pattern.as_str())
                        .is_some_and(|rest| rest.starts_with('-'))
                };
                decided
                    .iter()
                    .any(|id| matches(pattern, id.as_str()) || begins(id.as_str()))
            }
            Term::Chapter(text) => {
                let decided = test.requirements();
                let known = decided.iter().filter_map(|id| self.quoted.requirement(id.as_str()));
                let lower = text.to_lowercase();
                known.into_iter().any(|known| {
                    if is_section(text) {
                        let rest = known.section.strip_prefix(text.as_str());
                        rest.is_some_and(|rest| rest.is_empty() || rest.starts_with('.'))
                    } else {
                        known.chapter.to_lowercase().contains(&lower)
                    }
                })
            }
        }
    }

    /// Whether every term means some test.
    fn check(&self, expression: &Expression) -> Result<(), Diagnostic> {
        match expression {
            Expression::Or(one, other) | Expression::And(one, other) => {
                self.check(one)?;
                self.check(other)
            }
            Expression::Not(other) => self.check(other),
            Expression::Term(term, place) => {
                if self.all.iter().any(|test| self.is(term, test)) {
                    return Ok(());
                }
                Err(self.unknown(term, *place))
            }
        }
    }

    fn unknown(&self, term: &Term, (start, end): Place) -> Diagnostic {
        let tests = self.all.iter();
        let (value, label, known): (_, _, BTreeSet<String>) = match term {
            Term::Test(value) => (
                value,
                "no test matches this",
                tests.map(|test| test.id.clone()).collect(),
            ),
            Term::Tag(value) => {
                let tags = tests.flat_map(|test| test.tags().into_iter().map(str::to_owned).collect::<Vec<_>>());
                (value, "no test has this tag", tags.collect())
            }
            Term::Hook(value) => {
                let hooks = tests.flat_map(|test| test.hooks().into_iter().map(str::to_owned).collect::<Vec<_>>());
                (value, "no test uses this hook", hooks.collect())
            }
            Term::Requirement(value) => {
                let ids = tests.flat_map(|test| test.requirements());
                let ids = ids.map(|id| id.as_str().to_owned());
                (value, "no test decides this requirement", ids.collect())
            }
            Term::Chapter(value) => {
                let chapters = self.quoted.requirements.iter().map(|one| one.chapter.clone());
                (
                    value,
                    "no test decides a requirement of this chapter",
                    chapters.collect(),
                )
            }
        };
        let span = Span::new(&self.source, start, end);
        let wrong = Diagnostic::new("unknown-selection", span, "this selects no test", label);
        match diagnostic::closest(value, known.iter().map(String::as_str)) {
            Some(close) => wrong.hint(format!("did you mean `{close}`?")),
            None if known.len() <= 30 => {
                let known: Vec<String> = known.into_iter().collect();
                wrong.hint(format!("there are: {}", known.join(", ")))
            }
            None => wrong.hint("`vda5050-tck list tests` and `list requirements` show what there is"),
        }
    }
}

fn is_section(text: &str) -> bool {
    text.starts_with(|c: char| c.is_ascii_digit()) && text.chars().all(|c| c.is_ascii_digit() || c == '.')
}

/// Reads an expression.
fn parse(source: &Arc<Source>) -> Result<Expression, Diagnostic> {
    let mut parser = Parser {
        source,
        at: 0,
        depth: 0,
    };
    let expression = parser.any()?;
    parser.blank();
    if parser.at < source.text.len() {
        return Err(parser.wrong("`and`, `or` or the end was expected here"));
    }
    Ok(expression)
}

struct Parser<'a> {
    source: &'a Arc<Source>,
    at: usize,
    depth: usize,
}

impl Parser<'_> {
    fn rest(&self) -> &str {
        &self.source.text[self.at..]
    }

    fn blank(&mut self) {
        self.at += self.rest().len() - self.rest().trim_start().len();
    }

    /// Takes a word of the language, where it stands alone.
    fn word(&mut self, word: &str) -> bool {
        self.blank();
        let Some(rest) = self.rest().strip_prefix(word) else {
            return false;
        };
        let ends = rest.is_empty() || rest.starts_with(|c: char| c.is_whitespace() || c == '(');
        if ends {
            self.at += word.len();
        }
        ends
    }

    fn any(&mut self) -> Result<Expression, Diagnostic> {
        let mut one = self.all()?;
        while self.word("or") {
            one = Expression::Or(Box::new(one), Box::new(self.all()?));
        }
        Ok(one)
    }

    fn all(&mut self) -> Result<Expression, Diagnostic> {
        let mut one = self.negation()?;
        while self.word("and") {
            one = Expression::And(Box::new(one), Box::new(self.negation()?));
        }
        Ok(one)
    }

    fn negation(&mut self) -> Result<Expression, Diagnostic> {
        self.depth += 1;
        if self.depth > DEEPEST {
            return Err(self.wrong("this is nested too deep"));
        }
        let found = if self.word("not") {
            Expression::Not(Box::new(self.negation()?))
        } else if self.rest().starts_with('(') {
            self.at += 1;
            let inner = self.any()?;
            self.blank();
            if !self.rest().starts_with(')') {
                return Err(self.wrong("`)` was expected here"));
            }
            self.at += 1;
            inner
        } else {
            self.term()?
        };
        self.depth -= 1;
        Ok(found)
    }

    fn term(&mut self) -> Result<Expression, Diagnostic> {
        let begin = self.at;
        let word = self.rest().split(|c: char| c.is_whitespace() || c == '(' || c == ')');
        let word = word.into_iter().next().unwrap_or_default().to_owned();
        if word.is_empty() || ["and", "or"].contains(&word.as_str()) {
            return Err(self.wrong("a test, a term such as `tag(moves)`, `not` or `(` was expected here"));
        }
        self.at += word.len();
        if !self.rest().starts_with('(') {
            return Ok(Expression::Term(Term::Test(word), (begin, self.at)));
        }
        self.at += 1;
        let value = self.value()?;
        let place = (begin, self.at);
        let term = match word.as_str() {
            "test" => Term::Test(value),
            "requirement" => Term::Requirement(value),
            "chapter" => Term::Chapter(value),
            "tag" => Term::Tag(value),
            "hook" => Term::Hook(value),
            other => {
                let span = Span::new(self.source, begin, begin + other.len());
                let title = format!("there is no term `{other}`");
                let hint = diagnostic::did_you_mean(other, TERMS);
                return Err(Diagnostic::new("unknown-term", span, title, "not known").hint(hint));
            }
        };
        Ok(Expression::Term(term, place))
    }

    /// What stands in parentheses, and the parenthesis that ends it.
    fn value(&mut self) -> Result<String, Diagnostic> {
        self.blank();
        let quote = self.rest().chars().next().filter(|c| ['"', '\''].contains(c));
        let (value, taken) = match quote {
            Some(quote) => match self.rest()[1..].split_once(quote) {
                Some((value, _)) => (value.to_owned(), value.len() + 2),
                None => return Err(self.wrong("this quotation has no end")),
            },
            None => {
                let value = self.rest().split(')').next().unwrap_or_default();
                (value.trim_end().to_owned(), value.len())
            }
        };
        if value.is_empty() {
            return Err(self.wrong("a value was expected here"));
        }
        self.at += taken;
        self.blank();
        if !self.rest().starts_with(')') {
            return Err(self.wrong("`)` was expected here"));
        }
        self.at += 1;
        Ok(value)
    }

    fn wrong(&self, label: &str) -> Diagnostic {
        let end = self.rest().chars().next().map_or(self.at, |c| self.at + c.len_utf8());
        let span = Span::new(self.source, self.at, end);
        Diagnostic::new("bad-filter", span, "the filter cannot be read", label)
            .hint("such as `chapter(6.6) and not (tag(moves) or hook(set-mode))`; docs/selection.md has all terms")
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn read(text: &str) -> Result<Expression, Diagnostic> {
        parse(&Source::new("--filter", text))
    }

    /// Without places, which depend on blanks.
    fn bare(expression: &Expression) -> Expression {
        match expression {
            Expression::Or(one, other) => Expression::Or(Box::new(bare(one)), Box::new(bare(other))),
            Expression::And(one, other) => Expression::And(Box::new(bare(one)), Box::new(bare(other))),
            Expression::Not(other) => Expression::Not(Box::new(bare(other))),
            Expression::Term(term, _) => Expression::Term(term.clone(), (0, 0)),
        }
    }

    fn shown(expression: &Expression) -> String {
        match expression {
            Expression::Or(one, other) => format!("({} or {})", shown(one), shown(other)),
            Expression::And(one, other) => format!("({} and {})", shown(one), shown(other)),
            Expression::Not(other) => format!("not {}", shown(other)),
            Expression::Term(term, _) => match term {
                Term::Test(value) => format!("test(\"{value}\")"),
                Term::Requirement(value) => format!("requirement(\"{value}\")"),
                Term::Chapter(value) => format!("chapter(\"{value}\")"),
                Term::Tag(value) => format!("tag(\"{value}\")"),
                Term::Hook(value) => format!("hook(\"{value}\")"),
            },
        }
    }

    #[test]
    fn not_binds_closer_than_and_and_and_closer_than_or() {
        for (text, meant) in [
            ("a", "test(\"a\")"),
            ("a or b and not c", "(test(\"a\") or (test(\"b\") and not test(\"c\")))"),
            (
                "not (a or b)and(c)",
                "(not (test(\"a\") or test(\"b\")) and test(\"c\"))",
            ),
            ("chapter( 6.6 )", "chapter(\"6.6\")"),
            ("chapter('a ) b')", "chapter(\"a ) b\")"),
            ("not not a[x/y]", "not not test(\"a[x/y]\")"),
            ("order/* and nothing", "(test(\"order/*\") and test(\"nothing\"))"),
        ] {
            assert_eq!(
                shown(&read(text).unwrap_or_else(|wrong| panic!("{text}: {wrong}"))),
                meant,
                "{text}"
            );
        }
    }

    #[test]
    fn mistakes_are_shown_where_they_are() {
        let all = [
            "",
            "a b",
            "a and",
            "(a",
            "tag()",
            "tag(a",
            "chapter('a)",
            "a)",
            "tagg(a)",
            "or",
            "a or and b",
        ];
        let all = all.map(|text| read(text).expect_err(text).render(false));
        insta::assert_snapshot!(all.join("\n\n"));
        assert!(read(&"(".repeat(1_000)).is_err());
    }

    fn expressions() -> impl Strategy<Value = Expression> {
        let value = "[a-z0-9*/.) \\[\\]-]{0,7}[a-z0-9*/.)]";
        let term = (value, 0..5_u8).prop_map(|(value, kind)| {
            let term = match kind {
                0 => Term::Test(value),
                1 => Term::Requirement(value),
                2 => Term::Chapter(value),
                3 => Term::Tag(value),
                _ => Term::Hook(value),
            };
            Expression::Term(term, (0, 0))
        });
        term.prop_recursive(6, 40, 2, |inner| {
            prop_oneof![
                (inner.clone(), inner.clone()).prop_map(|(a, b)| Expression::Or(Box::new(a), Box::new(b))),
                (inner.clone(), inner.clone()).prop_map(|(a, b)| Expression::And(Box::new(a), Box::new(b))),
                inner.prop_map(|a| Expression::Not(Box::new(a))),
            ]
        })
    }

    proptest! {
        #[test]
        fn what_is_written_is_read_back(expression in expressions()) {
            prop_assert_eq!(bare(&read(&shown(&expression)).expect("an expression")), expression);
        }

        #[test]
        fn no_text_breaks_it(text in ".{0,60}") {
            let _ = read(&text);
        }

        #[test]
        fn nor_does_what_looks_like_one(text in "(and|or|not|\\(|\\)|tag|'| |[a-z]){0,30}") {
            let _ = read(&text);
        }
    }
}
