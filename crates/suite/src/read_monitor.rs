//! One file into a monitor: its rule, and what each of its requirements is about.

use std::sync::Arc;

use super::CheckInfo;
use super::fields::{Fields, Problems, text_of};
use super::lint::{self, HeaderPlaces, Vocabulary};
use super::model::{About, Binding, Monitor, Rule};
use super::read::{header, named, start};
use super::recordings::recordings;
use super::source::parse;
use super::steps::{check_use, checks};
use super::terms::pattern;
use tck_base::diagnostic::{Source, Span};
use tck_base::yaml::Node;
use tck_pack::RequirementId;

const MONITOR_KEYS: &[&str] = &[
    "monitor",
    "title",
    "device",
    "spec",
    "needs",
    "why",
    "checks",
    "about",
    "check",
    "with",
    "instead-of",
    "topic",
    "always",
    "when",
    "never",
    "hides",
    "recordings",
];
/// The monitor of a file. `name` is what its path asks for.
pub(super) fn read_monitor(
    source: &Arc<Source>,
    name: Option<&str>,
    vocabulary: &dyn Vocabulary,
    known: &[CheckInfo],
    lint: bool,
    problems: &mut Problems,
) -> Option<Monitor> {
    let root = parse(source, problems)?;
    let fields = Fields::of(&root, problems)?;
    fields.only(&[MONITOR_KEYS], problems);
    let at = start(&root);
    if let Some(name) = name {
        named(&fields, "monitor", name, &at, problems);
    }
    let id = fields.need_text("monitor", &at, problems).map(str::to_owned);
    let header = header(&fields, &at, problems);
    let bindings = checks(&fields, problems);
    if fields.need("checks", &at, problems).is_some() && bindings.is_empty() {
        problems.at(
            "decides-nothing",
            &at,
            "a monitor that decides nothing",
            "`checks` is empty",
        );
    }
    let rule = rule(&fields, &at, problems);
    let recordings = recordings(&fields, rule.as_ref(), problems);
    let instead_of = fields.get("instead-of", problems).and_then(|node| {
        let requirement = RequirementId::from(text_of(node, problems)?);
        Some(Binding {
            requirement,
            span: node.span.clone(),
        })
    });
    let hides: Vec<&Node> = fields.list("hides", problems).iter().collect();
    let (needs, need_places): (Vec<_>, Vec<_>) = header.needs.into_iter().unzip();
    let monitor = Monitor {
        id: id?,
        title: header.title,
        device: header.device,
        spec: header.spec?,
        needs,
        checks: bindings,
        instead_of,
        recordings: recordings?,
        about: about(&fields, problems),
        why: header.why,
        rule: rule?,
        hides: hides
            .iter()
            .filter_map(|node| text_of(node, problems).map(str::to_owned))
            .collect(),
        source: Arc::clone(source),
    };
    if !lint {
        return Some(monitor);
    }
    let places = HeaderPlaces {
        hides: hides.iter().map(|node| node.span.clone()).collect(),
        spec: fields
            .get("spec", &mut Problems::default())
            .map(|node| node.span.clone()),
        start: at,
        moves: None,
        needs: need_places,
        complete: true,
    };
    let topic_place = fields
        .get("topic", &mut Problems::default())
        .map(|node| node.span.clone());
    lint::monitor(&monitor, &places, topic_place.as_ref(), vocabulary, known, problems);
    Some(monitor)
}

/// Requirement id to topic to picture.
fn about(fields: &Fields<'_>, problems: &mut Problems) -> Vec<About> {
    let Some(inner) = fields
        .get("about", problems)
        .and_then(|node| Fields::of(node, problems))
    else {
        return Vec::new();
    };
    let mut all = Vec::new();
    for (key, value) in inner.entries() {
        let Some(id) = text_of(key, problems) else { continue };
        let Some(subject) = Fields::of(value, problems) else {
            continue;
        };
        let [(topic, picture)] = subject.entries() else {
            let label = "one topic, and what a message on it shows";
            problems.at(
                "about-one-topic",
                &value.span,
                format!("`{id}` is about one topic"),
                label,
            );
            continue;
        };
        let (Some(topic), Some(pattern)) = (text_of(topic, problems), pattern(picture, problems)) else {
            continue;
        };
        all.push(About {
            requirement: Binding {
                requirement: RequirementId::from(id),
                span: key.span.clone(),
            },
            topic: topic.to_owned(),
            pattern,
        });
    }
    all
}

fn rule(fields: &Fields<'_>, at: &Span, problems: &mut Problems) -> Option<Rule> {
    let written: Vec<&str> = ["check", "always", "never"]
        .into_iter()
        .filter(|key| fields.has(key))
        .collect();
    if written.len() != 1 {
        problems.at(
            "monitor-rule",
            at,
            "a monitor has one rule",
            "needs one of `check:`, `always:` and `never:`",
        );
        return None;
    }
    let unneeded: &[&str] = match written[0] {
        "check" => &["topic", "when"],
        "always" => &["with", "instead-of"],
        _ => &["with", "when", "instead-of"],
    };
    for key in unneeded {
        if let Some(name) = fields.key(key) {
            problems.at(
                "conflicting-keys",
                &name.span,
                format!("`{key}` beside `{}`", written[0]),
                "has no meaning here",
            );
        }
    }
    if written[0] == "check" {
        return check_use(fields, problems).map(Rule::Check);
    }
    let topic = text_of(fields.need("topic", at, problems)?, problems)?.to_owned();
    let picture = pattern(fields.get(written[0], problems)?, problems);
    if written[0] == "never" {
        return Some(Rule::Never {
            topic,
            pattern: picture?,
        });
    }
    let when = match fields.get("when", problems) {
        Some(node) => Some(pattern(node, problems)?),
        None => None,
    };
    Some(Rule::Always {
        topic,
        when,
        pattern: picture?,
    })
}
