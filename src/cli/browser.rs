//! `--open`: shows a page in the browser.

use std::path::Path;
use std::process::{Command, Stdio};

/// Shows it, or says why not: a run that is over is not spoiled by that.
pub(super) fn open(page: &Path) {
    let program = if cfg!(target_os = "macos") {
        "open"
    } else if cfg!(windows) {
        "explorer"
    } else {
        "xdg-open"
    };
    let mut command = Command::new(program);
    command.arg(page);
    command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
    if let Err(error) = command.spawn() {
        eprintln!("{} cannot be shown: {program}: {error}", page.display());
    }
}
