//! Devices nobody of this project wrote: the AGV and the master control of the npm package vda-5050-lib, each as it is
//! shipped and with one obstacle removed. The harness must find exactly what stands in their lists of expected findings,
//! each traced to a place in the library, and must accuse them of nothing else: by its suites, and by conversations.

mod explored;
mod listed;
mod scripted;

use std::path::Path;

/// A foreign device.
struct Device {
    /// Where it is, with its profiles and its list of expected findings.
    folder: &'static str,
    /// Name in the list, profile, and number of benches.
    variants: [(&'static str, &'static str, usize); 2],
}

const AGV: Device = Device {
    folder: "fixtures/devices/vda-5050-lib-agv",
    variants: [
        ("as-shipped", "device.toml", 10),
        ("translated", "device-translated.toml", 6),
    ],
};

const MASTER_CONTROL: Device = Device {
    folder: "fixtures/devices/vda-5050-lib-master",
    variants: [
        ("as-shipped", "device.toml", 6),
        ("translated", "device-translated.toml", 6),
    ],
};

impl Device {
    /// Whether it can be started; in CI it must be.
    fn is_installed(&self) -> bool {
        if !Path::new(self.folder)
            .join("node_modules/vda-5050-lib/package.json")
            .exists()
        {
            let missing = format!("the foreign device is not installed: run `npm ci` in {}", self.folder);
            assert!(std::env::var_os("CI").is_none(), "{missing}");
            eprintln!("skipped: {missing}");
            return false;
        }
        true
    }
}
