//! The loader as a whole, on the suites of `fixtures/good-suites/`.

use std::collections::BTreeMap;
use std::path::Path;

use proptest::prelude::*;

use super::*;
use crate::pack::Role;

const CHECKS: [CheckInfo; 1] = [CheckInfo {
    name: "header/id-rises",
    decides: &["HDR-02"],
    arguments: &["topic"],
}];

const HOOKS: [HookFacts; 2] = [
    HookFacts {
        name: "power-cycle",
        role: Role::Agv,
        parameters: &[],
    },
    HookFacts {
        name: "dispatch",
        role: Role::MasterControl,
        parameters: &["from", "to"],
    },
];

/// The good suites by path, as they would lie below `suites/`.
fn good() -> BTreeMap<String, String> {
    fn gather(folder: &Path, name: &str, files: &mut BTreeMap<String, String>) {
        for entry in std::fs::read_dir(folder).expect("fixtures") {
            let entry = entry.expect("entry");
            let name = format!("{name}/{}", entry.file_name().to_string_lossy());
            if entry.path().is_dir() {
                gather(&entry.path(), &name, files);
            } else {
                files.insert(name, std::fs::read_to_string(entry.path()).expect("text"));
            }
        }
    }
    let mut files = BTreeMap::new();
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("fixtures/good-suites");
    gather(&folder, "suites", &mut files);
    files
}

struct World {
    packs: Packs,
    catalogue: Catalogue,
}

impl World {
    fn new() -> Self {
        let assets = Assets::embedded();
        Self {
            packs: Packs::load(&assets).expect("packs"),
            catalogue: Catalogue::load(&assets).expect("catalogue"),
        }
    }

    fn load(&self, files: &BTreeMap<String, String>) -> Result<Suites, Vec<Diagnostic>> {
        let vocabulary = PackVocabulary {
            packs: &self.packs,
            catalogue: &self.catalogue,
            hooks: &HOOKS,
        };
        let files = files.iter().map(|(path, text)| (path.as_str(), text.as_str()));
        Suites::load_files(files, &vocabulary, &CHECKS)
    }
}

fn rendered(problems: &[Diagnostic]) -> String {
    problems.iter().map(|problem| format!("{problem}\n")).collect()
}

fn loaded() -> Suites {
    World::new()
        .load(&good())
        .unwrap_or_else(|problems| panic!("{}", rendered(&problems)))
}

#[test]
fn good_suites_load_without_a_word() {
    let suites = loaded();
    let ids: Vec<_> = suites.tests.iter().map(|test| test.id.as_str()).collect();
    assert_eq!(
        ids,
        [
            "connection/last-will-and-return",
            "dispatch/keeps-going",
            "map/download-enable-delete",
            "order/edge-actions",
            "order/malformed[negative-update]",
            "order/malformed[no-order-id]",
            "order/update-lower-id-refused",
        ]
    );
    assert_eq!(suites.monitors.len(), 2);
}
