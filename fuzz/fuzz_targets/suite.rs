//! A suite as its author writes it: what is wrong with it is said, with the place.
#![no_main]

use std::sync::LazyLock;

use libfuzzer_sys::fuzz_target;
use vda5050_tck::judge::Library;

static LIBRARY: LazyLock<Library> = LazyLock::new(|| vda5050_tck::library(None).expect("library"));

fuzz_target!(|text: &str| {
    if let Err(problems) = LIBRARY.check_suite("suite.yaml", text) {
        assert!(!problems.is_empty());
        for problem in problems {
            assert!(!problem.to_string().is_empty());
        }
    }
});
