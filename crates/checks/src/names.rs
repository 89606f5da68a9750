//! Names of members stand in the views alone: what reads a message by a name falls silent in a version that renames it.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

use tck_view::Field;

/// Every source of a folder, but those that only serve tests.
fn sources(folder: &Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for entry in fs::read_dir(folder).expect("sources are readable") {
        let path = entry.expect("entry").path();
        let name = path.file_name().expect("name").to_string_lossy().into_owned();
        if path.is_dir() && name != "tests" {
            found.extend(sources(&path));
        } else if path.extension().is_some_and(|extension| extension == "rs")
            && !matches!(name.as_str(), "tests.rs" | "trace.rs" | "known_members.rs")
        {
            found.push(path);
        }
    }
    found
}

/// The names that a source looks up in JSON values.
fn looked_up(source: &str) -> Vec<&str> {
    let (source, _) = source.split_once("#[cfg(test)]").unwrap_or((source, ""));
    let calls = [
        "get(",
        "pointer(",
        "elements(",
        "text(",
        "number(",
        "kept(",
        "short(",
        "finite(",
    ];
    let arguments = calls.iter().flat_map(|call| {
        let after = source.match_indices(call).map(|(at, _)| &source[at + call.len()..]);
        after.filter_map(|rest| Some(rest.split_once(')')?.0))
    });
    // The name is the last argument, in quotes; of a pointer it is a path.
    let names = arguments.filter_map(|arguments| arguments.trim_end().strip_suffix('"')?.rsplit_once('"'));
    names.flat_map(|(_, name)| name.split('/')).collect()
}

#[test]
fn names_are_found_where_they_are_looked_up() {
    let source =
        r#"message.get("orderId")?; text(state, "driving"); state.pointer("/safetyState/eStop"); quote("maps")"#;
    let found: BTreeSet<&str> = looked_up(source).into_iter().filter(|name| !name.is_empty()).collect();
    assert_eq!(found, BTreeSet::from(["driving", "eStop", "orderId", "safetyState"]));
}

#[test]
fn no_message_is_read_by_the_names_of_its_members() {
    let members: BTreeSet<&str> = Field::all().map(Field::usual_name).collect();
    let crates = Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("crates/");
    let mut wrong = Vec::new();
    for folder in [
        "audit", "checks", "engine", "explore", "judge", "report", "run", "watch", "world",
    ]
    .map(|room| format!("{room}/src"))
    {
        for path in sources(&crates.join(folder)) {
            let name = path
                .strip_prefix(crates)
                .expect("below crates/")
                .to_string_lossy()
                .replace('\\', "/");
            let source = fs::read_to_string(&path).expect("text");
            let named = looked_up(&source).into_iter().filter(|name| members.contains(name));
            wrong.extend(named.map(|member| format!("{name}: {member}")));
        }
    }
    assert!(
        wrong.is_empty(),
        "read it from the view of the message:\n{}",
        wrong.join("\n")
    );
}
