//! Recordings in lines, packed or not.
#![no_main]

use std::io::Cursor;

use libfuzzer_sys::fuzz_target;
use vda5050_tck::capture::{Lines, Mapping, input};

fuzz_target!(|file: &[u8]| {
    let Ok(reader) = input::unpacked(Box::new(Cursor::new(file.to_vec()))) else {
        return;
    };
    let mut lines = Lines::new(reader, 0, Mapping::default());
    while let Ok(Some(_)) = lines.read() {}
    assert!(lines.counted().skipped <= lines.counted().lines);
});
