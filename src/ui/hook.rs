//! Text of `explain` about a hook: what it is, how a profile has it done, and what comes of that.

use std::fmt::Write as _;

use tck_pack::{HookInfo, Hooks};
use tck_profile::HookExample;
use tck_report::statement::many;
use tck_run::hooks::REFUSALS;

/// Everything about a hook of these that somebody needs who writes its part of a profile, or its program.
#[must_use]
pub fn hook(hook: &HookInfo, hooks: &Hooks, tests: usize) -> String {
    let mut text = format!("hook {} (role {})\n\n{}\n", hook.name, hook.role, hook.doc);
    if !hook.parameters.is_empty() {
        text.push_str("\nparameters\n");
    }
    let width = hook.parameters.iter().map(|one| one.name.len()).max().unwrap_or(0);
    for parameter in &hook.parameters {
        let name = &parameter.name;
        let _ = write!(text, "  {name:<width$}  {}", parameter.about);
        let ids: Vec<&str> = parameter.values.iter().map(|value| value.id.as_str()).collect();
        let only = match ids.is_empty() {
            true => format!(", such as {}", parameter.example),
            false => format!(": {}", ids.join(", ")),
        };
        let _ = writeln!(text, "{only}");
        for value in &parameter.values {
            if let Some(meant) = &value.text {
                let _ = writeln!(text, "  {:<width$}    {}: {meant}", "", value.id);
            }
        }
    }
    text.push('\n');
    for effect in &hook.effects {
        let _ = writeln!(text, "effect      {}: {}", effect.word(), effect.doc());
    }
    let _ = writeln!(text, "risk        {}", hook.risk.word());
    if let Some(changes) = &hook.changes {
        let words: Vec<&str> = changes.iter().map(|change| change.word()).collect();
        let listed = if words.is_empty() {
            "nothing".to_owned()
        } else {
            words.join(", ")
        };
        let _ = writeln!(text, "changes     {listed} that nothing else in the state shows");
    }
    if let Some(other) = &hook.undoes {
        let _ = writeln!(text, "undoes      {other}");
    }
    if let Some(other) = hooks.opposite(hook) {
        let _ = writeln!(text, "undone by   {}", other.name);
    }
    if let Some(action) = &hook.for_action {
        let _ = writeln!(text, "for         vehicles that know the action {action}");
    }
    if hook.optional {
        let _ = writeln!(text, "absent      claims = [\"no hook {}\"] in [device]", hook.name);
    }
    let _ = writeln!(text, "used by     {}", many(tests, "test"));
    let example = HookExample::of(hook);
    let _ = write!(
        text,
        "\nIn the profile, one of these lines:\n\n[hooks.{}]\n{}\n{}\n{}\n\nThe request that comes of the last one:\n\n",
        hook.name, example.prompt, example.run, example.http
    );
    for line in example.request.lines() {
        let _ = writeln!(text, "    {line}");
    }
    let refusals = REFUSALS.map(|code| code.to_string()).join(", ");
    let _ = write!(
        text,
        "\nAnswers: 2xx is done; {refusals}: the device has understood and does not do it, which is right where a master\n\
         control must send nothing, and else leaves the test inconclusive; anything else, or nothing in time, is an error of the\n\
         bench. A program is done when it ends with 0.\n"
    );
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use tck_pack::Role;

    #[test]
    fn everything_about_a_hook_stands_on_one_page() {
        let library = crate::library(None).expect("the built-in suites");
        let hooks = &library.rules.hooks;
        for (name, role, lines) in [
            (
                "configure",
                Role::MasterControl,
                [
                    "  what     what it is to do otherwise than usual: trigger-timeout, corridors, corridors-with-release",
                    "             trigger-timeout: waitForTrigger is called off after 30 s",
                    "risk        by-hand",
                    "    {\"vehicle\": \"mock-1\", \"what\": \"trigger-timeout\"}",
                    "run = [\"./configure\", \"{vehicle}\", \"{what}\"]",
                ],
            ),
            (
                "unlock-charger",
                Role::Agv,
                [
                    "changes     charging that nothing else in the state shows",
                    "undoes      lock-charger",
                    "for         vehicles that know the action startCharging",
                    "absent      claims = [\"no hook unlock-charger\"] in [device]",
                    "http = { url = \"http://127.0.0.1:8080/hooks/unlock-charger\" }",
                ],
            ),
        ] {
            let text = hook(hooks.find(name, role).expect("a hook"), hooks, 1);
            for line in lines {
                assert!(text.lines().any(|known| known == line), "{line}\n{text}");
            }
        }
    }
}
