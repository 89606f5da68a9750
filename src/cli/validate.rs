//! `validate`: check files, told apart by their content.

use std::io::{BufReader, Read};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use serde::de::IgnoredAny;

use super::args::{Format, Validate};
use super::exit::Exit;
use super::messages::{self, Counted, Judging};
use super::problem::Problem;
use crate::ui::escaped;
use tck_audit::Hints;
use tck_base::diagnostic::{Diagnostic, Source};
use tck_capture::input::no_plain_text;
use tck_course::{Edge, Layout, Unheard};
use tck_explore::Grammar;
use tck_journal::place;
use tck_judge::Library;
use tck_pack::{Catalogue, Role};
use tck_profile as profile;
use tck_report::statement::{many, verb};
use tck_report::{clean, json as result_file};

/// A file that is read as a whole may have so many bytes.
const WHOLE: usize = 32 << 20;

/// What is wrong with a file, or what it is.
enum Found {
    Good(String),
    /// It is what it should be, and something in it looks wrong.
    Doubtful(String, Vec<String>),
    Bad(Vec<Diagnostic>),
    /// It is wrong, and everything was said.
    Told,
}

/// `validate`.
pub fn validate(arguments: &Validate) -> Result<Exit, Problem> {
    let library = crate::assets::library(arguments.suites.own())?;
    let judging = Judging {
        arguments,
        library: &library,
        hints: Hints::of(&library.rules.packs),
    };
    let mut wrong = 0;
    for path in &expanded(&arguments.files)? {
        let name = path.display().to_string();
        let (beginning, rest) = read(path)?;
        let found = if let Some(what) = no_plain_text(&beginning) {
            Found::Bad(vec![Diagnostic::whole("not-text", format!("{name} is {what}"))])
        } else if let Some(form) = messages::form(path, &beginning) {
            let all = BufReader::new(beginning.as_slice().chain(rest));
            let counted = messages::batch(&name, all, form, &judging)?;
            wrong += usize::from(counted.wrong > 0);
            summary(&name, counted, arguments.format)?;
            continue;
        } else if beginning.len() > WHOLE {
            let title =
                format!("{name} is larger than {WHOLE} bytes, and holds neither lines nor an array of messages");
            let hint = "many messages are read one a line, or as elements of one array";
            Found::Bad(vec![Diagnostic::whole("too-large", title).hint(hint)])
        } else {
            check(&name, &beginning, path, &judging)?
        };
        match (found, arguments.format) {
            (Found::Good(what), Format::Text) => super::print(&format!("{name}: {what}\n"))?,
            (Found::Good(what), Format::Json) => super::print(&format!(
                "{}\n",
                serde_json::json!({ "file": name, "ok": true, "what": what })
            ))?,
            (Found::Doubtful(what, doubts), Format::Text) => {
                for doubt in doubts {
                    super::print(&format!("{name}: WARN {}\n", clean::line(&doubt)))?;
                }
                super::print(&format!("{name}: {what}\n"))?
            }
            (Found::Doubtful(what, doubts), Format::Json) => super::print(&format!(
                "{}\n",
                serde_json::json!({ "file": name, "ok": true, "what": what, "warnings": doubts })
            ))?,
            (Found::Told, _) => {
                wrong += 1;
                Exit::Usage
            }
            (Found::Bad(all), format) => {
                wrong += 1;
                for one in &all {
                    match format {
                        Format::Text => super::print(&format!("{}\n\n", one.render(console::colors_enabled())))?,
                        Format::Json => super::print(&format!(
                            "{}\n",
                            serde_json::json!({ "file": name, "ok": false, "code": one.code, "title": one.title,
                                "line": one.span.as_ref().map(tck_base::diagnostic::Span::line), "hint": one.hint })
                        ))?,
                    };
                }
                Exit::Usage
            }
        };
    }
    Ok(if wrong == 0 { Exit::Conforms } else { Exit::Usage })
}

/// What was counted in a file with many messages.
fn summary(name: &str, counted: Counted, format: Format) -> Result<(), Problem> {
    let text = match format {
        Format::Text => format!(
            "{name}: {}, {} with violations, {} with warnings\n",
            many(counted.messages, "message"),
            counted.wrong,
            counted.warned
        ),
        Format::Json => format!(
            "{}\n",
            serde_json::json!({ "file": name, "ok": counted.wrong == 0, "messages": counted.messages,
                "withViolations": counted.wrong, "withWarnings": counted.warned })
        ),
    };
    super::print(&text).map(|_| ())
}

/// Every file, and of a folder all JSON files in it and below, in their order.
fn expanded(files: &[PathBuf]) -> Result<Vec<PathBuf>, Problem> {
    let mut all = Vec::new();
    for path in files {
        if !path.is_dir() {
            all.push(path.clone());
            continue;
        }
        let before = all.len();
        let mut folders = vec![path.clone()];
        while let Some(folder) = folders.pop() {
            let unreadable = |error: std::io::Error| {
                Diagnostic::whole("unreadable", format!("cannot read {}: {error}", folder.display()))
            };
            for entry in std::fs::read_dir(&folder).map_err(unreadable)? {
                let path = entry.map_err(unreadable)?.path();
                let extension = path.extension().and_then(|extension| extension.to_str());
                if path.is_dir() && !path.is_symlink() {
                    folders.push(path);
                } else if matches!(extension, Some("json" | "jsonl" | "ndjson")) {
                    all.push(path);
                }
            }
        }
        all[before..].sort();
    }
    Ok(all)
}

/// The beginning of a file, which is all of it unless it is very large, and what is left.
fn read(path: &Path) -> Result<(Vec<u8>, Box<dyn Read>), Problem> {
    let unreadable = |error| Diagnostic::whole("unreadable", format!("cannot read {}: {error}", path.display()));
    let mut input: Box<dyn Read> = if path.as_os_str() == "-" {
        Box::new(std::io::stdin().lock())
    } else {
        Box::new(std::fs::File::open(path).map_err(unreadable)?)
    };
    let mut beginning = Vec::new();
    let limit = WHOLE as u64 + 1;
    input
        .by_ref()
        .take(limit)
        .read_to_end(&mut beginning)
        .map_err(unreadable)?;
    Ok((beginning, input))
}

fn check(name: &str, bytes: &[u8], path: &Path, judging: &Judging<'_>) -> Result<Found, Problem> {
    let library = judging.library;
    let json = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    if serde_json::from_slice::<IgnoredAny>(json).is_ok() {
        // A file of many bytes is told by its members, and not kept as a whole.
        let member = |name: &str| place::member(json, name);
        if member("metaInformation").is_some() {
            // The text itself, so that a mistake is shown where it stands.
            return Ok(match layout(&Source::new(name, String::from_utf8_lossy(bytes))) {
                Ok((what, doubts)) if doubts.is_empty() => Found::Good(what),
                Ok((what, doubts)) => Found::Doubtful(what, doubts),
                Err(all) => Found::Bad(all),
            });
        }
        let format = member("format").map(|range| String::from_utf8_lossy(&json[range]));
        if format.is_some_and(|format| format.contains(".result/")) {
            return Ok(match result_file::from_str(&String::from_utf8_lossy(json), name) {
                Ok(result) => Found::Good(format!("a result of {}", many(result.tests.len(), "test"))),
                Err(error) => Found::Bad(vec![Diagnostic::whole("result", error.to_string())]),
            });
        }
        return one(name, bytes, judging);
    }
    let Ok(text) = std::str::from_utf8(bytes) else {
        return Ok(Found::Bad(vec![Diagnostic::whole(
            "not-text",
            format!("{name} is not UTF-8"),
        )]));
    };
    let extension = path
        .extension()
        .and_then(|extension| extension.to_str())
        .unwrap_or_default();
    if extension == "toml" || (extension != "json" && looks_like_toml(text)) {
        let folder = path.parent().unwrap_or(Path::new(""));
        return Ok(
            match profile::check(&Source::new(name, text), folder, &library.rules.hooks) {
                Ok(effective) => match super::plan::validated(&effective, library) {
                    Ok(what) => Found::Good(what),
                    Err(all) => Found::Bad(all),
                },
                Err(all) => Found::Bad(all),
            },
        );
    }
    if extension == "json" || text.trim_start().starts_with('{') {
        return one(name, bytes, judging);
    }
    let checked = beside_tests(name, text, path, library).unwrap_or_else(|| library.check_suite(name, text));
    Ok(match checked {
        Ok(what) => Found::Good(what),
        Err(all) => Found::Bad(all),
    })
}

/// A file of suites that is no test, state or monitor: requirements, hooks, or stimuli.
fn beside_tests(name: &str, text: &str, path: &Path, library: &Library) -> Option<Result<String, Vec<Diagnostic>>> {
    let has = |key: &str| text.lines().any(|line| line.starts_with(key));
    if has("requirements:") || has("chapter:") {
        let count = Catalogue::check_text(name, text);
        return Some(count.map(|count| format!("a file of {}", many(count, "requirement"))));
    }
    if has("hooks:") {
        let count = library.rules.hooks.check_text(name, text);
        return Some(count.map(|count| format!("a file of {}", many(count, "hook"))));
    }
    let folder = path.parent()?;
    let role = [Role::Agv, Role::MasterControl]
        .into_iter()
        .find(|role| folder.ends_with(Path::new("explore").join(role.word())));
    let read = match role {
        _ if has("explore:") => Grammar::read(name, text).map(|_| "a grammar of conversations".to_owned()),
        Some(role) => Grammar::check_part(&library.assets, role, name, text)
            .map(|count| format!("a file of {count} {}", verb(count, "stimulus", "stimuli"))),
        None => return None,
    };
    Some(read.map_err(|error| vec![Diagnostic::whole("explore", error.to_string())]))
}

fn looks_like_toml(text: &str) -> bool {
    text.lines()
        .map(str::trim)
        .find(|line| !line.is_empty() && !line.starts_with('#'))
        .is_some_and(|line| line.starts_with('[') || line.contains(" = "))
}

/// A file with one message.
fn one(name: &str, bytes: &[u8], judging: &Judging<'_>) -> Result<Found, Problem> {
    let (counted, what) = messages::alone(name, bytes, judging)?;
    Ok(if counted.wrong > 0 {
        Found::Told
    } else {
        Found::Good(what)
    })
}

/// How many of some things are used: `4 nodes`, or `3 of 4 nodes`.
fn part_of(used: usize, all: usize, one: &str) -> String {
    if used < all {
        format!("{used} of {}", many(all, one))
    } else {
        many(used, one)
    }
}

/// Reads a layout for each of its vehicle types: which one is meant is said by the profile that uses it. Gives what it is, and
/// what looks wrong in it.
fn layout(source: &Arc<Source>) -> Result<(String, Vec<String>), Vec<Diagnostic>> {
    let (mut said, mut left_out, mut doubts) = (Vec::new(), Vec::new(), Vec::new());
    let (all_nodes, all_edges) = Layout::written_in(source)?;
    for vehicle_type in Layout::vehicle_types(source)? {
        let whole = Layout::from_lif(source, Some(&vehicle_type))?;
        let layout = whole.fitted(&Unheard);
        let shown = escaped(&vehicle_type);
        let (nodes, edges) = (layout.nodes().count(), layout.edges().count());
        said.push(format!(
            "{} and {} for {vehicle_type}",
            part_of(nodes, all_nodes, "node"),
            part_of(edges, all_edges, "edge")
        ));
        let unused = layout.left_out().iter();
        left_out.extend(unused.map(|sentence| format!("\n  not used for {vehicle_type}: {}", escaped(sentence))));
        let unread = whole.unsaid().iter();
        left_out.extend(unread.map(|sentence| format!("\n  for {shown}: {}", escaped(sentence))));
        if layout.edges().any(Edge::has_more_to_say) {
            left_out.push(format!(
                "\n  for {shown}: curves, orientations, rotation and heights go into orders as far as its factsheet \
                 lists them; `run --plan` says which"
            ));
        }
        for doubt in whole.doubts() {
            if !doubts.contains(&doubt) {
                doubts.push(doubt);
            }
        }
    }
    let what = format!("a layout with {}{}", said.join(", "), left_out.concat());
    Ok((what, doubts))
}
