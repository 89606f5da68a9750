//! What the device can do, and who says so.
//!
//! Applicability comes from the device's own factsheet, completed by the profile. Declared absent is not applicable;
//! what is left open, not allowed, not named or not there is not, and the tests in question stay undecided. So do those
//! about which profile and factsheet contradict each other.

use std::collections::BTreeMap;

use serde_json::{Map, Value};

use super::factsheet_limits::exceeded;
use super::sheet::Sheet;
use tck_base::pattern::{Term, TermKind};
use tck_journal::event::{Capability, Gate};
use tck_journal::{Reason, Vantage};
use tck_pack::Role;
use tck_profile::{SAMPLE_ACTIONS, SampleKind};
use tck_suite::model::{Need, SendAction, ServeBehaviour, Test, Verb};

/// Found out from the first state, and said by no profile.
const ACTIVE_MAP: &str = "active-map";

/// What is known about device, bench and profile.
#[derive(Clone, Debug)]
pub struct Capabilities {
    /// The factsheet, once it was received.
    pub factsheet: Option<Sheet>,
    /// What the profile states: `stops-between-nodes` and so on.
    pub statements: BTreeMap<String, bool>,
    /// What the suites know of the device below `device`: its sample actions among it.
    pub samples: Map<String, Value>,
    /// Capabilities the profile claims beside the factsheet, by their names.
    pub claims: BTreeMap<String, bool>,
    /// From where the harness can see.
    pub vantage: Vantage,
    /// Names of the hooks that can be run.
    pub hooks: Vec<String>,
    /// Names of the hooks that are prompts, where nobody can be asked.
    pub unattended: Vec<String>,
    /// Whether the device can reach the map server; `Err` says why not.
    pub maps: Result<(), Reason>,
    /// Whether files are served to it over TLS; `Err` says why not.
    pub secured_files: Result<(), Reason>,
    /// Whether there is a map file that the device can read; `Err` says why not.
    pub map_file: Result<(), Reason>,
    /// Whether the vehicle may drive; `Err` says why not.
    pub motion: Result<(), Reason>,
    /// Whether a master control has a second mock vehicle beside the first.
    pub second_vehicle: bool,
    /// Whether a claim may add to a factsheet that says otherwise. Not for a certificate.
    pub claims_add: bool,
}

impl Capabilities {
    /// Whether a test runs, and if not, why.
    #[must_use]
    pub fn gate(&self, test: &Test) -> Gate {
        match self.weigh(test) {
            Err(why) => Gate::NotApplicable(why),
            Ok(open) => open.into_iter().next().map_or(Gate::Runs, Gate::Unobservable),
        }
    }

    /// Everything that stands in the way of a test, the first reason first.
    ///
    /// # Errors
    /// Why it does not apply at all.
    pub fn weigh(&self, test: &Test) -> Result<Vec<Reason>, Reason> {
        let mut open = Vec::new();
        let hooks = test
            .sections()
            .into_iter()
            .flat_map(|(_, steps)| steps)
            .filter_map(|step| match &*step.verb {
                Verb::Operator(operator) => Some(Need::Hook(operator.hook.clone())),
                _ => None,
            });
        let stations = test
            .course
            .stations()
            .filter_map(SampleKind::of_variable)
            .map(|sample| Need::Profile(sample.name.to_owned()));
        for need in test.needs.iter().cloned().chain(stations).chain(hooks) {
            match self.has(&need) {
                Gate::Runs => {}
                Gate::NotApplicable(why) => return Err(why),
                Gate::Unobservable(why) => open.push(why),
            }
        }
        let sends = test.sections().into_iter().flat_map(|(_, steps)| steps);
        let routes = sends.filter_map(|step| match &*step.verb {
            Verb::Send(send) => send.route.as_ref(),
            _ => None,
        });
        let mut ordered = routes.flat_map(|route| &route.actions).flat_map(|(_, actions)| actions);
        if let Some(why) = ordered.find_map(|action| self.blocks_otherwise(action)) {
            return Err(why);
        }
        if let Some(why) = self.factsheet.as_ref().and_then(|sheet| exceeded(sheet, test)) {
            return Err(why);
        }
        if test.moves
            && let Err(why) = &self.motion
        {
            open.push(why.clone());
        }
        if test.device == Role::MasterControl && !self.second_vehicle && test.needs_second_vehicle() {
            open.push(Reason::OneVehicle);
        }
        if serves_a_map_to_read(test)
            && let Err(why) = &self.map_file
        {
            open.push(why.clone());
        }
        Ok(open)
    }

    fn has(&self, need: &Need) -> Gate {
        match need {
            Need::Tap if self.vantage == Vantage::Tap => Gate::Runs,
            Need::Tap => Gate::Unobservable(Reason::NoTap),
            Need::MapServer => match &self.maps {
                Ok(()) => Gate::Runs,
                Err(why) => Gate::Unobservable(why.clone()),
            },
            Need::SecuredFiles => match self.maps.as_ref().and(self.secured_files.as_ref()) {
                Ok(()) => Gate::Runs,
                Err(why) => Gate::Unobservable(why.clone()),
            },
            Need::Hook(name) if self.hooks.iter().any(|hook| hook == name) => Gate::Runs,
            Need::Hook(name) if self.claims.get(&format!("hook {name}")) == Some(&false) => {
                Gate::NotApplicable(Reason::NothingForHook { hook: name.clone() })
            }
            Need::Hook(name) if self.unattended.contains(name) => {
                Gate::Unobservable(Reason::NobodyToAsk { hook: name.clone() })
            }
            Need::Hook(name) => Gate::Unobservable(Reason::NoHook { hook: name.clone() }),
            Need::Profile(name) => match self.statements.get(name) {
                Some(true) => Gate::Runs,
                Some(false) if SAMPLE_ACTIONS.iter().any(|sample| sample.name == name) => {
                    Gate::NotApplicable(Reason::SampleDenied { sample: name.clone() })
                }
                Some(false) => Gate::NotApplicable(Reason::StatedFalse {
                    statement: name.clone(),
                }),
                None if name == ACTIVE_MAP => Gate::Unobservable(Reason::NoActiveMap),
                None => Gate::Unobservable(match SAMPLE_ACTIONS.iter().find(|sample| sample.name == name) {
                    Some(sample) => Reason::NoSample {
                        sample: name.clone(),
                        what: sample.doc.to_owned(),
                    },
                    None => Reason::NotStated {
                        statement: name.clone(),
                    },
                }),
            },
            Need::Action { name, scope } => self.action(name, scope.as_deref()),
            Need::NoAction(name) => reverse(self.action(name, None), name),
            Need::Optional(path) => self.optional(path),
            Need::NoOptional(path) => reverse(self.optional(path), path),
            Need::NotRequired(path) => self.not_required(path),
            Need::Zone(name) => {
                let listed = name
                    .as_ref()
                    .map_or_else(|| "zones".to_owned(), |name| format!("zone {name}"));
                self.declared(&[listed], |sheet| sheet.heeds_zones(name.as_deref()))
            }
            Need::NoZone(name) => {
                let heeds = self.declared(&[format!("zone {name}")], |sheet| sheet.heeds_zones(Some(name)));
                reverse(heeds, &format!("zone {name}"))
            }
            Need::Limit(path) => self.declared(&[format!("limit {path}")], |sheet| sheet.has_limit(path)),
        }
    }

    /// Why an action of an order cannot be sent as the test wants: the factsheet lists it with other blocking types
    /// (FACT-15).
    fn blocks_otherwise(&self, action: &SendAction) -> Option<Reason> {
        let wanted = literal(action.blocking.as_ref()?)?;
        let action_type = match &action.action.kind {
            TermKind::Variable(name) => {
                let (sample, member) = name.strip_prefix("device.")?.split_once('.')?;
                self.samples.get(sample)?.get(member)?.as_str()?
            }
            _ => literal(&action.action)?,
        };
        let sheet = self.factsheet.as_ref()?;
        let own = sheet
            .offered_actions()
            .find(|listed| listed.action_type.is(action_type))?;
        let types = own.blocking_types.there()?;
        let allowed = types.is_empty() || types.iter().any(|known| known.is(wanted));
        (!allowed).then(|| Reason::BlockingTypeNotListed {
            action: action_type.to_owned(),
            blocking: wanted.to_owned(),
        })
    }

    /// Whether it can do an action, in this scope or in any.
    pub(super) fn action(&self, name: &str, scope: Option<&str>) -> Gate {
        let whole = action_name(name, None);
        let names = match scope {
            Some(_) => vec![action_name(name, scope), whole],
            None => vec![whole],
        };
        self.declared(&names, |sheet| sheet.has_action(name, scope))
    }

    fn not_required(&self, path: &str) -> Gate {
        let Some(sheet) = &self.factsheet else {
            return Gate::Unobservable(Reason::NoFactsheetOfNeeds {
                parameter: path.to_owned(),
            });
        };
        if sheet.requires(path) {
            return Gate::NotApplicable(Reason::Required {
                parameter: path.to_owned(),
            });
        }
        Gate::Runs
    }

    /// Whether it takes an optional member.
    pub(super) fn optional(&self, path: &str) -> Gate {
        self.declared(&[format!("optional {path}")], |sheet| sheet.has_optional(path))
    }

    /// Whether it has something, by its names, the most exact one first.
    fn declared(&self, names: &[String], says: impl Fn(&Sheet) -> Option<bool>) -> Gate {
        let capability = names.first().cloned().unwrap_or_default();
        let claimed = names.iter().find_map(|name| self.claims.get(name)).copied();
        let listed = self.factsheet.as_ref().map(says);
        match (listed, claimed) {
            (Some(Some(true)), Some(false)) => Gate::Unobservable(Reason::ListedAndDenied { capability }),
            (Some(Some(false)), Some(true)) if !self.claims_add => {
                Gate::Unobservable(Reason::ClaimedAndNotListed { capability })
            }
            (Some(Some(true)), _) | (_, Some(true)) => Gate::Runs,
            (_, Some(false)) => Gate::NotApplicable(Reason::Denied { capability }),
            (Some(Some(false)), None) => Gate::NotApplicable(Reason::NotListed { capability }),
            (Some(None), None) => Gate::Unobservable(Reason::NoList { capability }),
            (None, None) => Gate::Unobservable(Reason::NoFactsheet { capability }),
        }
    }

    /// Where the profile and the factsheet say the opposite of each other, one sentence each.
    #[must_use]
    pub fn contradictions(&self) -> Vec<String> {
        let Some(sheet) = &self.factsheet else {
            return Vec::new();
        };
        let one = |(name, claimed): (&String, &bool)| {
            let words: Vec<&str> = name.split(' ').collect();
            let listed = match words[..] {
                ["action", action] => sheet.has_action(action, None),
                ["action", action, scope] => sheet.has_action(action, Some(scope)),
                ["optional", path] => sheet.has_optional(path),
                ["limit", path] => sheet.has_limit(path),
                _ => None,
            }?;
            let (sheet_says, profile_says) = if *claimed {
                ("does not list", "has")
            } else {
                ("lists", "does not have")
            };
            (listed != *claimed)
                .then(|| format!("The factsheet {sheet_says} what the profile says the device {profile_says}: {name}."))
        };
        self.claims.iter().filter_map(one).collect()
    }

    /// The capabilities for the report, with their sources.
    #[must_use]
    pub fn list(&self) -> Vec<Capability> {
        let mut all = BTreeMap::new();
        for action in self.factsheet.iter().flat_map(|sheet| sheet.offered_actions()) {
            let name = action.action_type.text().unwrap_or("?");
            for scope in &action.action_scopes {
                let scope = scope.text().unwrap_or("?");
                all.insert(
                    action_name(name, Some(scope)),
                    ("yes".to_owned(), "factsheet".to_owned()),
                );
            }
        }
        for parameter in self.factsheet.iter().flat_map(|sheet| sheet.optional_parameters()) {
            let name = parameter.parameter.text().unwrap_or("?");
            let support = parameter.support.text().unwrap_or("?");
            all.insert(format!("optional {name}"), (support.to_owned(), "factsheet".to_owned()));
        }
        for (name, claimed) in self.statements.iter().chain(&self.claims) {
            let said = if *claimed { "yes" } else { "no" };
            all.entry(name.clone())
                .and_modify(|(listed, source)| {
                    let agrees = *claimed == !matches!(listed.as_str(), "no");
                    let both = if agrees {
                        "factsheet, and the profile"
                    } else {
                        "factsheet; the profile says the opposite"
                    };
                    both.clone_into(source);
                })
                .or_insert_with(|| (said.to_owned(), "profile".to_owned()));
        }
        all.into_iter()
            .take(500)
            .map(|(name, (value, source))| Capability { name, value, source })
            .collect()
    }
}

/// Whether the device has to get on with a map file of ours; a transfer that fails needs no file that it could read.
fn serves_a_map_to_read(test: &Test) -> bool {
    let mut steps = test.sections().into_iter().flat_map(|(_, steps)| steps);
    steps.any(|step| match &*step.verb {
        Verb::Serve(serve) => {
            serve.file.is_none()
                && serve.json.is_none()
                && serve.certificate.is_none()
                && matches!(serve.behaviour, ServeBehaviour::Well | ServeBehaviour::Slow)
        }
        _ => false,
    })
}

fn literal(term: &Term) -> Option<&str> {
    match &term.kind {
        TermKind::Literal(Value::String(text)) => Some(text),
        _ => None,
    }
}

fn action_name(name: &str, scope: Option<&str>) -> String {
    scope.map_or_else(|| format!("action {name}"), |scope| format!("action {name} {scope}"))
}

fn reverse(gate: Gate, name: &str) -> Gate {
    match gate {
        Gate::Runs => Gate::NotApplicable(Reason::Present {
            capability: name.to_owned(),
        }),
        Gate::NotApplicable(_) => Gate::Runs,
        open @ Gate::Unobservable(_) => open,
    }
}

/// A vehicle without a factsheet and without a word in the profile.
#[cfg(test)]
pub(crate) fn unknown() -> Capabilities {
    Capabilities {
        factsheet: None,
        statements: BTreeMap::new(),
        samples: Map::new(),
        claims: BTreeMap::new(),
        vantage: Vantage::Subscriber,
        hooks: Vec::new(),
        unattended: Vec::new(),
        maps: Ok(()),
        secured_files: Ok(()),
        map_file: Ok(()),
        motion: Ok(()),
        second_vehicle: true,
        claims_add: true,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;
    use tck_base::diagnostic::{Source, Span};
    use tck_view::Names;

    fn capabilities(factsheet: Option<Value>) -> Capabilities {
        Capabilities {
            factsheet: factsheet.map(|sheet| Sheet::read(&sheet, &Names::default())),
            statements: BTreeMap::from([("node-bound".to_owned(), false)]),
            ..unknown()
        }
    }

    fn sheet() -> Value {
        json!({ "protocolFeatures": {
            "agvActions": [{ "actionType": "pick", "actionScopes": ["NODE"] }],
            "optionalParameters": [{ "parameter": "order.edges.trajectory", "support": "SUPPORTED" }],
        }, "protocolLimits": { "maxArrayLens": { "order.nodes": 10 } } })
    }

    fn action(scope: Option<&str>) -> Need {
        Need::Action {
            name: "pick".to_owned(),
            scope: scope.map(str::to_owned),
        }
    }

    #[test]
    fn a_test_with_two_vehicles_needs_a_second_one() {
        let library = tck_testing::library();
        let tests = library.tests(Role::MasterControl, &library.rules.packs.latest().id);
        let two: Vec<_> = tests.iter().filter(|test| test.needs_second_vehicle()).collect();
        assert!(
            two.len() > 10 && two.len() < tests.len() / 2,
            "{} of {}",
            two.len(),
            tests.len()
        );
        let waits = |test: &Test, second: bool| {
            let mut device = capabilities(None);
            device.second_vehicle = second;
            device.weigh(test).is_ok_and(|open| open.contains(&Reason::OneVehicle))
        };
        for test in two {
            assert!(waits(test, false) && !waits(test, true), "{}", test.id);
        }
    }

    #[test]
    fn the_factsheet_decides_what_applies() {
        let known = capabilities(Some(sheet()));
        assert_eq!(known.has(&action(Some("NODE"))), Gate::Runs);
        assert!(matches!(known.has(&action(Some("EDGE"))), Gate::NotApplicable(_)));
        assert_eq!(
            known.has(&Need::Optional("order.edges.trajectory".to_owned())),
            Gate::Runs
        );
        assert!(matches!(
            known.has(&Need::NoOptional("order.edges.trajectory".to_owned())),
            Gate::NotApplicable(_)
        ));
        assert_eq!(
            known.has(&Need::Limit("maxArrayLens.order.nodes".to_owned())),
            Gate::Runs
        );
        assert!(matches!(
            known.has(&Need::Limit("maxArrayLens.order.edges".to_owned())),
            Gate::NotApplicable(_)
        ));
    }

    #[test]
    fn a_profile_that_contradicts_the_factsheet_decides_nothing_by_it() {
        let mut known = capabilities(Some(sheet()));
        known.claims = BTreeMap::from([
            ("action pick".to_owned(), false),
            ("action drop".to_owned(), true),
            ("hook use-lift".to_owned(), false),
        ]);
        assert!(matches!(known.has(&action(Some("NODE"))), Gate::Unobservable(_)));
        let drop = Need::Action {
            name: "drop".to_owned(),
            scope: None,
        };
        assert_eq!(known.has(&drop), Gate::Runs);
        assert_eq!(known.contradictions().len(), 2);
        known.claims_add = false;
        assert!(matches!(known.has(&drop), Gate::Unobservable(_)));
        let lift = Need::Hook("use-lift".to_owned());
        assert!(matches!(known.has(&lift), Gate::NotApplicable(_)));
    }

    #[test]
    fn an_action_is_sent_with_the_blocking_types_its_factsheet_lists() {
        let listed = json!([{ "actionType": "beep", "blockingTypes": ["SOFT", "HARD"] }]);
        let mut known = capabilities(Some(json!({ "protocolFeatures": { "agvActions": listed } })));
        known.samples = Map::from_iter([("briefAction".to_owned(), json!({ "type": "beep" }))]);
        let span = Span::new(&Source::new("x.yaml", "x"), 0, 1);
        let term = |kind| Term {
            kind,
            span: span.clone(),
        };
        let action = |of: TermKind, blocking: &str| SendAction {
            action: term(of),
            name: None,
            with: Vec::new(),
            with_all: None,
            blocking: Some(term(TermKind::Literal(json!(blocking)))),
            span: span.clone(),
        };
        let sample = || TermKind::Variable("device.briefAction.type".to_owned());
        assert_eq!(known.blocks_otherwise(&action(sample(), "HARD")), None);
        assert!(known.blocks_otherwise(&action(sample(), "NONE")).is_some());
        let unknown = TermKind::Literal(json!("other"));
        assert_eq!(known.blocks_otherwise(&action(unknown, "NONE")), None);
    }

    #[test]
    fn a_factsheet_without_lists_leaves_everything_open() {
        let header_only = capabilities(Some(json!({ "headerId": 1 })));
        assert!(matches!(header_only.has(&action(None)), Gate::Unobservable(_)));
        assert!(matches!(
            header_only.has(&Need::Limit("maxArrayLens.order.nodes".to_owned())),
            Gate::Unobservable(_)
        ));
    }

    #[test]
    fn what_nobody_says_is_open_and_not_absent() {
        let unknown = capabilities(None);
        assert!(matches!(unknown.has(&action(None)), Gate::Unobservable(_)));
        assert!(matches!(
            unknown.has(&Need::NoAction("pick".to_owned())),
            Gate::Unobservable(_)
        ));
        assert!(matches!(
            unknown.has(&Need::Profile("stops-between-nodes".to_owned())),
            Gate::Unobservable(_)
        ));
        assert!(matches!(
            unknown.has(&Need::Profile("node-bound".to_owned())),
            Gate::NotApplicable(_)
        ));
        assert!(matches!(unknown.has(&Need::Tap), Gate::Unobservable(_)));
    }
}
