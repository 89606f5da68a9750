//! Devices nobody of this project wrote: an AGV and a master control each of the npm package vda-5050-lib, as it is shipped
//! and with one obstacle removed, and of the Python package vda5050-sdk. The harness must find exactly what stands in their
//! lists of expected findings, each traced to a place in the library, and must accuse them of nothing else: by its suites,
//! and those of npm by conversations, too.

mod explored;
mod listed;
mod scripted;

use std::path::Path;
use std::process::{Command, Stdio};

/// A foreign device.
struct Device {
    /// Where it is, with its profiles and its list of expected findings.
    folder: &'static str,
    package: Package,
    variants: &'static [Variant],
    /// Tests that are not run: they say the same once more, and take their time.
    left_out: &'static [&'static str],
}

/// A device as it is started by one profile.
struct Variant {
    /// Its name in the list.
    name: &'static str,
    profile: &'static str,
    benches: usize,
}

/// Where a device comes from.
enum Package {
    Npm,
    PyPi,
}

const fn variant(name: &'static str, profile: &'static str, benches: usize) -> Variant {
    Variant { name, profile, benches }
}

const AGV: Device = Device {
    folder: "fixtures/devices/vda-5050-lib-agv",
    package: Package::Npm,
    variants: &[
        variant("as-shipped", "device.toml", 10),
        variant("translated", "device-translated.toml", 6),
    ],
    left_out: &[],
};

const MASTER_CONTROL: Device = Device {
    folder: "fixtures/devices/vda-5050-lib-master",
    package: Package::Npm,
    variants: &[
        variant("as-shipped", "device.toml", 6),
        variant("translated", "device-translated.toml", 6),
    ],
    left_out: &[],
};

const PYTHON_AGV: Device = Device {
    folder: "fixtures/devices/vda5050-sdk-agv",
    package: Package::PyPi,
    variants: &[variant("as-shipped", "device.toml", 8)],
    left_out: &["blocking", "combinations", "order-rejection/schema-*"],
};

const PYTHON_MASTER_CONTROL: Device = Device {
    folder: "fixtures/devices/vda5050-sdk-master",
    package: Package::PyPi,
    variants: &[variant("as-shipped", "device.toml", 6)],
    left_out: &[
        "combinations",
        "traffic",
        "fleet",
        "reported",
        "corridors",
        "trajectories",
        "actions",
        "modes/no-actions*",
        // It never connects again, and to start it anew after a cut is taken for a mere return of the link (HDR-02).
        "connection/*cut*",
        "*/*after-cut",
        "connection/lost",
        "connection/old-will",
        "connection/back-with-its-order",
        "connection/state-without-connection",
        "connection/subscribes",
    ],
};

const ALL: [Device; 4] = [AGV, MASTER_CONTROL, PYTHON_AGV, PYTHON_MASTER_CONTROL];

impl Device {
    /// Whether it can be started; in CI it must be.
    fn is_installed(&self) -> bool {
        let (is_there, how) = match self.package {
            Package::Npm => (
                Path::new(self.folder)
                    .join("node_modules/vda-5050-lib/package.json")
                    .exists(),
                "npm ci",
            ),
            Package::PyPi => (
                has_python_package("vda5050-sdk", "0.2.0") && has_python_package("aiomqtt", "2.5.1"),
                "python3 -m pip install -r requirements.txt",
            ),
        };
        if !is_there {
            let missing = format!("the foreign device is not installed: run `{how}` in {}", self.folder);
            assert!(std::env::var_os("CI").is_none(), "{missing}");
            eprintln!("skipped: {missing}");
        }
        is_there
    }
}

/// Whether the Python that starts the devices has this version of a package.
fn has_python_package(name: &str, version: &str) -> bool {
    let question = format!("from importlib.metadata import version; assert version({name:?}) == {version:?}");
    let asked = Command::new("python3")
        .args(["-c", &question])
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .status();
    asked.is_ok_and(|status| status.success())
}
