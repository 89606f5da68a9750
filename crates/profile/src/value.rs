//! One value: from a profile or from the text of a flag or an environment variable, checked by its kind.

use std::path::{Path, PathBuf};
use std::time::Duration;

use toml::de::{DeTable, DeValue};

use super::SampleAction;
use super::claim::Claim;
use super::key::{COMMON_PLACEHOLDERS, Kind, Place, TEMPLATE_PLACEHOLDERS};
use super::placeholder::placeholders;
use super::time;
use tck_base::diagnostic;
use tck_base::secrets::Secrets;
use tck_pack::Hooks;

/// A checked value.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Value {
    Text(String),
    Flag(bool),
    Duration(Duration),
    Number(f64),
    Path(PathBuf),
    Paths(Vec<PathBuf>),
    Texts(Vec<String>),
    Claims(Vec<Claim>),
    Action(SampleAction),
}

/// Why a value is refused.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Refusal {
    pub code: &'static str,
    pub label: String,
    pub hint: Option<String>,
    /// Which element of a list is meant.
    pub element: Option<usize>,
    /// What else is wrong in the same list.
    pub more: Vec<Refusal>,
}

impl Refusal {
    fn bad(label: impl Into<String>) -> Self {
        Self {
            code: "bad-value",
            label: label.into(),
            hint: None,
            element: None,
            more: Vec::new(),
        }
    }

    /// All that is wrong in a list, as one.
    fn all(refusals: Vec<Self>) -> Result<(), Self> {
        let mut refusals = refusals.into_iter();
        let Some(mut first) = refusals.next() else {
            return Ok(());
        };
        first.more = refusals.collect();
        Err(first)
    }

    fn hint(mut self, hint: impl Into<String>) -> Self {
        self.hint = Some(hint.into());
        self
    }

    fn at(mut self, element: usize) -> Self {
        self.element = Some(element);
        self
    }
}

/// The name of a TOML type, for messages.
pub(super) fn type_name(value: &DeValue<'_>) -> &'static str {
    match value {
        DeValue::String(_) => "a text",
        DeValue::Integer(_) => "a whole number",
        DeValue::Float(_) => "a number",
        DeValue::Boolean(_) => "true or false",
        DeValue::Datetime(_) => "a date",
        DeValue::Array(_) => "a list",
        DeValue::Table(_) => "a table",
    }
}

/// A number of either kind; infinite ones are none.
pub(super) fn number(value: &DeValue<'_>) -> Option<f64> {
    let number: f64 = match value {
        DeValue::Integer(integer) if integer.radix() == 10 => integer.as_str().parse().ok()?,
        DeValue::Float(float) => float.as_str().parse().ok()?,
        _ => return None,
    };
    number.is_finite().then_some(number)
}

impl Value {
    /// Reads a value of a profile whose folder is `folder`.
    pub(super) fn from_toml(kind: Kind, value: &DeValue<'_>, folder: &Path, hooks: &Hooks) -> Result<Self, Refusal> {
        let wrong_type = || Refusal {
            code: "wrong-type",
            label: format!("this is {}", type_name(value)),
            hint: Some(format!("expected {}", kind.hint())),
            element: None,
            more: Vec::new(),
        };
        match (kind, value) {
            (Kind::Flag, DeValue::Boolean(flag)) => Ok(Self::Flag(*flag)),
            (Kind::Action(place), DeValue::Table(table)) => action(table, place),
            (Kind::Action(place), _) if !matches!(place, Place::Anywhere | Place::Zone) => Err(wrong_type()),
            (Kind::Speed, _) => speed(number(value).ok_or_else(wrong_type)?),
            (Kind::Files | Kind::Brokers | Kind::Claims | Kind::Names | Kind::Command, DeValue::Array(items)) => {
                let mut texts = Vec::with_capacity(items.len());
                for (at, item) in items.iter().enumerate() {
                    let DeValue::String(text) = item.get_ref() else {
                        return Err(Refusal {
                            label: format!("this is {}", type_name(item.get_ref())),
                            ..wrong_type().at(at)
                        });
                    };
                    texts.push(text.clone().into_owned());
                }
                Self::from_list(kind, texts, folder, hooks)
            }
            (Kind::Flag | Kind::Files | Kind::Brokers | Kind::Claims | Kind::Names, _) => Err(wrong_type()),
            (_, DeValue::String(text)) => Self::from_text(kind, text, folder, hooks),
            _ => Err(wrong_type()),
        }
    }

    /// Reads a value of a flag or an environment variable. Lists are separated by commas.
    pub(super) fn from_text(kind: Kind, text: &str, folder: &Path, hooks: &Hooks) -> Result<Self, Refusal> {
        let text = text.trim();
        if text.is_empty() {
            return Err(Refusal::bad("nothing stands here").hint(format!("expected {}", kind.hint())));
        }
        let expected = |label: String| Refusal::bad(label).hint(format!("expected {}", kind.hint()));
        match kind {
            Kind::Text => Ok(Self::Text(text.to_owned())),
            Kind::Level => match text.find(['/', '+', '#', '\0']) {
                Some(_) => Err(expected("not possible in a level of a topic".to_owned())),
                None => Ok(Self::Text(text.to_owned())),
            },
            Kind::Word(words) if words.contains(&text) => Ok(Self::Text(text.to_owned())),
            Kind::Word(words) => Err(Refusal::bad("not one of the words allowed here")
                .hint(diagnostic::did_you_mean(text, words.iter().copied()))),
            Kind::Flag => text
                .parse()
                .map(Self::Flag)
                .map_err(|_| expected("neither true nor false".to_owned())),
            Kind::Duration => time::parse(text).map(Self::Duration).map_err(expected),
            Kind::Speed => speed(text.parse().map_err(|_| expected("not a number".to_owned()))?),
            Kind::File => Ok(Self::Path(folder.join(text))),
            Kind::Address => address(text).map_err(expected).map(Self::Text),
            Kind::Broker => broker(text),
            Kind::Template => template(text).map_err(expected).map(Self::Text),
            Kind::Version => text
                .parse::<tck_pack::Version>()
                .map(|_| Self::Text(text.to_owned()))
                .map_err(|_| expected("not a version".to_owned())),
            Kind::Action(Place::Anywhere | Place::Zone) => Ok(Self::Action(SampleAction::plain(text))),
            Kind::Action(_) => Err(expected("this has to be said in a profile".to_owned())),
            Kind::Command => {
                let words = shlex::split(text).ok_or_else(|| expected("a quote is left open".to_owned()))?;
                Self::from_list(kind, words, folder, hooks)
            }
            Kind::Files | Kind::Brokers | Kind::Claims | Kind::Names => {
                let items = text.split(',').map(|item| item.trim().to_owned()).collect();
                Self::from_list(kind, items, folder, hooks)
            }
        }
    }

    fn from_list(kind: Kind, items: Vec<String>, folder: &Path, hooks: &Hooks) -> Result<Self, Refusal> {
        if kind != Kind::Command {
            let empty = items.iter().enumerate().filter(|(_, item)| item.trim().is_empty());
            Refusal::all(
                empty
                    .map(|(at, _)| Refusal::bad("nothing stands here").at(at))
                    .collect(),
            )?;
        }
        match kind {
            Kind::Files => Ok(Self::Paths(items.iter().map(|item| folder.join(item)).collect())),
            Kind::Command => {
                if items.first().is_none_or(String::is_empty) {
                    return Err(Refusal::bad("no program is named").hint(format!("expected {}", kind.hint())));
                }
                let unknown = items.iter().enumerate().filter_map(|(at, item)| {
                    let refusal = unknown_placeholder(item, COMMON_PLACEHOLDERS).err()?;
                    Some(refusal.at(at))
                });
                Refusal::all(unknown.collect()).map(|()| Self::Texts(items))
            }
            Kind::Claims => {
                let mut claims: Vec<Claim> = Vec::with_capacity(items.len());
                let mut wrong = Vec::new();
                for (at, item) in items.iter().enumerate() {
                    let claim = match Claim::read(item, hooks) {
                        Ok(claim) => claim,
                        Err((label, hint)) => {
                            wrong.push(Refusal::bad(label).hint(hint).at(at));
                            continue;
                        }
                    };
                    if let Some(earlier) = claims.iter().find(|earlier| earlier.contradicts(&claim)) {
                        wrong.push(Refusal {
                            code: "contradiction",
                            ..Refusal::bad(format!("`{earlier}` above says otherwise")).at(at)
                        });
                    }
                    claims.push(claim);
                }
                Refusal::all(wrong).map(|()| Self::Claims(claims))
            }
            Kind::Brokers => {
                let checked = items.iter().enumerate();
                let wrong = checked.filter_map(|(at, item)| broker(item).err().map(|refusal| refusal.at(at)));
                Refusal::all(wrong.collect()).map(|()| Self::Texts(items))
            }
            _ => {
                let twice = |at: &usize| items[..*at].contains(&items[*at]);
                let repeated = (0..items.len()).filter(twice);
                let wrong = repeated.map(|at| Refusal::bad("named twice").at(at)).collect();
                Refusal::all(wrong).map(|()| Self::Texts(items))
            }
        }
    }

    /// The value as the report shows it.
    pub(super) fn shown(&self) -> String {
        match self {
            Self::Text(text) => Secrets::default().out_of(text),
            Self::Flag(flag) => flag.to_string(),
            Self::Duration(duration) => time::show(*duration),
            Self::Number(number) => number.to_string(),
            Self::Path(path) => path.display().to_string(),
            Self::Paths(paths) => paths
                .iter()
                .map(|path| path.display().to_string())
                .collect::<Vec<_>>()
                .join(", "),
            Self::Texts(texts) => {
                let shown = texts.iter().map(|text| Secrets::default().out_of(text));
                shown.collect::<Vec<_>>().join(", ")
            }
            Self::Action(action) => action.shown(),
            Self::Claims(claims) => claims.iter().map(ToString::to_string).collect::<Vec<_>>().join(", "),
        }
    }
}

fn action(table: &DeTable<'_>, place: Place) -> Result<Value, Refusal> {
    let expected = |label: String| Refusal::bad(label).hint(format!("expected {}", Kind::Action(place).hint()));
    let own = match place {
        Place::Anywhere | Place::Zone => None,
        Place::Shown => Some("shows"),
        Place::Node => Some("node"),
        Place::Edge => Some("edge"),
    };
    let mut texts = std::collections::BTreeMap::new();
    let mut parameters = serde_json::Map::new();
    for (name, value) in table {
        match (name.get_ref().as_ref(), value.get_ref()) {
            (key, DeValue::String(text)) if (key == "type" || Some(key) == own) && !text.trim().is_empty() => {
                texts.insert(key.to_owned(), text.clone().into_owned());
            }
            (key, _) if key == "type" || Some(key) == own => {
                return Err(expected(format!("`{key}` is a name")));
            }
            ("parameters", DeValue::Table(table)) => {
                for (key, value) in table {
                    let value = json(value.get_ref()).ok_or_else(|| {
                        expected(format!(
                            "parameter `{}` is {}",
                            key.get_ref(),
                            type_name(value.get_ref())
                        ))
                    })?;
                    parameters.insert(key.get_ref().clone().into_owned(), value);
                }
            }
            ("parameters", _) => return Err(expected("`parameters` is a table".to_owned())),
            (other, _) => {
                return Err(Refusal {
                    code: "unknown-key",
                    ..Refusal::bad(format!("an action has no `{other}`")).hint(diagnostic::did_you_mean(
                        other,
                        ["type", "parameters"].into_iter().chain(own),
                    ))
                });
            }
        }
    }
    if let Some(missing) = own.filter(|own| !texts.contains_key(*own)) {
        return Err(expected(format!("`{missing}` is missing")));
    }
    Ok(Value::Action(SampleAction {
        action_type: texts
            .remove("type")
            .ok_or_else(|| expected("`type` is missing".to_owned()))?,
        parameters,
        node: texts.remove("node"),
        edge: texts.remove("edge"),
        shows: texts.remove("shows"),
    }))
}

/// The JSON value of a parameter. A date has none.
fn json(value: &DeValue<'_>) -> Option<serde_json::Value> {
    Some(match value {
        DeValue::String(text) => text.as_ref().into(),
        DeValue::Boolean(flag) => (*flag).into(),
        DeValue::Integer(integer) => i64::from_str_radix(integer.as_str(), integer.radix()).ok()?.into(),
        DeValue::Float(_) => number(value)?.into(),
        DeValue::Array(items) => items
            .iter()
            .map(|item| json(item.get_ref()))
            .collect::<Option<Vec<_>>>()?
            .into(),
        DeValue::Table(table) => {
            let members = table
                .iter()
                .map(|(name, value)| Some((name.get_ref().to_string(), json(value.get_ref())?)));
            members.collect::<Option<serde_json::Map<_, _>>>()?.into()
        }
        DeValue::Datetime(_) => return None,
    })
}

/// Refuses `{name}` that stands for nothing.
pub(super) fn unknown_placeholder(text: &str, known: &[&str]) -> Result<(), Refusal> {
    match placeholders(text).into_iter().find(|(_, name)| !known.contains(name)) {
        Some((_, name)) => Err(Refusal {
            code: "unknown-placeholder",
            ..Refusal::bad(format!("`{{{name}}}` stands for nothing here"))
                .hint(diagnostic::did_you_mean(name, known.iter().copied()))
        }),
        None => Ok(()),
    }
}

fn speed(number: f64) -> Result<Value, Refusal> {
    if number > 0.0 && number.is_finite() {
        Ok(Value::Number(number))
    } else {
        Err(Refusal::bad("not a speed").hint(format!("expected {}", Kind::Speed.hint())))
    }
}

fn address(text: &str) -> Result<String, String> {
    let (host, port) = text.rsplit_once(':').ok_or("the port is missing")?;
    if host.is_empty() || host.contains('/') {
        return Err("the host is missing or not one".to_owned());
    }
    if host.contains(':') && !(host.starts_with('[') && host.ends_with(']')) {
        return Err("an IPv6 address stands in brackets".to_owned());
    }
    port.parse::<u16>()
        .map_err(|_| format!("`{port}` is not a port"))
        .map(|_| text.to_owned())
}

fn broker(text: &str) -> Result<Value, Refusal> {
    let expected = |label: &str| Refusal::bad(label).hint(format!("expected {}", Kind::Broker.hint()));
    let (scheme, rest) = text.split_once("://").unwrap_or_default();
    let is_web = matches!(scheme, "ws" | "wss");
    if !is_web && !matches!(scheme, "mqtt" | "mqtts") {
        return Err(expected("neither mqtt:// nor mqtts://, ws:// or wss://"));
    }
    if rest.contains('@') {
        return Err(Refusal {
            code: "credentials",
            ..Refusal::bad("credentials do not belong in an address")
                .hint("use `username`, and `password-env` or `password-file`")
        });
    }
    let place = match rest.find('/').filter(|_| is_web) {
        Some(path) => &rest[..path],
        None => rest.strip_suffix('/').unwrap_or(rest),
    };
    let has_port = place.rsplit_once(':').is_some_and(|(_, port)| !port.ends_with(']'));
    let with_port = if has_port {
        place.to_owned()
    } else {
        format!("{place}:1")
    };
    address(&with_port).map_err(|label| expected(&label))?;
    Ok(Value::Text(text.to_owned()))
}

fn template(text: &str) -> Result<String, String> {
    if text.contains(['+', '#', '\0']) {
        return Err("wildcards are not possible in a topic".to_owned());
    }
    if text.starts_with('/') || text.ends_with('/') || text.contains("//") {
        return Err("an empty level".to_owned());
    }
    let mut rest = text.to_owned();
    for name in TEMPLATE_PLACEHOLDERS {
        rest = rest.replace(&format!("{{{name}}}"), "");
    }
    if rest.contains(['{', '}']) {
        return Err("a placeholder that stands for nothing".to_owned());
    }
    Ok(text.to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(kind: Kind, text: &str) -> Result<Value, Refusal> {
        Value::from_text(kind, text, Path::new("/site"), &Hooks::default())
    }

    #[test]
    fn files_are_found_from_where_they_are_named() {
        assert_eq!(read(Kind::File, "a.json"), Ok(Value::Path("/site/a.json".into())));
        assert_eq!(read(Kind::File, "/b.json"), Ok(Value::Path("/b.json".into())));
    }

    #[test]
    fn a_command_is_split_as_a_shell_would_but_never_run_by_one() {
        assert_eq!(
            read(Kind::Command, "./agv --name 'my agv' {broker-port}; rm"),
            Ok(Value::Texts(
                ["./agv", "--name", "my agv", "{broker-port};", "rm"]
                    .map(String::from)
                    .into()
            ))
        );
        assert!(read(Kind::Command, "./agv 'open").is_err());
    }

    #[test]
    fn addresses_have_host_and_port() {
        for good in ["127.0.0.1:1883", "[::1]:0", "bench.local:65535"] {
            assert!(read(Kind::Address, good).is_ok(), "{good}");
        }
        for bad in ["1883", ":1883", "host:", "host:65536", "::1:1883", "mqtt://host:1"] {
            assert!(read(Kind::Address, bad).is_err(), "{bad}");
        }
    }

    #[test]
    fn a_broker_address_never_holds_credentials() {
        for good in [
            "mqtt://host",
            "mqtts://host:8883",
            "mqtt://[::1]:1883",
            "mqtt://[::1]",
            "mqtt://host:1/",
            "ws://host",
            "wss://host:8084/mqtt",
        ] {
            assert!(read(Kind::Broker, good).is_ok(), "{good}");
        }
        assert_eq!(
            read(Kind::Broker, "mqtt://me:secret@host").map_err(|r| r.code),
            Err("credentials")
        );
        assert!(read(Kind::Broker, "http://host:80").is_err() && read(Kind::Broker, "mqtt://").is_err());
        assert!(read(Kind::Broker, "mqtt://host/path").is_err() && read(Kind::Broker, "ws:///mqtt").is_err());
    }

    #[test]
    fn every_node_of_a_cluster_is_an_address() {
        let two = Value::Texts(vec!["mqtt://a:1883".into(), "mqtts://b".into()]);
        assert_eq!(read(Kind::Brokers, "mqtt://a:1883, mqtts://b"), Ok(two));
        assert_eq!(
            read(Kind::Brokers, "mqtt://a,b:1883").map_err(|r| r.element),
            Err(Some(1))
        );
    }

    #[test]
    fn lists_of_an_environment_variable_are_separated_by_commas() {
        assert_eq!(
            read(Kind::Names, "n1, n2"),
            Ok(Value::Texts(vec!["n1".into(), "n2".into()]))
        );
        assert_eq!(read(Kind::Names, "n1,,n2").map_err(|r| r.element), Err(Some(1)));
        assert_eq!(read(Kind::Names, "n1,n1").map_err(|r| r.element), Err(Some(1)));
    }
}
