//! The map files that are offered for download.

use tck_base::pattern::Bindings;
use tck_suite::model::Serve;

/// The map file that is served when a test names none.
const BUILT_IN_MAP: &[u8] = b"vda5050-tck built-in map\nresolution 0.05\norigin 0 0 0\n";

/// The document or the file a test names; or else one that the device can read, another for each offer of a test as far as there are
/// several; or one of our own.
///
/// # Errors
/// When there is no such file; the text says why.
pub(super) fn content(serve: &Serve, bindings: &Bindings, readable: &[bytes::Bytes]) -> Result<bytes::Bytes, String> {
    if let Some(document) = &serve.json {
        let document = document.bind(bindings).map_err(|unbound| unbound.to_string())?;
        return Ok(document.to_string().into());
    }
    let Some(term) = &serve.file else {
        if !readable.is_empty() {
            return Ok(readable[place(serve, bindings) % readable.len()].clone());
        }
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

/// Which offer of its test this is, counted from 0; what is offered again keeps its place.
fn place(serve: &Serve, bindings: &Bindings) -> usize {
    let offers = bindings.get("serve").and_then(serde_json::Value::as_object);
    offers.map_or(0, |offers| {
        offers
            .keys()
            .position(|name| *name == serve.name)
            .unwrap_or(offers.len())
    })
}

/// Its hash, in hexadecimal digits.
pub(super) fn sha256(bytes: &[u8]) -> String {
    use sha2::Digest as _;
    tck_journal::event::hex(&sha2::Sha256::digest(bytes))
}
