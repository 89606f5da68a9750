//! Which shares `cargo test` tries: a fixed rotation.

/// Which share is tried: the number in `QUALIFY_SHARE`, or the first. It depends on nothing else, so that a commit that
/// changes no suite and no check cannot fail by what it draws.
pub fn share() -> u64 {
    std::env::var("QUALIFY_SHARE")
        .ok()
        .and_then(|said| said.trim().parse().ok())
        .unwrap_or(0)
}
