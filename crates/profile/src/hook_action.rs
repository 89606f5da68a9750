//! What a profile says about a hook: how it is done. Doing it is left to the run.
//!
//! Values put into a hook may come from the device, so nothing here goes through a shell.

use std::collections::BTreeMap;
use std::time::Duration;

use percent_encoding::{NON_ALPHANUMERIC, utf8_percent_encode};
use serde_json::Value;

use super::placeholder::fill;
use super::secret::{PasswordError, SecretText};
use super::surroundings::Surroundings;
use tck_base::diagnostic::Span;
use tck_base::secrets::Password;
use tck_pack::HookInfo;

/// What a profile does when a test asks for a hook.
#[derive(Clone, Debug)]
pub struct Hook {
    /// Its name.
    pub name: String,
    /// What is known of it for the role of the device.
    pub info: HookInfo,
    /// How it is done.
    pub action: HookAction,
    /// How long it may take.
    pub timeout: Duration,
    /// Where it is written.
    pub span: Span,
}

/// How a hook is done.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum HookAction {
    /// A program and its arguments; no shell.
    Run(Vec<String>),
    /// An HTTP request; any 2xx answer is success.
    Http {
        /// Method in capitals.
        method: String,
        /// Address.
        url: String,
        /// Body, if there is one.
        body: Option<String>,
        /// Headers beside the usual ones.
        headers: Vec<(String, SecretText)>,
    },
    /// A text for a person.
    Prompt(String),
    /// The harness ends and starts again the device it has started itself (`device.command`).
    RestartDevice,
    /// The harness asks the device that it has started itself to end in good order.
    StopDevice,
    /// The harness starts it again.
    StartDevice,
    /// Nothing is done: the harness waits for the next order or instant action to come by itself.
    NaturalTraffic,
}

/// `builtin`: the harness ends and starts again the device it has started itself.
pub const RESTART_DEVICE: &str = "restart-command";

/// `builtin`: the harness asks the device it has started itself to end in good order, with SIGTERM.
pub const STOP_DEVICE: &str = "stop-command";

/// `builtin`: the harness starts that device again.
pub const START_DEVICE: &str = "start-command";

/// `builtin`: the harness waits for the next order or instant action to come by itself.
pub const NATURAL_TRAFFIC: &str = "natural-traffic";

impl HookAction {
    /// A program or request that needs nobody.
    #[must_use]
    pub fn is_unattended(&self) -> bool {
        !matches!(self, Self::Prompt(_))
    }

    /// How long it may take unless said.
    #[must_use]
    pub fn default_timeout(&self) -> Duration {
        let patient = !self.is_unattended() || *self == Self::NaturalTraffic;
        Duration::from_secs(if patient { 600 } else { 60 })
    }

    /// The action with values for its placeholders. A value stays one argument, one part of an address, one
    /// part of a JSON text, whatever stands in it.
    #[must_use]
    pub fn filled(&self, values: &BTreeMap<String, String>) -> Self {
        let verbatim = |value: &str| value.to_owned();
        match self {
            Self::Run(arguments) => Self::Run(arguments.iter().map(|text| fill(text, values, verbatim)).collect()),
            Self::Prompt(text) => Self::Prompt(fill(text, values, verbatim)),
            Self::RestartDevice | Self::StopDevice | Self::StartDevice | Self::NaturalTraffic => self.clone(),
            Self::Http {
                method,
                url,
                body,
                headers,
            } => Self::Http {
                method: method.clone(),
                headers: headers
                    .iter()
                    .map(|(name, value)| {
                        // A value of the device must not begin a header of its own.
                        let visible = |value: &str| value.replace(|c: char| c.is_control(), " ");
                        (name.clone(), value.with_texts(|text| fill(text, values, visible)))
                    })
                    .collect(),
                url: fill(url, values, |value| {
                    utf8_percent_encode(value, NON_ALPHANUMERIC).to_string()
                }),
                body: body.as_ref().map(|body| {
                    let json = body.trim_start().starts_with(['{', '[']);
                    fill(body, values, if json { inside_json } else { verbatim })
                }),
            },
        }
    }

    /// The action with the secrets of its headers.
    ///
    /// # Errors
    /// When one is not where it is said to be.
    pub fn resolved(&self, surroundings: &Surroundings) -> Result<Self, PasswordError> {
        let mut action = self.clone();
        if let Self::Http { headers, .. } = &mut action {
            for (_, value) in headers {
                *value = value.resolved(surroundings)?;
            }
        }
        Ok(action)
    }

    /// The secrets in it, once resolved.
    pub fn secrets(&self) -> Vec<Password> {
        match self {
            Self::Http { headers, .. } => headers.iter().flat_map(|(_, value)| value.secrets()).collect(),
            _ => Vec::new(),
        }
    }

    /// Every text that may hold placeholders.
    #[must_use]
    pub fn texts(&self) -> Vec<&str> {
        match self {
            Self::Run(arguments) => arguments.iter().map(String::as_str).collect(),
            Self::Prompt(text) => vec![text],
            Self::RestartDevice | Self::StopDevice | Self::StartDevice | Self::NaturalTraffic => Vec::new(),
            Self::Http { url, body, headers, .. } => {
                let texts = [Some(url), body.as_ref()].into_iter().flatten().map(String::as_str);
                let headers = headers.iter().flat_map(|(_, value)| value.texts());
                texts.chain(headers).collect()
            }
        }
    }
}

fn inside_json(value: &str) -> String {
    let quoted = Value::from(value).to_string();
    quoted.get(1..quoted.len() - 1).unwrap_or_default().to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn values(pairs: &[(&str, &str)]) -> BTreeMap<String, String> {
        pairs.iter().map(|(k, v)| ((*k).to_owned(), (*v).to_owned())).collect()
    }

    #[test]
    fn a_value_of_the_device_stays_one_argument() {
        let hook = HookAction::Run(vec!["./power".into(), "--serial={serial-number}".into()]);
        let filled = hook.filled(&values(&[("serial-number", "x; rm -rf $HOME {mode}")]));
        assert_eq!(
            filled,
            HookAction::Run(vec!["./power".into(), "--serial=x; rm -rf $HOME {mode}".into()])
        );
    }

    #[test]
    fn a_value_cannot_leave_its_place_in_an_address_or_in_json() {
        let hook = HookAction::Http {
            method: "POST".into(),
            url: "http://bench/mode/{mode}".into(),
            body: Some(r#"{"mode": "{mode}", "by": "${mode}"}"#.into()),
            headers: Vec::new(),
        };
        let HookAction::Http { url, body, .. } = hook.filled(&values(&[("mode", "a\"/?b")])) else {
            panic!("still a request");
        };
        assert_eq!(url, "http://bench/mode/a%22%2F%3Fb");
        assert_eq!(body.as_deref(), Some(r#"{"mode": "a\"/?b", "by": "${mode}"}"#));
    }
}
