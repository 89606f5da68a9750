//! What files of counterparts may say.

use super::*;

const HEAD: &str = "title: A product\nsource: a repository\nseen: \"2026-11-27\"\nhabits:\n";

fn read(role: &str, habits: &str) -> Result<Counterparts, Vec<Diagnostic>> {
    let text = format!("counterpart: some-product\nrole: {role}\n{HEAD}{habits}");
    Counterparts::read([("counterparts/some-product.yaml".to_owned(), text)])
}

/// Code, place and title of the only mistake.
fn mistake(role: &str, habits: &str) -> String {
    let all = read(role, habits).unwrap_err();
    assert_eq!(all.len(), 1, "{all:?}");
    format!("{} {}", all[0].span.as_ref().unwrap().place(), all[0].title)
}

const VEHICLE: &str = "  - does: It writes CONNECTIONBROKEN with QoS 0.
    as: will-qos-0
    where: will.ts
  - does: It publishes the state with QoS 1.
    as: state-qos-1
    where: state.ts
  - does: It says ONLINE twice.
    as: online-twice
    where: issue 7
    seen: \"2026-11-26\"
  - does: States come seldom.
    as: states-seldom
    only-simulated: Tests would wait.
    where: state.ts
  - does: It sings.
    not-imitated: The reference AGV cannot.
    where: song.ts
";

#[test]
fn a_simulated_device_takes_all_and_a_run_only_what_is_permitted() {
    let all = read("agv", VEHICLE).unwrap();
    let one = all.find("some-product", Role::Agv).unwrap();
    assert_eq!(one.faults().collect::<Vec<_>>(), ["will-qos-0", "state-qos-1"]);
    assert_eq!(one.tolerances().collect::<Vec<_>>(), ["online-twice", "states-seldom"]);
    assert_eq!(one.in_run(), ["online-twice"]);
    let kinds: Vec<_> = one
        .habits
        .iter()
        .filter_map(Habit::deviation)
        .map(|one| one.kind.word())
        .collect();
    assert_eq!(kinds, ["fault", "lapse", "tolerance", "tolerance"]);
    let days: Vec<&str> = one.habits.iter().map(|habit| habit.seen.as_str()).collect();
    assert_eq!(
        days,
        ["2026-11-27", "2026-11-27", "2026-11-26", "2026-11-27", "2026-11-27"]
    );
    let mut vehicle = ReferenceAgv::new(tck_testing::library().rules.packs.latest());
    one.shape(&mut vehicle);
    assert_eq!(vehicle.config.switched_on, ["online-twice"]);
    assert!(
        one.limit()
            .starts_with("The mock vehicles behaved like a product (counterpart some-product) in what"),
        "{}",
        one.limit()
    );
}

#[test]
fn what_a_run_takes_nothing_of_is_said_to_have_no_effect() {
    let habits = "  - does: It writes CONNECTIONBROKEN with QoS 0.\n    as: will-qos-0\n    where: will.ts\n";
    let all = read("agv", habits).unwrap();
    let limit = all.find("some-product", Role::Agv).unwrap().limit();
    assert_eq!(
        limit,
        "`--like some-product` had no effect: a product (counterpart some-product) has no habit that a run may take, and the mock \
         vehicles behaved as always."
    );
}

#[test]
fn a_master_control_has_manners_in_a_run() {
    let habits = "  - does: It indents.\n    as: pretty-printed\n    manner: pretty-printed\n    where: a.java\n  \
                  - does: No empty lists.\n    manner: empty-parameters-left-out\n    where: b.java\n  \
                  - does: It keeps its session.\n    as: session-kept\n    where: c.java\n";
    let all = read("master-control", habits).unwrap();
    let one = all.find("some-product", Role::MasterControl).unwrap();
    assert_eq!(one.in_run(), ["pretty-printed", "empty-parameters-left-out"]);
    assert!(one.manners().has(Manner::PrettyPrinted) && !one.manners().has(Manner::UuidActionIds));
    assert_eq!(one.tolerances().collect::<Vec<_>>(), ["pretty-printed", "session-kept"]);
    let wrong = all.find("some-product", Role::Agv).unwrap_err();
    assert!(wrong.title.contains("of role master-control"), "{wrong:?}");
    let wrong = all.find("same-product", Role::MasterControl).unwrap_err();
    assert_eq!(wrong.hint.as_deref(), Some("did you mean `some-product`?"));
}

#[test]
fn an_unknown_deviation_is_found_with_its_file_and_line() {
    let wrong = "  - does: It does that.\n    as: will-qos-9\n    where: will.ts\n";
    let all = read("agv", wrong).unwrap_err();
    assert_eq!(all[0].hint.as_deref(), Some("did you mean `will-qos-0`?"));
    assert_eq!(
        mistake("agv", wrong),
        "counterparts/some-product.yaml:8 the reference device of role agv has no fault or tolerance `will-qos-9`"
    );
    // Each role has deviations of its own.
    assert!(mistake("master-control", "  - does: It.\n    as: will-qos-0\n    where: x\n").contains(":8 "));
}

#[test]
fn what_makes_no_sense_is_named_at_its_place() {
    for (role, habit, title) in [
        ("agv", "    where: x", "a habit of which nothing comes"),
        ("agv", "    as: will-qos-0", "`where` is missing"),
        (
            "agv",
            "    as: will-qos-0\n    where: x\n    not-imitated: so it is",
            "a habit that is imitated and is not",
        ),
        (
            "agv",
            "    as: will-qos-0\n    where: x\n    manner: pretty-printed",
            "a manner of the harness for a vehicle",
        ),
        (
            "master-control",
            "    manner: sung\n    where: x",
            "the harness has no manner `sung`",
        ),
        (
            "agv",
            "    as: will-qos-0\n    where: x\n    seen: yesterday",
            "a day that is none",
        ),
        (
            "agv",
            "    as: will-qos-0\n    where: x\n    becuase: so it is",
            "unknown key `becuase`",
        ),
    ] {
        let found = mistake(role, &format!("  - does: Something.\n{habit}\n"));
        assert!(
            found.starts_with("counterparts/some-product.yaml:") && found.ends_with(title),
            "{found}"
        );
    }
    let text = format!("counterpart: other\nrole: agv\n{HEAD}{VEHICLE}");
    let wrong = Counterparts::read([("counterparts/some-product.yaml".to_owned(), text)]).unwrap_err();
    assert_eq!(wrong[0].title, "a counterpart that its file is not named after");
}
