//! `list language`: the complete reference of the language of suites, from the schema, the vocabularies of the protocol
//! versions and the registries of the program.

use std::fmt::Write as _;

use serde_json::{Value, json};

use tck_checks as checks;
use tck_judge::Library;
use tck_pack::HookEffect;
use tck_pack::Pack;
use tck_profile::VEHICLE_WORDS;
use tck_suite::{harness_topics, variables};

/// Parts of the schema that are no part of the language: they stand for it, or are filled in.
const NOT_SHOWN: [&str; 6] = ["filled", "step", "steps", "test", "state", "monitor"];

/// Something that has a name in the language.
struct Row {
    name: String,
    /// Whether it has to be there; of what may stand nowhere else nothing is said.
    required: bool,
    /// What may be written there.
    form: String,
    doc: String,
}

/// What belongs together.
struct Section {
    /// Below which heading it stands.
    part: &'static str,
    name: String,
    doc: String,
    /// What the columns are called.
    columns: [&'static str; 3],
    rows: Vec<Row>,
}

/// The reference as a page of Markdown.
pub fn page(library: &Library) -> Result<String, String> {
    let mut text =
        "# The language of suites\n\nWritten by `vda5050-tck list language` from what the program knows. A suite is \
         a file of YAML: a test, a state, or a monitor.\n"
            .to_owned();
    let mut part = "";
    for section in sections(library)? {
        if section.part != part {
            part = section.part;
            let _ = write!(text, "\n## {part}\n");
        }
        if !section.name.is_empty() {
            // A part may have the name of a step.
            let kind = if part == "Steps" { "Step " } else { "" };
            let _ = write!(text, "\n### {kind}{}\n", section.name);
        }
        if !section.doc.is_empty() {
            let _ = write!(text, "\n{}\n", section.doc);
        }
        if section.rows.is_empty() {
            continue;
        }
        let [name, form, doc] = section.columns;
        let has_form = section.rows.iter().any(|row| !row.form.is_empty());
        text += "\n";
        if has_form {
            let _ = writeln!(text, "| {name} | {form} | {doc} |\n|---|---|---|");
        } else {
            let _ = writeln!(text, "| {name} | {doc} |\n|---|---|");
        }
        for row in &section.rows {
            let must = if row.required { " (required)" } else { "" };
            let form = if has_form {
                format!(" {} |", cell(&row.form))
            } else {
                String::new()
            };
            let _ = writeln!(text, "| `{}`{must} |{form} {} |", row.name, cell(&row.doc));
        }
    }
    Ok(text)
}

/// The reference for programs: an object for each name.
pub fn objects(library: &Library) -> Result<Vec<Value>, String> {
    let all = sections(library)?.into_iter().flat_map(|section| {
        let Section { part, name, rows, .. } = section;
        rows.into_iter().map(move |row| {
            json!({ "part": part, "of": name, "name": row.name, "required": row.required, "form": row.form, "doc": row.doc })
        })
    });
    Ok(all.collect())
}

fn sections(library: &Library) -> Result<Vec<Section>, String> {
    let file = library.assets.get("schemas/suite.schema.json");
    let file = file.ok_or("the schema of suites is missing")?;
    let schema: Value = serde_json::from_str(&file.text).map_err(|error| error.to_string())?;
    let definitions = schema.get("$defs").and_then(Value::as_object);
    let definitions = definitions.ok_or("the schema of suites has no definitions")?;
    let keys = ["Key", "What stands there", "Meaning"];
    let section = |part: &'static str, name: &str, definition: &Value| Section {
        part,
        name: name.to_owned(),
        doc: words(definition),
        columns: keys,
        rows: rows("", definition),
    };
    let mut all = Vec::new();
    for name in ["test", "state", "monitor"] {
        all.extend(definitions.get(name).map(|found| section("Files", name, found)));
    }
    for (name, definition) in definitions {
        if let Some(verb) = name.strip_prefix("step-") {
            all.push(section("Steps", verb, definition));
        }
    }
    for (name, definition) in definitions {
        if NOT_SHOWN.contains(&name.as_str()) || name.starts_with("step-") || name == "pattern" {
            continue;
        }
        let mut part = section("Parts", name, definition);
        if part.rows.is_empty() {
            let form = form(definition);
            part.doc = [part.doc, form]
                .into_iter()
                .filter(|text| !text.is_empty())
                .collect::<Vec<_>>()
                .join(" Written as ");
        }
        all.push(part);
    }
    if let Some(pattern) = definitions.get("pattern") {
        all.push(Section {
            part: "Patterns",
            name: String::new(),
            doc: "A pattern is a picture of the part of a message that matters: of an object the members that are named, of \
                  anything else an equal value. In the place of a value may stand an operator."
                .to_owned(),
            columns: ["Operator", "What stands there", "Holds when"],
            rows: rows("", pattern),
        });
    }
    all.push(Section {
        part: "Variables",
        name: String::new(),
        doc:
            "Written as `${NAME}`. A part in capitals stands for a name. A monitor knows `time.`, `device.` and `vda.`."
                .to_owned(),
        columns: ["Variable", "", "Meaning"],
        rows: variables()
            .into_iter()
            .map(|variable| plain(&variable.name, "", &variable.doc))
            .collect(),
    });
    all.extend(library.rules.packs.all().iter().map(|pack| vocabulary(pack)));
    all.extend(topics(library));
    all.push(Section {
        part: "Named checks",
        name: String::new(),
        doc: "What a pattern cannot say. `check:` names one; `with:` hands over its arguments.".to_owned(),
        columns: ["Check", "Arguments", "What it holds"],
        rows: checks::REGISTRY
            .iter()
            .map(|check| {
                let doc = format!("{} Can decide {}.", check.doc, check.decides.join(", "));
                plain(check.name, &check.arguments.join(", "), &doc)
            })
            .collect(),
    });
    let hooks = &library.rules.hooks;
    all.push(Section {
        part: "Hooks",
        name: String::new(),
        doc: "What `operator:` can ask of a person or a machine.".to_owned(),
        columns: ["Hook", "Parameters", "What is done"],
        rows: hooks
            .all()
            .map(|hook| {
                let parameters: Vec<&str> = hook
                    .parameters
                    .iter()
                    .map(|parameter| parameter.name.as_str())
                    .collect();
                let doc = format!("{} ({})", hook.doc, hook.role);
                plain(&hook.name, &parameters.join(", "), &doc)
            })
            .collect(),
    });
    all.push(Section {
        part: "Hooks",
        name: "Effects".to_owned(),
        doc: "What a file below `hooks/` says under `effects`, so that the run and the checks know what follows from a hook."
            .to_owned(),
        columns: ["Effect", "Parameter", "What the program makes of it"],
        rows: HookEffect::ALL
            .iter()
            .map(|effect| plain(effect.word(), effect.parameter().unwrap_or_default(), effect.doc()))
            .collect(),
    });
    all.push(Section {
        part: "Commands for mock vehicles",
        name: String::new(),
        doc: "What `vehicle:` can ask of a mock vehicle, when a master control is tested.".to_owned(),
        columns: ["Command", "Parameters", "What the vehicle does"],
        rows: VEHICLE_WORDS
            .iter()
            .map(|word| plain(word.name, &word.parameters.join(", "), word.doc))
            .collect(),
    });
    Ok(all)
}

fn plain(name: &str, form: &str, doc: &str) -> Row {
    Row {
        name: name.to_owned(),
        required: false,
        form: form.to_owned(),
        doc: doc.to_owned(),
    }
}

/// The words of a version that suites reach as `${vda.…}`.
fn vocabulary(pack: &Pack) -> Section {
    let mut rows = Vec::new();
    leaves("vda", pack.vocabulary(), &mut rows);
    Section {
        part: "Variables",
        name: format!("Words of VDA 5050 {}", pack.version),
        doc: String::new(),
        columns: ["Variable", "", "Stands for"],
        rows,
    }
}

fn leaves(path: &str, value: &Value, rows: &mut Vec<Row>) {
    match value {
        Value::Object(members) if !members.is_empty() => {
            for (name, member) in members {
                leaves(&format!("{path}.{name}"), member, rows);
            }
        }
        Value::Object(_) => rows.push(plain(path, "", "anything: the text names no word here")),
        other => rows.push(plain(path, "", &format!("`{other}`"))),
    }
}

/// The topics of each version by who publishes them, and those of the harness.
fn topics(library: &Library) -> Vec<Section> {
    let mut all = Vec::new();
    for pack in library.rules.packs.all() {
        let rows = pack.topics().iter();
        all.push(Section {
            part: "Topics",
            name: format!("VDA 5050 {}", pack.version),
            doc: String::new(),
            columns: ["Topic", "", "Published by"],
            rows: rows
                .map(|topic| plain(topic.name.as_str(), "", topic.publisher.word()))
                .collect(),
        });
    }
    let rows = harness_topics().map(|(topic, path, kind, words)| {
        let words: Vec<String> = words.iter().map(|word| format!("`{word}`")).collect();
        plain(&format!("{topic}: {path}"), kind, &words.join(", "))
    });
    all.push(Section {
        part: "Topics",
        name: "Of the harness".to_owned(),
        doc: "What the harness sees of the connection, and of the downloads of maps.".to_owned(),
        columns: ["Topic and member", "Kind", "Only"],
        rows: rows.collect(),
    });
    all
}

/// The members of an object, and of objects in it that have no name of their own.
fn rows(prefix: &str, definition: &Value) -> Vec<Row> {
    let required = |name: &str| {
        let names = definition.get("required").and_then(Value::as_array);
        names.is_some_and(|names| names.iter().any(|one| one == name))
    };
    let properties = definition.get("properties").and_then(Value::as_object);
    let mut all = Vec::new();
    for (name, member) in properties.into_iter().flatten() {
        let full = format!("{prefix}{name}");
        all.push(Row {
            required: required(name),
            form: form(member),
            doc: words(member),
            name: full.clone(),
        });
        let inner = alternatives(member).chain(member.get("items"));
        for inner in inner.filter(|inner| inner.get("properties").is_some()) {
            all.extend(rows(&format!("{full}."), inner));
        }
    }
    all
}

/// The schema itself, or those of which one has to hold.
fn alternatives(schema: &Value) -> impl Iterator<Item = &Value> {
    let any = ["anyOf", "oneOf"].iter().find_map(|name| schema.get(*name)?.as_array());
    let itself = any.is_none().then_some(schema);
    itself.into_iter().chain(any.into_iter().flatten())
}

/// What a schema says in words, and those it consists of.
fn words(schema: &Value) -> String {
    let own = schema.get("description").and_then(Value::as_str);
    let of_parts = alternatives(schema).filter_map(|one| one.get("description")?.as_str());
    let mut all: Vec<&str> = own.into_iter().chain(of_parts).collect();
    all.dedup();
    all.join(" ")
}

/// What may be written there.
fn form(schema: &Value) -> String {
    if let Some(target) = schema.get("$ref").and_then(Value::as_str) {
        let name = target.rsplit('/').next().unwrap_or(target);
        return match name {
            // Filled in before the file is read.
            "filled" => String::new(),
            "pattern" => "a [pattern](#patterns)".to_owned(),
            "step" => "a [step](#steps)".to_owned(),
            "steps" => "a list of [steps](#steps)".to_owned(),
            name => format!("[{name}](#{name})"),
        };
    }
    let list = |member: &str| schema.get(member).and_then(Value::as_array);
    if let Some(words) = list("enum") {
        let words: Vec<String> = words.iter().map(|word| format!("`{}`", text(word))).collect();
        return words.join(", ");
    }
    if list("anyOf").or_else(|| list("oneOf")).is_some() {
        let mut all: Vec<String> = alternatives(schema).map(form).filter(|form| !form.is_empty()).collect();
        all.dedup();
        return all.join(", or ");
    }
    if let Some(items) = schema.get("items") {
        return format!("a list, each {}", form(items));
    }
    if let Some(values) = schema.get("additionalProperties").filter(|values| values.is_object()) {
        return format!("names, each with {}", form(values));
    }
    let examples: Vec<String> = list("examples")
        .into_iter()
        .flatten()
        .map(|one| format!("`{}`", text(one)))
        .collect();
    let kinds: Vec<&str> = match schema.get("type") {
        Some(Value::String(kind)) => vec![kind],
        Some(Value::Array(kinds)) => kinds.iter().filter_map(Value::as_str).collect(),
        _ => Vec::new(),
    };
    let pattern = schema.get("pattern").and_then(Value::as_str);
    let kinds: Vec<&str> = kinds.into_iter().map(kind).collect();
    let mut text = kinds.join(" or ");
    if !examples.is_empty() {
        let _ = write!(text, " such as {}", examples.join(", "));
    } else if let Some(pattern) = pattern {
        let _ = write!(text, " of the form `{pattern}`");
    }
    text.trim().to_owned()
}

fn kind(name: &str) -> &str {
    match name {
        "string" => "a text",
        "integer" => "a whole number",
        "number" => "a number",
        "boolean" => "`true` or `false`",
        "object" => "a mapping",
        "array" => "a list",
        other => other,
    }
}

fn text(value: &Value) -> String {
    value.as_str().map_or_else(|| value.to_string(), str::to_owned)
}

/// A text in a cell of a table.
fn cell(text: &str) -> String {
    text.replace('\n', " ").replace('|', "\\|")
}
