//! The file of a campaign: devices, suites, and how many run at the same time.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use toml::Spanned;
use toml::de::{DeTable, DeValue};

use tck_base::diagnostic::{Diagnostic, Source, Span, did_you_mean};

/// How many entries can run at the same time at most.
const MOST: i64 = 64;
/// Flags that belong to the campaign, or make a call that tests nothing.
const OURS: [&str; 8] = [
    "--out",
    "--resume",
    "--events",
    "--plan",
    "--profile",
    "--open",
    "--questions",
    "--format",
];

/// What a campaign does.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Plan {
    /// Where it is written, and what it is called in messages.
    pub source: Arc<Source>,
    /// How many entries run at the same time.
    pub parallel: usize,
    /// The folder of its results, as the file names it.
    pub out: Option<PathBuf>,
    /// Each device with each suite, in the order of the file.
    pub entries: Vec<Entry>,
}

/// The command that tests.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Command {
    /// `run`.
    Run,
    /// `certify`.
    Certify,
}

impl Command {
    /// Its name on the command line.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Run => "run",
            Self::Certify => "certify",
        }
    }
}

/// One device with one suite: a run of its own.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Entry {
    /// Name of the device, or of its version.
    pub device: String,
    /// Name of the suite.
    pub suite: String,
    /// What tests.
    pub command: Command,
    /// The profile of the device.
    pub profile: Option<PathBuf>,
    /// Where the device connects, where the profile does not say it.
    pub listen: Option<String>,
    /// Further arguments for the device.
    pub of_device: Vec<String>,
    /// Tests and arguments of the suite.
    pub of_suite: Vec<String>,
    /// Where the suite is named in the file, for what its call is refused for.
    pub span: Span,
}

impl Entry {
    /// The command line without what is about results.
    #[must_use]
    pub fn words(&self) -> Vec<String> {
        [self.device_words(), self.of_suite.clone()].concat()
    }

    /// The part of the command line that is about the device; a run that is gone on with has its tests in its journal.
    #[must_use]
    pub fn device_words(&self) -> Vec<String> {
        let mut words = vec![self.command.word().to_owned()];
        if let Some(profile) = &self.profile {
            words.extend(["--profile".to_owned(), profile.display().to_string()]);
        }
        if let (Some(listen), Command::Run) = (&self.listen, self.command) {
            words.extend(["--listen".to_owned(), listen.clone()]);
        }
        words.extend(self.of_device.iter().cloned());
        words
    }

    /// How it is called: device and suite.
    #[must_use]
    pub fn name(&self) -> String {
        format!("{}/{}", self.device, self.suite)
    }
}

/// A device as the file has it.
struct Device {
    name: String,
    at: Range<usize>,
    profile: Option<PathBuf>,
    listen: Option<(String, Range<usize>)>,
    arguments: Vec<String>,
}

/// A suite as the file has it.
struct Suite {
    name: String,
    at: Range<usize>,
    command: Command,
    words: Vec<String>,
    devices: Option<Vec<String>>,
}

impl Plan {
    /// Reads the file. Profiles are found from `folder`, in which the file lies.
    ///
    /// # Errors
    /// Every mistake in it, in the order of the file.
    pub fn read(source: &Arc<Source>, folder: &Path) -> Result<Self, Vec<Diagnostic>> {
        let document = DeTable::parse(&source.text).map_err(|error| {
            let at = error.span().unwrap_or(0..0);
            let span = Span::new(source, at.start, at.end);
            vec![Diagnostic::new("syntax", span, "this is not TOML", error.message())]
        })?;
        let mut reader = Reader {
            source,
            folder,
            parallel: 1,
            out: None,
            devices: Vec::new(),
            suites: Vec::new(),
            wrong: Vec::new(),
        };
        reader.document(document.get_ref());
        reader.end()
    }
}

struct Reader<'s> {
    source: &'s Arc<Source>,
    folder: &'s Path,
    parallel: usize,
    out: Option<PathBuf>,
    devices: Vec<Device>,
    suites: Vec<Suite>,
    wrong: Vec<Diagnostic>,
}

type Named<'a, 'i> = (&'a Spanned<Cow<'i, str>>, &'a Spanned<DeValue<'i>>);

impl Reader<'_> {
    fn complain(&mut self, at: Range<usize>, title: String, label: &str, hint: &str) {
        let span = Span::new(self.source, at.start, at.end);
        self.wrong
            .push(Diagnostic::new("campaign", span, title, label).hint(hint));
    }

    fn unknown(&mut self, name: &Spanned<Cow<'_, str>>, place: &str, known: &[&str]) {
        let hint = did_you_mean(name.get_ref(), known.iter().copied());
        self.complain(
            name.span(),
            format!("there is no `{}` in {place}", name.get_ref()),
            "not known",
            &hint,
        );
    }

    fn table<'a, 'i>(&mut self, what: &str, value: &'a Spanned<DeValue<'i>>) -> Option<&'a DeTable<'i>> {
        if let DeValue::Table(table) = value.get_ref() {
            return Some(table);
        }
        self.complain(
            value.span(),
            format!("{what} is a table"),
            "this is none",
            "write it as `[name]` with keys below",
        );
        None
    }

    fn text(&mut self, what: &str, value: &Spanned<DeValue<'_>>) -> Option<String> {
        match value.get_ref() {
            DeValue::String(text) if !text.is_empty() => Some(text.clone().into_owned()),
            _ => {
                self.complain(
                    value.span(),
                    format!("{what} is a text"),
                    "this is none",
                    "write it in quotes",
                );
                None
            }
        }
    }

    fn texts(&mut self, what: &str, value: &Spanned<DeValue<'_>>) -> Option<Vec<String>> {
        let DeValue::Array(items) = value.get_ref() else {
            let hint = "write it as `[\"one\", \"other\"]`";
            self.complain(value.span(), format!("{what} is a list of texts"), "this is none", hint);
            return None;
        };
        Some(items.iter().filter_map(|item| self.text(what, item)).collect())
    }

    /// Arguments that leave to the campaign what is its own.
    fn arguments(&mut self, what: &str, value: &Spanned<DeValue<'_>>) -> Vec<String> {
        let words = self.texts(what, value).unwrap_or_default();
        let ours = |word: &String| {
            OURS.iter()
                .find(|flag| word == *flag || word.starts_with(&format!("{flag}=")))
                .copied()
        };
        if let Some(flag) = words.iter().find_map(ours) {
            let hint = match flag {
                "--profile" => "write `profile = \"device.toml\"` below the device",
                "--out" => "write `out = \"folder\"` below `[campaign]`",
                _ => "leave it out",
            };
            self.complain(
                value.span(),
                format!("`{flag}` is said by the campaign itself"),
                "not here",
                hint,
            );
        }
        words
    }

    fn document(&mut self, document: &DeTable<'_>) {
        for (name, value) in document {
            match &**name.get_ref() {
                "campaign" => self.campaign(value),
                "devices" => {
                    for one in self.in_order("`[devices]`", value) {
                        self.device(one);
                    }
                }
                "suites" => {
                    for one in self.in_order("`[suites]`", value) {
                        self.suite(one);
                    }
                }
                _ => self.unknown(name, "a campaign", &["campaign", "devices", "suites"]),
            }
        }
    }

    /// The members of a table in the order of the file.
    fn in_order<'a, 'i>(&mut self, what: &str, value: &'a Spanned<DeValue<'i>>) -> Vec<Named<'a, 'i>> {
        let table = self.table(what, value);
        let mut all: Vec<Named<'a, 'i>> = table.into_iter().flat_map(DeTable::iter).collect();
        all.sort_by_key(|(name, _)| name.span().start);
        all
    }

    fn campaign(&mut self, value: &Spanned<DeValue<'_>>) {
        for (name, value) in self.in_order("`[campaign]`", value) {
            match &**name.get_ref() {
                "out" => self.out = self.text("`out`", value).map(|out| self.folder.join(out)),
                "parallel" => {
                    let number = match value.get_ref() {
                        DeValue::Integer(number) => i64::from_str_radix(number.as_str(), number.radix()).ok(),
                        _ => None,
                    };
                    match number
                        .filter(|number| (1..=MOST).contains(number))
                        .and_then(|one| usize::try_from(one).ok())
                    {
                        Some(number) => self.parallel = number,
                        None => {
                            let title = format!("`parallel` is a number from 1 to {MOST}");
                            self.complain(
                                value.span(),
                                title,
                                "this is none",
                                "how many entries run at the same time",
                            );
                        }
                    }
                }
                _ => self.unknown(name, "`[campaign]`", &["out", "parallel"]),
            }
        }
    }

    /// A name that is a folder, too.
    fn is_name(&mut self, name: &Spanned<Cow<'_, str>>) -> bool {
        let text = name.get_ref();
        let is_plain = |c: char| c.is_ascii_alphanumeric() || "-_.".contains(c);
        let is_good = !text.is_empty() && text.len() <= 80 && text.chars().all(is_plain) && !text.starts_with('.');
        if !is_good {
            let hint = "letters, digits, `-`, `_` and `.`, at most 80 of them: a folder is called so";
            self.complain(
                name.span(),
                format!("`{text}` cannot be the name of a folder"),
                "not a name",
                hint,
            );
        }
        is_good
    }

    fn device(&mut self, (name, value): Named<'_, '_>) {
        let is_good = self.is_name(name);
        let mut device = Device {
            name: name.get_ref().clone().into_owned(),
            at: name.span(),
            profile: None,
            listen: None,
            arguments: Vec::new(),
        };
        let what = format!("the device `{}`", device.name);
        for (key, value) in self.in_order(&what, value) {
            match &**key.get_ref() {
                "profile" => {
                    let profile = self.text("`profile`", value).map(|file| self.folder.join(file));
                    if let Some(file) = profile.as_ref().filter(|file| !file.is_file()) {
                        let title = format!("the profile {} is not there", file.display());
                        self.complain(
                            value.span(),
                            title,
                            "no file",
                            "it is found from the folder of the campaign's file",
                        );
                    }
                    device.profile = profile;
                }
                "listen" => device.listen = self.text("`listen`", value).map(|listen| (listen, value.span())),
                "arguments" => device.arguments = self.arguments("`arguments`", value),
                _ => self.unknown(key, &what, &["profile", "listen", "arguments"]),
            }
        }
        if is_good {
            self.devices.push(device);
        }
    }

    fn suite(&mut self, (name, value): Named<'_, '_>) {
        let is_good = self.is_name(name);
        let mut suite = Suite {
            name: name.get_ref().clone().into_owned(),
            at: name.span(),
            command: Command::Run,
            words: Vec::new(),
            devices: None,
        };
        let what = format!("the suite `{}`", suite.name);
        for (key, value) in self.in_order(&what, value) {
            match &**key.get_ref() {
                "command" => match self.text("`command`", value).as_deref() {
                    Some("run") => suite.command = Command::Run,
                    Some("certify") => suite.command = Command::Certify,
                    Some(other) => {
                        let hint = did_you_mean(other, ["run", "certify"]);
                        self.complain(value.span(), format!("a campaign has no `{other}`"), "not known", &hint);
                    }
                    None => {}
                },
                "tests" => {
                    let tests = self.texts("`tests`", value).unwrap_or_default();
                    suite.words = [tests, std::mem::take(&mut suite.words)].concat();
                }
                "arguments" => {
                    let words = self.arguments("`arguments`", value);
                    suite.words.extend(words);
                }
                "devices" => {
                    let names = self.texts("`devices`", value).unwrap_or_default();
                    suite.devices = Some(names);
                }
                _ => self.unknown(key, &what, &["command", "tests", "arguments", "devices"]),
            }
        }
        if is_good {
            self.suites.push(suite);
        }
    }

    /// Each device with each suite, if nothing is wrong.
    fn end(mut self) -> Result<Plan, Vec<Diagnostic>> {
        self.check_ports();
        self.check_devices();
        let missing = [
            (
                self.devices.is_empty(),
                "devices",
                "`[devices.acme]`, and below it `profile = \"device.toml\"`",
            ),
            (self.suites.is_empty(), "suites", "`[suites.all]`, which runs all tests"),
        ];
        for (is_missing, section, example) in missing {
            if is_missing && self.wrong.is_empty() {
                let hint = format!("add one, such as {example}");
                self.complain(0..0, format!("the campaign has no {section}"), "nothing to do", &hint);
            }
        }
        if !self.wrong.is_empty() {
            self.wrong.sort_by_key(|one| one.span.as_ref().map(|span| span.start));
            return Err(self.wrong);
        }
        let mut entries = Vec::new();
        for device in &self.devices {
            let meant = |suite: &&Suite| suite.devices.as_ref().is_none_or(|names| names.contains(&device.name));
            entries.extend(self.suites.iter().filter(meant).map(|suite| Entry {
                device: device.name.clone(),
                suite: suite.name.clone(),
                command: suite.command,
                profile: device.profile.clone(),
                listen: device.listen.as_ref().map(|(listen, _)| listen.clone()),
                of_device: device.arguments.clone(),
                of_suite: suite.words.clone(),
                span: Span::new(self.source, suite.at.start, suite.at.end),
            }));
        }
        Ok(Plan {
            source: Arc::clone(self.source),
            parallel: self.parallel,
            out: self.out,
            entries,
        })
    }

    /// What runs at the same time needs a place of its own to connect to.
    fn check_ports(&mut self) {
        if self.parallel < 2 || self.devices.len() < 2 {
            return;
        }
        let mut taken: BTreeMap<String, String> = BTreeMap::new();
        let mut wrong = Vec::new();
        let parallel = self.parallel;
        for device in &self.devices {
            let needs_none = device
                .arguments
                .iter()
                .any(|word| word == "--virtual" || word == "--broker" || word.starts_with("--broker="));
            match &device.listen {
                None if !needs_none => {
                    let title = format!(
                        "`{}` has no address of its own, and up to {parallel} entries run at the same time",
                        device.name
                    );
                    wrong.push((device.at.clone(), title));
                }
                Some((listen, at)) if !listen.ends_with(":0") => {
                    if let Some(other) = taken.insert(listen.clone(), device.name.clone()) {
                        wrong.push((at.clone(), format!("`{}` has the address of `{other}`", device.name)));
                    }
                }
                _ => {}
            }
        }
        for (at, title) in wrong {
            let hint = "give it a `listen` of its own, such as `listen = \"127.0.0.1:1884\"`, or leave `parallel` at 1";
            self.complain(at, title, "here", hint);
        }
    }

    /// A suite names devices that there are.
    fn check_devices(&mut self) {
        let known: Vec<String> = self.devices.iter().map(|device| device.name.clone()).collect();
        let mut wrong = Vec::new();
        for suite in &self.suites {
            let strangers = suite.devices.iter().flatten().filter(|name| !known.contains(name));
            wrong.extend(strangers.map(|name| (suite.at.clone(), suite.name.clone(), name.clone())));
        }
        for (at, suite, name) in wrong {
            let hint = did_you_mean(&name, known.iter().map(String::as_str));
            self.complain(
                at,
                format!("the suite `{suite}` is for the device `{name}`, which is not there"),
                "here",
                &hint,
            );
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<Plan, Vec<Diagnostic>> {
        Plan::read(&Source::new("c.toml", text), Path::new("/nowhere"))
    }

    #[test]
    fn each_device_meets_each_suite_in_the_order_of_the_file() {
        let plan = read(
            "[campaign]\nparallel = 2\nout = \"x\"\n[devices.b]\narguments = [\"--virtual\"]\n[devices.a]\nlisten = \
             \"127.0.0.1:1\"\n[suites.z]\narguments = [\"--seed\", \"1\"]\ntests = [\"t\"]\n[suites.y]\ncommand = \
             \"certify\"\ndevices = [\"a\"]\n",
        )
        .expect("a campaign");
        assert_eq!((plan.parallel, plan.out), (2, Some(PathBuf::from("/nowhere/x"))));
        let names: Vec<String> = plan.entries.iter().map(Entry::name).collect();
        assert_eq!(names, ["b/z", "a/z", "a/y"]);
        let words: Vec<String> = plan.entries.iter().map(|entry| entry.words().join(" ")).collect();
        // `certify` has no flag for it; it is told by the environment.
        assert_eq!(
            words,
            [
                "run --virtual t --seed 1",
                "run --listen 127.0.0.1:1 t --seed 1",
                "certify"
            ]
        );
    }

    #[test]
    fn every_mistake_has_a_place_and_a_hint() {
        for (text, line, title) in [
            ("[devices.a]\nprofle = \"x\"\n[suites.b]\n", 2, "there is no `profle`"),
            ("[devices.a]\nprofile = \"x.toml\"\n[suites.b]\n", 2, "is not there"),
            (
                "[devices.a]\narguments = [\"--out=x\"]\n[suites.b]\n",
                2,
                "`--out` is said by the campaign",
            ),
            (
                "[devices.a]\n[suites.b]\ncommand = \"runn\"\n",
                3,
                "a campaign has no `runn`",
            ),
            ("[devices.a]\n[suites.\"../b\"]\n", 2, "cannot be the name of a folder"),
            ("[devices.a]\n[suites.b]\ndevices = [\"c\"]\n", 2, "which is not there"),
            (
                "[campaign]\nparallel = 0\n[devices.a]\n[suites.b]\n",
                2,
                "a number from 1 to 64",
            ),
            (
                "[campaign]\nparallel = 2\n[devices.a]\n[devices.c]\nlisten = \"h:1\"\n[suites.b]\n",
                3,
                "no address of its own",
            ),
            (
                "[campaign]\nparallel = 2\n[devices.a]\nlisten = \"h:1\"\n[devices.c]\nlisten = \"h:1\"\n[suites.b]\n",
                6,
                "has the address of `a`",
            ),
            ("[devices.a]\n", 1, "the campaign has no suites"),
            ("[suites.b]\n", 1, "the campaign has no devices"),
            ("[dvices.a]\n[suites.b]\n", 1, "there is no `dvices`"),
            ("devices = 3\n[suites.b]\n", 1, "is a table"),
            ("[devices.a]\nlisten = 1\n[suites.b]\n", 2, "is a text"),
        ] {
            let wrong = read(text).expect_err(text);
            let first = &wrong[0];
            assert!(first.title.contains(title), "{text}: {}", first.title);
            assert_eq!(first.span.as_ref().map(Span::line), Some(line), "{text}");
            assert!(first.hint.is_some(), "{text}");
        }
        assert!(read("x = [").is_err());
    }
}
