//! What a run takes on: which tests, which of their many cases, and under which name.

use std::str::FromStr;
use std::time::Duration;

use super::selection::{Criteria, Selection, SelectionError};
use tck_judge::Library;
use tck_pack::{Pack, Role};

/// What a run takes on, and what it is called.
#[derive(Clone, Debug, Default)]
pub struct Request {
    /// The tests, in order.
    pub tests: Selection,
    /// Which cases that come from a schema or a matrix are run; all of them without a seed.
    pub draw: Option<u64>,
    /// Identifier of the run; makes ids unique.
    pub run: String,
    /// The command line, for the record.
    pub command: Vec<String>,
    /// Whether the run ends after the first test that fails.
    pub fail_fast: bool,
    /// How often each test is run.
    pub repeat: u32,
    /// How long the run may take; tests that do not fit into it are left out.
    pub budget: Option<Duration>,
    /// Whether nothing is left to choose: the run is for a certificate.
    pub certifies: bool,
    /// What restricts the statement because of what was asked for, one sentence each.
    pub limits: Vec<String>,
}

impl Request {
    /// All tests of a role and version, with the cases that the seed 1 draws.
    #[must_use]
    pub fn all(role: Role, library: &Library, pack: &Pack) -> Self {
        Self {
            tests: Selection::all(library.tests(role, &pack.id)),
            draw: Some(1),
            run: of_eight(uuid::Uuid::new_v4()),
            repeat: 1,
            ..Self::default()
        }
    }
}

/// One part of a run that several benches share.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shard {
    /// Which part, counted from 1.
    pub index: usize,
    /// Of how many.
    pub of: usize,
}

impl Shard {
    /// Whether the test at a place of the plan, counted from 0, belongs to this part.
    #[must_use]
    pub fn takes(self, place: usize) -> bool {
        place % self.of == self.index - 1
    }
}

impl FromStr for Shard {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let parts = text
            .split_once('/')
            .and_then(|(index, of)| Some((index.parse().ok()?, of.parse().ok()?)));
        match parts {
            Some((index, of)) if (1..=of).contains(&index) => Ok(Self { index, of }),
            Some((_, 0)) => Err("there is at least one part".to_owned()),
            Some((index, of)) => Err(format!("there is no part {index} of {of}")),
            None => Err("a part is written like 2/4: the second of four".to_owned()),
        }
    }
}

/// Chooses what a run takes on. Without a word it is every test, and what is drawn differs from run to run.
#[derive(Clone, Debug, Default)]
pub struct RequestBuilder {
    criteria: Criteria,
    left: Option<Selection>,
    shard: Option<Shard>,
    seed: Option<u64>,
    thorough: bool,
    same_draw: bool,
    fail_fast: bool,
    repeat: u32,
    budget: Option<Duration>,
    certifies: bool,
    command: Vec<String>,
}

impl RequestBuilder {
    /// Everything.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Selects the tests that match: an id, a group or table, or `*` for anything. May be called again for more of them.
    #[must_use]
    pub fn select(mut self, pattern: impl Into<String>) -> Self {
        self.criteria.patterns.push(pattern.into());
        self
    }

    /// Selects by all of this.
    #[must_use]
    pub fn criteria(mut self, criteria: Criteria) -> Self {
        self.criteria = criteria;
        self
    }

    /// Takes what a run that broke off has left, whatever is selected, with all of its cases.
    #[must_use]
    pub fn left(mut self, left: Selection) -> Self {
        self.left = Some(left);
        self
    }

    /// Takes one part of the selected tests.
    #[must_use]
    pub fn shard(mut self, shard: Shard) -> Self {
        self.shard = Some(shard);
        self
    }

    /// Draws by this seed, and makes ids from it, so that the run is the same again.
    #[must_use]
    pub fn seed(mut self, seed: u64) -> Self {
        self.seed = Some(seed);
        self
    }

    /// Tries all cases that come from schemas and matrices.
    #[must_use]
    pub fn thorough(mut self) -> Self {
        self.thorough = true;
        self
    }

    /// Draws the same cases in every run, with ids of its own in each.
    #[must_use]
    pub fn same_draw(mut self) -> Self {
        self.same_draw = true;
        self
    }

    /// Ends the run after the first test that fails.
    #[must_use]
    pub fn fail_fast(mut self) -> Self {
        self.fail_fast = true;
        self
    }

    /// Runs each test so often.
    #[must_use]
    pub fn repeat(mut self, times: u32) -> Self {
        self.repeat = times;
        self
    }

    /// Leaves out tests that do not fit any more into this time.
    #[must_use]
    pub fn budget(mut self, budget: Duration) -> Self {
        self.budget = Some(budget);
        self
    }

    /// Marks the run as one for a certificate.
    #[must_use]
    pub fn certifies(mut self) -> Self {
        self.certifies = true;
        self
    }

    /// Records the command line that asked for it.
    #[must_use]
    pub fn command(mut self, command: Vec<String>) -> Self {
        self.command = command;
        self
    }

    /// The request, for a role and a version.
    ///
    /// # Errors
    /// When a part of the selection means nothing that there is, or no test is left.
    pub fn build(self, role: Role, library: &Library, pack: &Pack) -> Result<Request, SelectionError> {
        let goes_on = self.left.is_some();
        let mut tests = match self.left {
            Some(left) => left,
            None => self.criteria.among(&library.tests(role, &pack.id), library, pack)?,
        };
        if let Some(shard) = self.shard {
            let mut place = 0;
            tests.retain(|_| {
                place += 1;
                shard.takes(place - 1)
            });
        }
        if tests.is_empty() {
            return Err(SelectionError::Nothing("no test was selected".to_owned()));
        }
        let random = uuid::Uuid::new_v4();
        // Whoever names a single case means it; the parts of one run have to draw the same.
        let whole = self.thorough || goes_on || self.criteria.patterns.iter().any(|pattern| pattern.contains('['));
        let draw = match self.seed {
            _ if whole => None,
            Some(seed) => Some(seed),
            None if self.shard.is_some() || self.same_draw => Some(1),
            None => Some(u64::from(random.as_fields().0)),
        };
        let limit = |Shard { index, of }| {
            format!(
                "Only part {index} of {of} of the tests was run (--shard): what the other parts found is not in here."
            )
        };
        Ok(Request {
            tests,
            draw,
            // The ids of a run that goes on are not those it has begun with.
            run: match self.seed.filter(|_| !goes_on) {
                Some(seed) => format!("seed{seed}"),
                None => of_eight(random),
            },
            command: self.command,
            fail_fast: self.fail_fast,
            repeat: self.repeat.max(1),
            budget: self.budget,
            certifies: self.certifies,
            limits: self.shard.map(limit).into_iter().collect(),
        })
    }
}

/// The first eight digits.
fn of_eight(id: uuid::Uuid) -> String {
    id.simple().to_string()[..8].to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn built(builder: RequestBuilder) -> Result<Request, SelectionError> {
        let library = tck_testing::library();
        builder.build(Role::Agv, library, library.rules.packs.latest())
    }

    #[test]
    fn a_seed_draws_and_names_the_same_and_whoever_names_a_case_means_it() {
        let seeded = built(RequestBuilder::new().seed(7)).unwrap();
        assert_eq!((seeded.draw, seeded.run.as_str()), (Some(7), "seed7"));
        assert!(seeded.tests.is_complete());
        let resumed = built(RequestBuilder::new().seed(7).left(seeded.tests.clone())).unwrap();
        assert_ne!(resumed.run, "seed7", "its ids were sent before");
        let thorough = built(RequestBuilder::new().seed(7).thorough()).unwrap();
        assert_eq!(thorough.draw, None);
        let single = built(RequestBuilder::new().select("*[*")).unwrap();
        assert!(single.draw.is_none() && !single.tests.is_complete());
        let same = RequestBuilder::new().same_draw();
        let (one, other) = (built(same.clone()).unwrap(), built(same).unwrap());
        assert_eq!((one.draw, other.draw), (Some(1), Some(1)));
        assert_ne!(one.run, other.run);
    }

    #[test]
    fn the_parts_of_a_run_are_all_of_it_and_each_says_that_it_is_one() {
        let all = built(RequestBuilder::new()).unwrap().tests.len();
        let parts = (1..=3).map(|index| built(RequestBuilder::new().shard(Shard { index, of: 3 })).unwrap());
        let parts: Vec<Request> = parts.collect();
        assert_eq!(parts.iter().map(|part| part.tests.len()).sum::<usize>(), all);
        for part in parts {
            assert!(!part.tests.is_complete() && part.draw == Some(1) && part.limits.len() == 1);
        }
    }

    #[test]
    fn nothing_selected_is_no_small_green_run() {
        let nothing = RequestBuilder::new().select("order-rejection/lower-update-id");
        let second = nothing.shard(Shard { index: 2, of: 2 });
        assert!(matches!(built(second), Err(SelectionError::Nothing(_))));
    }
}
