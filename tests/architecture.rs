//! The shape of the program, held by a test: dependencies point one way, and what is named stays in its place.
#![allow(
    clippy::expect_used,
    clippy::panic,
    clippy::unwrap_used,
    reason = "a test may fail by panicking"
)]

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

/// Rooms by layer; an arrow may point to the same layer or down, never up, and there are no circles on one layer. A room
/// is a crate below `crates/`, a folder of the two crates that hold several (`base` and `net`), or a folder of the program.
const LAYERS: [(&str, u8); 47] = [
    ("main", 6),
    ("cli", 6),
    ("ui", 6),
    ("assets", 6),
    ("facade", 6),
    ("run", 5),
    ("qualify", 5),
    ("audit", 5),
    ("campaign", 5),
    ("history", 5),
    ("watch", 5),
    ("simulate", 5),
    ("report", 5),
    ("explore", 5),
    ("engine", 4),
    ("judge", 4),
    ("reference", 4),
    ("capture", 3),
    ("result", 3),
    ("link", 3),
    ("bench", 3),
    ("broker", 3),
    ("tap", 3),
    ("maps", 3),
    ("page", 3),
    ("wire", 3),
    ("suite", 2),
    ("checks", 2),
    ("check", 2),
    ("world", 2),
    ("journal", 1),
    ("pack", 1),
    ("profile", 1),
    ("course", 1),
    ("verdict", 0),
    ("diagnostic", 0),
    ("clock", 0),
    ("device", 0),
    ("yaml", 0),
    ("nurbs", 0),
    ("polygon", 0),
    ("pattern", 0),
    ("secrets", 0),
    ("shard", 0),
    ("view", 0),
    ("time", 0),
    ("lib", 7),
];

/// The rooms that share a crate with others: of the crates of several rooms and of the program.
const HELD_TOGETHER: [&str; 22] = [
    "main",
    "facade",
    "cli",
    "ui",
    "assets",
    "lib",
    "bench",
    "broker",
    "link",
    "maps",
    "tap",
    "clock",
    "device",
    "diagnostic",
    "nurbs",
    "pattern",
    "polygon",
    "secrets",
    "shard",
    "time",
    "verdict",
    "yaml",
];

/// Crates that hold several rooms, each a folder or file of its own.
const OF_SEVERAL_ROOMS: [&str; 2] = ["base", "net"];

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// Every source of the program and of the crates it is made of, but those that only serve tests.
fn sources() -> Vec<(PathBuf, String)> {
    let crates = std::fs::read_dir(root().join("crates")).expect("crates is readable");
    let mut open: Vec<PathBuf> = crates
        .map(|entry| entry.expect("entry").path())
        .filter(|path| {
            !path
                .file_name()
                .expect("a name")
                .to_string_lossy()
                .starts_with("testing")
        })
        .map(|path| path.join("src"))
        .collect();
    open.push(root().join("src"));
    let mut all = Vec::new();
    while let Some(folder) = open.pop() {
        for entry in std::fs::read_dir(&folder).expect("sources are readable") {
            let path = entry.expect("entry").path();
            if path.is_dir() {
                open.push(path);
            } else if path.extension().is_some_and(|extension| extension == "rs") {
                let text = std::fs::read_to_string(&path).expect("source");
                all.push((path, text));
            }
        }
    }
    all.retain(|(path, _)| {
        !OF_SEVERAL_ROOMS
            .iter()
            .any(|name| path.ends_with(format!("crates/{name}/src/lib.rs")))
    });
    assert!(all.len() > 500, "the sources were not found");
    all
}

/// Where a file stands: room, then folders below it. `judge/window.rs` for `crates/judge/src/window.rs`, `tap/pump.rs` for
/// `crates/net/src/tap/pump.rs`, `cli/run.rs` for `src/cli/run/mod.rs`.
fn in_room(path: &Path) -> String {
    let below = path.strip_prefix(root()).expect("below the root").display().to_string();
    if let Some(program) = below.strip_prefix("src/") {
        return program.to_owned();
    }
    let below = below.strip_prefix("crates/").expect("a crate");
    let (name, file) = below.split_once("/src/").expect("a source of a crate");
    if OF_SEVERAL_ROOMS.contains(&name) {
        file.to_owned()
    } else {
        format!("{name}/{file}")
    }
}

/// The room of a file.
fn module(path: &Path) -> String {
    let place = in_room(path);
    let first = place.split('/').next().expect("a component");
    first.trim_end_matches(".rs").to_owned()
}

/// Code lines with their numbers: no comments, and no unit tests. A test module in a file of its own is named in one
/// line, and code goes on after it; an inline one is the end of its file.
fn code(text: &str) -> impl Iterator<Item = (usize, &str)> {
    let mut lines = text.lines().enumerate().peekable();
    let mut ended = false;
    std::iter::from_fn(move || {
        while !ended {
            let (at, line) = lines.next()?;
            if line.starts_with("#[cfg(test)]") {
                while lines.next_if(|(_, line)| line.starts_with("#[")).is_some() {}
                let declared = lines.next();
                ended = declared.is_some_and(|(_, line)| line.ends_with('{'));
                continue;
            }
            if !line.trim_start().starts_with("//") {
                return Some((at + 1, line));
            }
        }
        None
    })
}

fn is_test_file(path: &Path) -> bool {
    let name = in_room(path);
    // The last one writes the records that the checks are tried with.
    let endings = ["tests.rs", "properties.rs", "checks/trace.rs"];
    endings.iter().any(|ending| name.ends_with(ending)) || name.contains("/tests/")
}

/// A file as a module: `judge::step` for `judge/step/mod.rs`, `judge::step::weigh` for `judge/step/weigh.rs`.
type Module = Vec<String>;

/// Which modules each module names, by `crate::`, `super::` and `self::`. What a file names of its own ancestors is not
/// among it: a folder and its parts are one thing.
fn arrows() -> BTreeMap<Module, BTreeSet<Module>> {
    let files: BTreeMap<Module, String> = sources()
        .into_iter()
        .filter(|(path, _)| !is_test_file(path))
        .map(|(path, text)| {
            let name = in_room(&path);
            let name = name
                .trim_end_matches(".rs")
                .trim_end_matches("/mod")
                .trim_end_matches("/lib");
            let lines: Vec<&str> = code(&text).map(|(_, line)| line).collect();
            (name.split('/').map(str::to_owned).collect(), lines.join("\n"))
        })
        .filter(|(module, _): &(Module, String)| !matches!(module[0].as_str(), "lib" | "main"))
        .collect();
    let named = |module: &Module, text: &str| {
        let declared = text.lines().filter_map(|line| {
            let (_, name) = line.split_once("mod ")?;
            Some([module.clone(), vec![name.strip_suffix(';')?.to_owned()]].concat())
        });
        let paths = paths(text).into_iter().map(|path| absolute(module, path));
        let known = |mut path: Module| {
            while !path.is_empty() && !files.contains_key(&path) {
                path.pop();
            }
            path
        };
        let others = declared.chain(paths).map(known);
        others
            .filter(|other| !other.is_empty() && !module.starts_with(other))
            .collect()
    };
    let all: BTreeMap<Module, BTreeSet<Module>> = files
        .iter()
        .map(|(module, text)| (module.clone(), named(module, text)))
        .collect();
    assert!(
        all.values().map(BTreeSet::len).sum::<usize>() > 500,
        "the paths were not read"
    );
    all
}

/// All paths of a text that begin with `crate`, `super`, `self` or a crate of ours, with the lists in braces written out.
fn paths(text: &str) -> Vec<Vec<String>> {
    let mut all = Vec::new();
    let is_word = |c: char| c.is_alphanumeric() || c == '_';
    for word in ["crate", "super", "self", "tck_"] {
        let begins = if word == "tck_" {
            word.to_owned()
        } else {
            format!("{word}::")
        };
        for (at, _) in text.match_indices(&begins) {
            if text[..at].ends_with(|c: char| is_word(c) || c == ':') {
                continue;
            }
            let rest = &text[at..];
            let mut end = 0;
            loop {
                let part: usize = rest[end..]
                    .chars()
                    .take_while(|c| is_word(*c))
                    .map(char::len_utf8)
                    .sum();
                end += part;
                match rest[end..].strip_prefix("::") {
                    Some(more) if part > 0 && more.starts_with(|c: char| is_word(c) || c == '{') => end += 2,
                    _ => break,
                }
            }
            let begin: Vec<String> = rest[..end]
                .split("::")
                .filter(|part| !part.is_empty())
                .map(str::to_owned)
                .collect();
            if rest[end..].starts_with('{') {
                write_out(&begin, &rest[end..], &mut all);
            } else {
                all.push(begin);
            }
        }
    }
    all
}

/// `{a::B, c::{D, E}}` after `begin`; returns how long it was.
fn write_out(begin: &[String], list: &str, all: &mut Vec<Vec<String>>) -> usize {
    let mut here = begin.to_vec();
    let mut word = String::new();
    let mut at = 1;
    while let Some(c) = list[at..].chars().next() {
        match c {
            '{' => {
                at += write_out(&here, &list[at..], all);
                here.truncate(begin.len());
                continue;
            }
            ':' if !word.is_empty() => here.push(std::mem::take(&mut word)),
            ',' | '}' => {
                if !word.is_empty() {
                    here.push(std::mem::take(&mut word));
                    all.push(here.clone());
                }
                here.truncate(begin.len());
                if c == '}' {
                    return at + 1;
                }
            }
            c if c.is_whitespace() || c == ':' => {}
            c => word.push(c),
        }
        at += c.len_utf8();
    }
    at
}

/// A path as the crate's root sees it.
fn absolute(module: &Module, path: Vec<String>) -> Module {
    if let Some(name) = path[0].strip_prefix("tck_") {
        let own = (!OF_SEVERAL_ROOMS.contains(&name)).then(|| name.to_owned());
        return own.into_iter().chain(path[1..].iter().cloned()).collect();
    }
    if path[0] == "crate" {
        // The root of a crate that is one room is that room; the others hold rooms.
        let room = module[0].as_str();
        let own = !HELD_TOGETHER.contains(&room);
        return own
            .then(|| room.to_owned())
            .into_iter()
            .chain(path[1..].iter().cloned())
            .collect();
    }
    let ups = path
        .iter()
        .take_while(|part| matches!(part.as_str(), "super" | "self"))
        .count();
    let supers = path
        .iter()
        .take_while(|part| matches!(part.as_str(), "super" | "self"))
        .filter(|part| *part == "super")
        .count();
    let kept = module.len().saturating_sub(supers);
    [&module[..kept], &path[ups..]].concat()
}

/// The places that can be reached from themselves.
fn in_circles(arrows: &BTreeMap<Module, BTreeSet<Module>>) -> Vec<String> {
    let reached = |from: &Module| {
        let mut seen = BTreeSet::new();
        let mut open: Vec<&Module> = arrows[from].iter().collect();
        while let Some(at) = open.pop() {
            if seen.insert(at) {
                open.extend(arrows.get(at).into_iter().flatten());
            }
        }
        seen.contains(from)
    };
    arrows
        .keys()
        .filter(|from| reached(from))
        .map(|module| module.join("::"))
        .collect()
}

#[test]
fn dependencies_point_down() {
    let layers: BTreeMap<&str, u8> = LAYERS.into_iter().collect();
    let mut wrong = Vec::new();
    for (from, others) in arrows() {
        let here = from[0].as_str();
        let own = layers
            .get(here)
            .unwrap_or_else(|| panic!("{here} has no layer in this test"));
        for to in others {
            let layer = layers
                .get(to[0].as_str())
                .unwrap_or_else(|| panic!("{} has no layer in this test", to[0]));
            if layer > own {
                wrong.push(format!(
                    "{} (layer {own}) names {} (layer {layer})",
                    from.join("::"),
                    to.join("::")
                ));
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn no_rooms_stand_in_a_circle() {
    let mut rooms: BTreeMap<Module, BTreeSet<Module>> = BTreeMap::new();
    for (from, others) in arrows() {
        let room = rooms.entry(vec![from[0].clone()]).or_default();
        room.extend(
            others
                .into_iter()
                .filter(|to| to[0] != from[0])
                .map(|to| vec![to[0].clone()]),
        );
    }
    let circles = in_circles(&rooms);
    assert!(
        circles.is_empty(),
        "rooms that depend on themselves: {}",
        circles.join(", ")
    );
}

/// Rooms whose parts know each other both ways: a device is one state machine, told in chapters.
const TOLD_IN_CHAPTERS: [&str; 1] = ["reference"];

#[test]
fn no_files_of_a_room_stand_in_a_circle() {
    let mut arrows = arrows();
    arrows.retain(|module, _| !TOLD_IN_CHAPTERS.contains(&module[0].as_str()));
    let circles = in_circles(&arrows);
    assert!(
        circles.is_empty(),
        "files that depend on themselves: {}",
        circles.join(", ")
    );
}

#[test]
fn the_reading_of_paths_misses_none() {
    let text =
        "use crate::a::{b::C, d::{self, E},\n    F};\nlet x = super::g::h(); self::i();\nlet crate_name = mycrate::x;";
    let found: Vec<String> = paths(text).iter().map(|path| path.join("::")).collect();
    assert_eq!(
        found,
        [
            "crate::a::b::C",
            "crate::a::d::self",
            "crate::a::d::E",
            "crate::a::F",
            "super::g::h",
            "self::i"
        ]
    );
    let file =
        "//! Doc.\n#[cfg(test)]\nmod tests;\nuse crate::x;\n// no\n#[cfg(test)]\nmod inline {\nuse crate::y;\n}\n";
    let seen: Vec<&str> = code(file).map(|(_, line)| line).collect();
    assert_eq!(seen, ["use crate::x;"]);
    let circle = |ends: &[(&str, &str)]| {
        let mut arrows: BTreeMap<Module, BTreeSet<Module>> = BTreeMap::new();
        for (from, to) in ends {
            arrows
                .entry(vec![(*from).to_owned()])
                .or_default()
                .insert(vec![(*to).to_owned()]);
        }
        in_circles(&arrows)
    };
    assert_eq!(circle(&[("a", "b"), ("b", "c"), ("c", "b")]), ["b", "c"]);
    assert!(circle(&[("a", "b"), ("b", "c")]).is_empty());
}

#[test]
fn the_judging_side_knows_no_clock_and_no_runtime() {
    let forbidden = [
        "tokio",
        "Instant::now",
        "SystemTime",
        "WallClock",
        "Timestamp::now",
        "std::thread::sleep",
    ];
    refuse(
        &["judge", "pattern", "check", "checks", "world", "report", "reference"],
        &forbidden,
        &[],
    );
}

#[test]
fn libraries_stay_in_their_place() {
    let everywhere: Vec<&str> = LAYERS.iter().map(|(name, _)| *name).collect();
    refuse(
        &everywhere,
        &["rumqttc"],
        &["bench/client.rs", "bench/flow.rs", "bench/light.rs"],
    );
    refuse(&everywhere, &["mqtt5::", "mqtt5_protocol"], &["broker", "tap", "wire"]);
    refuse(&everywhere, &["saphyr"], &["yaml.rs"]);
    refuse(&everywhere, &["junit_report"], &["report/junit"]);
}

#[test]
fn versions_are_data() {
    let mut wrong = Vec::new();
    for (path, text) in sources().into_iter().filter(|(path, _)| !is_test_file(path)) {
        for (line, content) in code(&text) {
            for digit in ["\"1.", "\"2.", "\"3."] {
                for rest in content.split(digit).skip(1) {
                    let version = rest.split('"').next().unwrap_or("");
                    if !version.is_empty() && version.chars().all(|c| c.is_ascii_digit() || c == '.') {
                        wrong.push(format!(
                            "{}:{line}: a version literal {digit}{version}\"",
                            in_room(&path)
                        ));
                    }
                }
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// The text literals that a line looks for in another text.
fn looked_for(line: &str) -> impl Iterator<Item = &str> {
    const CALLS: [&str; 7] = [
        "starts_with(\"",
        "ends_with(\"",
        "contains(\"",
        "strip_prefix(\"",
        "strip_suffix(\"",
        "split_once(\"",
        "split(\"",
    ];
    let behind = CALLS.iter().flat_map(|call| line.split(call).skip(1));
    behind.filter_map(|rest| rest.split('"').next())
}

/// The rooms that make, carry and show results. Elsewhere the sentences of libraries are read that give no type.
const ROOMS_OF_RESULTS: [&str; 10] = [
    "run", "judge", "result", "report", "audit", "history", "watch", "explore", "cli", "ui",
];

#[test]
fn sentences_are_displayed_and_never_taken_apart() {
    let is_sentence = |text: &str| {
        let words: Vec<&str> = text.split(' ').filter(|word| word.len() > 1).collect();
        words.len() > 1 && words.iter().all(|word| word.chars().all(|c| c.is_ascii_alphabetic()))
    };
    assert!(looked_for("if why.starts_with(\"there is no factsheet \") {").any(is_sentence));
    assert!(looked_for("None if why.starts_with(\"not applicable\") => x").any(is_sentence));
    assert!(!looked_for("name.strip_prefix(\"time.\") || line.contains(\" = \")").any(is_sentence));
    let is_meant = |path: &Path| ROOMS_OF_RESULTS.contains(&in_room(path).split('/').next().unwrap_or_default());
    let mut wrong = Vec::new();
    for (path, text) in sources()
        .into_iter()
        .filter(|(path, _)| is_meant(path) && !is_test_file(path))
    {
        for (line, content) in code(&text) {
            for found in looked_for(content).filter(|found| is_sentence(found)) {
                wrong.push(format!("{}:{line}: looks for {found:?} in a sentence", in_room(&path)));
            }
        }
    }
    assert!(wrong.is_empty(), "match on a type instead:\n{}", wrong.join("\n"));
}

#[test]
fn incoming_messages_stay_values() {
    // Typed structs would repair what has to be detected: only the journal's own records, the results, the
    // profile, the packs and the grammars of explore are deserialized into types.
    let allowed = [
        "journal", "result", "report", "profile", "pack", "course", "verdict", "clock", "bench", "explore",
    ];
    let mut wrong = Vec::new();
    for (path, text) in sources() {
        for (line, content) in code(&text) {
            if content.contains("derive(")
                && content.contains("Deserialize")
                && !allowed.contains(&module(&path).as_str())
                // A master control reads of a state what it needs, and judges nothing; the others are parts of the result of an audit or a qualification.
                && ![
                    "reference/master_control/seen.rs",
                    "audit/result.rs",
                    "audit/saved.rs",
                    "audit/time_line.rs",
                    "audit/time_stretch.rs",
                    "qualify/decider.rs",
                    "qualify/saved.rs",
                    // What a version calls members is a part of its pack.
                    "view/names/details.rs",
                ]
                    .contains(&in_room(&path).as_str())
            {
                wrong.push(format!("{}:{line}: {}", in_room(&path), content.trim()));
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn every_module_says_what_it_is_for() {
    let silent: Vec<String> = sources()
        .iter()
        .filter(|(path, text)| !text.starts_with("//!") && !is_test_file(path))
        .map(|(path, _)| in_room(path))
        .collect();
    assert!(silent.is_empty(), "{silent:?}");
}

/// Whether the text of a comment needs what stands around it: it goes on from the line before, or only begins.
fn leans_on_others(comment: &str) -> bool {
    let bare = comment.trim_end_matches(['.', ',', ':']);
    comment.starts_with("The same")
        || comment.starts_with("See the module")
        || comment.starts_with('…')
        || bare.ends_with('…')
}

#[test]
fn documentation_stands_alone() {
    for leaning in [
        "The same with two vehicles.",
        "See the module.",
        "… and to the other side.",
        "Up to here …",
    ] {
        assert!(leans_on_others(leaning));
    }
    assert!(!leans_on_others("What `${each.…}` names."));
    let mut wrong = Vec::new();
    for (path, text) in sources() {
        let lines = || text.lines().map(str::trim);
        let before = std::iter::once("").chain(lines());
        for (at, (before, line)) in before.zip(lines()).enumerate() {
            let of = |line: &str| line.starts_with("///") || line.starts_with("//!");
            if of(line) && (!of(before) && leans_on_others(line[3..].trim()) || line.ends_with('…')) {
                wrong.push(format!("{}:{}: {line}", in_room(&path), at + 1));
            }
        }
    }
    assert!(wrong.is_empty(), "say what it is:\n{}", wrong.join("\n"));
}

/// No code line of these modules names one of these words, but in these places.
fn refuse(modules: &[&str], words: &[&str], places: &[&str]) {
    let mut wrong = Vec::new();
    for (path, text) in sources()
        .iter()
        .filter(|(path, _)| modules.contains(&module(path).as_str()))
    {
        let name = in_room(path);
        if places.iter().any(|place| name.starts_with(place)) {
            continue;
        }
        for (line, content) in code(text) {
            for word in words {
                if content.contains(word) {
                    wrong.push(format!("{name}:{line}: names {word}"));
                }
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// Who knows hooks by name: the devices that do what they ask for, and the words of mock vehicles, some of which sound alike.
const DOES_HOOKS: [&str; 3] = ["reference/", "simulate/", "profile/vehicle.rs"];

/// Words of other lists that a hook has, too.
const NAMED_ALIKE: [(&str, &str); 1] = [("watch/alarm.rs", "emergency-stop")];

/// What a hook does stands in its file. A name in the code would be right for the built-in hook alone, and one that no hook has
/// would never be found.
#[test]
fn no_code_but_the_devices_knows_a_hook_by_its_name() {
    let assets = vda5050_tck::embedded();
    let hooks = vda5050_tck::pack::Hooks::load(&assets).expect("hooks");
    let names: BTreeSet<&str> = hooks.all().map(|hook| hook.name.as_str()).collect();
    let mut wrong = Vec::new();
    for (path, text) in sources() {
        let place = in_room(&path);
        if is_test_file(&path) || DOES_HOOKS.iter().any(|device| place.starts_with(device)) {
            continue;
        }
        for (at, line) in code(&text) {
            let quoted = line.split('"').skip(1).step_by(2);
            // A word of one part may be another one's: `start`, `cancel`, `pause`.
            let named = |word: &str| names.contains(word) && (word.contains('-') || line.contains("hook"));
            let named = quoted.filter(|word| named(word) && !NAMED_ALIKE.contains(&(place.as_str(), *word)));
            wrong.extend(named.map(|word| format!("{place}:{at}: {word}")));
        }
    }
    assert!(
        wrong.is_empty(),
        "ask for an effect, `HookEffect` of tck-pack:\n{}",
        wrong.join("\n")
    );
}
