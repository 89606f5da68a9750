//! Which files make a device what it is: its profile, its program, and what both of them name. A run that goes on with another
//! one has to be about the same; their hashes tell it.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use sha2::{Digest as _, Sha256};

use tck_journal::event::hex;
use tck_profile::{Effective, LayoutSource};

/// The files by the names they have in the profile, with the SHA-256 of each. What cannot be read is left to those who use it.
pub(super) fn files(effective: &Effective, profile: Option<&Path>, folder: &Path) -> BTreeMap<String, String> {
    let mut all = BTreeMap::new();
    let mut add = |name: String, path: &Path| {
        if let Some(hash) = hash(path) {
            all.insert(name, hash);
        }
    };
    if let Some(profile) = profile {
        let name = profile.file_name().unwrap_or_default();
        add(format!("profile {}", name.display()), profile);
    }
    let known = &effective.profile;
    for (at, word) in known.device.command.iter().flatten().enumerate() {
        if let Some(path) = file_of(word, at == 0, folder) {
            add(format!("program {word}"), &path);
        }
    }
    if let LayoutSource::Lif { file, .. } = &known.layout.source {
        add(format!("layout {}", file.display()), file);
    }
    for file in &known.maps {
        add(format!("map {}", file.display()), file);
    }
    all
}

/// The file that a word of a command names, if it names one. The first one is searched for as the system does.
fn file_of(word: &str, is_program: bool, folder: &Path) -> Option<PathBuf> {
    let beside = folder.join(word);
    if !is_program || word.contains('/') || word.contains(std::path::MAIN_SEPARATOR) {
        return beside.is_file().then_some(beside);
    }
    let search = std::env::var_os("PATH")?;
    let mut places = std::env::split_paths(&search).map(|place| place.join(word));
    places.find(|path| path.is_file())
}

fn hash(path: &Path) -> Option<String> {
    let mut file = std::fs::File::open(path).ok()?;
    let mut digest = Sha256::new();
    let mut part = vec![0; 1 << 20];
    loop {
        match std::io::Read::read(&mut file, &mut part) {
            Ok(0) => break,
            Ok(length) => digest.update(&part[..length]),
            Err(_) => return None,
        }
    }
    Some(hex(&digest.finalize()))
}
