//! MCAP.
#![no_main]

use std::io::Cursor;

use libfuzzer_sys::fuzz_target;
use vda5050_tck::capture::Mcap;

fuzz_target!(|file: &[u8]| {
    if let Ok(mut mcap) = Mcap::new(Box::new(Cursor::new(file.to_vec())), 0) {
        while let Ok(Some(_)) = mcap.read() {}
    }
});
