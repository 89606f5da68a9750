//! The small texts with a grammar of their own: durations, walks of an action, needs, places of a route.

use serde_json::Value;

use super::fields::{Problems, short, text_of};
use super::model::{Need, RoutePlace, Station, TimeTerm, Walk};
use super::terms::{milliseconds, term};
use tck_base::diagnostic::{Diagnostic, Span, closest, did_you_mean};
use tck_base::pattern::{Bindings, Term, TermKind, Unbound};
use tck_base::yaml::Node;
use tck_course::is_station;
use tck_profile::SAMPLE_ACTIONS;

/// The longest duration that may be written out.
const LONGEST: f64 = 3_600_000.0;

impl TimeTerm {
    /// The duration.
    pub fn bind(&self, bindings: &Bindings) -> Result<std::time::Duration, Unbound> {
        let value = self.term.bind(bindings)?;
        value
            .as_f64()
            .and_then(|millis| std::time::Duration::try_from_secs_f64(millis / 1000.0).ok())
            .ok_or_else(|| Unbound {
                name: self.term.variables().first().copied().unwrap_or("duration").to_owned(),
                span: self.term.span.clone(),
            })
    }
}

/// `${time.react}`, `800 ms`, `5 s`, `2 min`.
pub(super) fn time(node: &Node, problems: &mut Problems) -> Option<TimeTerm> {
    let bad = |problems: &mut Problems, title: &str, label: &str| {
        problems.add(
            Diagnostic::new("bad-duration", node.span.clone(), title, label)
                .hint("write `${time.react}` or another name of `time.`, or such as `800 ms`, `5 s`, `2 min`"),
        );
    };
    let Some(text) = node.text() else {
        bad(problems, "not a duration", "a duration is a text with a unit");
        return None;
    };
    if text.contains("${") {
        let term = term(node, problems);
        if matches!(&term.kind, TermKind::Variable(name) if name.starts_with("time.")) {
            return Some(TimeTerm { term });
        }
        bad(problems, "not a duration", "one variable of `time.` and nothing else");
        return None;
    }
    let Some(millis) = milliseconds(text) else {
        bad(problems, "not a duration", "a number and `ms`, `s` or `min`");
        return None;
    };
    if !(1.0..=LONGEST).contains(&millis) {
        problems.at(
            "duration-out-of-range",
            &node.span,
            "a duration is more than nothing and at most an hour",
            "out of range",
        );
        return None;
    }
    Some(TimeTerm {
        term: Term {
            kind: TermKind::Literal(Value::from(millis)),
            span: node.span.clone(),
        },
    })
}

/// `WAITING? -> RUNNING -> FINISHED | FAILED`.
pub(super) fn walk(node: &Node, problems: &mut Problems) -> Option<Walk> {
    let text = text_of(node, problems)?;
    let mut stations = Vec::new();
    for part in text.split("->") {
        let part = part.trim();
        let (statuses, optional) = part.strip_suffix('?').map_or((part, false), |rest| (rest.trim(), true));
        let statuses: Vec<String> = statuses.split('|').map(|status| status.trim().to_owned()).collect();
        let is_word =
            |status: &String| !status.is_empty() && status.chars().all(|c| c.is_ascii_uppercase() || c == '_');
        if let Some(odd) = statuses.iter().find(|status| !is_word(status)) {
            problems.add(
                Diagnostic::new(
                    "bad-walk",
                    node.span.clone(),
                    "not a walk of action statuses",
                    format!("`{}` is no status", short(odd)),
                )
                .hint("write such as `WAITING? -> INITIALIZING? -> RUNNING? -> FINISHED | FAILED`"),
            );
            return None;
        }
        stations.push(Station { statuses, optional });
    }
    if stations.last().is_none_or(|last| last.optional) {
        problems.at(
            "walk-without-end",
            &node.span,
            "the last station of a walk may not be optional",
            "it would be over before it began",
        );
        return None;
    }
    Some(Walk { stations })
}

/// One entry of `needs:`.
pub(super) fn need(node: &Node, problems: &mut Problems) -> Option<Need> {
    let text = text_of(node, problems)?;
    let words: Vec<&str> = text.split_whitespace().collect();
    let owned = |text: &str| text.to_owned();
    let found = match words.as_slice() {
        ["action", name] => Need::Action {
            name: owned(name),
            scope: None,
        },
        ["action", name, scope @ ("INSTANT" | "NODE" | "EDGE" | "ZONE")] => Need::Action {
            name: owned(name),
            scope: Some(owned(scope)),
        },
        ["no", "action", name] => Need::NoAction(owned(name)),
        ["optional", path] => Need::Optional(owned(path)),
        ["no", "optional", path] => Need::NoOptional(owned(path)),
        ["not", "required", path] => Need::NotRequired(owned(path)),
        ["vantage", "tap"] => Need::Tap,
        ["maps"] => Need::MapServer,
        ["files", "over", "TLS"] => Need::SecuredFiles,
        ["hook", name] => Need::Hook(owned(name)),
        ["profile", name] => Need::Profile(owned(name)),
        ["limit", name] => Need::Limit(owned(name)),
        ["zones"] => Need::Zone(None),
        ["no", "zone", name] => Need::NoZone(owned(name)),
        ["zone", name] => Need::Zone(Some(owned(name))),
        _ => {
            let forms = [
                "action NAME",
                "action NAME SCOPE",
                "no action NAME",
                "optional PATH",
                "no optional PATH",
                "not required PATH",
                "vantage tap",
                "maps",
                "files over TLS",
                "hook NAME",
                "profile NAME",
                "limit NAME",
                "zones",
                "zone TYPE",
                "no zone TYPE",
            ];
            problems.add(
                Diagnostic::new(
                    "bad-need",
                    node.span.clone(),
                    format!("unknown need `{}`", short(text)),
                    "not of a known form",
                )
                .hint(did_you_mean(text, forms)),
            );
            return None;
        }
    };
    Some(found)
}

/// Whether this is the name of a course node: one letter, `far`, or a station of the profile.
pub(super) fn is_course_name(name: &str) -> bool {
    name == "far" || (name.len() == 1 && name.bytes().all(|byte| byte.is_ascii_lowercase())) || is_station(name)
}

/// The name of a course node.
pub(super) fn course_name(node: &Node, problems: &mut Problems) -> Option<String> {
    let text = text_of(node, problems)?;
    if is_course_name(text) {
        return Some(text.to_owned());
    }
    bad_course_name(text, &node.span, problems);
    None
}

fn bad_course_name(text: &str, span: &Span, problems: &mut Problems) {
    let stations = SAMPLE_ACTIONS.iter().filter(|sample| sample.is_station());
    let hint = match closest(text, stations.map(|sample| sample.variable)) {
        Some(close) => format!("did you mean `{close}`?"),
        None => {
            "nodes of the course are a, b, c, d …, `far` for one that is out of reach, and places of the profile such \
                 as `pick`"
                .to_owned()
        }
    };
    problems.add(
        Diagnostic::new(
            "bad-node-name",
            span.clone(),
            format!("`{}` is no name of a course node", short(text)),
            "not a name",
        )
        .hint(hint),
    );
}

/// `b`, or `a-b` for an edge.
pub(super) fn place(node: &Node, problems: &mut Problems) -> Option<RoutePlace> {
    let text = text_of(node, problems)?;
    match text.split_once('-') {
        Some((from, to)) if [from, to].iter().all(|name| is_course_name(name) && !is_station(name)) => {
            Some(RoutePlace::Edge(from.to_owned(), to.to_owned()))
        }
        None if is_course_name(text) => Some(RoutePlace::Node(text.to_owned())),
        Some((from, to)) if is_course_name(from) && is_course_name(to) => {
            problems.add(
                Diagnostic::new(
                    "bad-node-name",
                    node.span.clone(),
                    format!("`{}` is no edge of the course", short(text)),
                    "a way of any length, not one edge",
                )
                .hint("a place of the profile that is on an edge, such as `edgePick`, has its actions on that edge"),
            );
            None
        }
        _ => {
            bad_course_name(text, &node.span, problems);
            None
        }
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;
    use tck_base::diagnostic::Source;

    fn read<T>(text: &str, reader: fn(&Node, &mut Problems) -> Option<T>) -> Result<T, &'static str> {
        let quoted = serde_json::to_string(text).expect("json");
        let tree = tck_base::yaml::tree(&Source::new("test", quoted)).expect("yaml");
        let mut problems = Problems::default();
        reader(&tree, &mut problems).ok_or_else(|| problems.into_sorted()[0].code)
    }

    #[test]
    fn a_duration_is_a_name_of_time_or_a_number_with_a_unit() {
        let bindings = Bindings::from(json!({"time": {"react": 31000}}));
        let millis = |text| read(text, time).map(|time| time.bind(&bindings).expect("bound").as_millis());
        assert_eq!(millis("${time.react}"), Ok(31_000));
        assert_eq!(millis("1.5 s"), Ok(1_500));
        assert_eq!(millis("60 min"), Ok(3_600_000));
        assert_eq!(millis("61 min"), Err("duration-out-of-range"));
        assert_eq!(millis("0 s"), Err("duration-out-of-range"));
        assert_eq!(millis("5"), Err("bad-duration"));
        assert_eq!(millis("${run.x}"), Err("bad-duration"));
        assert!(read("${time.slow}", time).expect("read").bind(&bindings).is_err());
    }

    #[test]
    fn a_walk_has_optional_stations_and_alternatives_and_an_end() {
        let read = |text| read(text, walk);
        let long = read("WAITING? -> RUNNING -> FINISHED | FAILED").expect("walk");
        let shape: Vec<_> = long
            .stations
            .iter()
            .map(|s| (s.statuses.join("/"), s.optional))
            .collect();
        assert_eq!(
            shape,
            [
                ("WAITING".into(), true),
                ("RUNNING".into(), false),
                ("FINISHED/FAILED".into(), false)
            ]
        );
        assert_eq!(read("FINISHED?").err(), Some("walk-without-end"));
        for bad in ["", "->", "RUNNING ->", "running", "A B", "A || B"] {
            assert_eq!(read(bad).err(), Some("bad-walk"), "{bad}");
        }
    }

    #[test]
    fn needs_have_known_forms() {
        for text in [
            "action downloadMap",
            "action pick NODE",
            "no action X",
            "optional order.nodes.x",
            "no optional order.edges.trajectory",
            "vantage tap",
            "maps",
            "files over TLS",
            "hook power-cycle",
            "profile stops-between-nodes",
            "limit maxArrayLens.order.nodes",
        ] {
            assert!(read(text, need).is_ok(), "{text}");
        }
        for bad in ["", "action", "action pick FLOOR", "tap", "no hook x", "hook a b"] {
            assert_eq!(read(bad, need).err(), Some("bad-need"), "{bad}");
        }
    }

    #[test]
    fn places_are_nodes_and_edges() {
        assert_eq!(read("b", place), Ok(RoutePlace::Node("b".into())));
        assert_eq!(read("a-far", place), Ok(RoutePlace::Edge("a".into(), "far".into())));
        for bad in ["", "A", "aa", "a-", "a-b-c", "1"] {
            assert_eq!(read(bad, place), Err("bad-node-name"), "{bad}");
        }
    }
}
