//! Claims: what a profile says a device can do, beside its factsheet or against it.

use std::str::FromStr;

use super::key::{SAMPLE_ACTIONS, STATEMENTS};
use tck_base::diagnostic;
use tck_pack::{Hooks, Role};

/// One claim of `device.claims`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Claim {
    /// `action NAME` or `action NAME SCOPE`: it offers the action.
    Action {
        /// actionType.
        name: String,
        /// `INSTANT`, `NODE` or `EDGE`; all of them when absent.
        scope: Option<String>,
    },
    /// `no action NAME` or `no action NAME SCOPE`: it does not offer the action, or not there.
    NoAction {
        /// actionType.
        name: String,
        /// `INSTANT`, `NODE` or `EDGE`; all of them when absent.
        scope: Option<String>,
    },
    /// `optional PATH`: it reads this optional parameter.
    Optional(String),
    /// `no optional PATH`: it does not read it.
    NoOptional(String),
    /// `limit NAME = NUMBER`: a protocol limit.
    Limit {
        /// Such as `maxArrayLens.order.nodes`.
        name: String,
        /// The limit.
        value: u64,
    },
    /// A name of [`STATEMENTS`].
    Statement(String),
    /// `no` and a name of [`STATEMENTS`] or [`SAMPLE_ACTIONS`].
    NoStatement(String),
    /// `no hook NAME`: it has nothing that the hook could be about, such as a lift or a latch.
    NoHook(String),
}

const SCOPES: [&str; 4] = ["INSTANT", "NODE", "EDGE", "ZONE"];

impl FromStr for Claim {
    /// What is wrong, and what to do about it.
    type Err = (String, String);

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let words: Vec<&str> = text.split_whitespace().collect();
        match words.as_slice() {
            ["action", name] => Ok(Self::Action {
                name: (*name).to_owned(),
                scope: None,
            }),
            ["action", name, scope] if SCOPES.contains(scope) => Ok(Self::Action {
                name: (*name).to_owned(),
                scope: Some((*scope).to_owned()),
            }),
            ["no", "action", name] => Ok(Self::NoAction {
                name: (*name).to_owned(),
                scope: None,
            }),
            ["no", "action", name, scope] if SCOPES.contains(scope) => Ok(Self::NoAction {
                name: (*name).to_owned(),
                scope: Some((*scope).to_owned()),
            }),
            ["action", _, scope] | ["no", "action", _, scope] => Err((
                format!("`{scope}` is not a scope of actions"),
                diagnostic::did_you_mean(scope, SCOPES),
            )),
            ["no", "hook", name] => Ok(Self::NoHook((*name).to_owned())),
            ["optional", path] => Ok(Self::Optional((*path).to_owned())),
            ["no", "optional", path] => Ok(Self::NoOptional((*path).to_owned())),
            ["limit", name, "=", value] => match value.parse() {
                Ok(value) => Ok(Self::Limit {
                    name: (*name).to_owned(),
                    value,
                }),
                Err(_) => Err((
                    format!("`{value}` is not a whole number"),
                    "such as `limit NAME = 10`".to_owned(),
                )),
            },
            ["no", name] => {
                let actions = SAMPLE_ACTIONS.iter().map(|action| action.name);
                statement(name, statements().chain(actions)).map(Self::NoStatement)
            }
            [name] => statement(name, statements()).map(Self::Statement),
            _ => Err((
                format!("`{text}` is not a claim"),
                "a claim is `action NAME`, `action NAME NODE`, `no action NAME`, `no action NAME EDGE`, `optional PATH`, `no optional PATH`, \
                 `limit NAME = 10`, `no hook NAME`, or the name of a statement"
                    .to_owned(),
            )),
        }
    }
}

fn statements() -> impl Iterator<Item = &'static str> + Clone {
    STATEMENTS.iter().map(|statement| statement.name)
}

fn statement(name: &str, names: impl Iterator<Item = &'static str> + Clone) -> Result<String, (String, String)> {
    if names.clone().any(|known| known == name) {
        return Ok(name.to_owned());
    }
    let hint = if SAMPLE_ACTIONS.iter().any(|action| action.name == name) {
        format!("say which action it is: `{name} = {{ type = … }}`")
    } else {
        diagnostic::did_you_mean(name, names)
    };
    Err((format!("there is no statement `{name}`"), hint))
}

impl Claim {
    /// Reads a claim that names only hooks a vehicle may do without.
    ///
    /// # Errors
    /// What is wrong, and what to do about it.
    pub fn read(text: &str, hooks: &Hooks) -> Result<Self, (String, String)> {
        let claim = text.parse::<Self>()?;
        let Self::NoHook(name) = &claim else {
            return Ok(claim);
        };
        let optional = hooks.of(Role::Agv).filter(|hook| hook.optional);
        let names: Vec<&str> = optional.map(|hook| hook.name.as_str()).collect();
        if names.contains(&name.as_str()) {
            return Ok(claim);
        }
        let only = format!("only these may be missing at a device: {}", names.join(", "));
        Err(
            match (
                hooks.named(name).next(),
                diagnostic::closest(name, names.iter().copied()),
            ) {
                (Some(_), _) => (format!("a device cannot do without `{name}`"), only),
                (None, Some(close)) => (
                    format!("there is no hook `{name}`"),
                    format!("did you mean `{close}`? {only}"),
                ),
                (None, None) => (format!("there is no hook `{name}`"), only),
            },
        )
    }

    /// Whether both cannot be true.
    #[must_use]
    pub fn contradicts(&self, other: &Self) -> bool {
        use Claim::{Action, Limit, NoAction, NoOptional, NoStatement, Optional, Statement};
        match (self, other) {
            (
                Action { name, scope },
                NoAction {
                    name: no,
                    scope: where_no,
                },
            )
            | (
                NoAction {
                    name: no,
                    scope: where_no,
                },
                Action { name, scope },
            ) => {
                // What is said about one scope comes before what is said about all.
                name == no && (where_no.is_none() || scope == where_no)
            }
            (Optional(yes), NoOptional(no))
            | (NoOptional(no), Optional(yes))
            | (Statement(yes), NoStatement(no))
            | (NoStatement(no), Statement(yes)) => yes == no,
            (
                Limit { name, value },
                Limit {
                    name: other,
                    value: second,
                },
            ) => name == other && value != second,
            _ => false,
        }
    }
}

impl std::fmt::Display for Claim {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Action { name, scope: None } => write!(f, "action {name}"),
            Self::Action {
                name,
                scope: Some(scope),
            } => write!(f, "action {name} {scope}"),
            Self::NoAction { name, scope: None } => write!(f, "no action {name}"),
            Self::NoAction {
                name,
                scope: Some(scope),
            } => write!(f, "no action {name} {scope}"),
            Self::Optional(path) => write!(f, "optional {path}"),
            Self::NoOptional(path) => write!(f, "no optional {path}"),
            Self::Limit { name, value } => write!(f, "limit {name} = {value}"),
            Self::Statement(name) => f.write_str(name),
            Self::NoStatement(name) => write!(f, "no {name}"),
            Self::NoHook(name) => write!(f, "no hook {name}"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_claim_reads_back_as_it_was_written() {
        for text in [
            "action pick",
            "action pick NODE",
            "no action drop",
            "no action pick EDGE",
            "optional order.edges.trajectory",
            "no optional order.edges.corridor",
            "limit maxArrayLens.order.nodes = 10",
            "line-guided",
            "no line-guided",
            "no uninterruptible-action",
            "no hook use-lift",
        ] {
            assert_eq!(text.parse::<Claim>().expect("a claim").to_string(), text);
        }
    }

    #[test]
    fn a_claim_that_is_none_is_refused_with_a_hint() {
        for text in [
            "",
            "action",
            "action pick NODES",
            "line-guidet",
            "long-action",
            "limit x = y",
            "limit x 10",
            "a b c",
        ] {
            let (_, hint) = text.parse::<Claim>().expect_err(text);
            assert!(!hint.is_empty());
        }
    }

    #[test]
    fn yes_and_no_about_the_same_thing_contradict() {
        let claim = |text: &str| text.parse::<Claim>().expect("a claim");
        assert!(claim("action pick NODE").contradicts(&claim("no action pick")));
        assert!(claim("no line-guided").contradicts(&claim("line-guided")));
        assert!(!claim("action pick").contradicts(&claim("no action drop")));
    }
}
