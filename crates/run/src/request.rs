//! What a run takes on: which tests, which of their many cases, and under which name.

use std::time::Duration;

use super::selection::{Criteria, Selection, SelectionError};
use super::share::{share, share_vehicles};
use tck_base::shard::ChosenShard;
use tck_engine::Manners;
use tck_journal::event::{DIVIDED_TESTS, DIVIDED_VEHICLES, ShardRecord};
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
    /// Which part of a run it is.
    pub shard: Option<ShardRecord>,
    /// How the harness words its messages.
    pub manners: Manners,
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

/// Chooses what a run takes on. Without a word it is every test, and what is drawn differs from run to run.
#[derive(Clone, Debug, Default)]
pub struct RequestBuilder {
    criteria: Criteria,
    left: Option<Selection>,
    shard: Option<ChosenShard>,
    vehicles: Option<Vec<String>>,
    part: Option<ShardRecord>,
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
    pub fn shard(mut self, shard: ChosenShard) -> Self {
        self.shard = Some(shard);
        self
    }

    /// Divides these vehicles, which the harness plays, and not the tests.
    #[must_use]
    pub fn vehicles(mut self, names: Vec<String>) -> Self {
        self.vehicles = Some(names);
        self
    }

    /// Says that what a run has left was a part of another one.
    #[must_use]
    pub fn part(mut self, part: Option<ShardRecord>) -> Self {
        self.part = part;
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
        let shard = match (&self.shard, &self.vehicles) {
            (Some(chosen), Some(vehicles)) => Some(share_vehicles(&tests, chosen, vehicles)),
            (Some(chosen), None) => Some(share(&mut tests, chosen, draw)),
            (None, _) => self.part,
        };
        if let (Some(ShardRecord { index, of, filled, .. }), Some(_)) = (&shard, &self.vehicles)
            && index > filled
        {
            let why = format!("there is no vehicle for part {index} of {of}: there are {filled}");
            return Err(SelectionError::Nothing(why));
        }
        if let Some(ShardRecord { index, of, filled, .. }) = shard.as_ref().filter(|_| tests.is_empty()) {
            let why = format!(
                "no test was selected for part {index} of {of}: what was selected is divided into no more than {filled}"
            );
            return Err(SelectionError::Nothing(why));
        }
        let divided = match &self.vehicles {
            Some(_) => DIVIDED_VEHICLES,
            None => DIVIDED_TESTS,
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
            limits: shard.iter().map(|shard| shard.limit(divided)).collect(),
            shard,
            manners: Manners::default(),
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
    use tck_base::shard::Shard;

    fn part(index: usize, of: usize) -> ChosenShard {
        ChosenShard {
            shard: Shard { index, of },
            origin: "--shard".to_owned(),
        }
    }

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
        let all = built(RequestBuilder::new()).unwrap().tests;
        for of in [2, 3, 16] {
            let parts = (1..=of).map(|index| built(RequestBuilder::new().shard(part(index, of))).unwrap());
            let parts: Vec<Request> = parts.collect();
            let mut ids: Vec<&str> = parts
                .iter()
                .flat_map(|part| part.tests.iter().map(|test| test.id.as_str()))
                .collect();
            ids.sort_unstable();
            let mut wanted: Vec<&str> = all.iter().map(|test| test.id.as_str()).collect();
            wanted.sort_unstable();
            assert_eq!(ids, wanted);
            let facts = |request: &Request| {
                request
                    .shard
                    .clone()
                    .map(|shard| (shard.filled, shard.whole, shard.selection))
            };
            for (at, part) in parts.iter().enumerate() {
                assert!(!part.tests.is_complete() && part.draw == Some(1) && part.limits.len() == 1);
                assert_eq!(
                    part.shard.as_ref().map(|shard| (shard.index, shard.of)),
                    Some((at + 1, of))
                );
                assert_eq!(facts(part), facts(&parts[0]));
                // A table is drawn from as a whole, so that the parts draw what the whole would.
                for test in part.tests.iter().filter(|test| test.drawn.is_some()) {
                    let of_table =
                        |tests: &Selection| tests.iter().filter(|other| other.table() == test.table()).count();
                    assert_eq!(of_table(&part.tests), of_table(&all), "{}", test.id);
                }
            }
        }
        let other = built(RequestBuilder::new().select("order-rejection").shard(part(1, 2))).unwrap();
        let usual = built(RequestBuilder::new().shard(part(1, 2))).unwrap();
        assert_ne!(other.shard.unwrap().selection, usual.shard.unwrap().selection);
    }

    #[test]
    fn vehicles_are_divided_and_every_part_runs_all_tests() {
        let names: Vec<String> = (1..=5).map(|number| format!("ACME/mock-{number}")).collect();
        let of_part = |index| built(RequestBuilder::new().shard(part(index, 8)).vehicles(names.clone()));
        let (one, last) = (of_part(1).unwrap(), of_part(5).unwrap());
        assert_eq!(one.tests.len(), built(RequestBuilder::new()).unwrap().tests.len());
        assert_eq!(one.tests.len(), last.tests.len());
        let facts = |request: &Request| {
            let shard = request.shard.clone().unwrap();
            (shard.filled, shard.whole, shard.selection)
        };
        assert_eq!(facts(&one), facts(&last));
        assert_eq!(facts(&one).1, 5);
        assert!(one.limits[0].contains("of the vehicles"), "{:?}", one.limits);
        assert!(matches!(of_part(6), Err(SelectionError::Nothing(_))));
        let fewer = built(RequestBuilder::new().shard(part(1, 8)).vehicles(names[1..].to_vec())).unwrap();
        assert_ne!(facts(&one).2, facts(&fewer).2);
    }

    #[test]
    fn nothing_selected_is_no_small_green_run() {
        let nothing = RequestBuilder::new().select("order-rejection/lower-update-id");
        let second = nothing.shard(part(2, 2));
        assert!(matches!(built(second), Err(SelectionError::Nothing(_))));
    }
}
