//! Journal and test in, decisions out.
//!
//! Pure: no clock, no network, no engine. [`RunJudge`] sees every entry of a run, [`TestJudge`] those of one
//! test, an evaluator those of one step; [`MonitorJudge`] watches everything. The engine shows it entries
//! as they happen and asks what to wait for; `report --rejudge` shows it the same entries again.
#![forbid(unsafe_code)]
#![warn(missing_docs)]

mod company;
mod decide;
mod departure;
mod gone;
mod grounds;
mod hidden;
mod holds;
mod joined;
mod library;
mod limit;
mod mend;
mod monitor;
mod opinions;
mod own_errors;
mod program;
mod reactions;
mod rules;
mod run;
mod said;
mod scene;
mod sent;
mod side;
mod step;
mod test;
mod timeline;
mod unheard;
mod watches;
mod window;

pub use gone::{Gone, Sign};
pub use grounds::Ground;
pub use library::Library;
pub use monitor::MonitorJudge;
pub use rules::{JudgeError, Rules};
pub use run::{RESULT_FORMAT, RunJudge, judge, judged};
pub use side::SideJudge;
pub use step::Progress;
pub use test::TestJudge;
pub use timeline::{Timeline, client_of, number_of};
pub use watches::Observed;
