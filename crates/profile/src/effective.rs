//! All layers merged: the typed profile, the list of effective values, and what contradicts itself.

use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;

use super::hook_action::{Hook, HookAction};
use super::key::{KEYS, SAMPLE_ACTIONS, STATEMENTS};
use super::layer::{Layer, Origin};
use super::value::Value;
use super::written;
use super::{
    Bench, Claim, Device, Layout, LayoutSource, Motion, PasswordSource, Profile, SampleAction, SampleActions, Setting,
    TimeLimits, VehicleGroup, Vehicles,
};
use tck_base::diagnostic::{self, Diagnostic, Span};
use tck_pack::{Hooks, Role};

/// The profile as it is in force, and where everything in it came from.
#[derive(Clone, Debug)]
pub struct Effective {
    /// The profile.
    pub profile: Profile,
    /// Every value with its origin: settings in the order of the sections, then deviations and hooks.
    pub settings: Vec<Setting>,
    spans: BTreeMap<&'static str, Span>,
}

impl Effective {
    /// A complaint about a setting, with a caret if it is written in a file.
    #[must_use]
    pub fn complain(&self, setting: &str, code: &'static str, title: impl Into<String>, label: &str) -> Diagnostic {
        match self.spans.get(setting) {
            Some(span) => Diagnostic::new(code, span.clone(), title, label),
            None => Diagnostic::whole(code, title),
        }
    }
}

/// Checks a merged layer as a whole and turns it into a profile.
pub(super) fn effective(layer: &Layer, hooks: &Hooks) -> Result<Effective, Vec<Diagnostic>> {
    let taken = Taken { layer, hooks };
    let wrong = taken.contradictions();
    if !wrong.is_empty() {
        return Err(wrong);
    }
    let profile = taken.profile();
    let settings = taken.settings();
    let spans = layer
        .values
        .iter()
        .filter_map(|(path, setter)| Some((*path, setter.span.clone()?)))
        .collect();
    Ok(Effective {
        profile,
        settings,
        spans,
    })
}

/// What is no default is written down with the run.
fn made(origin: &Origin) -> Option<()> {
    (*origin != Origin::Default).then_some(())
}

/// The merged layer, read by name.
struct Taken<'a> {
    layer: &'a Layer,
    hooks: &'a Hooks,
}

impl Taken<'_> {
    fn value(&self, path: &str) -> Option<&Value> {
        self.layer.values.get(path).map(|setter| &setter.value)
    }

    fn text(&self, path: &str) -> Option<String> {
        match self.value(path)? {
            Value::Text(text) => Some(text.clone()),
            _ => None,
        }
    }

    fn flag(&self, path: &str) -> Option<bool> {
        match self.value(path)? {
            Value::Flag(flag) => Some(*flag),
            _ => None,
        }
    }

    fn path(&self, path: &str) -> Option<PathBuf> {
        match self.value(path)? {
            Value::Path(file) => Some(file.clone()),
            _ => None,
        }
    }

    fn texts(&self, path: &str) -> Option<Vec<String>> {
        match self.value(path)? {
            Value::Texts(texts) => Some(texts.clone()),
            _ => None,
        }
    }

    fn action(&self, path: &str) -> Option<SampleAction> {
        match self.value(path)? {
            Value::Action(action) => Some(action.clone()),
            _ => None,
        }
    }

    fn role(&self) -> Role {
        match self.text("device.role") {
            Some(word) if word == Role::MasterControl.word() => Role::MasterControl,
            _ => Role::Agv,
        }
    }

    fn claims(&self) -> Vec<Claim> {
        match self.value("device.claims") {
            Some(Value::Claims(claims)) => claims.clone(),
            _ => Vec::new(),
        }
    }

    fn others(&self) -> &[VehicleGroup] {
        self.layer.others.as_ref().map_or(&[], |(others, _)| others)
    }

    fn time(&self) -> TimeLimits {
        let limit = |path: &str| match self.value(path) {
            Some(Value::Duration(duration)) => Some(*duration),
            _ => None,
        };
        let default = TimeLimits::default();
        TimeLimits {
            react: limit("time.react").unwrap_or(default.react),
            slow: limit("time.slow").unwrap_or(default.slow),
            event: limit("time.event").unwrap_or(default.event),
            event_warning: limit("time.event-warning").unwrap_or(default.event_warning),
            drive: limit("time.drive").unwrap_or(default.drive),
            download: limit("time.download").unwrap_or(default.download),
            connect: limit("time.connect").unwrap_or(default.connect),
            reconnect: limit("time.reconnect").unwrap_or(default.reconnect),
            will: limit("time.will"),
            quiet: limit("time.quiet").unwrap_or(default.quiet),
            broker: limit("time.broker").unwrap_or(default.broker),
            state_period: limit("time.state-period").unwrap_or(default.state_period),
            settle: limit("time.settle").unwrap_or(default.settle),
            notice: limit("time.notice").unwrap_or(default.notice),
        }
    }

    fn statements(&self) -> BTreeMap<String, bool> {
        let flags = STATEMENTS.iter().filter_map(|statement| {
            let said = self.flag(&format!("device.{}", statement.name))?;
            Some((statement.name.to_owned(), said))
        });
        let claims = self.claims().into_iter().filter_map(|claim| match claim {
            Claim::Statement(name) => Some((name, true)),
            Claim::NoStatement(name) => Some((name, false)),
            _ => None,
        });
        let actions = SAMPLE_ACTIONS.iter().filter_map(|action| {
            self.action(&format!("device.{}", action.name))?;
            Some((action.name.to_owned(), true))
        });
        claims.chain(flags).chain(actions).collect()
    }

    fn profile(&self) -> Profile {
        let source = match (&self.layer.list, self.path("layout.lif")) {
            (Some((list, _)), _) => LayoutSource::List(list.clone()),
            (None, Some(file)) => LayoutSource::Lif {
                file,
                vehicle_type: self.text("layout.vehicle-type"),
            },
            (None, None) => LayoutSource::None,
        };
        let password = match (self.text("bench.password-env"), self.path("bench.password-file")) {
            (Some(variable), _) => PasswordSource::Environment(variable),
            (None, Some(file)) => PasswordSource::File(file),
            (None, None) => PasswordSource::Usual,
        };
        Profile {
            device: Device {
                role: self.role(),
                manufacturer: self.text("device.manufacturer"),
                serial_number: self.text("device.serial-number"),
                protocol: self.text("device.protocol"),
                topic_template: self.text("device.topic-template"),
                command: self.texts("device.command"),
                sample_actions: SampleActions(
                    SAMPLE_ACTIONS
                        .iter()
                        .filter_map(|kind| Some((kind.name, self.action(&format!("device.{}", kind.name))?)))
                        .collect(),
                ),
                statements: self.statements(),
                claims: self.claims(),
            },
            bench: Bench {
                listen: self.text("bench.listen").unwrap_or_default(),
                tap: self.flag("bench.tap").unwrap_or(true),
                broker: self.text("bench.broker"),
                cluster: self.texts("bench.cluster").unwrap_or_default(),
                own_topics: self.text("bench.own-topics").unwrap_or_default(),
                client_id: self.text("bench.client-id").unwrap_or_default(),
                maps_listen: self.text("bench.maps-listen").unwrap_or_default(),
                maps_host: self.text("bench.maps-host"),
                page: self.text("bench.page"),
                tls_cert: self.path("bench.tls-cert"),
                tls_key: self.path("bench.tls-key"),
                tls_ca: self.path("bench.tls-ca"),
                client_cert: self.path("bench.client-cert"),
                client_key: self.path("bench.client-key"),
                username: self.text("bench.username"),
                password,
            },
            motion: Motion {
                allowed: self.flag("motion.allowed").unwrap_or(false),
                max_speed: match self.value("motion.max-speed") {
                    Some(Value::Number(speed)) => Some(*speed),
                    _ => None,
                },
            },
            layout: Layout {
                source,
                allow_list: self.texts("layout.allow-list"),
            },
            vehicles: Vehicles {
                manufacturer: self.text("vehicles.manufacturer").unwrap_or_default(),
                serial_numbers: self.texts("vehicles.serial-numbers").unwrap_or_default(),
                start_node: self.text("vehicles.start-node"),
                others: self.others().to_vec(),
            },
            time: self.time(),
            maps: match self.value("maps.files") {
                Some(Value::Paths(files)) => files.clone(),
                _ => Vec::new(),
            },
            deviations: self
                .layer
                .deviations
                .iter()
                .map(|(deviation, _)| deviation.clone())
                .collect(),
            known: self.layer.known.iter().map(|(known, _)| known.clone()).collect(),
            hooks: self
                .layer
                .hooks
                .iter()
                .filter_map(|(name, (hook, _))| {
                    let info = self.hooks.find(name, self.role())?.clone();
                    Some((name.clone(), Hook { info, ..hook.clone() }))
                })
                .collect(),
        }
    }

    fn settings(&self) -> Vec<Setting> {
        let mut settings: Vec<Setting> = KEYS
            .iter()
            .filter_map(|key| {
                let setter = self.layer.values.get(key.path)?;
                Some(Setting {
                    name: key.path.to_owned(),
                    value: setter.value.shown(),
                    origin: setter.origin.to_string(),
                    written: made(&setter.origin).and_then(|()| {
                        // Its arguments may hold a password.
                        if key.path == "device.command" {
                            return None;
                        }
                        let name = key.path.split('.').next_back()?;
                        written::line(name, &setter.value)
                    }),
                })
            })
            .collect();
        if let Some((list, origin)) = &self.layer.list {
            settings.push(Setting {
                name: "layout.nodes".to_owned(),
                value: format!("{} nodes, {} edges", list.nodes.len(), list.edges.len()),
                origin: origin.to_string(),
                written: made(origin).map(|()| written::layout(list)),
            });
        }
        if let Some((others, origin)) = &self.layer.others {
            let groups = others.iter().map(|group| {
                let speak = group.protocol.iter().map(|version| format!(" ({version})"));
                format!(
                    "{} {}{}",
                    group.manufacturer,
                    group.serial_numbers.join(", "),
                    speak.collect::<String>()
                )
            });
            settings.push(Setting {
                name: "vehicles.others".to_owned(),
                value: groups.collect::<Vec<_>>().join("; "),
                origin: origin.to_string(),
                written: made(origin).map(|()| written::others(others)),
            });
        }
        settings.extend(self.layer.deviations.iter().map(|(deviation, origin)| Setting {
            name: format!("deviations.{}", deviation.requirement),
            value: deviation.reason.clone(),
            origin: origin.to_string(),
            written: Some(written::deviation(deviation.requirement.as_str(), &deviation.reason)),
        }));
        settings.extend(self.layer.known.iter().map(|(known, origin)| Setting {
            name: format!("known.{}", known.id),
            value: format!("{} (until {})", known.reason, known.until),
            origin: origin.to_string(),
            written: Some(written::known(&known.id, &known.reason, &known.until)),
        }));
        settings.extend(self.layer.issue_keys.iter().map(|(id, (key, origin))| Setting {
            name: format!("keys.{id}"),
            value: key.clone(),
            origin: origin.to_string(),
            written: Some(written::issue_key(id, key)),
        }));
        settings.extend(self.layer.hooks.iter().map(|(name, (hook, origin))| {
            Setting {
                name: format!("hooks.{name}"),
                // Not the command or the address itself: those may hold what a report should not.
                value: match hook.action {
                    HookAction::Run(_) => "run",
                    HookAction::Http { .. } => "http",
                    HookAction::Prompt(_) => "prompt",
                    HookAction::RestartDevice
                    | HookAction::StopDevice
                    | HookAction::StartDevice
                    | HookAction::NaturalTraffic => "builtin",
                }
                .to_owned(),
                origin: origin.to_string(),
                written: written::hook(name, hook),
            }
        }));
        settings
    }

    fn at(&self, path: &str, title: impl Into<String>, label: &str) -> Diagnostic {
        match self.layer.values.get(path).and_then(|setter| setter.span.clone()) {
            Some(span) => Diagnostic::new("contradiction", span, title, label),
            None => Diagnostic::whole("contradiction", title),
        }
    }

    fn contradictions(&self) -> Vec<Diagnostic> {
        let mut wrong = Vec::new();
        let has = |path: &str| self.value(path).is_some();
        if let (Some((list, _)), true) = (&self.layer.list, has("layout.lif")) {
            let title = "the layout is given twice, by a LIF file and by a list";
            wrong.push(Diagnostic::new("contradiction", list.span.clone(), title, "the list").hint("keep one of them"));
        }
        if has("layout.vehicle-type") && !has("layout.lif") {
            let title = "`layout.vehicle-type` belongs to a LIF file, and none is named";
            wrong.push(
                self.at("layout.vehicle-type", title, "of which file?")
                    .hint("name the file with `lif`"),
            );
        }
        if has("bench.password-env") && has("bench.password-file") {
            let title = "the password is said to be in two places";
            wrong.push(
                self.at("bench.password-file", title, "and `password-env` names another")
                    .hint("keep one of them"),
            );
        }
        let pairs = [
            ("bench.tls-cert", "bench.tls-key"),
            ("bench.client-cert", "bench.client-key"),
        ];
        for (one, other) in pairs.into_iter().flat_map(|(one, other)| [(one, other), (other, one)]) {
            if has(one) && !has(other) {
                let title = format!("`{one}` needs `{other}`");
                wrong.push(self.at(one, title, "half of a pair"));
            }
        }
        if self.flag("bench.tap") == Some(false) && !has("bench.broker") {
            let title = "without the tap the device needs a broker of its own";
            wrong.push(
                self.at("bench.tap", title, "and no broker is named")
                    .hint("name it with `broker`"),
            );
        }
        let time = self.time();
        if time.slow > time.react {
            let title = "`time.slow` is longer than `time.react`";
            wrong.push(self.at("time.slow", title, "a warning would come after the failure"));
        }
        if time.event > time.event_warning {
            let title = "`time.event` is longer than `time.event-warning`";
            wrong.push(self.at("time.event", title, "a pass would come after the warning"));
        }
        let statements = self.statements();
        let said = |name: &str| statements.get(name) == Some(&true);
        if said("node-bound") && said("stops-between-nodes") {
            let title = "a vehicle that is bound to nodes does not stop between them";
            wrong.push(self.at("device.node-bound", title, "and `stops-between-nodes` says otherwise"));
        }
        for claim in self.claims() {
            let (Claim::Statement(name) | Claim::NoStatement(name)) = &claim else {
                continue;
            };
            let claimed = matches!(claim, Claim::Statement(_));
            let path = format!("device.{name}");
            let said = self.flag(&path).or_else(|| self.action(&path).map(|_| true));
            if said.is_some_and(|said| said != claimed) {
                let title = format!("`device.claims` and `device.{name}` say the opposite of each other");
                wrong.push(self.at("device.claims", title, "the claims"));
            }
        }
        let maker = self.text("vehicles.manufacturer").unwrap_or_default();
        let serials = self.texts("vehicles.serial-numbers").unwrap_or_default();
        let mut named: BTreeSet<(&str, &str)> =
            serials.iter().map(|serial| (maker.as_str(), serial.as_str())).collect();
        for group in self.others() {
            for serial in &group.serial_numbers {
                if !named.insert((&group.manufacturer, serial)) {
                    let title = format!("there are two vehicles {} {serial}", group.manufacturer);
                    wrong.push(Diagnostic::new(
                        "contradiction",
                        group.span.clone(),
                        title,
                        "the second one",
                    ));
                }
            }
        }
        let role = self.role();
        for (name, (hook, _)) in &self.layer.hooks {
            if self.hooks.find(name, role).is_none() {
                let title = format!("hook `{name}` is not for a device of role `{role}`");
                let others: Vec<&str> = self.hooks.of(role).map(|info| info.name.as_str()).collect();
                let diagnostic = Diagnostic::new("contradiction", hook.span.clone(), title, "for the other side");
                wrong.push(diagnostic.hint(diagnostic::did_you_mean(name, others.iter().copied())));
            }
        }
        wrong
    }
}
