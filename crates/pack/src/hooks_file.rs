//! One file of hooks: from a tree with places to typed hooks.

use std::collections::BTreeMap;
use std::sync::Arc;

use super::reader::Reader;
use super::{HookChange, HookEffect, HookInfo, HookParameter, HookRisk, HookValue, Role};
use tck_base::diagnostic::{Diagnostic, Source, Span, did_you_mean};
use tck_base::yaml::{self, Kind, Node};

const CODE: &str = "hooks";
const KEYS: [&str; 9] = [
    "hook",
    "does",
    "parameters",
    "effects",
    "changes",
    "risk",
    "undoes",
    "for-action",
    "optional",
];

/// A hook with the places where it may be wrong only beside others.
pub(super) struct Entry {
    pub(super) hook: HookInfo,
    name: Span,
    undoes: Option<Span>,
}

impl Entry {
    pub(super) fn is(&self, role: Role, name: &str) -> bool {
        self.hook.role == role && self.hook.name == name
    }

    /// What is wrong when another hook has the name, which is remembered otherwise.
    pub(super) fn taken_by<'e>(&'e self, taken: &mut BTreeMap<(Role, &'e str), &'e Span>) -> Option<Diagnostic> {
        let first = taken.insert((self.hook.role, &self.hook.name), &self.name)?;
        let title = format!("the hook `{}` for a second time", self.hook.name);
        let label = format!("{} has the name already", first.place());
        let complaint = Diagnostic::new("hook-twice", self.name.clone(), title, label);
        Some(complaint.hint("give it another name: in profiles and tests it is all it is known by"))
    }

    /// What is wrong when the hook whose opposite it is does not exist.
    pub(super) fn without_opposite(&self, known: impl Fn(Role, &str) -> bool) -> Option<Diagnostic> {
        let (undoes, place) = (self.hook.undoes.as_deref()?, self.undoes.as_ref()?);
        let wrong = if undoes == self.hook.name {
            format!("the hook `{undoes}` is its own opposite")
        } else if known(self.hook.role, undoes) {
            return None;
        } else {
            format!("there is no hook `{undoes}` for a device of role `{}`", self.hook.role)
        };
        let complaint = Diagnostic::new("hook-without-opposite", place.clone(), wrong, "undoes nothing");
        Some(
            complaint
                .hint("`undoes` names the hook that does what this one takes back; leave it out where there is none"),
        )
    }
}

/// Reads a file; mistakes are added to `problems`.
pub(super) fn read(source: &Arc<Source>, problems: &mut Vec<Diagnostic>) -> Vec<Entry> {
    let root = match yaml::tree(source) {
        Ok(root) => root,
        Err(mistakes) => {
            problems.extend(mistakes);
            return Vec::new();
        }
    };
    let mut reader = Reader::new(CODE, problems);
    reader.known(&root, &["device", "hooks"]);
    let role = reader.choice(&root, "device", &["agv", "master-control"]);
    let items = reader.list(&root, "hooks").unwrap_or_default();
    let Some(role) = role else { return Vec::new() };
    items.iter().filter_map(|item| reader.hook(item, role)).collect()
}

impl Reader<'_> {
    fn hook(&mut self, node: &Node, role: Role) -> Option<Entry> {
        self.known(node, &KEYS);
        let place = self.member(node, "hook")?;
        let name = self.as_text(place)?;
        self.is_plain(place, &name, "name of a hook", |c| c.is_ascii_lowercase() || c == '-');
        let parameters = self.parameters(node);
        let effects = self
            .words(node, "effects", &HookEffect::ALL, HookEffect::word)
            .unwrap_or_default();
        for effect in &effects {
            let Some(parameter) = effect.parameter() else { continue };
            if !parameters.iter().any(|known| known.name == parameter) {
                let title = format!("`{}` without the parameter `{parameter}`", effect.word());
                let hint =
                    format!("the run hands it over: add `{parameter}` below `parameters`, or take the effect out");
                self.problem(place, &title, "takes no such parameter", &hint);
            }
        }
        let risk = node
            .get("risk")
            .map(|_| self.choice(node, "risk", &HookRisk::ALL.map(HookRisk::word)));
        let optional = match node.get("optional").map(|flag| (flag, &flag.kind)) {
            Some((_, Kind::Bool(flag))) => *flag,
            Some((flag, _)) => {
                self.wrong(flag, "`true` or `false`");
                false
            }
            None => false,
        };
        let undoes = node.get("undoes");
        Some(Entry {
            hook: HookInfo {
                name,
                role,
                doc: self.text(node, "does")?,
                parameters,
                effects,
                changes: self.words(node, "changes", &HookChange::ALL, HookChange::word),
                risk: risk.flatten().unwrap_or_default(),
                undoes: undoes.and_then(|other| self.as_text(other)),
                for_action: node.get("for-action").and_then(|action| self.as_text(action)),
                optional,
            },
            name: place.span.clone(),
            undoes: undoes.map(|other| other.span.clone()),
        })
    }

    /// The words of a list, if there is one.
    fn words<T: Copy>(&mut self, node: &Node, key: &str, all: &[T], word: fn(T) -> &'static str) -> Option<Vec<T>> {
        node.get(key)?;
        let items = self.list(node, key)?;
        let mut found = Vec::new();
        for item in items {
            let Some(text) = self.as_text(item) else { continue };
            let Some(known) = all.iter().find(|known| word(**known) == text) else {
                let title = format!("`{text}` is not known for `{key}`");
                let hint = did_you_mean(&text, all.iter().map(|known| word(*known)));
                self.problem(item, &title, "unknown word", &hint);
                continue;
            };
            found.push(*known);
        }
        Some(found)
    }

    fn parameters(&mut self, node: &Node) -> Vec<HookParameter> {
        let Some(parameters) = node.get("parameters") else {
            return Vec::new();
        };
        let Some(entries) = parameters.map() else {
            self.wrong(parameters, "a mapping from name to what it says");
            return Vec::new();
        };
        let mut all = Vec::new();
        for (key, said) in entries {
            let name = key.text().unwrap_or_default().to_owned();
            self.is_plain(key, &name, "name of a parameter", |c| c.is_ascii_alphabetic());
            self.known(said, &["about", "example", "values"]);
            let values = self.values(said);
            let example = match values.first() {
                Some(first) if said.get("example").is_none() => Some(first.id.clone()),
                _ => self.text(said, "example"),
            };
            if let (Some(about), Some(example)) = (self.text(said, "about"), example) {
                all.push(HookParameter {
                    name,
                    about,
                    example,
                    values,
                });
            }
        }
        all
    }

    /// A list of identifiers, or a mapping from each to what it means.
    fn values(&mut self, node: &Node) -> Vec<HookValue> {
        let Some(values) = node.get("values") else {
            return Vec::new();
        };
        let mut all = Vec::new();
        match &values.kind {
            Kind::List(items) => {
                for item in items {
                    all.extend(self.as_text(item).map(|id| HookValue { id, text: None }));
                }
            }
            Kind::Map(entries) => {
                for (key, text) in entries {
                    let id = key.text().unwrap_or_default().to_owned();
                    all.extend(self.as_text(text).map(|text| HookValue { id, text: Some(text) }));
                }
            }
            _ => self.wrong(values, "a list of identifiers, or a mapping from each to what it means"),
        }
        all
    }

    /// Names stand in profiles as they are, in placeholders, and in addresses.
    fn is_plain(&mut self, node: &Node, name: &str, what: &str, allowed: fn(char) -> bool) {
        let begins = name.starts_with(|c: char| c.is_ascii_lowercase());
        if !begins || !name.chars().all(|c| allowed(c) || c.is_ascii_digit()) {
            let hint = "begin with a small letter, and use no blanks or signs, such as `set-mode` for a hook and `nodeId` for a parameter";
            self.problem(node, &format!("`{name}` is no {what}"), "not plain", hint);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::Hooks;
    use super::*;

    const GOOD: &str = r"device: agv
hooks:
  - hook: open-door
    does: Open the door.
    parameters:
      door: { about: which one, example: d1 }
      how: { about: how far, values: { wide: Open it wide., half: Open one wing. } }
    effects: [may-restart]
    changes: [order]
    risk: modes
    for-action: passDoor
    optional: true
  - hook: close-door
    does: Close the door.
    undoes: open-door
";

    fn check(text: &str) -> Result<usize, Vec<Diagnostic>> {
        Hooks::default().check_text("own/hooks/doors.yaml", text)
    }

    #[test]
    fn a_good_file_is_read_whole() {
        assert_eq!(check(GOOD).expect("good"), 2);
        let all = read(&Source::new("x.yaml", GOOD), &mut Vec::new());
        let open = &all[0].hook;
        assert_eq!(
            (open.effects.as_slice(), open.changes()),
            (&[HookEffect::MayRestart][..], &[HookChange::Order][..])
        );
        assert!(open.may_restart() && !open.restarts() && open.optional && open.risk == HookRisk::Modes);
        assert_eq!(open.parameters[1].example, "wide");
        assert_eq!(open.parameters[1].values[1].text.as_deref(), Some("Open one wing."));
        assert_eq!(all[1].hook.undoes.as_deref(), Some("open-door"));
    }

    #[test]
    fn every_mistake_is_named_with_its_line_and_a_hint() {
        for (good, bad, line, expected) in [
            (
                "[may-restart]",
                "[may-restrat]",
                8,
                "`may-restrat` is not known for `effects`",
            ),
            (
                "[may-restart]",
                "[sets-mode]",
                3,
                "`sets-mode` without the parameter `mode`",
            ),
            (
                "changes: [order]",
                "changes: [ordr]",
                9,
                "`ordr` is not known for `changes`",
            ),
            ("risk: modes", "risk: mode", 10, "`mode` is not known for `risk`"),
            ("device: agv", "device: agx", 1, "`agx` is not known for `device`"),
            (
                "hook: close-door",
                "hook: open-door",
                13,
                "the hook `open-door` for a second time",
            ),
            (
                "undoes: open-door",
                "undoes: shut-door",
                15,
                "there is no hook `shut-door` for a device of role `agv`",
            ),
            (
                "undoes: open-door",
                "undoes: close-door",
                15,
                "the hook `close-door` is its own opposite",
            ),
            (
                "hook: open-door",
                "hook: Open door",
                3,
                "`Open door` is no name of a hook",
            ),
            ("door: {", "the-door: {", 6, "`the-door` is no name of a parameter"),
            (", example: d1", "", 6, "`example` is missing"),
            ("    does: Open the door.\n", "", 3, "`does` is missing"),
            (
                "optional: true",
                "optional: yes please",
                12,
                "a text where `true` or `false` is due",
            ),
            ("for-action:", "action:", 11, "unknown key `action`"),
        ] {
            let text = GOOD.replacen(good, bad, 1);
            assert_ne!(text, GOOD);
            let wrong = check(&text).expect_err(bad);
            assert_eq!(wrong[0].title, expected, "{bad}");
            assert_eq!(wrong[0].span.as_ref().map(Span::line), Some(line), "{bad}");
            assert!(wrong[0].hint.is_some(), "{bad}");
        }
    }
}
