//! The files of the page, which are in the program.

/// A file of the page.
pub(crate) struct Asset {
    pub kind: &'static str,
    pub text: &'static str,
}

/// The file of this name; the page itself has none.
pub(crate) fn asset(name: &str) -> Option<Asset> {
    let (kind, text) = match name {
        "" => ("text/html; charset=utf-8", include_str!("../assets/page.html")),
        "page.css" => ("text/css; charset=utf-8", include_str!("../assets/page.css")),
        "page.js" => ("text/javascript; charset=utf-8", include_str!("../assets/page.js")),
        "floor.js" => ("text/javascript; charset=utf-8", include_str!("../assets/floor.js")),
        _ => return None,
    };
    Some(Asset { kind, text })
}
