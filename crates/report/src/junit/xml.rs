//! Texts and tags of the XML that `junit_report` writes as it comes.

use crate::clean;

/// Puts other tags in the place of those for which there are some. Only tags are touched: the writer escapes `>` and `"` in
/// their attributes, and what stands in CDATA sections is not ours.
pub(super) fn with_tags(xml: &str, mut other: impl FnMut(&str) -> Option<String>) -> String {
    const CDATA: &str = "<![CDATA[";
    let mut text = String::with_capacity(xml.len());
    let mut rest = xml;
    while let Some(begin) = rest.find('<') {
        let is_data = rest[begin..].starts_with(CDATA);
        let close = if is_data { "]]>" } else { ">" };
        let Some(length) = rest[begin..].find(close) else { break };
        let end = begin + length + close.len();
        text.push_str(&rest[..begin]);
        let tag = &rest[begin..end];
        match (!is_data).then(|| other(tag)).flatten() {
            Some(changed) => text.push_str(&changed),
            None => text.push_str(tag),
        }
        rest = &rest[end..];
    }
    text + rest
}

/// One line, without anything XML forbids. Escaping is done by the writer.
pub(super) fn attribute(text: &str) -> String {
    // Line breaks would be folded to blanks by the next parser anyway.
    clean::line(&text.replace(['\n', '\t'], " ")).into_owned()
}

/// Many lines, without anything XML forbids and without an end of the CDATA section they will stand in.
pub(super) fn cdata(text: &str) -> String {
    clean::block(text).replace("]]>", "]] >")
}
