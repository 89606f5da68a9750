//! The files of `suites/` and `schemas/`, replaceable by a directory.

use std::collections::BTreeSet;
use std::io;
use std::path::{Path, PathBuf};

use sha2::{Digest, Sha256};

/// Folders of a replacement deeper than this are refused: it is a loop of links or not a suite.
const MAX_DEPTH: usize = 16;
/// Files of a replacement longer than this are refused, in bytes.
const MAX_BYTES: u64 = 1 << 20;

/// One file.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct AssetFile {
    /// Path with `/`, beginning with `suites/` or `schemas/`.
    pub path: String,
    /// The whole text.
    pub text: String,
}

/// All files, sorted by path. Hidden files (`.gitkeep`) are left out.
#[derive(Clone, Debug)]
pub struct Assets {
    files: Vec<AssetFile>,
    /// Paths of files that were checked before the program was built.
    checked: BTreeSet<String>,
    sha256: String,
    modified: bool,
    /// The paths of the files that somebody has given.
    own: Vec<String>,
    /// The folder they are in.
    folder: Option<PathBuf>,
}

impl Assets {
    /// The files that the program carries, without hidden ones. They were checked before it was built.
    #[must_use]
    pub fn built_in(files: impl IntoIterator<Item = AssetFile>) -> Self {
        let mut assets = Self::new(files.into_iter().filter(|file| !hidden(&file.path)).collect());
        assets.checked = assets.files.iter().map(|file| file.path.clone()).collect();
        assets
    }

    /// Whether a file was checked before the program was built, so that nobody has to look for mistakes in it again.
    #[must_use]
    pub fn is_checked(&self, path: &str) -> bool {
        self.checked.contains(path)
    }

    /// The folders `suites/` and `schemas/` of a source tree.
    ///
    /// # Errors
    /// One of them cannot be read, holds a file that is not UTF-8 or longer than 1 MiB, or is nested too deeply.
    pub fn of_folder(root: &Path) -> io::Result<Self> {
        let mut files = Vec::new();
        for name in ["suites", "schemas"] {
            files_below(&root.join(name), name, 0, &mut files)?;
        }
        Ok(Self::new(files))
    }

    /// Everything under `suites/` replaced by the files of `dir`, which is laid out like `suites/`.
    ///
    /// # Errors
    /// `dir` cannot be read, holds a file that is not UTF-8 or longer than 1 MiB, or is nested too deeply.
    pub fn with_suites(&self, dir: &Path) -> io::Result<Self> {
        let mut files = Vec::new();
        files_below(dir, "suites", 0, &mut files)?;
        let own = paths(&files);
        files.extend(self.under("schemas/").cloned());
        let mut assets = Self::new(files);
        assets.own = own;
        assets.folder = Some(dir.to_owned());
        assets.modified = assets.sha256 != self.sha256;
        let same = |path: &&String| assets.get(path) == self.get(path);
        assets.checked = self.checked.iter().filter(same).cloned().collect();
        Ok(assets)
    }

    /// These files and those of `dir` beside them, which is laid out like `suites/`.
    ///
    /// # Errors
    /// As [`Assets::with_suites`], or when a file of `dir` has the path of an embedded one and another text.
    pub fn with_added(&self, dir: &Path) -> io::Result<Self> {
        let mut own = Vec::new();
        files_below(dir, "suites", 0, &mut own)?;
        let paths = paths(&own);
        let mut files = self.files.clone();
        for file in own {
            match self.get(&file.path) {
                None => files.push(file),
                Some(known) if known.text == file.text => {}
                Some(_) => {
                    let message = format!("{} is built in, and its text there is another one", file.path);
                    return Err(io::Error::new(io::ErrorKind::AlreadyExists, message));
                }
            }
        }
        let mut assets = Self::new(files);
        assets.own = paths;
        assets.folder = Some(dir.to_owned());
        assets.modified = assets.sha256 != self.sha256;
        let same = |path: &&String| assets.get(path) == self.get(path);
        assets.checked = self.checked.iter().filter(same).cloned().collect();
        Ok(assets)
    }

    /// The folders of the source tree that this crate was compiled from, for tests: the program carries its files itself.
    ///
    /// # Errors
    /// The tree is not there any more.
    pub fn of_source_tree() -> io::Result<Self> {
        Self::of_folder(&Path::new(env!("CARGO_MANIFEST_DIR")).join("../.."))
    }

    fn new(mut files: Vec<AssetFile>) -> Self {
        files.sort();
        let mut digest = Sha256::new();
        for file in &files {
            // Lengths keep a boundary from moving between a path and a text.
            for part in [&file.path, &file.text] {
                digest.update(u64::try_from(part.len()).unwrap_or(u64::MAX).to_be_bytes());
                digest.update(part.as_bytes());
            }
        }
        let sha256 = digest
            .finalize()
            .iter()
            .fold(String::with_capacity(64), |mut hex, byte| {
                for digit in [byte >> 4, byte & 15] {
                    hex.extend(char::from_digit(u32::from(digit), 16));
                }
                hex
            });
        Self {
            files,
            checked: BTreeSet::new(),
            sha256,
            modified: false,
            own: Vec::new(),
            folder: None,
        }
    }

    /// The files whose path begins with `prefix`, sorted by path.
    pub fn under(&self, prefix: &str) -> impl Iterator<Item = &AssetFile> {
        self.files.iter().filter(move |file| file.path.starts_with(prefix))
    }

    /// The file at `path`.
    #[must_use]
    pub fn get(&self, path: &str) -> Option<&AssetFile> {
        let at = self.files.binary_search_by(|file| file.path.as_str().cmp(path)).ok()?;
        self.files.get(at)
    }

    /// The paths of the files that somebody has given, built in or not.
    #[must_use]
    pub fn own(&self) -> &[String] {
        &self.own
    }

    /// Where whoever has given a file finds it; `None` for what is built in.
    #[must_use]
    pub fn as_given(&self, path: &str) -> Option<String> {
        let folder = self.folder.as_ref().filter(|_| !self.is_checked(path))?;
        let own = self.own.iter().find(|own| *own == path)?.strip_prefix("suites/")?;
        Some(folder.join(own).to_string_lossy().replace('\\', "/"))
    }

    /// SHA-256 over all paths and texts, in hexadecimal.
    #[must_use]
    pub fn sha256(&self) -> &str {
        &self.sha256
    }

    /// Whether the suites were replaced by something else than what is embedded.
    #[must_use]
    pub fn modified(&self) -> bool {
        self.modified
    }
}

fn paths(files: &[AssetFile]) -> Vec<String> {
    files.iter().map(|file| file.path.clone()).collect()
}

fn hidden(path: &str) -> bool {
    path.split('/').any(|part| part.starts_with('.'))
}

fn files_below(dir: &Path, prefix: &str, depth: usize, files: &mut Vec<AssetFile>) -> io::Result<()> {
    let refuse = |path: &Path, reason: &str| {
        let message = format!("{}: {reason}", path.display());
        Err(io::Error::new(io::ErrorKind::InvalidData, message))
    };
    if depth > MAX_DEPTH {
        return refuse(dir, "nested too deeply");
    }
    for entry in std::fs::read_dir(dir)? {
        let entry = entry?;
        let path = entry.path();
        let Some(name) = entry.file_name().to_str().map(str::to_owned) else {
            return refuse(&path, "the name is not UTF-8");
        };
        if hidden(&name) {
            continue;
        }
        let inside = format!("{prefix}/{name}");
        let facts = std::fs::metadata(&path)?;
        if facts.is_dir() {
            files_below(&path, &inside, depth + 1, files)?;
        } else if facts.len() > MAX_BYTES {
            return refuse(&path, "longer than 1 MiB");
        } else {
            let Ok(text) = String::from_utf8(std::fs::read(&path)?) else {
                return refuse(&path, "not UTF-8");
            };
            files.push(AssetFile { path: inside, text });
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn built_in() -> Assets {
        Assets::of_source_tree().expect("suites and schemas")
    }

    #[test]
    fn everything_is_read_and_nothing_hidden() {
        let assets = built_in();
        assert!(assets.get("suites/requirements/ORD-REJ.yaml").is_some());
        assert!(
            assets
                .under("schemas/")
                .any(|file| file.path.ends_with("/protocol.toml"))
        );
        assert!(assets.under("").all(|file| !file.path.contains("/.")));
        assert!(assets.get("suites/agv/.gitkeep").is_none());
        assert_eq!(assets.sha256().len(), 64);
        assert!(!assets.modified());
    }

    #[test]
    fn a_directory_replaces_the_suites_only() {
        let dir = tempfile::tempdir().expect("directory");
        std::fs::create_dir_all(dir.path().join("agv/x")).expect("directory");
        std::fs::write(dir.path().join("agv/x/y.yaml"), "test: x/y").expect("file");
        std::fs::write(dir.path().join(".hidden"), [0xff]).expect("file");
        let assets = built_in().with_suites(dir.path()).expect("assets");
        let suites: Vec<_> = assets.under("suites/").map(|file| file.path.as_str()).collect();
        assert_eq!(suites, ["suites/agv/x/y.yaml"]);
        assert!(assets.under("schemas/").count() > 10);
        assert!(assets.modified());
        assert_ne!(assets.sha256(), built_in().sha256());
    }

    #[test]
    fn own_files_stand_beside_the_built_in_ones_and_replace_none() {
        let dir = tempfile::tempdir().expect("directory");
        std::fs::create_dir_all(dir.path().join("agv/acme")).expect("directory");
        std::fs::create_dir_all(dir.path().join("requirements")).expect("directory");
        std::fs::write(dir.path().join("agv/acme/own.yaml"), "test: acme/own").expect("file");
        let embedded = built_in();
        let known = embedded.get("suites/requirements/ORD.yaml").expect("a file");
        let copy = dir.path().join("requirements/ORD.yaml");
        std::fs::write(&copy, &known.text).expect("file");
        let added = built_in().with_added(dir.path()).expect("assets");
        assert_eq!(added.files.len(), embedded.files.len() + 1);
        assert!(added.get("suites/agv/acme/own.yaml").is_some() && added.modified());
        std::fs::write(&copy, "group: ORD").expect("file");
        let refused = built_in().with_added(dir.path()).expect_err("another text");
        assert_eq!(refused.kind(), io::ErrorKind::AlreadyExists);
    }

    #[test]
    fn a_copy_of_the_suites_counts_as_unmodified() {
        let dir = tempfile::tempdir().expect("directory");
        let embedded = built_in();
        for file in embedded.under("suites/") {
            let path = dir.path().join(&file.path["suites/".len()..]);
            std::fs::create_dir_all(path.parent().expect("parent")).expect("directory");
            std::fs::write(path, &file.text).expect("file");
        }
        let copy = built_in().with_suites(dir.path()).expect("assets");
        assert_eq!(copy.sha256(), embedded.sha256());
        assert!(!copy.modified());
    }

    #[test]
    fn what_is_no_text_is_refused_with_its_name() {
        let dir = tempfile::tempdir().expect("directory");
        std::fs::write(dir.path().join("x.yaml"), [0xff, 0xfe]).expect("file");
        let message = built_in().with_suites(dir.path()).expect_err("not text").to_string();
        assert!(message.contains("x.yaml"), "{message}");
        assert!(built_in().with_suites(&dir.path().join("missing")).is_err());
    }
}
