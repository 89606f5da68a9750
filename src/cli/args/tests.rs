//! What the command line has to hold.

use clap::CommandFactory as _;

use super::*;
use tck_base::shard::Shard;

fn parse(line: &str) -> Result<Command, clap::Error> {
    let words = shlex::split(line).expect("words");
    Cli::try_parse_from(std::iter::once("vda5050-tck".to_owned()).chain(words)).map(|cli| cli.command)
}

fn run(line: &str) -> Run {
    match parse(line) {
        Ok(Command::Run(run)) => run,
        other => panic!("{line}: {other:?}"),
    }
}

#[test]
fn the_command_line_is_consistent() {
    Cli::command().debug_assert();
}

#[test]
fn help_reads_well() {
    fn show(command: &mut clap::Command, name: &str) {
        let text = command.render_long_help().to_string();
        let version = env!("CARGO_PKG_VERSION").replace('.', "\\.");
        insta::with_settings!({ filters => vec![(version.as_str(), "[version]")] }, {
            insta::assert_snapshot!(format!("help{name}"), text);
        });
        for subcommand in command.get_subcommands_mut() {
            let name = format!("{name}-{}", subcommand.get_name());
            show(subcommand, &name);
        }
    }
    let mut command = Cli::command().term_width(100);
    command.build();
    show(&mut command, "");
}

#[test]
fn the_exit_codes_in_the_help_are_the_exit_codes() {
    for exit in crate::cli::exit::Exit::ALL {
        let word = exit.meaning().split(':').next().unwrap_or_default();
        assert!(AFTER_HELP.contains(&format!("{} {word}", exit.code())), "{exit:?}");
    }
}

#[test]
fn flags_become_settings_by_their_names_in_the_profile() {
    let run = run("run 'order/*' --serial 7 --broker mqtt://host --no-tap --allow-motion --shard 2/4 --seed 5");
    assert_eq!(run.tests, ["order/*"]);
    assert_eq!(run.shard, Some(Shard { index: 2, of: 4 }));
    let settings = run.device.settings();
    let expected = [
        ("device.serial-number", "7"),
        ("bench.broker", "mqtt://host"),
        ("bench.tap", "false"),
        ("motion.allowed", "true"),
    ];
    assert_eq!(settings, expected.map(|(name, text)| (name, text.to_owned())));
    for (name, _) in settings {
        assert!(tck_profile::Key::find(name).is_some(), "{name}");
    }
}

#[test]
fn without_flags_nothing_is_set() {
    assert!(run("run").device.settings().is_empty());
}

#[test]
fn what_makes_no_sense_is_refused() {
    for line in [
        "",
        "run --virtual --profile device.toml",
        "run --virtual --listen 127.0.0.1:1883",
        "run --fault x --profile device.toml",
        "run --allow-motion --no-motion",
        "run --shard 5/4",
        "run --shard 0/4",
        "run --shard 1/0",
        "run --shard 2",
        "certify",
        "certify --profile device.toml --protocol 9",
        "list",
        "list tests --role mc",
        "report",
        "report --compare one",
        "report one --compare one two",
        "report --merge one two",
        "report --merge one --out two --verify",
        "report one --verify --rejudge",
        "simulate agv --count 0",
        "validate",
    ] {
        assert!(parse(line).is_err(), "{line}");
    }
}

#[test]
fn variables_of_flags_are_known_to_the_settings() {
    fn variables(command: &clap::Command) -> Vec<String> {
        let own = command.get_arguments().filter_map(|argument| argument.get_env());
        let own = own.map(|name| name.to_string_lossy().into_owned());
        own.chain(command.get_subcommands().flat_map(variables)).collect()
    }
    let variables = variables(&Cli::command());
    assert!(variables.iter().any(|name| name == "VDA5050_TCK_PROFILE"));
    let surroundings = tck_profile::Surroundings {
        environment: variables.into_iter().map(|name| (name, "x".to_owned())).collect(),
        ..Default::default()
    };
    let hooks = tck_pack::Hooks::load(&crate::embedded()).expect("hooks");
    if let Err(wrong) = tck_profile::load(None, &[], &surroundings, &hooks) {
        panic!("{}", wrong[0]);
    }
}

/// The examples of a command and of those below it.
fn examples(command: &clap::Command) -> Vec<String> {
    let text = command.get_after_help().map(ToString::to_string).unwrap_or_default();
    let own = text.lines().filter_map(|line| {
        let line = line.trim_start();
        // What stands after two blanks, or where the output goes, is no part of the command.
        let (line, _) = line.split_once("  ").unwrap_or((line, ""));
        let (line, _) = line.split_once(" > ").unwrap_or((line, ""));
        let hash = format!("sha256:{}", "0".repeat(64));
        Some(
            line.strip_prefix("vda5050-tck ")?
                .trim_end()
                .replace("sha256:HASH", &hash),
        )
    });
    let own: Vec<String> = own.collect();
    own.into_iter()
        .chain(command.get_subcommands().flat_map(examples))
        .collect()
}

#[test]
fn every_example_in_a_help_is_a_command_and_names_tests_that_exist() {
    let all = examples(&Cli::command());
    assert!(all.len() > 30, "only {} examples were found", all.len());
    let library = crate::assets::library(None).unwrap_or_else(|all| panic!("{}", all[0]));
    let protocol = library.rules.packs.latest().id.clone();
    for line in all {
        let patterns = match parse(&line) {
            Ok(Command::Run(run)) => run.tests,
            Ok(Command::Qualify(qualify)) => qualify.tests,
            Ok(_) => Vec::new(),
            Err(error) => panic!("{line}: {error}"),
        };
        let tests = library.tests(tck_pack::Role::Agv, &protocol);
        let found = tck_run::select(&tests, &patterns);
        assert!(
            found.is_ok(),
            "{line}: {}",
            found.err().map_or(String::new(), |wrong| wrong.title)
        );
    }
}

/// The commands of a file in `deploy/`: lines that begin with the program, up to what a shell makes of them. What the shell puts in
/// stands as 1.
fn deployed(text: &str) -> Vec<String> {
    let lines = text.lines().map(|line| line.trim_start().trim_start_matches("- "));
    let own = lines.filter_map(|line| {
        let line = line.strip_prefix("vda5050-tck ")?;
        let (line, _) = line.split_once(" || ").unwrap_or((line, ""));
        Some(without_variables(line))
    });
    own.collect()
}

/// A line in which what a shell or a pipeline puts in is 1.
fn without_variables(line: &str) -> String {
    let mut text = String::new();
    let mut rest = line;
    while let Some((before, behind)) = rest.split_once('$') {
        text += before;
        text.push('1');
        rest = match behind.as_bytes().first() {
            Some(b'{') => behind
                .trim_start_matches('{')
                .split_once('}')
                .map_or("", |(_, rest)| rest.trim_start_matches('}')),
            Some(b'@') => &behind[1..],
            _ => behind.trim_start_matches(|c: char| c.is_ascii_alphanumeric() || c == '_'),
        };
    }
    text + rest
}

#[test]
fn every_command_in_an_example_for_a_scheduler_is_one() {
    let deploy = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("deploy");
    let mut files = Vec::new();
    for folder in [deploy.clone(), deploy.join("kubernetes")] {
        let entries = std::fs::read_dir(folder).expect("examples");
        files.extend(
            entries
                .map(|entry| entry.expect("entry").path())
                .filter(|path| path.is_file()),
        );
    }
    let mut count = 0;
    for path in files {
        let text = std::fs::read_to_string(&path).expect("text");
        for line in deployed(&text) {
            if let Err(error) = parse(&line) {
                panic!("{}: {line}: {error}", path.display());
            }
            count += 1;
        }
    }
    assert!(count >= 9, "only {count} commands were found");
    let line = "vda5050-tck run --shard ${{ matrix.part }}/4 --out \"a/$PART\" ${MORE:-} \"$@\" || code=$?";
    assert_eq!(deployed(line), ["run --shard 1/4 --out \"a/1\" 1 \"1\""]);
}

/// The files with commands that CI cannot run, since they need GitHub, GitLab or a device.
const PIPELINES: [&str; 5] = [
    ".github/workflows/ci.yml",
    ".github/workflows/release.yml",
    "action.yml",
    "templates/conformance.yml",
    "docs/ci.md",
];

/// Every command line of this program in a text. What is filled in later is `1`: a number, a name and a path.
fn commands_in(text: &str) -> Vec<String> {
    let call = regex::Regex::new(r#"(?:cargo run --locked --|"\$tool"|(?:\S*/)?vda5050-tck) +([a-z][^\n;&|>#`]*)"#);
    let later = regex::Regex::new(r"\$\[\[[^\]]*\]\]|\$\{\{[^}]*\}\}|\$\{?[A-Za-z_]+\}?").expect("a pattern");
    let joined = text.replace("\\\n", " ");
    let call = call.expect("a pattern");
    let lines = joined.lines().filter(|line| !line.trim_start().starts_with('#'));
    let calls = lines.flat_map(|line| {
        call.captures_iter(line)
            .map(|found| found[1].to_owned())
            .collect::<Vec<_>>()
    });
    calls
        .map(|call| later.replace_all(&call, "1").trim_end().to_owned())
        .collect()
}

#[test]
fn every_command_of_a_pipeline_exists_with_its_flags() {
    let mut count = 0;
    for path in PIPELINES {
        let text = std::fs::read_to_string(std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join(path)).expect(path);
        let commands = commands_in(&text);
        assert!(!commands.is_empty(), "{path}");
        for command in commands {
            // The name of a shell stands for what is filled in.
            let command = command.replace("completions \"1\"", "completions bash");
            parse(&command).unwrap_or_else(|error| panic!("{path}: {command}: {error}"));
            count += 1;
        }
    }
    assert!(count > 15, "{count} commands");
    assert_eq!(
        commands_in("x: |\n  ./t/vda5050-tck run --profile \"$P\" \\\n  --seed $[[ inputs.seed ]] | cat\n"),
        ["run --profile \"1\"    --seed 1"]
    );
    assert!(parse("run --profile x --no-such-flag").is_err());
}
