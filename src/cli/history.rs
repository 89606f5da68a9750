//! `history`: what became of every requirement over many runs.

use std::collections::BTreeMap;
use std::path::{Component, Path, PathBuf};

use super::args::{Format, History as Arguments, HistoryKind};
use super::exit::Exit;
use super::problem::Problem;
use tck_base::diagnostic::Diagnostic;
use tck_history::{GatherError, History, gather, markdown, page, text};
use tck_report::sources::Sources;
use tck_run::{sources, write_whole};

/// `history`.
pub fn history(arguments: &Arguments) -> Result<Exit, Problem> {
    let history = gather(&arguments.folder).map_err(unreadable)?;
    let wants_html = arguments
        .renderings
        .iter()
        .any(|wanted| wanted.kind == HistoryKind::Html);
    let known = if wants_html {
        catalogues(&history, arguments)?
    } else {
        BTreeMap::new()
    };
    for wanted in &arguments.renderings {
        let text = match wanted.kind {
            HistoryKind::Html => {
                let base = way(wanted.file.as_deref(), &arguments.folder);
                page::render(&history, &known, &base).map_err(|error| Problem::Environment(error.to_string()))?
            }
            HistoryKind::Markdown => markdown::markdown(&history),
            HistoryKind::Json => json(&history)?,
        };
        match &wanted.file {
            Some(file) => {
                write_whole(file, text.as_bytes()).map_err(|error| Problem::Environment(error.to_string()))?;
            }
            None => {
                super::print(&text)?;
            }
        }
    }
    // Standard output holds one of them.
    if arguments.renderings.iter().all(|wanted| wanted.file.is_some()) {
        super::print(&match arguments.format {
            Format::Text => text::text(&history),
            Format::Json => json(&history)?,
        })?;
    }
    Ok(if history.series.is_empty() {
        super::tell(&format!(
            "below {} is no bundle that can be taken",
            arguments.folder.display()
        ));
        Exit::NothingToDo
    } else {
        Exit::Conforms
    })
}

fn json(history: &History) -> Result<String, Problem> {
    let text = serde_json::to_string_pretty(history).map_err(|error| Problem::Environment(error.to_string()))?;
    Ok(text + "\n")
}

/// What the catalogue says in each version that a series is of; of a version that is not known it says nothing.
fn catalogues(history: &History, arguments: &Arguments) -> Result<BTreeMap<String, Sources>, Problem> {
    let library = crate::assets::library(arguments.suites.own())?;
    let mut all = BTreeMap::new();
    for series in &history.series {
        if let (false, Some(pack)) = (
            all.contains_key(&series.protocol),
            library.rules.packs.get(&series.protocol),
        ) {
            all.insert(series.protocol.clone(), sources(&library, pack));
        }
    }
    Ok(all)
}

fn unreadable(error: GatherError) -> Problem {
    let hint = "give the folder below which the bundles of runs and audits lie, such as `reports`";
    Diagnostic::whole("history", error.to_string()).hint(hint).into()
}

/// The way from the folder of a page to the folder of the bundles, with `/` at its end; a page on standard output is taken to
/// go into the current folder.
fn way(file: Option<&Path>, folder: &Path) -> String {
    let parent = file
        .and_then(Path::parent)
        .filter(|parent| !parent.as_os_str().is_empty());
    let whole = |path: &Path| path.canonicalize().or_else(|_| std::path::absolute(path)).ok();
    let (Some(from), Some(to)) = (whole(parent.unwrap_or(Path::new("."))), whole(folder)) else {
        return String::new();
    };
    between(&from, &to)
}

/// The way from one folder to another, both from the root.
fn between(from: &Path, to: &Path) -> String {
    let parts = |path: &Path| {
        path.components()
            .map(|part: Component<'_>| part.as_os_str().to_owned())
            .collect::<Vec<_>>()
    };
    let (from, to) = (parts(from), parts(to));
    let shared = from.iter().zip(&to).take_while(|(one, other)| one == other).count();
    let mut way: PathBuf = from[shared..].iter().map(|_| "..").collect();
    way.extend(&to[shared..]);
    match way.to_string_lossy().replace('\\', "/") {
        way if way.is_empty() => way,
        way => format!("{way}/"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_page_finds_the_bundles_from_where_it_lies() {
        for (from, to, way) in [
            ("/a/reports", "/a/reports", ""),
            ("/a", "/a/reports", "reports/"),
            ("/a/out", "/a/reports", "../reports/"),
            ("/a/out/b", "/a", "../../"),
        ] {
            assert_eq!(between(Path::new(from), Path::new(to)), way, "{from} {to}");
        }
    }
}
