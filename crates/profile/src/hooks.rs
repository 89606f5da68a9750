//! What a profile can say of a hook, to copy, and the request that comes of it.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use super::hook_action::HookAction;
use tck_pack::HookInfo;

/// Where `vda5050-tck simulate --hooks` takes requests in the examples.
const HOST: &str = "127.0.0.1:8080";

/// Three ways in which a profile can have a hook done, as lines of TOML below `[hooks.NAME]`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct HookExample {
    /// A question to a person.
    pub prompt: String,
    /// A program and its arguments.
    pub run: String,
    /// An HTTP request.
    pub http: String,
    /// That request with a value for each parameter, as it reaches the server.
    pub request: String,
}

impl HookExample {
    /// The examples of a hook.
    #[must_use]
    pub fn of(hook: &HookInfo) -> Self {
        let names: Vec<&str> = hook
            .parameters
            .iter()
            .map(|parameter| parameter.name.as_str())
            .collect();
        let listed: Vec<String> = names.iter().map(|name| format!("{name}: {{{name}}}")).collect();
        let text = match listed.is_empty() {
            true => hook.doc.clone(),
            false => format!("{} {}", hook.doc, listed.join(", ")),
        };
        let words = std::iter::once(format!("./{}", hook.name)).chain(names.iter().map(|name| format!("{{{name}}}")));
        let words: Vec<toml::Value> = words.map(toml::Value::String).collect();
        let url = format!("http://{HOST}/hooks/{}", hook.name);
        let members: Vec<String> = names.iter().map(|name| format!("\"{name}\": \"{{{name}}}\"")).collect();
        let body = (!names.is_empty()).then(|| format!("{{{}}}", members.join(", ")));
        // A literal text of TOML: nothing in it is escaped, and no name has an apostrophe.
        let with_body = body
            .as_ref()
            .map_or_else(String::new, |body| format!(", body = '{body}'"));
        Self {
            prompt: format!("prompt = {}", toml::Value::String(text)),
            run: format!("run = {}", toml::Value::Array(words)),
            http: format!("http = {{ url = \"{url}\"{with_body} }}"),
            request: request(hook, url, body),
        }
    }
}

fn request(hook: &HookInfo, url: String, body: Option<String>) -> String {
    let values = hook.parameters.iter();
    let values: BTreeMap<String, String> = values
        .map(|parameter| (parameter.name.clone(), parameter.example.clone()))
        .collect();
    let action = HookAction::Http {
        method: "POST".to_owned(),
        url,
        body,
        headers: Vec::new(),
    };
    let HookAction::Http { method, body, .. } = action.filled(&values) else {
        return String::new();
    };
    let mut text = format!("{method} /hooks/{} HTTP/1.1\nHost: {HOST}\n", hook.name);
    if let Some(body) = body {
        let _ = write!(text, "Content-Type: application/json\n\n{body}\n");
    }
    text
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::super::check;
    use super::*;
    use tck_base::diagnostic::Source;
    use tck_pack::{Assets, Hooks};

    #[test]
    fn every_example_of_every_hook_can_stand_in_a_profile() {
        let hooks = Hooks::load(&Assets::of_source_tree().unwrap()).unwrap();
        for hook in hooks.all() {
            let example = HookExample::of(hook);
            for way in [&example.prompt, &example.run, &example.http] {
                let role = hook.role;
                let text = format!("[device]\nrole = \"{role}\"\n[hooks.{}]\n{way}\n", hook.name);
                let read = check(&Source::new("device.toml", text.clone()), Path::new(""), &hooks);
                let profile = read.unwrap_or_else(|wrong| panic!("{}\n{text}", wrong[0])).profile;
                assert_eq!(profile.hooks[&hook.name].info.role, role);
            }
            let body = example.request.split_once("\n\n").map(|(_, body)| body);
            let object: Option<serde_json::Value> = body.map(|body| serde_json::from_str(body).expect("JSON"));
            let sent = object.map_or(0, |object| object.as_object().expect("an object").len());
            assert_eq!(sent, hook.parameters.len(), "{}", hook.name);
        }
    }
}
