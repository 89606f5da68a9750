//! The map files that are offered for download.

use crate::pattern::Bindings;
use crate::suite::model::Serve;

/// The map file that is served when a test names none.
const BUILT_IN_MAP: &[u8] = b"vda5050-tck built-in map\nresolution 0.05\norigin 0 0 0\n";

/// The file a test names, or one of our own.
///
/// # Errors
/// When there is no such file; the text says why.
pub(super) fn content(serve: &Serve, bindings: &Bindings) -> Result<bytes::Bytes, String> {
    let Some(term) = &serve.file else {
        // Every offer is a file of its own, so that two versions of a map differ.
        let mut body = BUILT_IN_MAP.to_vec();
        body.extend_from_slice(serve.name.as_bytes());
        return Ok(body.into());
    };
    let path = term.bind(bindings).map_err(|unbound| unbound.to_string())?;
    let path = path.as_str().ok_or("a file name is a text")?;
    std::fs::read(path)
        .map(Into::into)
        .map_err(|error| format!("cannot read the map file {path}: {error}"))
}

/// Its hash, in hexadecimal digits.
pub(super) fn sha256(bytes: &[u8]) -> String {
    use sha2::Digest as _;
    crate::journal::event::hex(&sha2::Sha256::digest(bytes))
}
