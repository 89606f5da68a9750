//! The log: what happens inside, for whoever looks for a mistake. Results and evidence are not part of it.

use std::fs::File;
use std::io::{self, IsTerminal as _, Write};
use std::path::Path;
use std::sync::{Arc, Mutex, PoisonError};

use tracing_subscriber::fmt::MakeWriter;
use tracing_subscriber::{EnvFilter, fmt};

use super::problem::Problem;
use tck_profile::Secrets;

/// What is logged unless said: everything of this program, and what goes wrong elsewhere.
const USUAL: &str = "warn,vda5050_tck=debug,tck_=debug";

/// The environment variable that says what is logged, as `tracing` has it.
const FILTER: &str = "VDA5050_TCK_LOG";

/// Begins to log, to a file or, where the user wants to know everything, to standard error.
pub(super) fn begin(file: Option<&Path>, verbose: u8) -> Result<(), Problem> {
    let sink = match file {
        Some(path) => {
            let file = File::create(path);
            Sink::File(file.map_err(|error| {
                Problem::Environment(format!("the log cannot be written to {}: {error}", path.display()))
            })?)
        }
        None if verbose >= 2 => Sink::Terminal {
            is_raw_at_times: io::stderr().is_terminal(),
        },
        None => return Ok(()),
    };
    let filter = match std::env::var(FILTER) {
        Ok(text) if !text.is_empty() => EnvFilter::try_new(&text)
            .map_err(|error| Problem::Environment(format!("{FILTER} cannot be understood: {error}")))?,
        _ => EnvFilter::new(USUAL),
    };
    // It is the only one: this is called once, at the beginning of the program.
    let _ = fmt()
        .with_env_filter(filter)
        .with_ansi(false)
        .with_writer(Log(Arc::new(Mutex::new(sink))))
        .try_init();
    Ok(())
}

enum Sink {
    File(File),
    Terminal {
        /// While a person is asked something, a line break alone does not go back to the left.
        is_raw_at_times: bool,
    },
}

#[derive(Clone)]
struct Log(Arc<Mutex<Sink>>);

impl<'a> MakeWriter<'a> for Log {
    type Writer = Self;

    fn make_writer(&'a self) -> Self {
        self.clone()
    }
}

impl Write for Log {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        // A line comes as a whole. Addresses lose what is for no reader; other secrets are not logged.
        let text = Secrets::default().out_of(&String::from_utf8_lossy(bytes));
        match &mut *self.0.lock().unwrap_or_else(PoisonError::into_inner) {
            Sink::File(file) => file.write_all(text.as_bytes())?,
            Sink::Terminal { is_raw_at_times: true } => {
                io::stderr().write_all(text.replace('\n', "\r\n").as_bytes())?;
            }
            Sink::Terminal { .. } => io::stderr().write_all(text.as_bytes())?,
        }
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        match &mut *self.0.lock().unwrap_or_else(PoisonError::into_inner) {
            Sink::File(file) => file.flush(),
            Sink::Terminal { .. } => io::stderr().flush(),
        }
    }
}
