//! `validate`: check files, told apart by their content.

use std::io::Read as _;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use serde_json::Value;

use super::args::{Format, Validate};
use super::exit::Exit;
use super::messages::{self, Counted};
use super::problem::Problem;
use crate::course::Layout;
use crate::diagnostic::{Diagnostic, Source};
use crate::journal::json::Parsed;
use crate::profile;
use crate::report::json as result_file;
use crate::run::Library;

/// What is wrong with a file, or what it is.
enum Found {
    Good(String),
    Bad(Vec<Diagnostic>),
    /// It is wrong, and everything was said.
    Told,
}

/// `validate`.
pub fn validate(arguments: &Validate) -> Result<Exit, Problem> {
    let library = Library::load(None)?;
    let mut wrong = 0;
    for path in &expanded(&arguments.files)? {
        let name = path.display().to_string();
        let text = read(path)?;
        let found = if messages::is_batch(path, &text) {
            let counted = messages::batch(&name, &text, arguments, &library)?;
            wrong += usize::from(counted.wrong > 0);
            summary(&name, counted, arguments.format)?;
            continue;
        } else {
            check(&name, &text, path, arguments, &library)?
        };
        match (found, arguments.format) {
            (Found::Good(what), Format::Text) => super::print(&format!("{name}: {what}\n"))?,
            (Found::Good(what), Format::Json) => super::print(&format!(
                "{}\n",
                serde_json::json!({ "file": name, "ok": true, "what": what })
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
                                "line": one.span.as_ref().map(crate::diagnostic::Span::line), "hint": one.hint })
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
            "{name}: {} messages, {} with violations, {} with warnings\n",
            counted.messages, counted.wrong, counted.warned
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

fn read(path: &Path) -> Result<Vec<u8>, Problem> {
    let read = if path.as_os_str() == "-" {
        let mut bytes = Vec::new();
        std::io::stdin().lock().read_to_end(&mut bytes).map(|_| bytes)
    } else {
        std::fs::read(path)
    };
    read.map_err(|error| Diagnostic::whole("unreadable", format!("cannot read {}: {error}", path.display())).into())
}

fn check(name: &str, bytes: &[u8], path: &Path, arguments: &Validate, library: &Library) -> Result<Found, Problem> {
    let parsed = Parsed::of_bytes(bytes);
    if let Some(value) = parsed.value() {
        return json_file(name, value, bytes, arguments, library);
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
        return Ok(match profile::check(&Source::new(name, text), folder) {
            Ok(effective) => match super::plan::validated(&effective, library) {
                Ok(what) => Found::Good(what),
                Err(all) => Found::Bad(all),
            },
            Err(all) => Found::Bad(all),
        });
    }
    if extension == "json" || text.trim_start().starts_with('{') {
        return one(name, bytes, arguments, library);
    }
    Ok(match library.check_suite(name, text) {
        Ok(what) => Found::Good(what),
        Err(all) => Found::Bad(all),
    })
}

fn looks_like_toml(text: &str) -> bool {
    text.lines()
        .map(str::trim)
        .find(|line| !line.is_empty() && !line.starts_with('#'))
        .is_some_and(|line| line.starts_with('[') || line.contains(" = "))
}

fn json_file(
    name: &str,
    value: &Value,
    bytes: &[u8],
    arguments: &Validate,
    library: &Library,
) -> Result<Found, Problem> {
    if value.get("metaInformation").is_some() && value.get("layouts").is_some() {
        // The text itself, so that a mistake is shown where it stands.
        return Ok(match layout(&Source::new(name, String::from_utf8_lossy(bytes))) {
            Ok(what) => Found::Good(what),
            Err(all) => Found::Bad(all),
        });
    }
    if value
        .get("format")
        .and_then(Value::as_str)
        .is_some_and(|format| format.contains(".result/"))
    {
        return Ok(match result_file::from_str(&value.to_string(), name) {
            Ok(result) => Found::Good(format!("a result of {} tests", result.tests.len())),
            Err(error) => Found::Bad(vec![Diagnostic::whole("result", error.to_string())]),
        });
    }
    one(name, bytes, arguments, library)
}

/// A file with one message.
fn one(name: &str, bytes: &[u8], arguments: &Validate, library: &Library) -> Result<Found, Problem> {
    let (counted, what) = messages::alone(name, bytes, arguments, library)?;
    Ok(if counted.wrong > 0 {
        Found::Told
    } else {
        Found::Good(what)
    })
}

/// Reads a layout for each of its vehicle types: which one is meant is said by the profile that uses it.
fn layout(source: &Arc<Source>) -> Result<String, Vec<Diagnostic>> {
    let mut said = Vec::new();
    for vehicle_type in Layout::vehicle_types(source)? {
        let layout = Layout::from_lif(source, Some(&vehicle_type))?;
        let (nodes, edges) = (layout.nodes().count(), layout.edges().count());
        said.push(format!("{nodes} nodes and {edges} edges for {vehicle_type}"));
    }
    Ok(format!("a layout with {}", said.join(", ")))
}
