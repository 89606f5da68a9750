//! What unit tests of several crates share: the source tree, its suites, and the allocator of the program.
#![forbid(unsafe_code)]
#![warn(missing_docs)]
#![allow(clippy::panic, reason = "a test may fail by panicking")]

use std::path::{Path, PathBuf};
use std::sync::LazyLock;

use tck_judge::Library;
use tck_pack::Assets;

/// The allocator of the program: half of what the tests do is to make small trees.
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

static ASSETS: LazyLock<Assets> =
    LazyLock::new(|| Assets::of_folder(&root()).unwrap_or_else(|error| panic!("suites and schemas: {error}")));

static LIBRARY: LazyLock<Library> = LazyLock::new(|| {
    Library::load(ASSETS.clone(), tck_checks::REGISTRY)
        .unwrap_or_else(|all| panic!("{} mistakes, first {}", all.len(), all[0]))
});

/// The root of the source tree.
#[must_use]
pub fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

/// The suites and schemas of the source tree.
#[must_use]
pub fn assets() -> &'static Assets {
    &ASSETS
}

/// The suites of the source tree, read and checked once for each program of tests.
#[must_use]
pub fn library() -> &'static Library {
    &LIBRARY
}
