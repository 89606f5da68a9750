//! Reading the steps that do something: `send`, `link`, `serve`, `operator`.

use base64::Engine as _;

use super::fields::{Fields, Problems, text_of, word_of};
use super::grammar::{course_name, place, time};
use super::model::{
    CertificateFile, LinkStep, Operator, Patch, Raw, Route, Send, SendAction, Serve, ServeBehaviour, VehicleStep, Which,
};
use super::terms::{named_terms, term};
use tck_base::diagnostic::Span;
use tck_base::yaml::{Kind, Node};
use tck_journal::event::{Direction, LinkFault};

pub(super) const SEND_KEYS: &[&str] = &[
    "route",
    "payload",
    "action",
    "as",
    "with",
    "withAll",
    "blocking",
    "actions",
    "patch",
    "raw",
    "qos",
    "retain",
    "neighbour",
];
pub(super) const SERVE_KEYS: &[&str] = &["file", "json", "certificate", "behaviour"];
pub(super) const OPERATOR_KEYS: &[&str] = &["with", "within", "each"];
pub(super) const VEHICLE_KEYS: &[&str] = &["with", "of"];

const WHICH: [(&str, Which); 2] = [("first", Which::First), ("second", Which::Second)];

/// Every word of `link:` and the keys it takes.
const FAULTS: [(&str, &[&str]); 7] = [
    ("cut", &["reset"]),
    ("silence", &["direction"]),
    ("delay", &["millis", "direction"]),
    ("drop", &["topic", "count", "direction"]),
    ("duplicate", &["topic", "count", "direction"]),
    ("refuse", &[]),
    ("restore", &[]),
];

/// The words of `certificate`.
const CERTIFICATE_FILES: [(&str, CertificateFile); 6] = [
    ("authority", CertificateFile::Authority),
    ("certificate", CertificateFile::Certificate),
    ("key", CertificateFile::Key),
    ("stray-certificate", CertificateFile::StrayCertificate),
    ("other-key", CertificateFile::OtherKey),
    ("broken-certificate", CertificateFile::BrokenCertificate),
];

const BEHAVIOURS: [(&str, ServeBehaviour); 7] = [
    ("well", ServeBehaviour::Well),
    ("not-found", ServeBehaviour::NotFound),
    ("stall", ServeBehaviour::Stall),
    ("cut", ServeBehaviour::Cut),
    ("wrong-bytes", ServeBehaviour::WrongBytes),
    ("slow", ServeBehaviour::Slow),
    ("unreachable", ServeBehaviour::Unreachable),
];

/// The keys that go with this word of `link:`.
pub(super) fn link_keys(fault: &str) -> &'static [&'static str] {
    FAULTS
        .iter()
        .find(|(word, _)| *word == fault)
        .map_or(&["reset", "direction", "millis", "topic", "count"], |(_, keys)| keys)
}

pub(super) fn send(topic: &str, fields: &Fields<'_>, at: &Span, problems: &mut Problems) -> Send {
    exclusive(
        fields,
        "raw",
        &["payload", "route", "patch", "action", "actions"],
        problems,
    );
    exclusive(fields, "actions", &["action"], problems);
    for key in ["as", "with", "withAll", "blocking"] {
        if let Some(name) = fields.key(key)
            && !fields.has("action")
        {
            problems.at(
                "missing-key",
                &name.span,
                format!("`{key}` without `action`"),
                "belongs to an `action:` of this step",
            );
        }
    }
    let payload = fields.get("payload", problems).map(|node| {
        if matches!(node.kind, Kind::List(_) | Kind::Bool(_) | Kind::Number(_)) {
            problems.wrong_type(node, "a mapping");
        }
        term(node, problems)
    });
    let mut actions: Vec<SendAction> = fields
        .list("actions", problems)
        .iter()
        .filter_map(|node| send_action_item(node, problems))
        .collect();
    if let Some(node) = fields.get("action", problems) {
        actions.push(send_action(node, fields, at, problems));
    }
    if topic == "instantActions"
        && !["action", "actions", "payload", "raw"]
            .iter()
            .any(|key| fields.has(key))
    {
        problems.at(
            "missing-key",
            at,
            "`instantActions` without an action",
            "needs `action:` or `actions:`",
        );
    }
    if topic != "instantActions" {
        for key in ["action", "actions"] {
            if let Some(name) = fields.key(key) {
                problems.at(
                    "misplaced-key",
                    &name.span,
                    format!("`{key}` belongs to `send: instantActions`"),
                    "actions of an order stand in its `route:`, under `actions:`",
                );
            }
        }
    }
    if let Some(name) = fields.key("route")
        && topic != "order"
    {
        problems.at(
            "misplaced-key",
            &name.span,
            "`route` belongs to `send: order`",
            "not on this topic",
        );
    }
    let patch = fields.get("patch", problems).and_then(|node| match node.kind {
        Kind::Map(_) => Some(Patch::Merge(term(node, problems))),
        Kind::List(_) => {
            check_operations(node, problems);
            Some(Patch::Operations(term(node, problems)))
        }
        _ => {
            problems.wrong_type(node, "a mapping (merge patch) or a list (JSON patch)");
            None
        }
    });
    Send {
        topic: topic.to_owned(),
        payload,
        route: fields.get("route", problems).and_then(|node| route(node, problems)),
        actions,
        patch,
        raw: fields.get("raw", problems).and_then(|node| raw(node, problems)),
        qos: fields
            .whole_number("qos", 2, problems)
            .and_then(|qos| u8::try_from(qos).ok()),
        retain: fields.flag("retain", problems),
        neighbour: fields.flag("neighbour", problems),
    }
}

/// Notes every key of `others` beside `key`.
fn exclusive(fields: &Fields<'_>, key: &str, others: &[&str], problems: &mut Problems) {
    if !fields.has(key) {
        return;
    }
    for other in others {
        if let Some(name) = fields.key(other) {
            problems.at(
                "conflicting-keys",
                &name.span,
                format!("`{other}` beside `{key}`"),
                format!("`{key}` leaves nothing for it to do"),
            );
        }
    }
}

fn check_operations(node: &Node, problems: &mut Problems) {
    const OPERATIONS: [(&str, ()); 7] = [
        ("add", ()),
        ("remove", ()),
        ("replace", ()),
        ("move", ()),
        ("copy", ()),
        ("test", ()),
        ("as-text", ()),
    ];
    for item in node.list().unwrap_or_default() {
        let Some(fields) = Fields::of(item, problems) else {
            continue;
        };
        fields.only(&[&["op", "path", "from", "value"]], problems);
        fields.need("op", &item.span, problems);
        fields.word("op", "unknown-word", &OPERATIONS, problems);
        if let Some(path) = fields.need_text("path", &item.span, problems)
            && !path.starts_with('/')
        {
            problems.at(
                "bad-pointer",
                &item.span,
                "a path of JSON Patch begins with `/`",
                "not a JSON pointer",
            );
        }
    }
}

fn raw(node: &Node, problems: &mut Problems) -> Option<Raw> {
    if node.text().is_some() {
        return Some(Raw::Text(term(node, problems)));
    }
    let fields = Fields::of(node, problems)?;
    fields.only(&[&["base64"]], problems);
    let text = fields.need("base64", &node.span, problems)?;
    match base64::engine::general_purpose::STANDARD.decode(text_of(text, problems)?) {
        Ok(bytes) => Some(Raw::Bytes(bytes)),
        Err(error) => {
            problems.at("bad-base64", &text.span, "not base64", error.to_string());
            None
        }
    }
}

/// The action named by `action:`; its other members stand beside it.
fn send_action(action: &Node, fields: &Fields<'_>, at: &Span, problems: &mut Problems) -> SendAction {
    text_of(action, problems);
    SendAction {
        action: term(action, problems),
        name: fields.get("as", problems).and_then(|node| name(node, problems)),
        with: fields
            .get("with", problems)
            .map(|node| named_terms(node, problems))
            .unwrap_or_default(),
        with_all: fields.get("withAll", problems).map(|node| term(node, problems)),
        blocking: fields.get("blocking", problems).map(|node| term(node, problems)),
        span: at.clone(),
    }
}

fn send_action_item(node: &Node, problems: &mut Problems) -> Option<SendAction> {
    let fields = Fields::of(node, problems)?;
    fields.only(&[&["action", "as", "with", "withAll", "blocking"]], problems);
    let action = fields.need("action", &node.span, problems)?;
    Some(send_action(action, &fields, &node.span, problems))
}

/// A name that variables can begin with.
pub(super) fn name(node: &Node, problems: &mut Problems) -> Option<String> {
    let text = text_of(node, problems)?;
    check_name(text, &node.span, problems).then(|| text.to_owned())
}

/// Names that belong to the harness.
pub(super) const RESERVED: [&str; 8] = ["time", "device", "course", "run", "vda", "serve", "case", "with"];

/// Whether `text` can be the name of a value, noting why not.
pub(super) fn check_name(text: &str, span: &Span, problems: &mut Problems) -> bool {
    if RESERVED.contains(&text) {
        problems.at(
            "reserved-name",
            span,
            format!("`{text}` is a name of the harness"),
            "choose another name",
        );
        return false;
    }
    let fits = text.starts_with(|c: char| c.is_ascii_alphabetic())
        && text.chars().all(|c| c.is_ascii_alphanumeric() || c == '_' || c == '-');
    if !fits {
        problems.at(
            "bad-name",
            span,
            format!("`{}` cannot be a name", super::fields::short(text)),
            "letters, digits, `-` and `_`, a letter first",
        );
    }
    fits
}

fn route(node: &Node, problems: &mut Problems) -> Option<Route> {
    let fields = Fields::of(node, problems)?;
    fields.only(&[&["base", "horizon", "from", "actions"]], problems);
    let names = |key: &str, problems: &mut Problems| -> Vec<String> {
        fields
            .list(key, problems)
            .iter()
            .filter_map(|node| course_name(node, problems))
            .collect()
    };
    let before = problems.len();
    let base = names("base", problems);
    let horizon = names("horizon", problems);
    if base.is_empty() && problems.len() == before {
        if horizon.is_empty() {
            problems.at(
                "missing-key",
                &node.span,
                "a route without nodes",
                "needs `base:` with a node",
            );
        } else {
            problems.at(
                "horizon-without-base",
                &node.span,
                "a horizon without a base",
                "the first node of an order is always released",
            );
        }
    }
    let way: Vec<&String> = base.iter().chain(&horizon).collect();
    let to_itself = way.iter().zip(way.iter().skip(1)).find(|(from, to)| from == to);
    if let Some((from, _)) = to_itself {
        problems.at(
            "bad-route",
            &node.span,
            format!("the route goes from `{from}` to itself"),
            "no edge leads there",
        );
    }
    let mut actions = Vec::new();
    if let Some(places) = fields.get("actions", problems)
        && let Some(entries) = Fields::of(places, problems)
    {
        for (key, value) in entries.entries() {
            let list = value.list().unwrap_or_else(|| {
                problems.wrong_type(value, "a list of actions");
                &[]
            });
            let list: Vec<_> = list
                .iter()
                .filter_map(|item| send_action_item(item, problems))
                .collect();
            let Some(place) = place(key, problems) else { continue };
            let there = match &place {
                super::model::RoutePlace::Node(name) => way.contains(&name),
                super::model::RoutePlace::Edge(from, to) => way.windows(2).any(|pair| pair[0] == from && pair[1] == to),
            };
            if !there && problems.len() == before {
                problems.at(
                    "place-not-in-route",
                    &key.span,
                    format!("`{}` is not on this route", key.text().unwrap_or_default()),
                    "neither a node of it nor two in a row",
                );
            }
            actions.push((place, list));
        }
    }
    Some(Route {
        base,
        horizon,
        from: fields.whole_number("from", u32::MAX, problems),
        actions,
        span: node.span.clone(),
    })
}

pub(super) fn link(word: &str, fields: &Fields<'_>, at: &Span, problems: &mut Problems) -> Option<LinkStep> {
    let words: Vec<(&'static str, ())> = FAULTS.iter().map(|(word, _)| (*word, ())).collect();
    word_of(word, at, "fault of the link", "unknown-fault", &words, problems)?;
    let directions = [
        ("from-device", Direction::FromDevice),
        ("to-device", Direction::ToDevice),
    ];
    let direction = fields.word("direction", "unknown-word", &directions, problems);
    let fault = match word {
        "cut" => LinkFault::Cut {
            reset: fields.flag("reset", problems),
        },
        "silence" => LinkFault::Silence { direction },
        "delay" => {
            fields.need("millis", at, problems)?;
            let millis = u64::from(fields.whole_number("millis", 3_600_000, problems)?);
            LinkFault::Delay { millis, direction }
        }
        "drop" | "duplicate" => {
            let topic = fields.text("topic", problems).map(str::to_owned);
            let count = fields.whole_number("count", 1000, problems).unwrap_or(1);
            if word == "drop" {
                LinkFault::Drop {
                    topic,
                    count,
                    direction,
                }
            } else {
                LinkFault::Duplicate {
                    topic,
                    count,
                    direction,
                }
            }
        }
        "refuse" => LinkFault::Refuse,
        _ => LinkFault::Restore,
    };
    Some(LinkStep { fault })
}

pub(super) fn serve(served: &Node, fields: &Fields<'_>, problems: &mut Problems) -> Option<Serve> {
    exclusive(fields, "certificate", &["file", "json"], problems);
    Some(Serve {
        certificate: fields.word("certificate", "unknown-certificate-file", &CERTIFICATE_FILES, problems),
        file: fields.get("file", problems).map(|node| {
            text_of(node, problems);
            term(node, problems)
        }),
        json: fields.get("json", problems).map(|node| term(node, problems)),
        behaviour: fields
            .word("behaviour", "unknown-behaviour", &BEHAVIOURS, problems)
            .unwrap_or_default(),
        name: name(served, problems)?,
    })
}

pub(super) fn operator(hook: &str, fields: &Fields<'_>, problems: &mut Problems) -> Operator {
    Operator {
        hook: hook.to_owned(),
        with: fields
            .get("with", problems)
            .map(|node| named_terms(node, problems))
            .unwrap_or_default(),
        within: fields.get("within", problems).and_then(|node| time(node, problems)),
        each: fields
            .get("each", problems)
            .and_then(|node| {
                let text = text_of(node, problems)?;
                word_of(
                    text,
                    &node.span,
                    "thing to do it for",
                    "unknown-word",
                    &[("vehicle", true)],
                    problems,
                )
            })
            .unwrap_or(false),
    }
}

/// `vehicle:`.
pub(super) fn vehicle(what: &str, fields: &Fields<'_>, problems: &mut Problems) -> VehicleStep {
    VehicleStep {
        what: what.to_owned(),
        with: fields
            .get("with", problems)
            .map(|node| named_terms(node, problems))
            .unwrap_or_default(),
        of: which(fields, problems),
    }
}

/// `of:`; the first vehicle unless said.
pub(super) fn which(fields: &Fields<'_>, problems: &mut Problems) -> Which {
    let Some(node) = fields.get("of", problems) else {
        return Which::First;
    };
    text_of(node, problems)
        .and_then(|text| word_of(text, &node.span, "mock vehicle", "unknown-word", &WHICH, problems))
        .unwrap_or_default()
}
