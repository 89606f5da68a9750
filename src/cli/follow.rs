//! `audit --follow`: judge a recording while it is written.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use super::args::{Audit as Arguments, Format};
use super::exit::Exit;
use super::problem::Problem;
use super::recordings::{broken, in_time, mapping, show};
use crate::ui::{LineOptions, Lines};
use tck_audit::Options;
use tck_audit::result::Recording;
use tck_base::clock::WallClock;
use tck_base::diagnostic::Diagnostic;
use tck_capture::merge::Merged;
use tck_capture::{Recorded, Told};
use tck_judge::Library;
use tck_watch::Watch;
use tck_watch::session::Viewer as _;

/// Judges until it is interrupted.
pub fn follow(arguments: &Arguments, library: &Library, options: Options) -> Result<Exit, Problem> {
    let [path] = arguments.captures.as_slice() else {
        return Err(Diagnostic::whole("audit", "one recording can be followed at a time").into());
    };
    let name = path.display().to_string();
    let stop = stopped()?;
    let recorded = Recorded::follow(path, mapping(arguments), stop).map_err(broken)?;
    let mut watch = Watch::new(&library.rules, options)?;
    let mut lines = Lines::of_process(LineOptions {
        json: arguments.format == Format::Json,
        color: super::color() == tck_report::text::Color::Always,
        ..LineOptions::default()
    });
    let clock = WallClock::start();
    let unit = recorded.unit();
    let mut merged = Merged::new(vec![(name, recorded)]).map_err(broken)?;
    while let Some(told) = merged.read().map_err(broken)? {
        if !in_time(told.at(), arguments) {
            continue;
        }
        let notices = match told {
            Told::Message(message) => watch.take(clock.now(), message),
            Told::Wire(wire) => watch.take_wire(wire),
        };
        for notice in &notices {
            lines.found(notice);
        }
        if lines.is_closed() {
            break;
        }
    }
    let mut result = watch.finish();
    result.recordings = merged
        .counted()
        .into_iter()
        .map(|(name, counted)| Recording {
            name,
            unit: unit.to_owned(),
            lines: counted.lines,
            skipped: counted.skipped,
        })
        .collect();
    show(&result, arguments.format)
}

/// Becomes true when the user has had enough.
fn stopped() -> Result<Arc<AtomicBool>, Problem> {
    let stop = Arc::new(AtomicBool::new(false));
    let runtime = tokio::runtime::Builder::new_current_thread()
        .enable_all()
        .build()
        .map_err(|error| Problem::Environment(format!("cannot start: {error}")))?;
    let mut interrupt = {
        let _inside = runtime.enter();
        super::ending::interrupts()?
    };
    let told = Arc::clone(&stop);
    std::thread::spawn(move || {
        runtime.block_on(async {
            // Who sends is gone only when the program ends.
            let _ = interrupt.changed().await;
        });
        told.store(true, Ordering::Relaxed);
    });
    Ok(stop)
}
