//! The MQTT decoder: whatever a peer sends, the pieces together are what came.
#![no_main]

use libfuzzer_sys::fuzz_target;
use vda5050_tck::wire::Reader;

fuzz_target!(|input: (u8, Vec<Vec<u8>>)| {
    let (level, parts) = input;
    let mut reader = Reader::default();
    reader.set_level(level);
    let mut out = Vec::new();
    for part in &parts {
        reader.push(part);
        while let Some(piece) = reader.next_piece() {
            out.extend_from_slice(&piece.raw);
            assert!(piece.evidence().len() <= piece.raw.len());
        }
    }
    out.extend(reader.rest().into_iter().flat_map(|piece| piece.raw));
    assert_eq!(out, parts.concat());
});
