//! `manifest.json`: which files belong to a bundle, and one hash over all of them.
//!
//! The root hash is the SHA-256 of the lines `sha256sum` would print for the files in the order of their
//! names, so that it can be checked without this tool. Signing it is left to tools proven for that.

use std::io::{self, Read as _};
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use super::json::write_atomically;
use tck_journal::event::hex;

/// The format this version writes and reads.
pub const FORMAT: &str = "vda5050-tck.manifest/1";
/// Name of the manifest inside its bundle.
pub const NAME: &str = "manifest.json";

/// The manifest of a bundle.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Manifest {
    /// [`FORMAT`].
    pub format: String,
    /// Every file but the manifest, in the order of their paths.
    pub files: Vec<ManifestFile>,
    /// The root hash, in hexadecimal.
    pub root: String,
}

/// One file of a bundle.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ManifestFile {
    /// Path below the bundle, with `/`.
    pub path: String,
    /// Length in bytes.
    pub bytes: u64,
    /// SHA-256 in hexadecimal.
    pub sha256: String,
}

/// Why a manifest could not be made or read.
#[derive(Debug, thiserror::Error)]
pub enum ManifestError {
    /// A file could not be read or written.
    #[error("cannot read or write {}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What the operating system said.
        source: io::Error,
    },
    /// The name of a file cannot stand in a manifest.
    #[error("the file name {0:?} cannot stand in a manifest")]
    Name(PathBuf),
    /// The manifest is not one.
    #[error("{} is not a manifest of this tool: {reason}", path.display())]
    Malformed {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        reason: String,
    },
}

/// What verifying a bundle found.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "camelCase")]
pub struct Verification {
    /// Root hash of the manifest as it stands there.
    pub root: String,
    /// Whether the root hash follows from the list of files.
    pub root_holds: bool,
    /// Files whose content is not what the manifest says.
    pub changed: Vec<String>,
    /// Files of the manifest that are not there.
    pub missing: Vec<String>,
    /// Files that are there and not in the manifest.
    pub extra: Vec<String>,
}

impl Verification {
    /// Whether everything is as the manifest says.
    #[must_use]
    pub fn holds(&self) -> bool {
        self.root_holds && self.changed.is_empty() && self.missing.is_empty() && self.extra.is_empty()
    }

    /// One line per deviation, and the root hash.
    #[must_use]
    pub fn text(&self) -> String {
        let mut lines = Vec::new();
        if !self.root_holds {
            lines.push("the root hash does not follow from the files of the manifest".to_owned());
        }
        for (what, files) in [
            ("changed", &self.changed),
            ("missing", &self.missing),
            ("extra", &self.extra),
        ] {
            lines.extend(
                files
                    .iter()
                    .map(|file| format!("{what:<8} {}", super::clean::line(file))),
            );
        }
        let verdict = if self.holds() { "intact" } else { "not intact" };
        lines.push(format!("{verdict}: root {}", super::clean::line(&self.root)));
        lines.join("\n") + "\n"
    }
}

fn io_error(path: &Path) -> impl FnOnce(io::Error) -> ManifestError {
    let path = path.to_owned();
    move |source| ManifestError::Io { path, source }
}

/// The root hash over a list of files, which must be sorted by path.
fn root(files: &[ManifestFile]) -> String {
    let mut hash = Sha256::new();
    for file in files {
        hash.update(format!("{}  {}\n", file.sha256, file.path));
    }
    hex(&hash.finalize())
}

/// Files below `dir` with `/` between the parts of their names; links are taken for files of their own,
/// never followed out of the bundle.
fn walk(dir: &Path, prefix: &str, found: &mut Vec<String>) -> Result<(), ManifestError> {
    for entry in std::fs::read_dir(dir).map_err(io_error(dir))? {
        let entry = entry.map_err(io_error(dir))?;
        let path = entry.path();
        let name = entry.file_name();
        let name = name.to_str().filter(|name| !name.contains(['\n', '\r', '\\']));
        let name = name.ok_or_else(|| ManifestError::Name(path.clone()))?;
        let name = format!("{prefix}{name}");
        if entry.file_type().map_err(io_error(&path))?.is_dir() {
            walk(&path, &format!("{name}/"), found)?;
        } else if name != NAME {
            found.push(name);
        }
    }
    Ok(())
}

/// Length and SHA-256, in hexadecimal, of a file.
///
/// # Errors
/// What the operating system says.
pub fn digest(path: &Path) -> io::Result<(u64, String)> {
    let mut hash = Sha256::new();
    let mut file = std::fs::File::open(path)?;
    let mut bytes = 0;
    let mut buffer = vec![0; 64 * 1024];
    loop {
        let length = file.read(&mut buffer)?;
        if length == 0 {
            return Ok((bytes, hex(&hash.finalize())));
        }
        hash.update(&buffer[..length]);
        bytes += length as u64;
    }
}

fn hash(dir: &Path, name: &str) -> Result<ManifestFile, ManifestError> {
    let path = dir.join(name);
    let kind = std::fs::symlink_metadata(&path).map_err(io_error(&path))?;
    if !kind.is_file() {
        return Err(ManifestError::Name(path));
    }
    let (bytes, sha256) = digest(&path).map_err(io_error(&path))?;
    Ok(ManifestFile {
        path: name.to_owned(),
        bytes,
        sha256,
    })
}

impl Manifest {
    /// The manifest of the files that are in `dir` now.
    ///
    /// # Errors
    /// When a file cannot be read, is no regular file, or has a name a manifest cannot hold.
    pub fn of(dir: &Path) -> Result<Self, ManifestError> {
        let mut names = Vec::new();
        walk(dir, "", &mut names)?;
        names.sort();
        let files = names
            .iter()
            .map(|name| hash(dir, name))
            .collect::<Result<Vec<_>, _>>()?;
        Ok(Self {
            format: FORMAT.to_owned(),
            root: root(&files),
            files,
        })
    }

    /// Writes the manifest of `dir` into it, and gives it back.
    ///
    /// # Errors
    /// As [`Manifest::of`], or when the manifest cannot be written.
    pub fn write(dir: &Path) -> Result<Self, ManifestError> {
        let manifest = Self::of(dir)?;
        let path = dir.join(NAME);
        let mut text = serde_json::to_string_pretty(&manifest).map_err(|error| ManifestError::Malformed {
            path: path.clone(),
            reason: error.to_string(),
        })?;
        text.push('\n');
        write_atomically(&path, text.as_bytes()).map_err(io_error(&path))?;
        Ok(manifest)
    }

    /// Reads the manifest of a bundle.
    ///
    /// # Errors
    /// When there is none, or it is not one.
    pub fn read(dir: &Path) -> Result<Self, ManifestError> {
        let path = dir.join(NAME);
        let text = std::fs::read_to_string(&path).map_err(io_error(&path))?;
        let manifest: Self = serde_json::from_str(&text).map_err(|error| ManifestError::Malformed {
            path: path.clone(),
            reason: error.to_string(),
        })?;
        if manifest.format != FORMAT {
            let reason = format!("its format is {:?}, this version reads {FORMAT:?}", manifest.format);
            return Err(ManifestError::Malformed { path, reason });
        }
        Ok(manifest)
    }

    /// Holds a bundle against its manifest.
    ///
    /// # Errors
    /// When the manifest cannot be read. Files that cannot be read are in the list of what changed.
    pub fn verify(dir: &Path) -> Result<Verification, ManifestError> {
        let manifest = Self::read(dir)?;
        let mut there = Vec::new();
        walk(dir, "", &mut there)?;
        there.sort();
        let mut found = Verification {
            root_holds: root(&manifest.files) == manifest.root,
            root: manifest.root,
            ..Verification::default()
        };
        for file in &manifest.files {
            if !there.contains(&file.path) {
                found.missing.push(file.path.clone());
            } else if hash(dir, &file.path).ok().as_ref() != Some(file) {
                found.changed.push(file.path.clone());
            }
        }
        found.extra = there;
        found
            .extra
            .retain(|name| !manifest.files.iter().any(|file| file.path == *name));
        Ok(found)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bundle() -> tempfile::TempDir {
        let dir = tempfile::tempdir().expect("directory");
        std::fs::write(dir.path().join("result.json"), "{}\n").expect("write");
        std::fs::create_dir(dir.path().join("maps")).expect("folder");
        std::fs::write(dir.path().join("maps/hall.bin"), [0, 1, 2]).expect("write");
        dir
    }

    #[test]
    fn the_root_is_what_sha256sum_piped_into_itself_prints() {
        let dir = bundle();
        let manifest = Manifest::write(dir.path()).expect("manifest");
        let lines = "ae4b3280e56e2faf83f414a6e3dabe9d5fbe18976544c05fed121accb85b53fc  maps/hall.bin\n\
                     ca3d163bab055381827226140568f3bef7eaac187cebd76878e0b63e9e442356  result.json\n";
        assert_eq!(manifest.root, hex(&Sha256::digest(lines)));
        assert_eq!(Manifest::read(dir.path()).expect("read"), manifest);
    }

    #[test]
    fn an_untouched_bundle_holds() {
        let dir = bundle();
        Manifest::write(dir.path()).expect("manifest");
        let found = Manifest::verify(dir.path()).expect("verify");
        assert!(found.holds(), "{found:?}");
        assert!(found.text().starts_with("intact: root "));
    }

    #[test]
    fn a_changed_a_missing_and_an_extra_file_are_named() {
        let dir = bundle();
        std::fs::write(dir.path().join("junit.xml"), "<a/>").expect("write");
        Manifest::write(dir.path()).expect("manifest");
        std::fs::write(dir.path().join("result.json"), "[]\n").expect("write");
        std::fs::remove_file(dir.path().join("junit.xml")).expect("remove");
        std::fs::write(dir.path().join("late.txt"), "").expect("write");
        let found = Manifest::verify(dir.path()).expect("verify");
        assert_eq!(found.changed, ["result.json"]);
        assert_eq!(found.missing, ["junit.xml"]);
        assert_eq!(found.extra, ["late.txt"]);
        assert!(!found.holds());
    }

    #[test]
    fn a_list_that_was_edited_no_longer_gives_its_root() {
        let dir = bundle();
        let mut manifest = Manifest::write(dir.path()).expect("manifest");
        manifest.files.pop();
        std::fs::remove_file(dir.path().join("result.json")).expect("remove");
        let text = serde_json::to_string(&manifest).expect("json");
        std::fs::write(dir.path().join(NAME), text).expect("write");
        let found = Manifest::verify(dir.path()).expect("verify");
        assert!(!found.root_holds && !found.holds());
    }

    #[test]
    fn what_is_not_a_manifest_is_refused() {
        let dir = bundle();
        assert!(matches!(Manifest::read(dir.path()), Err(ManifestError::Io { .. })));
        std::fs::write(dir.path().join(NAME), "{}").expect("write");
        assert!(matches!(
            Manifest::read(dir.path()),
            Err(ManifestError::Malformed { .. })
        ));
        let other = r#"{"format":"vda5050-tck.manifest/9","files":[],"root":""}"#;
        std::fs::write(dir.path().join(NAME), other).expect("write");
        assert!(matches!(
            Manifest::read(dir.path()),
            Err(ManifestError::Malformed { .. })
        ));
    }
}
