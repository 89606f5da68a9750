//! Which shares `cargo test` tries: a fixed rotation.

use std::process::Command;

/// What git answers in this folder; `None` where there is no git, or where git refuses.
pub fn git(arguments: &[&str]) -> Option<String> {
    let folder = env!("CARGO_MANIFEST_DIR");
    let output = Command::new("git")
        .arg("-C")
        .arg(folder)
        .args(arguments)
        .output()
        .ok()?;
    output
        .status
        .success()
        .then(|| String::from_utf8_lossy(&output.stdout).into_owned())
}

/// Which share is tried: the number in `QUALIFY_SHARE`, or the first. It depends on nothing else, so that a commit that
/// changes no suite and no check cannot fail by what it draws.
pub fn share() -> u64 {
    std::env::var("QUALIFY_SHARE")
        .ok()
        .and_then(|said| said.trim().parse().ok())
        .unwrap_or(0)
}
