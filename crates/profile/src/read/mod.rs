//! One profile file: TOML into a [`Layer`], with every mistake in it named at its place.

mod hooks;
mod keys;
mod known;
mod layout;

use std::collections::BTreeMap;
use std::ops::Range;
use std::path::Path;
use std::sync::Arc;

use toml::Spanned;
use toml::de::{DeTable, DeValue};

use super::key::{KEYS, Key, Kind};
use super::layer::{Layer, Origin, Setter};
use super::value::{self, Refusal, Value};
use super::{Deviation, LayoutList, VehicleGroup};
use tck_base::diagnostic::{self, Diagnostic, Source, Span};
use tck_pack::{Hooks, RequirementId};

const SECTIONS: [&str; 12] = [
    "device",
    "bench",
    "motion",
    "layout",
    "vehicles",
    "time",
    "maps",
    "certificate",
    "deviations",
    "known",
    "keys",
    "hooks",
];

type Entry<'a, 'i> = (&'a Spanned<std::borrow::Cow<'i, str>>, &'a Spanned<DeValue<'i>>);

/// Reads a profile. Relative files in it are found from `folder`.
///
/// # Errors
/// Every mistake that could be found, in the order of the file.
pub(super) fn read(
    source: &Arc<Source>,
    folder: &Path,
    origin: Origin,
    hooks: &Hooks,
) -> Result<Layer, Vec<Diagnostic>> {
    let document = DeTable::parse(&source.text).map_err(|error| {
        let at = error.span().unwrap_or(0..0);
        let span = Span::new(source, at.start, at.end);
        vec![Diagnostic::new("syntax", span, "this is not TOML", error.message())]
    })?;
    let mut reader = Reader {
        source,
        folder,
        origin,
        hooks,
        layer: Layer::default(),
        wrong: Vec::new(),
    };
    reader.document(document.get_ref());
    if reader.wrong.is_empty() {
        return Ok(reader.layer);
    }
    reader
        .wrong
        .sort_by_key(|diagnostic| diagnostic.span.as_ref().map(|span| span.start));
    Err(reader.wrong)
}

struct Reader<'s> {
    source: &'s Arc<Source>,
    folder: &'s Path,
    origin: Origin,
    hooks: &'s Hooks,
    layer: Layer,
    wrong: Vec<Diagnostic>,
}

impl Reader<'_> {
    fn span(&self, range: Range<usize>) -> Span {
        Span::new(self.source, range.start, range.end)
    }

    fn complain(&mut self, code: &'static str, at: Range<usize>, title: &str, label: &str, hint: Option<String>) {
        let diagnostic = Diagnostic::new(code, self.span(at), title, label);
        self.wrong.push(match hint {
            Some(hint) => diagnostic.hint(hint),
            None => diagnostic,
        });
    }

    fn refuse(&mut self, what: &str, value: &Spanned<DeValue<'_>>, mut refusal: Refusal) {
        for more in std::mem::take(&mut refusal.more) {
            self.refuse(what, value, more);
        }
        let at = match (refusal.element, value.get_ref()) {
            (Some(element), DeValue::Array(items)) => items.get(element).map_or(value.span(), Spanned::span),
            _ => value.span(),
        };
        let title = format!("bad value for {what}");
        if refusal.code == "credentials" {
            self.complain_masked(at, &title, &refusal.label, refusal.hint);
        } else {
            self.complain(refusal.code, at, &title, &refusal.label, refusal.hint);
        }
    }

    /// Complains about a value that must not be shown, because logs are read by many.
    fn complain_masked(&mut self, at: Range<usize>, title: &str, label: &str, hint: Option<String>) {
        let mut text = self.source.text.clone();
        text.replace_range(at.clone(), &"*".repeat(at.len()));
        let masked = Source::new(self.source.name.clone(), text);
        let diagnostic = Diagnostic::new("credentials", Span::new(&masked, at.start, at.end), title, label);
        self.wrong.push(diagnostic.hint(hint.unwrap_or_default()));
    }

    fn unknown_key(&mut self, at: Range<usize>, title: &str, name: &str, known: &[&str]) {
        let hint = diagnostic::did_you_mean(name, known.iter().copied());
        self.complain("unknown-key", at, title, "not known", Some(hint));
    }

    fn table<'a, 'i>(&mut self, what: &str, value: &'a Spanned<DeValue<'i>>) -> Option<&'a DeTable<'i>> {
        if let DeValue::Table(table) = value.get_ref() {
            return Some(table);
        }
        let label = format!("this is {}", value::type_name(value.get_ref()));
        self.complain("wrong-type", value.span(), &format!("{what} is a table"), &label, None);
        None
    }

    fn document(&mut self, document: &DeTable<'_>) {
        for (name, value) in document {
            let section = name.get_ref().as_ref();
            if !SECTIONS.contains(&section) {
                self.unknown_key(
                    name.span(),
                    &format!("there is no section `{section}`"),
                    section,
                    &SECTIONS,
                );
                continue;
            }
            let Some(table) = self.table(&format!("`[{section}]`"), value) else {
                continue;
            };
            match section {
                "hooks" => table.iter().for_each(|entry| self.hook(entry)),
                "deviations" => table.iter().for_each(|entry| self.deviation(entry)),
                "known" => table.iter().for_each(|entry| self.known(entry)),
                "keys" => table.iter().for_each(|entry| self.issue_key(entry)),
                _ => self.section(section, table),
            }
        }
    }

    fn section(&mut self, section: &str, table: &DeTable<'_>) {
        let mut list = None;
        for (name, value) in table {
            let path = format!("{section}.{}", name.get_ref());
            if let Some(key) = Key::find(&path) {
                match Value::from_toml(key.kind, value.get_ref(), self.folder, self.hooks) {
                    Ok(checked) => {
                        let span = self.span(value.span());
                        let setter = Setter {
                            value: checked,
                            origin: self.origin.clone(),
                            span: Some(span),
                        };
                        self.layer.values.insert(key.path, setter);
                    }
                    Err(refusal) => self.refuse(&format!("`{path}`"), value, refusal),
                }
            } else if path == "layout.nodes" || path == "layout.edges" {
                let list = list.get_or_insert_with(|| LayoutList {
                    nodes: Vec::new(),
                    edges: Vec::new(),
                    span: Span::new(self.source, name.span().start, name.span().end),
                });
                let DeValue::Array(items) = value.get_ref() else {
                    let label = format!("this is {}", value::type_name(value.get_ref()));
                    self.complain("wrong-type", value.span(), &format!("`{path}` is a list"), &label, None);
                    continue;
                };
                for item in items {
                    if path == "layout.nodes" {
                        list.nodes.extend(self.node(item));
                    } else {
                        list.edges.extend(self.edge(item));
                    }
                }
            } else if path == "vehicles.others" {
                let DeValue::Array(items) = value.get_ref() else {
                    let label = format!("this is {}", value::type_name(value.get_ref()));
                    self.complain(
                        "wrong-type",
                        value.span(),
                        &format!("`{path}` is a list of tables"),
                        &label,
                        None,
                    );
                    continue;
                };
                let groups = items.iter().filter_map(|item| self.vehicle_group(item)).collect();
                self.layer.others = Some((groups, self.origin.clone()));
            } else if name.get_ref() == "password" || name.get_ref().ends_with("-password") {
                let hint = "name an environment variable with `password-env`, or a file with `password-file`";
                self.complain_masked(
                    value.span(),
                    "a password does not belong in a profile",
                    "profiles are copied, mailed and checked in",
                    Some(hint.to_owned()),
                );
            } else {
                let prefix = format!("{section}.");
                let mut known: Vec<&str> = KEYS.iter().filter_map(|key| key.path.strip_prefix(&prefix)).collect();
                match section {
                    "layout" => known.extend(["nodes", "edges"]),
                    "vehicles" => known.push("others"),
                    _ => {}
                }
                let title = format!("there is no `{}` in `[{section}]`", name.get_ref());
                self.unknown_key(name.span(), &title, name.get_ref(), &known);
            }
        }
        if let Some(list) = list {
            self.check_list(&list);
            self.layer.list = Some((list, self.origin.clone()));
        }
    }

    /// The members of an inline table, each known and of the right type.
    fn members<'a, 'i>(
        &mut self,
        what: &str,
        item: &'a Spanned<DeValue<'i>>,
        known: &[&str],
        required: &[&str],
    ) -> Option<BTreeMap<&'a str, &'a Spanned<DeValue<'i>>>> {
        let table = self.table(what, item)?;
        let mut members = BTreeMap::new();
        for (name, value) in table {
            if known.contains(&name.get_ref().as_ref()) {
                members.insert(name.get_ref().as_ref(), value);
            } else {
                self.unknown_key(
                    name.span(),
                    &format!("{what} has no `{}`", name.get_ref()),
                    name.get_ref(),
                    known,
                );
            }
        }
        let missing: Vec<&str> = required
            .iter()
            .copied()
            .filter(|name| !members.contains_key(name))
            .collect();
        if missing.is_empty() {
            return Some(members);
        }
        let title = format!("{what} lacks `{}`", missing.join("`, `"));
        self.complain("missing-key", item.span(), &title, "incomplete", None);
        None
    }

    fn text(&mut self, what: &str, value: &Spanned<DeValue<'_>>) -> Option<String> {
        match self.value(Kind::Text, what, value)? {
            Value::Text(text) => Some(text),
            _ => None,
        }
    }

    fn value(&mut self, kind: Kind, what: &str, value: &Spanned<DeValue<'_>>) -> Option<Value> {
        let read = Value::from_toml(kind, value.get_ref(), self.folder, self.hooks);
        read.map_err(|refusal| self.refuse(what, value, refusal)).ok()
    }

    /// An entry of `[[vehicles.others]]`.
    fn vehicle_group(&mut self, item: &Spanned<DeValue<'_>>) -> Option<VehicleGroup> {
        const REQUIRED: [&str; 2] = ["manufacturer", "serial-numbers"];
        const KNOWN: [&str; 3] = ["manufacturer", "serial-numbers", "protocol"];
        let members = self.members("a group of vehicles", item, &KNOWN, &REQUIRED)?;
        let manufacturer = members.get("manufacturer")?;
        let manufacturer = self.value(Kind::Level, "the manufacturer of vehicles", manufacturer);
        let serials = members.get("serial-numbers")?;
        let serials = self.value(Kind::Names, "the serial numbers of vehicles", serials);
        let protocol = match members.get("protocol") {
            Some(protocol) => Some(self.value(Kind::Version, "the version of vehicles", protocol)?),
            None => None,
        };
        let (Value::Text(manufacturer), Value::Texts(serial_numbers)) = (manufacturer?, serials?) else {
            return None;
        };
        Some(VehicleGroup {
            manufacturer,
            serial_numbers,
            protocol: protocol.as_ref().map(Value::shown),
            span: self.span(item.span()),
        })
    }

    /// A number within limits; `expected` says which.
    fn number(
        &mut self,
        what: &str,
        value: &Spanned<DeValue<'_>>,
        (low, high): (f64, f64),
        expected: &str,
    ) -> Option<f64> {
        match value::number(value.get_ref()) {
            Some(number) if (low..=high).contains(&number) => Some(number),
            Some(number) => {
                let hint = format!("expected {expected}");
                let title = format!("{what} cannot be {number}");
                self.complain("out-of-range", value.span(), &title, "out of range", Some(hint));
                None
            }
            None => {
                let label = format!("this is {}", value::type_name(value.get_ref()));
                self.complain("wrong-type", value.span(), &format!("{what} is a number"), &label, None);
                None
            }
        }
    }

    fn deviation(&mut self, (name, value): Entry<'_, '_>) {
        let id = name.get_ref().as_ref();
        if !RequirementId::is_one(id) {
            let title = format!("`{id}` is not the id of a requirement");
            let hint = "an id looks like ORD-REJ-03; `vda5050-tck list requirements` shows them all".to_owned();
            self.complain("bad-value", name.span(), &title, "not an id", Some(hint));
            return;
        }
        if let Some(reason) = self.text(&format!("the reason of `{id}`"), value) {
            let deviation = Deviation {
                requirement: RequirementId::from(id),
                reason,
                span: self.span(name.span()),
            };
            self.layer.deviations.push((deviation, self.origin.clone()));
        }
    }
}
