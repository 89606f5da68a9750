//! What is known of a run while it goes on: its result on the disk, and the findings on the page.

use std::time::{Duration, Instant};

use crate::cli::page;
use tck_judge::RunJudge;
use tck_page::Page;
use tck_run::{Bundle, write_result};

/// How long a result on the disk may be behind the journal. Written after every test, the results of a long run cost more
/// than the run; what a crash leaves is complete in the journal, and `report` reads it from there.
const SAVED_EVERY: Duration = Duration::from_secs(5);

/// How long the findings on a page may be behind those of the judge.
const SHOWN_EVERY: Duration = Duration::from_secs(1);

/// Keeps `result.json` on the disk while a run goes on, and the findings on the page.
pub(super) fn saving(bundle: &Bundle, page: Option<Page>) -> impl FnMut(&RunJudge) + '_ {
    let mut written: Option<Instant> = None;
    let mut shown: Option<Instant> = None;
    let is_due = |last: Option<Instant>, every: Duration| last.is_none_or(|last| last.elapsed() >= every);
    move |judge| {
        let page = page.as_ref().filter(|_| is_due(shown, SHOWN_EVERY));
        let writes = is_due(written, SAVED_EVERY);
        if page.is_none() && !writes {
            return;
        }
        let result = judge.result();
        if let Some(page) = page {
            shown = Some(Instant::now());
            page.findings(page::findings_of(&result));
        }
        if writes {
            written = Some(Instant::now());
            drop(write_result(bundle, &result));
        }
    }
}
