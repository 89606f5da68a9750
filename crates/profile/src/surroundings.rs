//! What is around the program: folder and environment.

use std::collections::BTreeMap;
use std::path::PathBuf;

/// What a process finds around itself. A value, so that tests need no real environment.
#[derive(Clone, Debug, Default)]
pub struct Surroundings {
    /// Where the project file is looked for, here and above.
    pub directory: PathBuf,
    /// Environment variables.
    pub environment: BTreeMap<String, String>,
}

impl Surroundings {
    /// Those of this process. Variables that are not text are left out.
    #[must_use]
    pub fn of_process() -> Self {
        Self {
            directory: std::env::current_dir().unwrap_or_default(),
            environment: std::env::vars_os()
                .filter_map(|(name, value)| Some((name.into_string().ok()?, value.into_string().ok()?)))
                .collect(),
        }
    }
}
