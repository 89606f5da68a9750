//! What schedulers say of the part that a process is to do: one table, which the documentation shows as it stands here.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use super::Shard;

/// The variable that says how many parts there are, where a scheduler does not.
pub const SHARDS: &str = "VDA5050_TCK_SHARDS";

/// How a scheduler counts its parts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Numbering {
    /// From 0.
    FromZero,
    /// From 1.
    FromOne,
    /// From any number, in steps of any size; these variables say which.
    Steps {
        /// The first number.
        first: &'static str,
        /// From one to the next.
        step: &'static str,
    },
}

/// Who says how many parts there are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Count {
    /// A variable of the scheduler.
    By(&'static str),
    /// A variable of the scheduler that holds the last number.
    UpTo(&'static str),
    /// Nobody but the user, in [`SHARDS`].
    Asked,
}

/// A scheduler that starts several processes of one job.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Scheduler {
    /// Its name, and what of it makes several processes.
    pub name: &'static str,
    /// The variable that says which one this is.
    pub index: &'static str,
    /// How it counts.
    pub numbering: Numbering,
    /// Who says of how many.
    pub count: Count,
}

/// Every scheduler that is understood.
pub const SCHEDULERS: [Scheduler; 10] = [
    Scheduler {
        name: "Kubernetes, Indexed Job",
        index: "JOB_COMPLETION_INDEX",
        numbering: Numbering::FromZero,
        count: Count::Asked,
    },
    Scheduler {
        name: "Slurm, job array",
        index: "SLURM_ARRAY_TASK_ID",
        numbering: Numbering::Steps {
            first: "SLURM_ARRAY_TASK_MIN",
            step: "SLURM_ARRAY_TASK_STEP",
        },
        count: Count::By("SLURM_ARRAY_TASK_COUNT"),
    },
    Scheduler {
        name: "AWS Batch, array job",
        index: "AWS_BATCH_JOB_ARRAY_INDEX",
        numbering: Numbering::FromZero,
        count: Count::By("AWS_BATCH_JOB_ARRAY_SIZE"),
    },
    Scheduler {
        name: "GitLab, `parallel`",
        index: "CI_NODE_INDEX",
        numbering: Numbering::FromOne,
        count: Count::By("CI_NODE_TOTAL"),
    },
    Scheduler {
        name: "Buildkite, `parallelism`",
        index: "BUILDKITE_PARALLEL_JOB",
        numbering: Numbering::FromZero,
        count: Count::By("BUILDKITE_PARALLEL_JOB_COUNT"),
    },
    Scheduler {
        name: "CircleCI, `parallelism`",
        index: "CIRCLE_NODE_INDEX",
        numbering: Numbering::FromZero,
        count: Count::By("CIRCLE_NODE_TOTAL"),
    },
    Scheduler {
        name: "Azure Pipelines, `parallel`",
        index: "SYSTEM_JOBPOSITIONINPHASE",
        numbering: Numbering::FromOne,
        count: Count::By("SYSTEM_TOTALJOBSINPHASE"),
    },
    Scheduler {
        name: "Google Cloud Run, job",
        index: "CLOUD_RUN_TASK_INDEX",
        numbering: Numbering::FromZero,
        count: Count::By("CLOUD_RUN_TASK_COUNT"),
    },
    Scheduler {
        name: "Grid Engine, array job",
        index: "SGE_TASK_ID",
        numbering: Numbering::Steps {
            first: "SGE_TASK_FIRST",
            step: "SGE_TASK_STEPSIZE",
        },
        count: Count::UpTo("SGE_TASK_LAST"),
    },
    Scheduler {
        name: "PBS, job array from 0",
        index: "PBS_ARRAY_INDEX",
        numbering: Numbering::FromZero,
        count: Count::Asked,
    },
];

/// A part, and who has said that it is to be done.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ChosenShard {
    /// The part.
    pub shard: Shard,
    /// Who says so: `--shard`, or a scheduler with the variables that were read.
    pub origin: String,
}

/// Why nobody knows which part is to be done.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum SchedulerError {
    /// A variable is missing, or makes no sense.
    #[error("{scheduler} has set {found}, and that says no part: {why}")]
    Unclear {
        /// The scheduler.
        scheduler: &'static str,
        /// Variables with their values.
        found: String,
        /// What is wrong.
        why: String,
    },
    /// Two schedulers say different parts.
    #[error("two schedulers say which part to do: {one}, and {other}")]
    Contradiction {
        /// One of them.
        one: String,
        /// The other one.
        other: String,
    },
}

/// Which part is to be done: what the flag says, else what a scheduler says. `None` is all of it, as `--shard 1/1` is.
///
/// # Errors
/// When a scheduler has begun to say a part and it is not clear which, or two of them differ.
pub fn chosen(
    flag: Option<Shard>,
    environment: &BTreeMap<String, String>,
) -> Result<Option<ChosenShard>, SchedulerError> {
    if let Some(shard) = flag {
        return Ok((!shard.is_whole()).then(|| ChosenShard {
            shard,
            origin: "--shard".to_owned(),
        }));
    }
    let mut found: Option<ChosenShard> = None;
    for scheduler in SCHEDULERS {
        let Some(own) = scheduler.says(environment)? else {
            continue;
        };
        match &found {
            Some(known) if known.shard != own.shard => {
                return Err(SchedulerError::Contradiction {
                    one: known.origin.clone(),
                    other: own.origin,
                });
            }
            Some(_) => {}
            None => found = Some(own),
        }
    }
    Ok(found.filter(|found| !found.shard.is_whole()))
}

impl Scheduler {
    /// What it says; `None` where it is not there.
    fn says(&self, environment: &BTreeMap<String, String>) -> Result<Option<ChosenShard>, SchedulerError> {
        let value = |name: &str| {
            environment
                .get(name)
                .map(|value| value.trim())
                .filter(|value| !value.is_empty())
        };
        let Some(index) = value(self.index) else {
            return Ok(None);
        };
        // Grid Engine says so of a job that is no array.
        if index == "undefined" {
            return Ok(None);
        }
        let mut found = format!("{}={}", self.index, bounded(index));
        let unclear = |found: &str, why: String| SchedulerError::Unclear {
            scheduler: self.name,
            found: found.to_owned(),
            why,
        };
        let mut number = |name: &'static str, usual: Option<u64>| -> Result<u64, String> {
            match (value(name), usual) {
                (Some(text), _) => {
                    let _ = write!(found, ", {name}={}", bounded(text));
                    text.parse().map_err(|_| format!("{name} is no number"))
                }
                (None, Some(usual)) => Ok(usual),
                (None, None) => Err(format!("{name} does not say of how many")),
            }
        };
        let mut parts = || -> Result<(u64, u64), String> {
            let index: u64 = index.parse().map_err(|_| format!("{} is no number", self.index))?;
            let (first, step) = match self.numbering {
                Numbering::FromZero => (0, 1),
                Numbering::FromOne => (1, 1),
                Numbering::Steps { first, step } => (number(first, Some(1))?, number(step, Some(1))?),
            };
            let count = match self.count {
                Count::By(name) => number(name, None)?,
                Count::UpTo(name) => {
                    let last = number(name, None)?;
                    last.checked_sub(first).map_or(0, |span| span / step.max(1) + 1)
                }
                Count::Asked => number(SHARDS, None)?,
            };
            let place = index
                .checked_sub(first)
                .filter(|beyond| step > 0 && beyond % step == 0)
                .map(|beyond| beyond / step + 1);
            let place = place.ok_or_else(|| "the numbers of the array are not evenly spaced".to_owned())?;
            Ok((place, count))
        };
        let (place, count) = parts().map_err(|why| unclear(&found, why))?;
        let small = |number: u64| usize::try_from(number).unwrap_or(usize::MAX);
        let Some(shard) = Shard::new(small(place), small(count)) else {
            let why = format!("there is no part {place} of {count}");
            return Err(unclear(&found, why));
        };
        Ok(Some(ChosenShard {
            shard,
            origin: format!("{}: {found}", self.name.replace('`', "")),
        }))
    }

    /// The row of the table in the documentation.
    #[must_use]
    pub fn row(&self) -> String {
        let index = match self.numbering {
            Numbering::FromZero => format!("`{}`, from 0", self.index),
            Numbering::FromOne => format!("`{}`, from 1", self.index),
            Numbering::Steps { first, step } => format!("`{}`, from `{first}` by `{step}`", self.index),
        };
        let count = match self.count {
            Count::By(name) => format!("`{name}`"),
            Count::UpTo(name) => format!("`{name}` is the last"),
            Count::Asked => format!("`{SHARDS}`, which you set"),
        };
        format!("| {} | {index} | {count} |", self.name)
    }
}

/// A value of a variable, which anybody may have set, fit to be shown.
fn bounded(text: &str) -> String {
    text.chars().take(20).filter(|c| !c.is_control()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn environment(all: &[(&str, &str)]) -> BTreeMap<String, String> {
        all.iter()
            .map(|(name, value)| ((*name).to_owned(), (*value).to_owned()))
            .collect()
    }

    fn said(all: &[(&str, &str)]) -> Option<(String, String)> {
        let chosen = chosen(None, &environment(all)).expect("clear")?;
        Some((chosen.shard.to_string(), chosen.origin))
    }

    #[test]
    fn each_scheduler_is_understood_in_its_own_way_of_counting() {
        for (variables, shard) in [
            (&[("JOB_COMPLETION_INDEX", "0"), ("VDA5050_TCK_SHARDS", "4")][..], "1/4"),
            (
                &[
                    ("SLURM_ARRAY_TASK_ID", "7"),
                    ("SLURM_ARRAY_TASK_MIN", "1"),
                    ("SLURM_ARRAY_TASK_STEP", "2"),
                    ("SLURM_ARRAY_TASK_COUNT", "4"),
                ],
                "4/4",
            ),
            (
                &[
                    ("SLURM_ARRAY_TASK_ID", "0"),
                    ("SLURM_ARRAY_TASK_MIN", "0"),
                    ("SLURM_ARRAY_TASK_COUNT", "8"),
                ],
                "1/8",
            ),
            (
                &[("AWS_BATCH_JOB_ARRAY_INDEX", "3"), ("AWS_BATCH_JOB_ARRAY_SIZE", "4")],
                "4/4",
            ),
            (&[("CI_NODE_INDEX", "2"), ("CI_NODE_TOTAL", "4")], "2/4"),
            (
                &[("BUILDKITE_PARALLEL_JOB", "1"), ("BUILDKITE_PARALLEL_JOB_COUNT", "3")],
                "2/3",
            ),
            (&[("CIRCLE_NODE_INDEX", "1"), ("CIRCLE_NODE_TOTAL", "3")], "2/3"),
            (
                &[("SYSTEM_JOBPOSITIONINPHASE", "3"), ("SYSTEM_TOTALJOBSINPHASE", "3")],
                "3/3",
            ),
            (&[("CLOUD_RUN_TASK_INDEX", "0"), ("CLOUD_RUN_TASK_COUNT", "2")], "1/2"),
            (
                &[
                    ("SGE_TASK_ID", "5"),
                    ("SGE_TASK_FIRST", "1"),
                    ("SGE_TASK_LAST", "9"),
                    ("SGE_TASK_STEPSIZE", "4"),
                ],
                "2/3",
            ),
            (&[("PBS_ARRAY_INDEX", "1"), ("VDA5050_TCK_SHARDS", "2")], "2/2"),
        ] {
            let (found, origin) = said(variables).unwrap_or_else(|| panic!("{variables:?}"));
            assert_eq!(found, shard, "{variables:?}");
            assert!(
                variables
                    .iter()
                    .all(|(name, value)| origin.contains(&format!("{name}={value}"))),
                "{origin}"
            );
        }
    }

    #[test]
    fn without_a_scheduler_or_with_one_process_of_it_everything_is_done() {
        assert_eq!(said(&[]), None);
        assert_eq!(said(&[("CI_NODE_TOTAL", "1")]), None);
        assert_eq!(said(&[("CI_NODE_INDEX", "1"), ("CI_NODE_TOTAL", "1")]), None);
        assert_eq!(
            said(&[("SGE_TASK_ID", "undefined"), ("SGE_TASK_LAST", "undefined")]),
            None
        );
        assert_eq!(said(&[("VDA5050_TCK_SHARDS", "4")]), None);
    }

    #[test]
    fn a_flag_wins_and_one_of_one_turns_it_off() {
        let of_gitlab = environment(&[("CI_NODE_INDEX", "2"), ("CI_NODE_TOTAL", "4")]);
        let flag = |text: &str| chosen(Some(text.parse().expect("a part")), &of_gitlab).expect("clear");
        assert_eq!(flag("1/1"), None);
        let named = flag("3/8").expect("a part");
        assert_eq!(
            (named.shard.to_string(), named.origin.as_str()),
            ("3/8".to_owned(), "--shard")
        );
        // Even where nobody could read what the scheduler says.
        let odd = environment(&[("CI_NODE_INDEX", "x"), ("CI_NODE_TOTAL", "4")]);
        assert_eq!(chosen(Some(Shard { index: 1, of: 1 }), &odd), Ok(None));
    }

    #[test]
    fn what_says_no_part_is_said_and_never_taken_for_all_or_for_nothing() {
        for (variables, wanted) in [
            (
                &[("JOB_COMPLETION_INDEX", "0")][..],
                "VDA5050_TCK_SHARDS does not say of how many",
            ),
            (
                &[("CI_NODE_INDEX", "5"), ("CI_NODE_TOTAL", "4")],
                "there is no part 5 of 4",
            ),
            (
                &[("CI_NODE_INDEX", "x"), ("CI_NODE_TOTAL", "4")],
                "CI_NODE_INDEX is no number",
            ),
            (
                &[
                    ("SLURM_ARRAY_TASK_ID", "4"),
                    ("SLURM_ARRAY_TASK_MIN", "1"),
                    ("SLURM_ARRAY_TASK_STEP", "2"),
                    ("SLURM_ARRAY_TASK_COUNT", "4"),
                ],
                "not evenly spaced",
            ),
            (
                &[
                    ("SLURM_ARRAY_TASK_ID", "9"),
                    ("SLURM_ARRAY_TASK_MIN", "1"),
                    ("SLURM_ARRAY_TASK_COUNT", "4"),
                ],
                "there is no part 9 of 4",
            ),
            (
                &[
                    ("CI_NODE_INDEX", "2"),
                    ("CI_NODE_TOTAL", "4"),
                    ("CIRCLE_NODE_INDEX", "0"),
                    ("CIRCLE_NODE_TOTAL", "4"),
                ],
                "two schedulers",
            ),
        ] {
            let error = chosen(None, &environment(variables)).expect_err(wanted);
            assert!(error.to_string().contains(wanted), "{error}");
        }
    }
}
