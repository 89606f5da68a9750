//! The vocabulary of hooks: `suites/hooks/`, and files of somebody's own beside it.
//!
//! A hook is what a person or a machine does to the device when a test asks for it. Its file says what it is called, what is
//! done, what a test may hand over, and what follows from it for the run and for the checks. How it is done at one device is
//! left to the profile. Code asks for a [`HookEffect`] and never for a name.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::{Assets, Role, hooks_file};
use tck_base::diagnostic::{Diagnostic, Source};

/// What follows from a hook, as far as the run or a check has to know it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum HookEffect {
    /// The device gets what it needs after a start.
    PreparesAfterStart,
    /// The device is switched off without a farewell and on again.
    PowerCycles,
    /// The device ends its communication in good order.
    ShutsDown,
    /// The device is started.
    Starts,
    /// The device may be started anew, and then goes on where it was.
    MayRestart,
    /// The operating mode is switched to `mode`.
    SetsMode,
    /// The vehicle is brought to `nodeId`.
    MovesToNode,
    /// A pressed emergency stop is released and acknowledged.
    ReleasesEmergencyStop,
    /// A pause that was begun at the vehicle ends.
    ReleasesPause,
    /// Errors that were brought about are gone.
    ClearsErrors,
    /// Loads are taken off; `loadType` empty means all of them.
    RemovesLoads,
    /// The master control is asked for a transport.
    OrdersTransport,
    /// The master control is to give up what it wants of `vehicle`.
    CallsOff,
}

impl HookEffect {
    /// Every effect there is.
    pub const ALL: [Self; 13] = [
        Self::PreparesAfterStart,
        Self::PowerCycles,
        Self::ShutsDown,
        Self::Starts,
        Self::MayRestart,
        Self::SetsMode,
        Self::MovesToNode,
        Self::ReleasesEmergencyStop,
        Self::ReleasesPause,
        Self::ClearsErrors,
        Self::RemovesLoads,
        Self::OrdersTransport,
        Self::CallsOff,
    ];

    /// The word used in files and outputs.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::PreparesAfterStart => "prepares-after-start",
            Self::PowerCycles => "power-cycles",
            Self::ShutsDown => "shuts-down",
            Self::Starts => "starts",
            Self::MayRestart => "may-restart",
            Self::SetsMode => "sets-mode",
            Self::MovesToNode => "moves-to-node",
            Self::ReleasesEmergencyStop => "releases-emergency-stop",
            Self::ReleasesPause => "releases-pause",
            Self::ClearsErrors => "clears-errors",
            Self::RemovesLoads => "removes-loads",
            Self::OrdersTransport => "orders-transport",
            Self::CallsOff => "calls-off",
        }
    }

    /// What the program makes of it.
    #[must_use]
    pub fn doc(self) -> &'static str {
        match self {
            Self::PreparesAfterStart => "The run has it done when the device is there, and again after every start.",
            Self::PowerCycles => "The run brings back a device with it that is gone or obeys no more.",
            Self::ShutsDown => {
                "The device may end by it, says farewell, and does not know afterwards what it was sent before."
            }
            Self::Starts => "The device was just started when it is done, and does not know what it was sent before.",
            Self::MayRestart => {
                "The device may end by it and come back: its connection may be lost, and headerId may begin anew."
            }
            Self::SetsMode => "The run switches a vehicle back to automatic with it after a test; it takes `mode`.",
            Self::MovesToNode => {
                "The run has a vehicle brought to a node that does not drive there; it takes `nodeId`."
            }
            Self::ReleasesEmergencyStop => {
                "The run releases an emergency stop with it after a test, and nobody is asked twice."
            }
            Self::ReleasesPause => "The run ends a pause with it after a test.",
            Self::ClearsErrors => "The run has a fatal error cleared with it after a test.",
            Self::RemovesLoads => "The run has a load taken off that a test has left; it takes `loadType`.",
            Self::OrdersTransport => "A transport is wanted from then on, and a master control may hold it back.",
            Self::CallsOff => "The run has called off with it what a test has left to the vehicle; it takes `vehicle`.",
        }
    }

    /// The parameter that the run hands over when it has the hook done by itself.
    #[must_use]
    pub fn parameter(self) -> Option<&'static str> {
        match self {
            Self::SetsMode => Some("mode"),
            Self::MovesToNode => Some("nodeId"),
            Self::RemovesLoads => Some("loadType"),
            Self::CallsOff => Some("vehicle"),
            _ => None,
        }
    }
}

/// What of the state a hook may change beside the protocol, and no mode, error or new connection shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum HookChange {
    /// Whether the vehicle is paused.
    Pause,
    /// Whether it is charging.
    Charging,
    /// Which maps are enabled.
    Maps,
    /// Where it is, or believes to be.
    Position,
    /// What is left of its order.
    Order,
}

impl HookChange {
    /// Everything that a hook may change.
    pub const ALL: [Self; 5] = [Self::Pause, Self::Charging, Self::Maps, Self::Position, Self::Order];

    /// The word used in files and outputs.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Pause => "pause",
            Self::Charging => "charging",
            Self::Maps => "maps",
            Self::Position => "position",
            Self::Order => "order",
        }
    }
}

/// How hard it may be to get the device back after a hook: tests with more run later.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum HookRisk {
    /// Something is done by hand.
    #[default]
    ByHand,
    /// Its maps or its place on them change.
    Maps,
    /// Its mode, its pause or its safety is changed.
    Modes,
    /// A fault is brought about.
    Faults,
    /// It is switched off.
    Power,
}

impl HookRisk {
    /// Every risk, the smallest first.
    pub const ALL: [Self; 5] = [Self::ByHand, Self::Maps, Self::Modes, Self::Faults, Self::Power];

    /// The word used in files and outputs.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::ByHand => "by-hand",
            Self::Maps => "maps",
            Self::Modes => "modes",
            Self::Faults => "faults",
            Self::Power => "power",
        }
    }
}

/// A value that a parameter of a hook may take.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct HookValue {
    /// What programs and requests are given.
    pub id: String,
    /// What a person is told instead, where the identifier does not say it.
    pub text: Option<String>,
}

/// What a test may hand over to a hook.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct HookParameter {
    /// Name, as in `with: { NAME: … }` and `{NAME}`.
    pub name: String,
    /// What it says.
    pub about: String,
    /// A value it may have.
    pub example: String,
    /// The only values it may have; any value where this is empty.
    pub values: Vec<HookValue>,
}

/// A hook that a test may ask for.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct HookInfo {
    /// Name, as in `[hooks.NAME]` and `operator: NAME`.
    pub name: String,
    /// Which side it is for.
    pub role: Role,
    /// What to do, as an order to a person.
    pub doc: String,
    /// What a test may hand over.
    pub parameters: Vec<HookParameter>,
    /// What follows from it.
    pub effects: Vec<HookEffect>,
    /// What it may change unseen; anything when absent.
    pub changes: Option<Vec<HookChange>>,
    /// How hard it may be to get the device back.
    pub risk: HookRisk,
    /// The hook that does the opposite and came before.
    pub undoes: Option<String>,
    /// The action without which a vehicle has no use for it.
    pub for_action: Option<String>,
    /// Whether a vehicle may lack what it is about, such as a lift.
    pub optional: bool,
}

impl HookInfo {
    /// Whether this follows from it.
    #[must_use]
    pub fn has(&self, effect: HookEffect) -> bool {
        self.effects.contains(&effect)
    }

    /// Whether the program of the device may end by it.
    #[must_use]
    pub fn may_end_the_device(&self) -> bool {
        self.has(HookEffect::PowerCycles) || self.has(HookEffect::ShutsDown) || self.has(HookEffect::MayRestart)
    }

    /// Whether the device was just started when it is done.
    #[must_use]
    pub fn starts(&self) -> bool {
        self.has(HookEffect::PowerCycles) || self.has(HookEffect::Starts)
    }

    /// Whether the device does not know afterwards what it was sent or did before.
    #[must_use]
    pub fn restarts(&self) -> bool {
        self.starts() || self.has(HookEffect::ShutsDown)
    }

    /// Whether the connection of the device may be lost by it, and its counts may begin anew.
    #[must_use]
    pub fn may_restart(&self) -> bool {
        self.restarts() || self.has(HookEffect::MayRestart)
    }

    /// What it may change that nothing in the state tells.
    #[must_use]
    pub fn changes(&self) -> &[HookChange] {
        self.changes.as_deref().unwrap_or(&HookChange::ALL)
    }

    /// The parameter of that name.
    #[must_use]
    pub fn parameter(&self, name: &str) -> Option<&HookParameter> {
        self.parameters.iter().find(|parameter| parameter.name == name)
    }
}

/// Every hook of both sides, in the order of the files.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Hooks {
    all: Vec<HookInfo>,
}

impl Hooks {
    /// Reads `suites/hooks/`.
    ///
    /// # Errors
    /// Every mistake in the files, with its place; also when there are none.
    pub fn load(assets: &Assets) -> Result<Self, Vec<Diagnostic>> {
        let mut files: Vec<_> = assets.under("suites/hooks/").collect();
        // Those of the program come first: where two hooks have the effect that the run wants, it takes the first.
        files.sort_by_key(|file| !assets.is_checked(&file.path) && assets.own().contains(&file.path));
        let sources = files
            .into_iter()
            .map(|file| Source::new(file.path.as_str(), file.text.as_str()));
        let (hooks, mut problems) = Self::read(sources);
        if hooks.all.is_empty() && problems.is_empty() {
            problems.push(
                Diagnostic::whole("no-hooks", "there are no hooks under suites/hooks/")
                    .hint("a directory that replaces the suites needs a copy of that folder"),
            );
        }
        if problems.is_empty() { Ok(hooks) } else { Err(problems) }
    }

    /// Checks the text of one file of hooks; how many it has. `undoes` may name a hook of these, too.
    ///
    /// # Errors
    /// Every mistake in it.
    pub fn check_text(&self, name: &str, text: &str) -> Result<usize, Vec<Diagnostic>> {
        let mut problems = Vec::new();
        let entries = hooks_file::read(&Source::new(name, text), &mut problems);
        let known = |role: Role, name: &str| {
            let here = entries.iter().any(|entry| entry.is(role, name));
            here || self.find(name, role).is_some()
        };
        let mut taken = BTreeMap::new();
        problems.extend(entries.iter().filter_map(|entry| entry.taken_by(&mut taken)));
        problems.extend(entries.iter().filter_map(|entry| entry.without_opposite(known)));
        if problems.is_empty() {
            Ok(entries.len())
        } else {
            Err(problems)
        }
    }

    fn read(sources: impl Iterator<Item = std::sync::Arc<Source>>) -> (Self, Vec<Diagnostic>) {
        let mut problems = Vec::new();
        let entries: Vec<_> = sources
            .flat_map(|source| hooks_file::read(&source, &mut problems))
            .collect();
        let mut taken = BTreeMap::new();
        problems.extend(entries.iter().filter_map(|entry| entry.taken_by(&mut taken)));
        let known = |role: Role, name: &str| entries.iter().any(|entry| entry.is(role, name));
        problems.extend(entries.iter().filter_map(|entry| entry.without_opposite(known)));
        let all = entries.into_iter().map(|entry| entry.hook).collect();
        (Self { all }, problems)
    }

    /// All of them.
    pub fn all(&self) -> impl Iterator<Item = &HookInfo> {
        self.all.iter()
    }

    /// Those of one side.
    pub fn of(&self, role: Role) -> impl Iterator<Item = &HookInfo> {
        self.all.iter().filter(move |hook| hook.role == role)
    }

    /// Those of that name, which both sides may have.
    pub fn named(&self, name: &str) -> impl Iterator<Item = &HookInfo> {
        self.all.iter().filter(move |hook| hook.name == name)
    }

    /// The hook of that name for that side.
    #[must_use]
    pub fn find(&self, name: &str, role: Role) -> Option<&HookInfo> {
        self.of(role).find(|hook| hook.name == name)
    }

    /// The names of the hooks of a side that have this effect, in their order.
    pub fn with(&self, effect: HookEffect, role: Role) -> impl Iterator<Item = &str> {
        self.of(role)
            .filter(move |hook| hook.has(effect))
            .map(|hook| hook.name.as_str())
    }

    /// The hook that does the opposite of this one afterwards.
    #[must_use]
    pub fn opposite(&self, hook: &HookInfo) -> Option<&HookInfo> {
        self.of(hook.role)
            .find(|other| other.undoes.as_ref() == Some(&hook.name))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn hooks() -> Hooks {
        let loaded = Hooks::load(&Assets::of_source_tree().unwrap());
        loaded.unwrap_or_else(|problems| panic!("{}", problems.iter().map(ToString::to_string).collect::<String>()))
    }

    #[test]
    fn every_built_in_hook_says_what_is_done_and_what_it_takes() {
        let hooks = hooks();
        assert!(hooks.all().count() > 40);
        for hook in hooks.all() {
            assert!(hook.doc.ends_with('.'), "{}", hook.name);
            for parameter in &hook.parameters {
                assert!(!parameter.about.ends_with('.'), "{} {}", hook.name, parameter.name);
            }
        }
    }

    #[test]
    fn the_run_finds_a_hook_for_every_effect_it_asks_for() {
        let hooks = hooks();
        for effect in HookEffect::ALL {
            assert!(hooks.all().any(|hook| hook.has(effect)), "{}", effect.word());
        }
    }

    #[test]
    fn words_are_those_of_the_files() {
        for effect in HookEffect::ALL {
            assert_eq!(serde_json::to_value(effect).unwrap(), effect.word());
        }
        for change in HookChange::ALL {
            assert_eq!(serde_json::to_value(change).unwrap(), change.word());
        }
        for risk in HookRisk::ALL {
            assert_eq!(serde_json::to_value(risk).unwrap(), risk.word());
        }
    }

    #[test]
    fn hooks_of_somebodys_own_stand_behind_the_built_in_ones() {
        let dir = tempfile::tempdir().expect("directory");
        std::fs::create_dir_all(dir.path().join("hooks")).expect("directory");
        let own = "device: agv\nhooks:\n  - hook: pull-plug\n    does: Pull the plug.\n    effects: [power-cycles]\n";
        std::fs::write(dir.path().join("hooks/aaa.yaml"), own).expect("file");
        let assets = Assets::of_source_tree()
            .unwrap()
            .with_added(dir.path())
            .expect("assets");
        let hooks = Hooks::load(&assets).expect("hooks");
        let all: Vec<_> = hooks.with(HookEffect::PowerCycles, Role::Agv).collect();
        assert_eq!(all, ["power-cycle", "pull-plug"]);
        let own = hooks.find("pull-plug", Role::Agv).expect("the hook");
        assert!(own.starts() && own.may_end_the_device() && own.changes().len() == 5);
        assert_eq!(own.risk, HookRisk::ByHand);
    }

    #[test]
    fn a_directory_without_hooks_is_an_error() {
        let dir = tempfile::tempdir().expect("directory");
        let assets = Assets::of_source_tree()
            .unwrap()
            .with_suites(dir.path())
            .expect("assets");
        assert_eq!(Hooks::load(&assets).expect_err("empty")[0].code, "no-hooks");
    }
}
