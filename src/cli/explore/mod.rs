//! `explore`: conversations nobody wrote down, and the shortest of them that fail.

mod measure;
mod show;
mod stage;

use std::collections::BTreeSet;
use std::path::Path;

use super::args::Explore;
use super::device::check_faults;
use super::exit::Exit;
use super::explored;
use super::problem::Problem;
use super::reference::{self, Asked};
use stage::{Device, OnStage};
use tck_base::diagnostic::Diagnostic;
use tck_base::shard::{ChosenShard, Shard};
use tck_base::verdict::Verdict;
use tck_explore::saved::ExploredResult;
use tck_explore::{Chain, ConversationFile, Exploration, Grammar, Purpose, Shown, Stage as _, family};
use tck_journal::event::ShardRecord;
use tck_profile::{self as profile, Surroundings};

/// How much more often a stimulus is drawn on which the exploration is focused.
const FOCUS: u32 = 20;

/// In how many rounds conversations are held at most, each of which has a report.
const MOST_ROUNDS: usize = 10;

/// How many conversations a round has at least: to start the device and to write the report takes as long for one as for all.
const AT_ONCE: usize = 8;

/// `explore`.
pub fn explore(arguments: &Explore) -> Result<Exit, Problem> {
    let surroundings = Surroundings::of_process();
    if arguments.in_virtual_time && arguments.page.address.is_some() {
        return Err(super::page::in_virtual_time());
    }
    let library = crate::assets::library(arguments.suites.own())?;
    let effective = profile::load(
        arguments.device.profile.as_deref(),
        &[arguments.device.settings(), arguments.page.settings()].concat(),
        &surroundings,
        &library.rules.hooks,
    )?;
    if !arguments.stimuli {
        reference::is_tested(&Asked::of_explore(arguments), &effective, &surroundings, &super::tell)?;
    }
    let pack = tck_run::pack_of(&library, &effective)?;
    let role = effective.profile.device.role;
    let grammar =
        Grammar::load(&library.assets, role).map_err(|error| Diagnostic::whole("explore", error.to_string()))?;
    if !grammar.speaks(&pack) {
        let title = format!(
            "of protocol version {} there are no stimuli of an exploration yet",
            pack.version
        );
        let known = library.rules.packs.of_role(role).filter(|known| grammar.speaks(known));
        let known = known.map(|known| known.version.to_string());
        let hint = format!("there are for {}", known.collect::<Vec<_>>().join(", "));
        return Err(Diagnostic::whole("no-stimuli", title).hint(hint).into());
    }
    check_faults(role, &arguments.fault)?;
    let grammar = grammar.only(&pack, |_, _| true);
    let grammar = focused(grammar, &arguments.focus)?;
    if arguments.stimuli {
        super::print(&show::stimuli(&grammar))?;
        return Ok(Exit::Conforms);
    }
    let part = match arguments.replay.is_empty() && arguments.every_fault.is_none() {
        true => super::shard::chosen(arguments.shard, &surroundings)?,
        false => None,
    };
    let shard = part.map(|part| share(&part, &grammar, arguments.conversations));
    if let Some(ShardRecord { index, of, filled, .. }) = shard.as_ref().filter(|part| part.index > part.filled) {
        let why =
            format!("there is no conversation for part {index} of {of}: they are divided into no more than {filled}");
        return Err(Problem::NothingToDo(why));
    }
    let device = Device::of(arguments, &effective, &pack, &surroundings)?;
    // All parts draw from one seed.
    let usual_seed = || match shard {
        Some(_) => 1,
        None => device.usual_seed(),
    };
    let exploration = Exploration {
        grammar,
        seed: arguments.seed.unwrap_or_else(usual_seed),
        conversations: arguments.conversations,
        at_once: arguments
            .conversations
            .div_ceil(MOST_ROUNDS)
            .clamp(AT_ONCE, device.most_at_once()),
        length: arguments.length,
        trials: arguments.shrink_budget,
        budget: arguments.budget,
        part: shard.as_ref().and_then(|part| Shard::new(part.index, part.filled)),
    };
    if let Some(every) = arguments.every_fault {
        return measure::every_fault(library, &pack, &exploration, every.max(1), arguments);
    }
    let mut stage = OnStage::new(library, pack, device, &arguments.output.out)?;
    stage.serve_page(&effective)?;
    let outcome = match arguments.replay.as_slice() {
        [] => held(&exploration, &mut stage, arguments, shard),
        replayed => replay(replayed, &mut stage),
    };
    stage.finish(outcome.as_ref().ok());
    outcome
}

/// The part of an exploration that one process does.
fn share(part: &ChosenShard, grammar: &Grammar, conversations: usize) -> ShardRecord {
    let count = format!("{conversations} conversations");
    let stimuli = grammar.stimuli.keys().map(String::as_str);
    let names: Vec<&str> = stimuli.chain([count.as_str()]).collect();
    let filled = part.shard.of.min(conversations.max(1));
    ShardRecord {
        whole: conversations,
        ..ShardRecord::of(part, filled, &names)
    }
}

/// Holds the conversations, and says what came of them. A part leaves a result of its own, to be joined with those of others.
fn held(
    exploration: &Exploration,
    stage: &mut OnStage,
    arguments: &Explore,
    shard: Option<ShardRecord>,
) -> Result<Exit, Problem> {
    let page = stage.page();
    let explored = exploration.carry_out(stage, &mut |text| {
        eprintln!("{text}");
        if let Some(page) = &page {
            page.note(text);
        }
    })?;
    let place = show::Place {
        report: stage.report(),
        conversations: &stage.conversations(&explored)?,
        remarks: &stage.remarks(&explored)?,
    };
    super::print(&show::explored(
        &explored,
        exploration,
        stage.catalogue(),
        place,
        arguments.output.format,
    )?)?;
    if let Some(shard) = shard {
        let name = format!("exploration-{}-{}-of-{}", exploration.seed, shard.index, shard.of);
        let mut result = ExploredResult::of(&explored, exploration, shard);
        stage.describe(&mut result);
        result.given = arguments.fault.iter().chain(&arguments.tolerance).cloned().collect();
        let folder = arguments.output.out.join(name);
        let root = explored::write(&result, &folder)?;
        super::tell(&format!(
            "the result of this part in {} has the root hash sha256:{root}",
            folder.display()
        ));
    }
    let fails = explored.findings.iter().any(Shown::fails);
    // There was no time to see whether it shows again.
    let is_open = |one: &Shown| one.shows.1 == 0 && one.finding.verdict == Verdict::Fail;
    let open = explored.remarks.iter().any(is_open) || explored.conversations == explored.undecided.0;
    Ok(match (fails, explored.interrupted) {
        (_, true) => Exit::Interrupted,
        (true, _) => Exit::DoesNotConform,
        (false, _) if open => Exit::Undecided,
        (false, _) => Exit::Conforms,
    })
}

/// Keeps of a grammar the stimuli that are named, and those that lead to them and from one to the next, which are drawn
/// less often.
fn focused(mut grammar: Grammar, focus: &[String]) -> Result<Grammar, Problem> {
    if focus.is_empty() {
        return Ok(grammar);
    }
    let mut named = BTreeSet::new();
    for pattern in focus {
        let names = grammar.stimuli.keys();
        // One that stands for many is named as in the grammar.
        let fits = |name: &&String| tck_run::matches(pattern, name) || tck_run::matches(pattern, family(name));
        let matching: Vec<&String> = names.filter(fits).collect();
        if matching.is_empty() {
            let names = grammar.stimuli.keys().map(String::as_str);
            let hint = match tck_base::diagnostic::closest(pattern, names) {
                Some(close) => format!("did you mean `{close}`?"),
                None => "`vda5050-tck explore --stimuli` shows them all".to_owned(),
            };
            let title = format!("no stimulus matches `{pattern}`");
            return Err(Diagnostic::whole("unknown-stimulus", title).hint(hint).into());
        }
        named.extend(matching.into_iter().cloned());
    }
    let kept = Chain::around(&grammar, &named);
    grammar.stimuli.retain(|name, stimulus| {
        if named.contains(name) {
            stimulus.weight = stimulus.weight.saturating_mul(FOCUS);
        }
        kept.contains(name)
    });
    Ok(grammar)
}

/// Carries out conversations that stand in files.
fn replay(paths: &[std::path::PathBuf], stage: &mut OnStage) -> Result<Exit, Problem> {
    let files: Result<Vec<_>, Problem> = paths.iter().map(|path| read(path)).collect();
    let result = stage.carry_out(&files?, Purpose::Evidence, None)?.result;
    super::print(&show::replayed(&result))?;
    Ok(Exit::of(result.verdict))
}

fn read(path: &Path) -> Result<ConversationFile, Problem> {
    let text = std::fs::read_to_string(path).map_err(|error| {
        Diagnostic::whole("unreadable", format!("cannot read {}: {error}", path.display()))
            .hint("give a conversation that `explore` has written")
    })?;
    ConversationFile::read(text).ok_or_else(|| {
        Diagnostic::whole(
            "conversation",
            format!("{} does not begin with `test:`", path.display()),
        )
        .hint("give a conversation that `explore` has written")
        .into()
    })
}
