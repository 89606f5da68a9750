//! Journal and test in, decisions out.
//!
//! Pure: no clock, no network, no engine. [`RunJudge`] sees every entry of a run, [`TestJudge`] those of one
//! test, an evaluator those of one step; [`MonitorJudge`] watches everything. The engine shows it entries
//! as they happen and asks what to wait for; `report --rejudge` shows it the same entries again.
#![forbid(unsafe_code)]
#![warn(missing_docs)]

mod clause_outcome;
mod clients;
mod conversation_coverage;
mod decide;
mod declined;
mod delivery;
mod disconnect;
mod eval_context;
mod gone;
mod hidden;
mod join;
mod library;
mod limit;
mod merge;
mod message_tally;
mod monitor;
mod monitor_set;
mod never_shown;
mod on_word;
mod own_errors;
mod program;
mod reactions;
mod repair;
mod requirement_verdict;
mod rules;
mod run;
mod run_contexts;
mod sent;
mod step;
mod test;
mod timeline;
mod traffic_judge;
mod window;

pub use gone::{Gone, Sign};
pub use join::{Evidence, JoinError, RunPart, join};
pub use library::Library;
pub use message_tally::MessageTally;
pub use monitor::MonitorJudge;
pub use monitor_set::Observed;
pub use never_shown::of_monitors as never_shown;
pub use rules::{JudgeError, Rules};
pub use run::{RESULT_FORMAT, RunJudge, judge, judged};
pub use run_contexts::Ground;
pub use step::Progress;
pub use test::TestJudge;
pub use timeline::{Timeline, client_of, number_of};
pub use traffic_judge::TrafficJudge;
