//! Conversations with foreign devices, from a fixed seed and about a part of what may be said: with everything they take half
//! an hour.

use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};

use serde_json::Value;

use super::listed::{Found, Way, differences, expected, list};
use super::{AGV, Device, MASTER_CONTROL};

/// The variant that is explored: what the other one says is refused for one reason nearly always.
const VARIANT: (&str, &str) = ("translated", "device-translated.toml");

/// What is said to each of them.
const SAID: [(Device, &[&str]); 2] = [
    (AGV, &["ask-many", "ask-unknown", "outdated", "cancel"]),
    (MASTER_CONTROL, &["transport", "cancel-by-hand"]),
];

/// A harness that explores its own device behind its own broker.
struct Conversations {
    folder: &'static str,
    process: Child,
}

impl Conversations {
    fn start(device: &Device, said: &[&str]) -> Self {
        let name = Path::new(device.folder).file_name().unwrap();
        let out: PathBuf = Path::new(env!("CARGO_TARGET_TMPDIR")).join("explored").join(name);
        let _ = std::fs::remove_dir_all(&out);
        let process = Command::new(env!("CARGO_BIN_EXE_vda5050-tck"))
            .args(["explore", "--profile", &format!("{}/{}", device.folder, VARIANT.1)])
            .args(["--seed", "1", "--conversations", "3", "--shrink-budget", "0"])
            .args(["--format", "json"])
            .args(said.iter().flat_map(|name| ["--focus", name]))
            .arg("--out")
            .arg(&out)
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        Self {
            folder: device.folder,
            process,
        }
    }

    /// What differs from the list; empty when nothing does.
    fn differences(self) -> String {
        let folder = self.folder;
        let ended = self.process.wait_with_output().unwrap();
        let explored: Value = match serde_json::from_slice(&ended.stdout) {
            Ok(explored) => explored,
            Err(error) => {
                let words = String::from_utf8_lossy(&ended.stderr);
                return format!("{folder}: exploring gave nothing: {error}: {words}\n");
            }
        };
        let mut found = Found::default();
        for finding in list(&explored, "findings") {
            let (requirement, verdict) = (&finding["requirement"], &finding["verdict"]);
            found.add(requirement, verdict, &finding["stimulus"], &finding["message"]);
        }
        match differences(&expected(folder, VARIANT.0, Way::Explored), &found) {
            same if same.is_empty() => same,
            differences => {
                format!("what is found by conversations differs from {folder}/expected-findings.toml\n{differences}")
            }
        }
    }
}

#[test]
fn conversations_find_in_foreign_devices_what_is_listed_and_nothing_else() {
    let installed = SAID.into_iter().filter(|(device, _)| device.is_installed());
    let started: Vec<Conversations> = installed
        .map(|(device, said)| Conversations::start(&device, said))
        .collect();
    let report: String = started.into_iter().map(Conversations::differences).collect();
    assert!(report.is_empty(), "{report}");
}
