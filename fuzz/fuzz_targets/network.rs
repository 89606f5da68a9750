//! Captured network traffic: pcap and pcapng.
#![no_main]

use std::io::Cursor;

use libfuzzer_sys::fuzz_target;
use vda5050_tck::capture::Packets;

fuzz_target!(|file: &[u8]| {
    if let Ok(mut packets) = Packets::new(Box::new(Cursor::new(file.to_vec())), 0) {
        while let Ok(Some(_)) = packets.read() {}
    }
});
