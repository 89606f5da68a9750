//! The report holds on a screen, on a tablet and on a telephone: no page is wider than its window, and no text is broken into a
//! column of a few characters.

use std::path::Path;
use std::process::{Command, Stdio};

use vda5050_tck::report::html;

use crate::samples;

/// A screen, a tablet and a telephone, in pixels.
const WIDTHS: [u32; 3] = [1280, 810, 390];

/// A text without a place to break, as devices put it into their messages.
const LONG: &str = r#"{"actionId":"b70c8e0a-action-158","actionType":"beep","actionStatus":"RUNNING","actionDescription":"beeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeeep"} is there twice"#;

/// What does not hold in a window of this width; `None` without a browser.
fn measured(page: &Path, width: u32) -> Option<String> {
    let output = Command::new("chromium-headless-shell")
        .args(["--no-sandbox", "--disable-gpu", "--hide-scrollbars", "--dump-dom"])
        .arg(format!("--window-size={width},1200"))
        .arg(format!("file://{}", page.display()))
        .stdin(Stdio::null())
        .stderr(Stdio::null())
        .output()
        .ok()?;
    let text = String::from_utf8_lossy(&output.stdout);
    let (_, told) = text.split_once("<pre id=\"measured\">")?;
    let (told, _) = told.split_once("</pre>")?;
    Some(told.to_owned())
}

#[test]
fn a_report_holds_at_every_width() {
    let (pass, pass_journal) = samples::pass();
    let (mut fail, fail_journal) = samples::fail();
    LONG.clone_into(&mut fail.monitors[0].findings[0].message);
    for test in &mut fail.tests {
        test.reason = test.reason.as_ref().map(|_| LONG.to_owned());
    }
    let (hostile, hostile_journal, hostile_sources) = samples::hostile();
    let sources = samples::sources();
    let pages = [
        ("pass", html::render(&pass, &sources, Some(&pass_journal))),
        ("fail", html::render(&fail, &sources, Some(&fail_journal))),
        (
            "hostile",
            html::render(&hostile, &hostile_sources, Some(&hostile_journal)),
        ),
        ("course", Ok(crate::course::page())),
    ];
    let folder = tempfile::tempdir().expect("a folder");
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("fixtures/page/narrow.js");
    let script = std::fs::read_to_string(script).expect("the script");
    let has_browser = Command::new("chromium-headless-shell")
        .arg("--version")
        .output()
        .is_ok();
    if !has_browser {
        assert!(std::env::var_os("CI").is_none(), "chromium-headless-shell is missing");
        eprintln!("skipped: chromium-headless-shell is missing");
        return;
    }
    for (name, page) in pages {
        // The page forbids scripts; this copy is measured by one.
        let page = page.expect("html");
        let open: Vec<&str> = page
            .lines()
            .filter(|line| !line.contains("Content-Security-Policy"))
            .collect();
        assert!(open.len() < page.lines().count());
        let path = folder.path().join(format!("{name}.html"));
        std::fs::write(&path, format!("{}\n<script>\n{script}\n</script>\n", open.join("\n"))).expect("a file");
        for width in WIDTHS {
            let told = measured(&path, width).unwrap_or_else(|| panic!("{name} was not measured at {width}"));
            assert_eq!(told.trim(), "measured", "{name} at {width} pixels");
        }
    }
}

#[test]
fn a_page_that_does_not_hold_is_found() {
    let folder = tempfile::tempdir().expect("a folder");
    let script = include_str!("../../fixtures/page/narrow.js");
    let page = "<!DOCTYPE html><html><body><main><table><tr><td style=\"width:2ch; overflow-wrap:anywhere; display:block\">\
                order-rejection</td><td><pre>";
    let path = folder.path().join("page.html");
    let text = format!(
        "{page}{}</pre></td></tr></table></main><script>{script}</script></body></html>",
        "x".repeat(300)
    );
    std::fs::write(&path, text).expect("a file");
    if Command::new("chromium-headless-shell")
        .arg("--version")
        .output()
        .is_err()
    {
        assert!(std::env::var_os("CI").is_none(), "chromium-headless-shell is missing");
        return;
    }
    let told = measured(&path, 810).expect("it was measured");
    assert!(
        told.contains("the page is") && told.contains("order-rejection"),
        "{told}"
    );
}
