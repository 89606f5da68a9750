//! `[hooks.NAME]`.

use toml::Spanned;
use toml::de::DeValue;

use super::{Entry, Reader};
use crate::hook_action::{Hook, HookAction, NATURAL_TRAFFIC, RESTART_DEVICE, START_DEVICE, STOP_DEVICE};
use crate::key::{COMMON_PLACEHOLDERS, Kind};
use crate::secret::SecretText;
use crate::value::{self, Value};
use tck_base::diagnostic;

impl Reader<'_> {
    pub(super) fn hook(&mut self, (name, value): Entry<'_, '_>) {
        let id = name.get_ref().as_ref();
        let hooks = self.hooks;
        let Some(info) = hooks.named(id).next() else {
            let hint = match diagnostic::closest(id, hooks.all().map(|hook| hook.name.as_str())) {
                Some(close) => format!("did you mean `{close}`?"),
                None => {
                    "`vda5050-tck list hooks` shows all; one of suites of your own is known with `--suites`".to_owned()
                }
            };
            self.complain(
                "unknown-key",
                name.span(),
                &format!("there is no hook `{id}`"),
                "not known",
                Some(hint),
            );
            return;
        };
        let what = format!("hook `{id}`");
        let Some(members) = self.members(
            &what,
            value,
            &["run", "http", "prompt", "builtin", "listen", "timeout"],
            &[],
        ) else {
            return;
        };
        let ways: Vec<&str> = members.keys().copied().filter(|way| *way != "timeout").collect();
        let [way] = ways.as_slice() else {
            let title = format!(
                "{what} has {}",
                if ways.is_empty() {
                    "no way to be done"
                } else {
                    "more than one way to be done"
                }
            );
            let hint = "give exactly one of `run`, `http`, `prompt`, `builtin` and `listen`".to_owned();
            self.complain("contradiction", name.span(), &title, &ways.join(" and "), Some(hint));
            return;
        };
        let Some(way_value) = members.get(way) else { return };
        let Some(action) = self.action(id, way, way_value) else {
            return;
        };
        let mut timeout = action.default_timeout();
        if *way == "listen" {
            if members.contains_key("timeout") {
                let title = format!("{what} says twice how long it may take");
                let hint = "`listen` is the time itself: leave `timeout` out".to_owned();
                return self.complain(
                    "contradiction",
                    name.span(),
                    &title,
                    "`listen` and `timeout`",
                    Some(hint),
                );
            }
            match Value::from_toml(Kind::Duration, way_value.get_ref(), self.folder, hooks) {
                Ok(Value::Duration(duration)) => timeout = duration,
                Ok(_) => {}
                Err(refusal) => return self.refuse(&format!("`listen` of {what}"), way_value, refusal),
            }
        }
        if let Some(written) = members.get("timeout") {
            match Value::from_toml(Kind::Duration, written.get_ref(), self.folder, hooks) {
                Ok(Value::Duration(duration)) => timeout = duration,
                Ok(_) => {}
                Err(refusal) => return self.refuse(&format!("the timeout of {what}"), written, refusal),
            }
        }
        let hook = Hook {
            name: id.to_owned(),
            info: info.clone(),
            action,
            timeout,
            span: self.span(name.span()),
        };
        self.layer.hooks.insert(id.to_owned(), (hook, self.origin.clone()));
    }

    fn action(&mut self, hook: &str, way: &str, value: &Spanned<DeValue<'_>>) -> Option<HookAction> {
        let what = format!("`{way}` of hook `{hook}`");
        let action = match way {
            "run" => HookAction::Run(self.command(&what, value)?),
            "prompt" => HookAction::Prompt(self.text(&what, value)?),
            "builtin" => self.builtin(&what, value)?,
            "listen" => HookAction::NaturalTraffic,
            _ => self.http(&what, value)?,
        };
        if let HookAction::Prompt(text) = &action
            && !text.contains(char::is_alphanumeric)
        {
            let hint = Some("write what the person is to do, in a sentence".to_owned());
            self.complain("bad-value", value.span(), &format!("{what} says nothing"), text, hint);
            return None;
        }
        let hooks = self.hooks;
        let parameters = hooks.named(hook).flat_map(|info| &info.parameters);
        let mut known: Vec<&str> = parameters
            .map(|parameter| parameter.name.as_str())
            .chain(COMMON_PLACEHOLDERS.iter().copied())
            .collect();
        known.dedup();
        for text in action.texts() {
            if let Err(refusal) = value::unknown_placeholder(text, &known) {
                self.refuse(&what, value, refusal);
                return None;
            }
        }
        Some(action)
    }

    fn builtin(&mut self, what: &str, value: &Spanned<DeValue<'_>>) -> Option<HookAction> {
        let name = self.text(what, value)?;
        let known = [
            (RESTART_DEVICE, HookAction::RestartDevice),
            (STOP_DEVICE, HookAction::StopDevice),
            (START_DEVICE, HookAction::StartDevice),
            (NATURAL_TRAFFIC, HookAction::NaturalTraffic),
        ];
        if let Some((_, action)) = known.iter().find(|(word, _)| *word == name) {
            return Some(action.clone());
        }
        let hint = Some(diagnostic::did_you_mean(&name, known.iter().map(|(word, _)| *word)));
        self.complain("bad-value", value.span(), &format!("{what} is not known"), &name, hint);
        None
    }

    fn command(&mut self, what: &str, value: &Spanned<DeValue<'_>>) -> Option<Vec<String>> {
        let words = match value.get_ref() {
            DeValue::String(line) => shlex::split(line).unwrap_or_default(),
            DeValue::Array(items) => items.iter().map(|item| self.text(what, item)).collect::<Option<_>>()?,
            other => {
                let label = format!("this is {}", value::type_name(other));
                let title = format!("{what} is a program and its arguments");
                self.complain("wrong-type", value.span(), &title, &label, Some(Kind::Command.hint()));
                return None;
            }
        };
        if words.is_empty() {
            self.complain(
                "bad-value",
                value.span(),
                &format!("{what} names no program"),
                "no program",
                None,
            );
            return None;
        }
        Some(words)
    }

    fn http(&mut self, what: &str, value: &Spanned<DeValue<'_>>) -> Option<HookAction> {
        const METHODS: [&str; 5] = ["GET", "POST", "PUT", "PATCH", "DELETE"];
        let members = self.members(what, value, &["method", "url", "body", "headers"], &["url"])?;
        let url_value = members.get("url")?;
        let url = self.text(&format!("the url in {what}"), url_value)?;
        if !url.starts_with("http://") && !url.starts_with("https://") {
            let hint = "such as \"http://192.168.1.30/mode\"".to_owned();
            self.complain(
                "bad-value",
                url_value.span(),
                &format!("{what} has no web address"),
                "neither http:// nor https://",
                Some(hint),
            );
            return None;
        }
        let body = match members.get("body") {
            Some(body) => Some(self.text(&format!("the body in {what}"), body)?),
            None => None,
        };
        let method = match members.get("method") {
            Some(method) => {
                let text = self.text(&format!("the method in {what}"), method)?;
                if !METHODS.contains(&text.as_str()) {
                    let hint = diagnostic::did_you_mean(&text, METHODS);
                    self.complain(
                        "bad-value",
                        method.span(),
                        &format!("{what} has no method `{text}`"),
                        "not a method",
                        Some(hint),
                    );
                    return None;
                }
                text
            }
            None => "POST".to_owned(),
        };
        let headers = match members.get("headers") {
            Some(headers) => self.headers(what, headers)?,
            None => Vec::new(),
        };
        Some(HookAction::Http {
            method,
            url,
            body,
            headers,
        })
    }

    fn headers(&mut self, what: &str, value: &Spanned<DeValue<'_>>) -> Option<Vec<(String, SecretText)>> {
        let DeValue::Table(table) = value.get_ref() else {
            let label = format!("this is {}", value::type_name(value.get_ref()));
            let title = format!("the headers in {what} are a table");
            let hint = "such as headers = { Authorization = \"Bearer ${env:TOKEN}\" }".to_owned();
            self.complain("wrong-type", value.span(), &title, &label, Some(hint));
            return None;
        };
        let mut headers = Vec::new();
        for (name, value) in table {
            let id = name.get_ref().as_ref();
            let is_name = |c: char| c.is_ascii_alphanumeric() || "!#$%&'*+-.^_`|~".contains(c);
            if id.is_empty() || !id.chars().all(is_name) {
                let title = format!("`{id}` is no name of a header in {what}");
                self.complain("bad-value", name.span(), &title, "not a name", None);
                return None;
            }
            let text = self.text(&format!("the header `{id}` in {what}"), value)?;
            match SecretText::read(&text, self.folder) {
                Ok(read) if !text.contains(|c: char| c.is_control()) => headers.push((id.to_owned(), read)),
                Ok(_) => {
                    let title = format!("the header `{id}` in {what} has a line break or another control character");
                    self.complain("bad-value", value.span(), &title, "here", None);
                    return None;
                }
                Err(why) => {
                    let title = format!("the header `{id}` in {what} cannot be read");
                    let hint = "a value of the site is taken from ${env:NAME} or ${file:PATH}".to_owned();
                    self.complain("bad-value", value.span(), &title, &why, Some(hint));
                    return None;
                }
            }
        }
        Some(headers)
    }
}
