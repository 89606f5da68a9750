//! What a profile as a whole has to hold.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::sync::LazyLock;

use super::*;
use tck_base::diagnostic::{Diagnostic, Source};
use tck_pack::{Assets, Hooks};

fn fixtures(which: &str) -> Vec<PathBuf> {
    let folder = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../.."))
        .join("fixtures/profiles")
        .join(which);
    let mut files: Vec<PathBuf> = std::fs::read_dir(folder)
        .expect("fixtures")
        .map(|entry| entry.expect("entry").path())
        .filter(|path| path.extension().is_some_and(|extension| extension == "toml"))
        .collect();
    files.sort();
    files
}

fn checked(path: &Path) -> Result<Effective, Vec<Diagnostic>> {
    let text = std::fs::read_to_string(path).expect("fixture");
    let name = path.file_name().expect("name").to_string_lossy();
    check(&Source::new(name, text), Path::new("site"), hooks())
}

fn check_text(text: &str) -> Result<Effective, Vec<Diagnostic>> {
    check(&Source::new("device.toml", text), Path::new("site"), hooks())
}

fn hooks() -> &'static Hooks {
    static HOOKS: LazyLock<Hooks> = LazyLock::new(|| Hooks::load(&Assets::of_source_tree().unwrap()).unwrap());
    &HOOKS
}

fn setting<'a>(effective: &'a Effective, name: &str) -> Option<(&'a str, &'a str)> {
    let setting = effective.settings.iter().find(|setting| setting.name == name)?;
    Some((&setting.value, &setting.origin))
}

#[test]
fn every_good_profile_is_taken() {
    let files = fixtures("good");
    assert!(files.len() >= 4);
    for file in files {
        if let Err(wrong) = checked(&file) {
            panic!("{}: {}", file.display(), wrong[0]);
        }
    }
}

#[test]
fn every_bad_profile_is_refused_at_its_place_with_a_way_out() {
    let files = fixtures("bad");
    assert!(files.len() >= 20);
    for file in files {
        let wrong = checked(&file).expect_err(&file.display().to_string());
        let shown: Vec<String> = wrong.iter().map(|diagnostic| diagnostic.render(false)).collect();
        let name = file.file_stem().expect("name").to_string_lossy().into_owned();
        let expected = if name == "two-mistakes" { 2 } else { 1 };
        assert_eq!(wrong.len(), expected, "{name}: {}", shown.join("\n"));
        assert!(
            wrong.iter().all(|diagnostic| diagnostic.span.is_some()),
            "{name} has a caret"
        );
        assert!(!shown.concat().contains("secret"), "{name} shows a password");
        insta::assert_snapshot!(name, shown.join("\n\n"));
    }
}

#[test]
fn all_mistakes_of_a_list_are_named_at_once() {
    let text = "[device]\nclaims = [\"action pick\", \"action drop NODES\", \"line-guidet\", \"no action pick\"]\n";
    let wrong = check_text(text).expect_err("three mistakes");
    let shown: Vec<&str> = wrong.iter().filter_map(|one| Some(one.span.as_ref()?.text())).collect();
    assert_eq!(
        shown,
        ["\"action drop NODES\"", "\"line-guidet\"", "\"no action pick\""]
    );
}

#[test]
fn the_default_file_says_what_the_defaults_are() {
    let effective = check_text(DEFAULT_TOML).expect("the default file");
    let profile = &effective.profile;
    assert_eq!(profile.time, TimeLimits::default());
    assert_eq!(profile.device.role, Role::Agv);
    assert_eq!(profile.bench.listen, "127.0.0.1:1883");
    assert!(profile.bench.tap && profile.bench.broker.is_none());
    assert!(!profile.motion.allowed, "no vehicle drives before somebody says so");
    assert!(matches!(profile.layout.source, LayoutSource::None));
    assert!(profile.deviations.is_empty() && profile.hooks.is_empty() && profile.maps.is_empty());
}

/// Takes away the `# ` before settings, and only there.
fn uncommented(text: &str) -> String {
    let is_setting = |line: &str| {
        line.starts_with('[')
            || line
                .split_once(" = ")
                .is_some_and(|(name, _)| name.chars().all(|c| c.is_ascii_alphanumeric() || c == '-'))
    };
    text.lines()
        .map(|line| match line.strip_prefix("# ") {
            Some(rest) if is_setting(rest) => rest,
            _ => line,
        })
        .fold(String::new(), |all, line| all + line + "\n")
}

#[test]
fn the_default_file_shows_every_setting_there_is() {
    let whole: toml::Table = uncommented(DEFAULT_TOML).parse().expect("TOML");
    for key in KEYS {
        let (section, name) = key.path.split_once('.').expect("section and name");
        assert!(
            whole[section].get(name).is_some(),
            "{} is not in default.toml",
            key.path
        );
    }
}

#[test]
fn the_examples_in_the_default_file_work() {
    let conflicting = ["password-env", "lif", "vehicle-type", "protocol"];
    let text: String = uncommented(DEFAULT_TOML)
        .lines()
        .filter(|line| !conflicting.iter().any(|name| line.starts_with(&format!("{name} = "))))
        .fold(String::new(), |all, line| all + line + "\n");
    if let Err(wrong) = check_text(&text) {
        panic!("{}", wrong[0]);
    }
}

#[test]
fn the_schema_for_editors_agrees_with_the_reader_about_good_profiles() {
    let schema: Value = serde_json::from_str(SCHEMA).expect("JSON");
    let validator = jsonschema::draft202012::new(&schema).expect("a schema");
    let mut texts: Vec<(String, String)> = fixtures("good")
        .into_iter()
        .map(|file| {
            (
                file.display().to_string(),
                std::fs::read_to_string(&file).expect("fixture"),
            )
        })
        .collect();
    texts.push(("default.toml".to_owned(), DEFAULT_TOML.to_owned()));
    for (name, text) in texts {
        let profile: Value = toml::from_str(&text).expect("TOML");
        let errors: Vec<String> = validator.iter_errors(&profile).map(|error| error.to_string()).collect();
        assert!(errors.is_empty(), "{name}: {errors:?}");
    }
}

#[test]
fn the_schema_for_editors_refuses_what_a_schema_can_refuse() {
    // These need to look at two places, at the other layers, or at the text of a value.
    const BEYOND_A_SCHEMA: [&str; 15] = [
        "claim",
        "claims-contradict",
        "claim-against-statement",
        "command-placeholder",
        "duplicate-edge",
        "duplicate-node",
        "edge-to-itself",
        "edge-to-nowhere",
        "event-after-warning",
        "hook-of-the-other-side",
        "hook-open-quote",
        "hook-placeholder",
        "layout-twice",
        "slow-after-react",
        "statements-contradict",
    ];
    const ALSO_BEYOND: [&str; 12] = [
        "action-claimed",
        "action-claimed-absent",
        "claim-about-an-unknown-hook",
        "claim-without-a-needed-hook",
        "hook-header",
        "hook-listen-and-timeout",
        "hook-prompt-of-nothing",
        "hook-unknown",
        "no-tap-no-broker",
        "topic-template-placeholder",
        "vehicle-type-of-nothing",
        "vehicles-named-twice",
    ];
    let schema: Value = serde_json::from_str(SCHEMA).expect("JSON");
    let validator = jsonschema::draft202012::new(&schema).expect("a schema");
    for file in fixtures("bad") {
        let name = file.file_stem().expect("name").to_string_lossy().into_owned();
        let text = std::fs::read_to_string(&file).expect("fixture");
        let Ok(profile) = toml::from_str::<Value>(&text) else {
            continue;
        };
        let beyond = BEYOND_A_SCHEMA.contains(&name.as_str()) || ALSO_BEYOND.contains(&name.as_str());
        assert_eq!(validator.is_valid(&profile), beyond, "{name}");
    }
}

#[test]
fn the_schema_for_editors_knows_the_same_names_as_the_reader() {
    let schema: Value = serde_json::from_str(SCHEMA).expect("JSON");
    let mut in_schema = Vec::new();
    for (section, rules) in schema["properties"].as_object().expect("sections") {
        for name in rules["properties"]
            .as_object()
            .into_iter()
            .flat_map(serde_json::Map::keys)
        {
            in_schema.push(format!("{section}.{name}"));
        }
    }
    in_schema.retain(|path| !["layout.nodes", "layout.edges", "vehicles.others"].contains(&path.as_str()));
    in_schema.sort();
    let mut in_reader: Vec<String> = KEYS.iter().map(|key| key.path.to_owned()).collect();
    in_reader.sort();
    assert_eq!(in_schema, in_reader);

    let names = &schema["properties"]["hooks"]["propertyNames"]["anyOf"][0]["enum"];
    let names = names.as_array().expect("names").iter().filter_map(Value::as_str);
    let in_schema: BTreeSet<&str> = names.collect();
    let in_vocabulary: BTreeSet<&str> = hooks().all().map(|hook| hook.name.as_str()).collect();
    assert_eq!(in_schema, in_vocabulary);
}

#[test]
fn every_statement_is_a_setting_of_the_device() {
    let actions = SAMPLE_ACTIONS.iter().map(|action| action.name);
    for name in STATEMENTS.iter().map(|statement| statement.name).chain(actions) {
        assert!(Key::find(&format!("device.{name}")).is_some(), "{name}");
    }
}

#[test]
fn a_full_profile_arrives_whole() {
    let text = std::fs::read_to_string(
        fixtures("good")
            .iter()
            .find(|f| f.ends_with("hall.toml"))
            .expect("hall"),
    );
    let effective = check_text(&text.expect("fixture")).expect("good");
    let profile = &effective.profile;
    assert_eq!(profile.device.serial_number.as_deref(), Some("carrier_07"));
    assert_eq!(profile.device.states("stops-between-nodes"), Some(true));
    assert_eq!(profile.device.states("node-bound"), Some(false));
    assert_eq!(profile.device.states("line-guided"), None);
    assert_eq!(profile.device.claims.len(), 4);
    assert_eq!(profile.device.states("long-action"), Some(true));
    let bindings = serde_json::Value::Object(profile.device.bindings());
    let expected = serde_json::json!({
        "manufacturer": "ACME",
        "serialNumber": "carrier_07",
        "longAction": { "type": "wait", "parameters": { "seconds": 20, "quiet": true } },
        "uninterruptibleAction": { "type": "finePositioning", "parameters": {} },
        "pick": { "type": "pick", "parameters": { "stationType": "rack", "loadType": "EPAL" }, "node": "P1" },
        "edgeCondition": { "type": "blink", "parameters": {}, "shows": "blinking" },
    });
    assert_eq!(bindings, expected);
    assert_eq!(profile.motion.max_speed, Some(0.4));
    assert_eq!(profile.maps, [PathBuf::from("site/hall-v2.map")]);
    assert_eq!(profile.deviations[0].requirement.as_str(), "MQTT-04");
    let LayoutSource::Lif { file, vehicle_type } = &profile.layout.source else {
        panic!("a LIF file");
    };
    assert_eq!(file, Path::new("site/../../layouts/hall.lif.json"));
    assert_eq!(vehicle_type.as_deref(), Some("ACME.Carrier"));
    let cycle = &profile.hooks["power-cycle"];
    assert_eq!(cycle.timeout, std::time::Duration::from_secs(120));
    let words = ["./power", "--device", "{serial-number}", "cycle"]
        .map(String::from)
        .to_vec();
    assert_eq!(cycle.action, HookAction::Run(words));
    assert_eq!(
        profile.hooks["emergency-stop"].timeout,
        std::time::Duration::from_secs(600)
    );
    assert_eq!(setting(&effective, "hooks.set-mode"), Some(("http", "device.toml")));
    assert_eq!(setting(&effective, "time.react"), Some(("10 s", "device.toml")));
    assert_eq!(setting(&effective, "time.slow"), Some(("5 s", "default")));
}

#[test]
fn a_hook_may_listen_or_carry_headers() {
    let text = "[hooks.shutdown]\nlisten = \"5 min\"\n[hooks.start]\nhttp = { url = \"https://fleet.site/{vehicle}\", headers = \
                { Authorization = \"Bearer ${env:TOKEN}\", X-Vehicle = \"{vehicle}\" } }\n";
    let profile = check_text(text).expect("good").profile;
    let listens = &profile.hooks["shutdown"];
    assert_eq!(listens.action, HookAction::NaturalTraffic);
    assert_eq!(listens.timeout, std::time::Duration::from_secs(300));
    let mut surroundings = Surroundings::default();
    let start = &profile.hooks["start"].action;
    assert!(start.resolved(&surroundings).is_err(), "there is no TOKEN");
    surroundings
        .environment
        .insert("TOKEN".to_owned(), "{vehicle}".to_owned());
    let values = BTreeMap::from([("vehicle".to_owned(), "mock\r\n1".to_owned())]);
    let HookAction::Http { url, headers, .. } = start.resolved(&surroundings).expect("TOKEN").filled(&values) else {
        panic!("still a request");
    };
    assert_eq!(url, "https://fleet.site/mock%0D%0A1");
    let headers: Vec<String> = headers
        .iter()
        .map(|(name, value)| format!("{name}: {}", value.reveal()))
        .collect();
    assert_eq!(headers, ["Authorization: Bearer {vehicle}", "X-Vehicle: mock  1"]);
}

#[test]
fn a_limit_that_was_not_set_gives_way_to_the_one_that_was() {
    let limits = |text: &str| check_text(text).expect("no contradiction").profile.time;
    let tight = limits("[time]\nreact = \"4 s\"\nevent-warning = \"800 ms\"\n");
    assert_eq!((tight.slow, tight.event), (tight.react, tight.event_warning));
    let loose = limits("[time]\nevent = \"8 s\"\n");
    assert_eq!(loose.event_warning, loose.event);
}

#[test]
fn a_later_complaint_points_at_the_line_of_the_setting() {
    let effective = check_text("[device]\nprotocol = \"9.9\"\n").expect("a version by its form");
    let diagnostic = effective.complain("device.protocol", "unknown-version", "no such version", "this one");
    assert_eq!(diagnostic.span.expect("caret").place(), "device.toml:2");
    assert_eq!(effective.complain("bench.username", "x", "y", "z").span, None);
}

struct Site {
    folder: tempfile::TempDir,
    surroundings: Surroundings,
}

impl Site {
    fn new() -> Self {
        let folder = tempfile::tempdir().expect("folder");
        let below = folder.path().join("project/below");
        std::fs::create_dir_all(&below).expect("folder");
        std::fs::create_dir_all(folder.path().join("config/vda5050-tck")).expect("folder");
        let config = folder.path().join("config").display().to_string();
        let environment = BTreeMap::from([("XDG_CONFIG_HOME".to_owned(), config)]);
        Self {
            surroundings: Surroundings {
                directory: below,
                environment,
            },
            folder,
        }
    }

    fn write(&self, name: &str, text: &str) -> PathBuf {
        let path = self.folder.path().join(name);
        std::fs::write(&path, text).expect("written");
        path
    }
}

#[test]
fn flag_beats_environment_beats_profile_beats_project_beats_user_beats_default() {
    let mut site = Site::new();
    let user = site.write("config/vda5050-tck/config.toml", "[bench]\nlisten = \"u:1\"\n");
    let origin = |path: &Path| path.display().to_string();
    let listen = |site: &Site, profile: Option<&Path>, flags: &[(&'static str, String)]| {
        let effective = load(profile, flags, &site.surroundings, hooks()).expect("effective");
        let (value, origin) = setting(&effective, "bench.listen").expect("set");
        (value.to_owned(), origin.to_owned())
    };
    assert_eq!(listen(&site, None, &[]), ("u:1".to_owned(), origin(&user)));

    let project = site.write("project/vda5050-tck.toml", "[bench]\nlisten = \"p:1\"\n");
    assert_eq!(listen(&site, None, &[]), ("p:1".to_owned(), origin(&project)));

    let profile = site.write("device.toml", "[bench]\nlisten = \"d:1\"\n");
    assert_eq!(listen(&site, Some(&profile), &[]), ("d:1".to_owned(), origin(&profile)));

    let variable = ("VDA5050_TCK_BENCH_LISTEN".to_owned(), "e:1".to_owned());
    site.surroundings.environment.extend([variable]);
    assert_eq!(
        listen(&site, Some(&profile), &[]),
        ("e:1".to_owned(), "environment".to_owned())
    );

    let flags = [("bench.listen", "f:1".to_owned())];
    assert_eq!(
        listen(&site, Some(&profile), &flags),
        ("f:1".to_owned(), "flag".to_owned())
    );
}

#[test]
fn the_other_way_of_saying_a_thing_is_replaced_by_the_layer_above() {
    let site = Site::new();
    site.write(
        "project/vda5050-tck.toml",
        "[bench]\npassword-file = \"p\"\n[layout]\nlif = \"hall.lif.json\"\nvehicle-type = \"t\"\n",
    );
    let profile = site.write(
        "device.toml",
        "[bench]\npassword-env = \"P\"\n[layout]\nnodes = [{ id = \"n\", x = 0, y = 0, map = \"m\" }]\n",
    );
    let effective = load(Some(&profile), &[], &site.surroundings, hooks()).expect("no contradiction");
    assert!(matches!(effective.profile.layout.source, LayoutSource::List(_)));
    assert_eq!(
        effective.profile.bench.password,
        PasswordSource::Environment("P".to_owned())
    );
}

#[test]
fn hooks_and_deviations_of_two_layers_add_up() {
    let site = Site::new();
    site.write(
        "project/vda5050-tck.toml",
        "[deviations]\nMQTT-04 = \"old\"\n[hooks.start]\nprompt = \"start it\"\n",
    );
    let profile = site.write(
        "device.toml",
        "[deviations]\nMQTT-04 = \"new\"\n[hooks.shutdown]\nprompt = \"stop it\"\n",
    );
    let profile = load(Some(&profile), &[], &site.surroundings, hooks())
        .expect("effective")
        .profile;
    assert_eq!(profile.hooks.keys().collect::<Vec<_>>(), ["shutdown", "start"]);
    assert_eq!(profile.deviations.len(), 1);
    assert_eq!(profile.deviations[0].reason, "new");
}

#[test]
fn keys_of_test_management_are_settings_with_their_origin_and_a_wrong_one_is_refused() {
    let text = "[keys]\nORD-REJ-12 = \"PROJ-12\"\n\"order-rejection/lower-update-id\" = \"C1234\"\n";
    let effective = check_text(text).expect("good");
    assert_eq!(setting(&effective, "keys.ORD-REJ-12"), Some(("PROJ-12", "device.toml")));
    let test = setting(&effective, "keys.order-rejection/lower-update-id");
    assert_eq!(test, Some(("C1234", "device.toml")));
    let wrong = check_text("[keys]\nA-1 = \"proj-12\"\nA-2 = 7\n").expect_err("refused");
    let codes: Vec<&str> = wrong.iter().map(|one| one.code).collect();
    assert_eq!(codes, ["bad-value", "wrong-type"]);
}

#[test]
fn a_variable_that_sets_nothing_is_refused_with_the_one_that_was_meant() {
    let mut site = Site::new();
    let variable = ("VDA5050_TCK_BENCH_LISTN".to_owned(), "e:1".to_owned());
    site.surroundings.environment.extend([variable]);
    let wrong = load(None, &[], &site.surroundings, hooks()).expect_err("a slip");
    assert_eq!(
        wrong[0].hint.as_deref(),
        Some("did you mean `VDA5050_TCK_BENCH_LISTEN`?")
    );
}

#[test]
fn a_variable_set_to_nothing_is_not_set() {
    let mut site = Site::new();
    let variable = ("VDA5050_TCK_DEVICE_MANUFACTURER".to_owned(), String::new());
    site.surroundings.environment.extend([variable]);
    let effective = load(None, &[], &site.surroundings, hooks()).expect("effective");
    assert_eq!(effective.profile.device.manufacturer, None);
}

#[test]
fn a_bad_flag_and_a_missing_profile_are_both_named() {
    let site = Site::new();
    let flags = [("bench.broker", "mqtt://me:secret@host".to_owned())];
    let wrong = load(
        Some(Path::new("/nowhere/device.toml")),
        &flags,
        &site.surroundings,
        hooks(),
    )
    .expect_err("two mistakes");
    assert_eq!(
        wrong.iter().map(|diagnostic| diagnostic.code).collect::<Vec<_>>(),
        ["credentials", "unreadable"]
    );
    assert!(!format!("{wrong:?}").contains("secret"));
}

#[test]
fn passwords_come_from_environment_or_file_and_are_never_shown() {
    let mut site = Site::new();
    let secret = |source: &PasswordSource, site: &Site| source.password(&site.surroundings);
    assert_eq!(secret(&PasswordSource::Usual, &site).expect("none needed"), None);
    let named = PasswordSource::Environment("PLANT".to_owned());
    assert!(matches!(secret(&named, &site), Err(PasswordError::NotSet(_))));
    site.surroundings
        .environment
        .insert("PLANT".to_owned(), "hush".to_owned());
    let password = secret(&named, &site).expect("set").expect("there");
    assert_eq!(password.reveal(), "hush");
    assert!(!format!("{password:?}").contains("hush"));
    let file = PasswordSource::File(site.write("password", "two words\n"));
    assert_eq!(
        secret(&file, &site).expect("readable").expect("there").reveal(),
        "two words"
    );
    assert!(secret(&PasswordSource::File("/nowhere".into()), &site).is_err());
}

#[test]
fn a_profile_that_is_written_down_from_a_run_is_the_same_profile() {
    let shown = |effective: &Effective| {
        let made = effective.settings.iter().filter(|setting| !setting.is_default());
        let made = made.map(|setting| (setting.name.clone(), setting.value.clone(), setting.written.clone()));
        made.collect::<BTreeSet<_>>()
    };
    let mut written_down = 0;
    for file in fixtures("good") {
        let before = checked(&file).unwrap_or_else(|wrong| panic!("{}: {}", file.display(), wrong[0]));
        let Some(text) = written(&before.settings) else {
            continue;
        };
        // Files are named from where the run was started, and the profile lies in another folder.
        let again = check(&Source::new("again.toml", text.clone()), Path::new(""), hooks());
        let again = again.unwrap_or_else(|wrong| panic!("{}: {}\n{text}", file.display(), wrong[0]));
        let missing: BTreeSet<_> = shown(&before).difference(&shown(&again)).cloned().collect();
        let is_secret = |name: &str| text.contains(&format!("# {name} is not written here"));
        let lost: Vec<_> = missing.iter().filter(|(name, ..)| !is_secret(name)).collect();
        assert!(lost.is_empty(), "{}: {lost:?}\n{text}", file.display());
        written_down += 1;
    }
    assert!(written_down >= 4, "{written_down}");
}

#[test]
fn what_may_be_secret_is_named_and_not_written() {
    let effective = check_text(
        "[device]\nmanufacturer = \"ACME\"\nserial-number = \"1\"\nlong-action = { type = \"wait\", parameters = { seconds = 2.5, deep = { a = [1, true] } } }\n\
         [time]\nreact = \"4 s\"\n[deviations]\nMQTT-04 = \"stops \\\"first\\\"\"\n\
         [hooks.power-cycle]\nrun = [\"./power\", \"--token\", \"abc-secret\"]\n\
         [hooks.emergency-stop]\nprompt = \"Press it.\"\ntimeout = \"20 s\"\n",
    )
    .unwrap_or_else(|wrong| panic!("{}", wrong[0]));
    let text = written(&effective.settings).expect("a profile");
    assert!(!text.contains("abc-secret") && !text.contains("./power"), "{text}");
    assert!(text.contains("# hooks.power-cycle is not written here"), "{text}");
    let again = check_text(&text).unwrap_or_else(|wrong| panic!("{}\n{text}", wrong[0]));
    assert_eq!(again.profile.hooks["emergency-stop"].timeout.as_secs(), 20);
    assert_eq!(again.profile.time.react.as_secs(), 4);
    assert_eq!(again.profile.deviations[0].reason, "stops \"first\"");
    let (before, after) = (effective.profile.device, again.profile.device);
    assert_eq!(before.sample_actions, after.sample_actions);
    assert!(written(&check_text("").expect("defaults").settings).is_none());
}
