//! Finding the sources of settings, and laying them over one another.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::effective::{Effective, effective};
use super::key::{KEYS, Key, PASSWORD_VARIABLE};
use super::layer::{Layer, Origin, Setter};
use super::surroundings::Surroundings;
use super::value::Value;
use super::{DEFAULT_TOML, read};
use tck_base::diagnostic::{self, Diagnostic, Source};
use tck_pack::Hooks;

/// Variables that belong to flags which are no settings of a device.
const OTHER_VARIABLES: [&str; 8] = [
    PASSWORD_VARIABLE,
    tck_base::shard::SHARDS,
    "VDA5050_TCK_PROFILE",
    "VDA5050_TCK_OUT",
    "VDA5050_TCK_FORMAT",
    "VDA5050_TCK_SUITES",
    "VDA5050_TCK_LOG",
    "VDA5050_TCK_LOG_FILE",
];

/// Name of the project file.
const PROJECT_FILE: &str = "vda5050-tck.toml";

impl Surroundings {
    fn project_file(&self) -> Option<PathBuf> {
        self.directory
            .ancestors()
            .map(|folder| folder.join(PROJECT_FILE))
            .find(|file| file.is_file())
    }

    fn user_file(&self) -> Option<PathBuf> {
        let absolute = |name: &str| {
            let path = PathBuf::from(self.environment.get(name)?);
            path.is_absolute().then_some(path)
        };
        let config = absolute("XDG_CONFIG_HOME").or_else(|| Some(absolute("HOME")?.join(".config")))?;
        Some(config.join("vda5050-tck").join("config.toml")).filter(|file| file.is_file())
    }

    fn layer(&self, hooks: &Hooks) -> Result<Layer, Vec<Diagnostic>> {
        let mut layer = Layer::default();
        let mut wrong = Vec::new();
        for (name, text) in &self.environment {
            let ours = name.starts_with("VDA5050_TCK_") && !OTHER_VARIABLES.contains(&name.as_str());
            // Set to nothing is how scripts say "not set".
            if !ours || text.is_empty() {
                continue;
            }
            let Some(key) = KEYS.iter().find(|key| key.variable() == *name) else {
                let names: Vec<String> = KEYS.iter().map(Key::variable).collect();
                let title = format!("the environment variable {name} is not known");
                let hint = match diagnostic::closest(name, names.iter().map(String::as_str)) {
                    Some(close) => format!("did you mean `{close}`?"),
                    None => "the name is VDA5050_TCK_, the section, `_`, and the name of the setting".to_owned(),
                };
                wrong.push(Diagnostic::whole("unknown-key", title).hint(hint));
                continue;
            };
            match given(
                key,
                text,
                &self.directory,
                &Origin::Environment,
                &format!("the environment variable {name}"),
                hooks,
            ) {
                Ok(setter) => drop(layer.values.insert(key.path, setter)),
                Err(diagnostic) => wrong.push(diagnostic),
            }
        }
        if wrong.is_empty() { Ok(layer) } else { Err(wrong) }
    }
}

fn given(
    key: &Key,
    text: &str,
    folder: &Path,
    origin: &Origin,
    what: &str,
    hooks: &Hooks,
) -> Result<Setter, Diagnostic> {
    match Value::from_text(key.kind, text, folder, hooks) {
        Ok(value) => Ok(Setter {
            value,
            origin: origin.clone(),
            span: None,
        }),
        Err(refusal) => {
            let title = format!("bad value for {what}: {}", refusal.label);
            let diagnostic = Diagnostic::whole(refusal.code, title);
            Err(match refusal.hint {
                Some(hint) => diagnostic.hint(hint),
                None => diagnostic,
            })
        }
    }
}

fn file(path: &Path, hooks: &Hooks) -> Result<Layer, Vec<Diagnostic>> {
    let name = path.display().to_string();
    let text = std::fs::read_to_string(path).map_err(|error| {
        let diagnostic = Diagnostic::whole("unreadable", format!("the profile {name} cannot be read: {error}"));
        vec![
            diagnostic
                .hint("give the path of a profile with --profile; every setting is explained in the documentation"),
        ]
    })?;
    let folder = path.parent().unwrap_or(Path::new(""));
    read::read(&Source::new(name.clone(), text), folder, Origin::File(name), hooks)
}

fn defaults(hooks: &Hooks) -> Result<Layer, Vec<Diagnostic>> {
    read::read(
        &Source::new("defaults", DEFAULT_TOML),
        Path::new(""),
        Origin::Default,
        hooks,
    )
}

/// The effective profile: `flags` (name of the setting and text) over environment, profile, project file,
/// user file and defaults. A hook in it is one of `hooks`.
///
/// # Errors
/// Every mistake in any of them.
pub fn load(
    profile: Option<&Path>,
    flags: &[(&'static str, String)],
    surroundings: &Surroundings,
    hooks: &Hooks,
) -> Result<Effective, Vec<Diagnostic>> {
    let mut from_flags = Layer::default();
    let mut wrong = Vec::new();
    for (path, text) in flags {
        let Some(key) = Key::find(path) else {
            wrong.push(Diagnostic::whole(
                "unknown-key",
                format!("there is no setting `{path}`"),
            ));
            continue;
        };
        match given(
            key,
            text,
            &surroundings.directory,
            &Origin::Flag,
            &format!("the flag for `{path}`"),
            hooks,
        ) {
            Ok(setter) => drop(from_flags.values.insert(key.path, setter)),
            Err(diagnostic) => wrong.push(diagnostic),
        }
    }
    let files = [
        surroundings.user_file(),
        surroundings.project_file(),
        profile.map(Path::to_path_buf),
    ];
    let layers = std::iter::once(defaults(hooks))
        .chain(files.into_iter().flatten().map(|path| file(&path, hooks)))
        .chain([surroundings.layer(hooks), Ok(from_flags)]);
    let mut merged = Layer::default();
    for layer in layers {
        match layer {
            Ok(layer) => merged = merged.under(layer),
            Err(diagnostics) => wrong.extend(diagnostics),
        }
    }
    if wrong.is_empty() {
        effective(&merged.fit_defaults(), hooks)
    } else {
        Err(wrong)
    }
}

/// Reads one profile by itself, over the defaults only. Relative files in it are found from `folder`.
///
/// # Errors
/// Every mistake in it.
pub fn check(source: &Arc<Source>, folder: &Path, hooks: &Hooks) -> Result<Effective, Vec<Diagnostic>> {
    let layer = read::read(source, folder, Origin::File(source.name.clone()), hooks)?;
    effective(&defaults(hooks)?.under(layer).fit_defaults(), hooks)
}
