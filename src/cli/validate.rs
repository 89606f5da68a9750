//! `validate`: check files, told apart by their content.

use std::io::Read as _;
use std::path::Path;
use std::sync::Arc;

use serde_json::Value;

use super::args::{Format, Validate};
use super::exit::Exit;
use super::problem::Problem;
use crate::course::Layout;
use crate::diagnostic::{Diagnostic, Source};
use crate::journal::json::Parsed;
use crate::pack::Pack;
use crate::profile;
use crate::report::json as result_file;
use crate::run::Library;

/// What is wrong with a file, or what it is.
enum Found {
    Good(String),
    Bad(Vec<Diagnostic>),
}

/// `validate`.
pub fn validate(arguments: &Validate) -> Result<Exit, Problem> {
    let library = Library::load(None)?;
    let mut wrong = 0;
    for path in &arguments.files {
        let name = path.display().to_string();
        let text = read(path)?;
        let found = check(&name, &text, path, arguments, &library)?;
        match (found, arguments.format) {
            (Found::Good(what), Format::Text) => super::print(&format!("{name}: {what}\n"))?,
            (Found::Good(what), Format::Json) => super::print(&format!(
                "{}\n",
                serde_json::json!({ "file": name, "ok": true, "what": what })
            ))?,
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
        return json_file(name, value, bytes, &parsed, arguments, library);
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
        let problems = parsed
            .problems()
            .iter()
            .map(ToString::to_string)
            .collect::<Vec<_>>()
            .join("; ");
        return Ok(Found::Bad(vec![Diagnostic::whole(
            "not-json",
            format!("{name}: {problems}"),
        )]));
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
    parsed: &Parsed,
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
    message(name, value, parsed, arguments, library)
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

fn message(
    name: &str,
    value: &Value,
    parsed: &Parsed,
    arguments: &Validate,
    library: &Library,
) -> Result<Found, Problem> {
    let said = value.get("version").and_then(Value::as_str);
    let pack = match arguments.protocol.as_deref().or(said) {
        Some(version) => super::pack(library, Some(version))?,
        None => super::pack(library, None)?,
    };
    let Some(topic) = arguments.topic.as_deref().or_else(|| topic_of(value)) else {
        let diagnostic = Diagnostic::whole(
            "unknown-message",
            format!("{name} is JSON, but not a message that can be told by its members"),
        );
        return Ok(Found::Bad(vec![diagnostic.hint("say which with --topic")]));
    };
    let Some(schema) = pack.schema(topic) else {
        return Err(unknown_topic(topic, &pack).into());
    };
    let mut all: Vec<Diagnostic> = parsed
        .problems()
        .iter()
        .map(|problem| Diagnostic::whole("json", format!("{name}: {problem}")))
        .collect();
    all.extend(schema.findings(value).into_iter().map(|finding| {
        let place = if finding.path.is_empty() {
            "the message"
        } else {
            &finding.path
        };
        Diagnostic::whole("schema", format!("{name}: {place}: {}", finding.message))
    }));
    Ok(if all.is_empty() {
        Found::Good(format!("a valid {topic} message of VDA 5050 {}", pack.version))
    } else {
        Found::Bad(all)
    })
}

fn unknown_topic(topic: &str, pack: &Pack) -> Diagnostic {
    let names: Vec<&str> = pack.topics().iter().map(|rule| rule.name.as_str()).collect();
    let diagnostic = Diagnostic::whole("unknown-topic", format!("there is no topic `{topic}`"));
    diagnostic.hint(crate::diagnostic::did_you_mean(topic, names.iter().copied()))
}

/// The topic a message belongs to, by a member only it has.
fn topic_of(value: &Value) -> Option<&'static str> {
    let has = |name: &str| value.get(name).is_some();
    [
        ("nodeStates", "state"),
        ("nodes", "order"),
        ("actions", "instantActions"),
        ("connectionState", "connection"),
        ("typeSpecification", "factsheet"),
        ("agvPosition", "visualization"),
        ("velocity", "visualization"),
    ]
    .into_iter()
    .find(|(member, _)| has(member))
    .map(|(_, topic)| topic)
}
