//! What a call of `run` or `certify` asks for, held against suites and profile before anything is begun.

use tokio::sync::watch;

use super::Job;
use super::resume::Earlier;
use crate::cli::args;
use crate::cli::device::check_faults;
use crate::cli::like::Harness;
use crate::cli::page;
use crate::cli::problem::Problem;
use crate::cli::reference::{self, Asked};
use crate::cli::shard;
use crate::ui::Prompter;
use tck_base::diagnostic::Diagnostic;
use tck_base::shard::ChosenShard;
use tck_judge::Library;
use tck_pack::Role;
use tck_profile::{self as profile, Surroundings};
use tck_run::{Criteria, RequestBuilder, fleet_names, pack_of};

/// What is to be done, and whether the built-in device is tested. What a user has to know of it goes to `tell`.
pub(super) fn prepared(
    arguments: &args::Run,
    library: Library,
    surroundings: &Surroundings,
    tell: &dyn Fn(&str),
) -> Result<(Job, bool), Problem> {
    if arguments.in_virtual_time && arguments.people.page.address.is_some() {
        return Err(page::in_virtual_time());
    }
    // What a run that goes on is a part of stands in its journal.
    let part = match arguments.selection.resume {
        Some(_) => None,
        None => shard::chosen(arguments.shard, surroundings)?,
    };
    let effective = profile::load(
        arguments.device.profile.as_deref(),
        &[
            arguments.device.settings(),
            arguments.people.page.settings(),
            arguments.said.clone(),
        ]
        .concat(),
        surroundings,
        &library.rules.hooks,
    )?;
    let built_in = reference::is_tested(&Asked::of_run(arguments), &effective, surroundings, tell)?;
    if let Some(own) = library.own() {
        tell(&own);
    }
    let pack = pack_of(&library, &effective)?;
    let role = effective.profile.device.role;
    let earlier = match &arguments.selection.resume {
        Some(folder) => Some(Earlier::read(folder, &library.tests(role, &pack.id), &library)?),
        None => None,
    };
    let mut wanted = asked(arguments, part, earlier.as_ref());
    // A master control that the run starts itself is one of several, and one that is there is shared.
    if role == Role::MasterControl && !built_in && effective.profile.device.command.is_none() {
        let count = arguments.vehicles.map(|count| count as usize);
        wanted = wanted.vehicles(fleet_names(&effective.profile, count));
    }
    let mut request = wanted.build(role, &library, &pack)?;
    let harness = Harness::of_run(arguments.like.as_deref(), role, &mut request, tell)?;
    if role == Role::MasterControl && arguments.vehicle.0 != tck_simulate::Vehicle::default() {
        let title = "`--vehicle` is for the reference AGV, and a master control is tested here";
        return Err(Diagnostic::whole("usage", title).into());
    }
    if role == Role::Agv && arguments.vehicles.is_some() {
        let title = "`--vehicles` is for a master control under test, and an AGV is tested here";
        return Err(Diagnostic::whole("usage", title)
            .hint("add `--role master-control`")
            .into());
    }
    check_faults(role, &arguments.fault)?;
    let job = Job {
        desk: Prompter::new(watch::channel(false).0),
        page: None,
        request,
        library,
        pack,
        effective,
        output: arguments.output.clone(),
        no_motion: arguments.device.no_motion,
        certifies: arguments.certifies,
        vehicles: arguments.vehicles.map(|count| count as usize),
        harness,
        earlier,
        quit: None,
    };
    Ok((job, built_in))
}

/// Whether a call can begin: its profile, its selection, and the files that they name. Nothing is asked of a device or broker.
pub(in crate::cli) fn check(
    arguments: &args::Run,
    library: Library,
    surroundings: &Surroundings,
) -> Result<(), Problem> {
    let (job, built_in) = prepared(arguments, library, surroundings, &|_| ())?;
    if built_in {
        job.built_in_device(arguments).map(drop)
    } else {
        job.of_profile(arguments, surroundings).map(drop)
    }
}

/// What the command line asks for.
fn asked(arguments: &args::Run, part: Option<ChosenShard>, earlier: Option<&Earlier>) -> RequestBuilder {
    let wanted = &arguments.selection;
    let repeat = earlier.map_or(1, |earlier| earlier.repeat).max(wanted.repeat);
    let mut asked = RequestBuilder::new()
        .criteria(Criteria {
            patterns: arguments.tests.clone(),
            requirements: wanted.requirement.clone(),
            chapters: wanted.chapter.clone(),
            filters: wanted.filter.clone(),
            exclude: wanted.exclude.clone(),
            failed_in: wanted.last_failed.then(|| arguments.output.out.clone()),
        })
        .command(std::env::args().collect())
        .repeat(repeat);
    if let Some(earlier) = earlier {
        asked = asked.left(earlier.tests.clone()).part(earlier.part());
    }
    if let Some(part) = part {
        asked = asked.shard(part);
    }
    if let Some(seed) = arguments.seed {
        asked = asked.seed(seed);
    }
    if arguments.thorough {
        asked = asked.thorough();
    }
    if arguments.certificate {
        asked = asked.same_draw();
    }
    if arguments.certifies {
        asked = asked.certifies();
    }
    if let Some(budget) = arguments.budget {
        asked = asked.budget(budget);
    }
    if wanted.fail_fast {
        asked = asked.fail_fast();
    }
    asked
}
