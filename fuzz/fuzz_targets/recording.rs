//! A recording from its bytes to the findings: no message, in no order, ends the audit.
#![no_main]

use std::io::Cursor;
use std::sync::LazyLock;

use libfuzzer_sys::fuzz_target;
use vda5050_tck::audit::{Audit, Options};
use vda5050_tck::capture::{Item, Lines, Mapping};
use vda5050_tck::judge::Library;

static LIBRARY: LazyLock<Library> = LazyLock::new(|| vda5050_tck::library(None).expect("library"));

fuzz_target!(|file: &[u8]| {
    let mut audit = Audit::new(&LIBRARY.rules, Options::default()).expect("options");
    let mut lines = Lines::new(Box::new(Cursor::new(file.to_vec())), 0, Mapping::default());
    while let Ok(Some(item)) = lines.read() {
        if let Item::Message(message) = item {
            audit.observe(message);
        }
    }
    audit.finish(Vec::new());
});
