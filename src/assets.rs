//! The suites and schemas the program was built with, and the library made of them and of a user's own.

use std::path::Path;

use include_dir::{Dir, DirEntry, include_dir};

use tck_base::diagnostic::Diagnostic;
use tck_judge::Library;
use tck_pack::{AssetFile, Assets};
use tck_simulate::Counterparts;

static SUITES: Dir<'static> = include_dir!("$CARGO_MANIFEST_DIR/suites");
static SCHEMAS: Dir<'static> = include_dir!("$CARGO_MANIFEST_DIR/schemas");
static COUNTERPARTS: Dir<'static> = include_dir!("$CARGO_MANIFEST_DIR/counterparts");

/// A folder of suites, laid out like `suites/`.
#[derive(Clone, Copy, Debug)]
pub enum Own<'a> {
    /// Its files stand beside the built-in ones.
    Added(&'a Path),
    /// Its files take the place of the built-in ones.
    Alone(&'a Path),
}

/// The files the program was built with.
#[must_use]
pub fn embedded() -> Assets {
    let mut files = Vec::new();
    embedded_files("suites", &SUITES, &mut files);
    embedded_files("schemas", &SCHEMAS, &mut files);
    Assets::built_in(files)
}

/// The protocol versions the program was built with, for devices that need no suites.
#[cfg(feature = "cli")]
pub(crate) fn embedded_versions() -> Assets {
    let mut files = Vec::new();
    embedded_files("schemas", &SCHEMAS, &mut files);
    Assets::built_in(files)
}

/// The counterparts the program was built with. Nothing is judged by them, so they are no part of the suites.
///
/// # Errors
/// Every mistake in their files.
pub fn counterparts() -> Result<Counterparts, Vec<Diagnostic>> {
    let mut files = Vec::new();
    embedded_files("counterparts", &COUNTERPARTS, &mut files);
    Counterparts::read(files.into_iter().map(|file| (file.path, file.text)))
}

/// The suites the program was built with and those of a folder, ready to judge by.
///
/// # Errors
/// Every mistake in the files of the folder.
pub fn library(own: Option<Own<'_>>) -> Result<Library, Vec<Diagnostic>> {
    let unreadable = |folder: &Path, error: std::io::Error| {
        let title = format!("the suites in {} cannot be read: {error}", folder.display());
        let hint = match error.kind() {
            std::io::ErrorKind::AlreadyExists => {
                "give the file another name, or use the folder alone, without the built-in suites, by --replace-suites"
            }
            _ => "give a folder that is laid out like `suites/` (`vda5050-tck init --suites DIR` writes one)",
        };
        vec![Diagnostic::whole("unreadable", title).hint(hint)]
    };
    let built_in = embedded();
    let assets = match own {
        None => built_in,
        Some(Own::Added(folder)) => built_in.with_added(folder).map_err(|error| unreadable(folder, error))?,
        Some(Own::Alone(folder)) => built_in
            .with_suites(folder)
            .map_err(|error| unreadable(folder, error))?,
    };
    if let Some(Own::Added(folder) | Own::Alone(folder)) = own {
        holds_suites(&assets, folder)?;
    }
    let of_assets = assets.clone();
    let given = |path: &str| of_assets.as_given(path);
    let as_given = |all: Vec<Diagnostic>| all.into_iter().map(|one| one.renamed(&given)).collect();
    Library::load(assets, tck_checks::REGISTRY).map_err(as_given)
}

/// Folders below `suites/` whose files test or judge something, and are not only used by others.
const DECIDING: [&str; 4] = ["agv/", "master-control/", "monitors/", "explore/"];

/// A folder of suites that holds none was not checked out, or is another one.
fn holds_suites(assets: &Assets, folder: &Path) -> Result<(), Vec<Diagnostic>> {
    let mut inside = assets.own().iter().filter_map(|path| path.strip_prefix("suites/"));
    if inside.any(|path| DECIDING.iter().any(|folder| path.starts_with(folder))) {
        return Ok(());
    }
    let title = format!(
        "{} holds no test, monitor or stimulus: they stand in {}",
        folder.display(),
        DECIDING.join(", ")
    );
    let hint = "is everything checked out? `vda5050-tck init --suites DIR` writes a folder that is laid out right";
    Err(vec![Diagnostic::whole("no-suites", title).hint(hint)])
}

fn embedded_files(root: &str, dir: &Dir<'static>, files: &mut Vec<AssetFile>) {
    for entry in dir.entries() {
        match entry {
            DirEntry::Dir(inner) => embedded_files(root, inner, files),
            DirEntry::File(file) => files.push(AssetFile {
                path: format!("{root}/{}", file.path().to_string_lossy().replace('\\', "/")),
                text: String::from_utf8_lossy(file.contents()).into_owned(),
            }),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_program_carries_the_files_of_its_source_tree() {
        let own = Assets::of_folder(Path::new(env!("CARGO_MANIFEST_DIR"))).expect("suites and schemas");
        assert_eq!(embedded().sha256(), own.sha256());
        // The program does not lint what it carries; as files of a folder they are.
        let linted = Library::load(own, crate::checks::REGISTRY);
        assert!(linted.is_ok_and(|library| !library.rules.suites.tests.is_empty()));
    }

    #[cfg(feature = "cli")]
    #[test]
    fn the_versions_alone_are_all_versions() {
        let versions = |assets: &Assets| {
            let packs = tck_pack::Packs::load(assets).expect("versions");
            packs
                .all()
                .iter()
                .map(|pack| pack.version.to_string())
                .collect::<Vec<_>>()
        };
        assert_eq!(versions(&embedded_versions()), versions(&embedded()));
    }

    #[test]
    fn the_counterparts_are_written_well() {
        let known = counterparts().unwrap_or_else(|all| panic!("{}", all[0].render(false)));
        for role in [tck_pack::Role::Agv, tck_pack::Role::MasterControl] {
            assert!(known.all().filter(|one| one.role == role).count() > 2, "{role}");
        }
        // A sentence each, with a reason where nothing comes of it.
        for habit in known.all().flat_map(|one| &one.habits) {
            assert!(habit.does.ends_with('.') && habit.place.len() > 10, "{habit:?}");
        }
    }
}
