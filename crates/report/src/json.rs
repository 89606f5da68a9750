//! `result.json`: written canonically, read back with errors that say what is wrong.
//!
//! The order of keys is that of [`RunResult`], numbers are written the shortest way, two spaces indent, and a
//! line feed ends the file: the same result is always the same bytes.

use std::io::{self, Write as _};
use std::path::{Path, PathBuf};

use serde_json::Value;

use tck_result::RunResult;

/// The format this version writes and reads.
pub const FORMAT: &str = "vda5050-tck.result/1";
/// The member of a result that says its format.
const FORMAT_MEMBER: &str = "format";

/// Why a result could not be written or read.
#[derive(Debug, thiserror::Error)]
pub enum ResultError {
    /// The file could not be opened, read or written.
    #[error("cannot {what} {}: {source}", path.display())]
    Io {
        /// `read` or `write`.
        what: &'static str,
        /// The file.
        path: PathBuf,
        /// What the operating system said.
        source: io::Error,
    },
    /// Not JSON.
    #[error("{name} is not JSON: {source}")]
    NotJson {
        /// The file.
        name: String,
        /// Where and why.
        source: serde_json::Error,
    },
    /// JSON, but not a result of this tool.
    #[error("{name} is not a result of vda5050-tck: it has no `format` that begins with `vda5050-tck.result/`")]
    NotAResult {
        /// The file.
        name: String,
    },
    /// A result of another version of this tool.
    #[error("{name} has the format `{found}`, and this version of the tool reads `{FORMAT}`")]
    OtherFormat {
        /// The file.
        name: String,
        /// Its format.
        found: String,
    },
    /// A result whose content is not as the format says.
    #[error("{name} is a damaged result: {source}")]
    Damaged {
        /// The file.
        name: String,
        /// What is wrong.
        source: serde_json::Error,
    },
    /// A number that JSON cannot hold.
    #[error("the result cannot be written as JSON: {0}")]
    Unwritable(serde_json::Error),
}

/// The result as canonical JSON.
///
/// # Errors
/// [`ResultError::Unwritable`] when serialization fails.
pub fn to_string(result: &RunResult) -> Result<String, ResultError> {
    let mut text = serde_json::to_string_pretty(result).map_err(ResultError::Unwritable)?;
    text.push('\n');
    Ok(text)
}

/// Reads a result; `name` is what the errors call it.
///
/// # Errors
/// When it is not JSON, not a result, of another format, or damaged.
pub fn from_str(text: &str, name: &str) -> Result<RunResult, ResultError> {
    let name = || name.to_owned();
    let value: Value = serde_json::from_str(text).map_err(|source| ResultError::NotJson { name: name(), source })?;
    let found = value.get(FORMAT_MEMBER).and_then(Value::as_str).unwrap_or_default();
    if !found.starts_with("vda5050-tck.result/") {
        return Err(ResultError::NotAResult { name: name() });
    }
    if found != FORMAT {
        let found = super::clean::short(&super::clean::line(found), 60).into_owned();
        return Err(ResultError::OtherFormat { name: name(), found });
    }
    // From the text again and not from the value, so that the error has a line and a column.
    serde_json::from_str(text).map_err(|source| ResultError::Damaged { name: name(), source })
}

/// Reads a result from a file.
///
/// # Errors
/// As [`from_str`], or when the file cannot be read.
pub fn read(path: &Path) -> Result<RunResult, ResultError> {
    let text = std::fs::read_to_string(path).map_err(|source| ResultError::Io {
        what: "read",
        path: path.to_owned(),
        source,
    })?;
    from_str(&text, &path.display().to_string())
}

/// Writes a result to a file, atomically.
///
/// # Errors
/// When it cannot be serialized or the file cannot be written.
pub fn write(path: &Path, result: &RunResult) -> Result<(), ResultError> {
    write_atomically(path, to_string(result)?.as_bytes()).map_err(|source| ResultError::Io {
        what: "write",
        path: path.to_owned(),
        source,
    })
}

/// Writes a file so that a reader sees the old content or the new, and never half of either: to a
/// neighbour first, which is then renamed. What is there and no file, such as a terminal, a pipe or `/dev/null`, is written to as
/// it is, because it cannot be replaced.
///
/// # Errors
/// What the operating system says; the neighbour is removed again.
pub fn write_atomically(path: &Path, bytes: &[u8]) -> io::Result<()> {
    if std::fs::metadata(path).is_ok_and(|facts| !facts.is_file() && !facts.is_dir()) {
        return std::fs::write(path, bytes);
    }
    let mut name = path
        .file_name()
        .ok_or_else(|| io::Error::new(io::ErrorKind::InvalidInput, "not a file name"))?
        .to_owned();
    name.push(".part");
    let part = path.with_file_name(name);
    let written = (|| {
        let mut file = std::fs::File::create(&part)?;
        file.write_all(bytes)?;
        file.sync_all()?;
        std::fs::rename(&part, path)
    })();
    if written.is_err() {
        // The first error is the one that matters.
        let _ = std::fs::remove_file(&part);
    }
    written
}
