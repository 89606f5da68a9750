//! A message as a device sends it: the bytes, and where something stands in them.
#![no_main]

use libfuzzer_sys::fuzz_target;
use vda5050_tck::journal::{Parsed, place};

fuzz_target!(|bytes: &[u8]| {
    let parsed = Parsed::of_bytes(bytes);
    if parsed.problems().is_empty() {
        assert!(parsed.value().is_some());
    }
    for (pointer, name) in place::repeated(bytes) {
        assert!(name.end <= bytes.len());
        place::of(bytes, &pointer);
    }
    place::elements(bytes);
});
