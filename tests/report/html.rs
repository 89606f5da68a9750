//! The HTML page: complete, linked, well-formed, and safe whatever the device calls itself.

use std::collections::BTreeSet;

use roxmltree::{Document, Node, ParsingOptions};
use vda5050_tck::report::html;
use vda5050_tck::report::sources::Sources;
use vda5050_tck::verdict::Verdict;

use crate::samples;

fn parse(html: &str) -> Document<'_> {
    let options = ParsingOptions {
        allow_dtd: true,
        ..ParsingOptions::default()
    };
    match Document::parse_with_options(html, options) {
        Ok(document) => document,
        Err(error) => {
            let line = html
                .lines()
                .nth(error.pos().row.saturating_sub(1) as usize)
                .unwrap_or_default();
            panic!("{error}: {line}");
        }
    }
}

fn named<'a>(document: &'a Document<'a>, name: &'a str) -> impl Iterator<Item = Node<'a, 'a>> {
    document
        .descendants()
        .filter(move |node| node.is_element() && node.tag_name().name() == name)
}

fn text(node: Node<'_, '_>) -> String {
    let all: String = node
        .descendants()
        .filter(Node::is_text)
        .filter_map(|node| node.text())
        .collect();
    all.split_whitespace().collect::<Vec<_>>().join(" ")
}

fn pages() -> [String; 4] {
    let (pass, pass_journal) = samples::pass();
    let (fail, fail_journal) = samples::fail();
    let (hostile, hostile_journal, hostile_sources) = samples::hostile();
    [
        html::render(&pass, &samples::sources(), Some(&pass_journal)).expect("html"),
        html::render(&fail, &samples::sources(), Some(&fail_journal)).expect("html"),
        html::render(&hostile, &hostile_sources, Some(&hostile_journal)).expect("html"),
        html::render(&fail, &Sources::default(), None).expect("html"),
    ]
}

#[test]
fn the_passing_sample() {
    let [pass, ..] = pages();
    let (_, body) = pass.split_once("</head>").expect("head");
    insta::assert_snapshot!("html_pass", body);
}

#[test]
fn the_same_input_gives_the_same_bytes() {
    assert_eq!(pages(), pages());
}

#[test]
fn every_link_leads_somewhere_and_every_id_is_there_once() {
    for page in pages() {
        let document = parse(&page);
        let mut ids = BTreeSet::new();
        for node in document.descendants() {
            if let Some(id) = node.attribute("id") {
                assert!(ids.insert(id.to_owned()), "the id {id:?} is there twice");
            }
        }
        for node in document.descendants() {
            if let Some(link) = node.attribute("href") {
                let target = link
                    .strip_prefix('#')
                    .unwrap_or_else(|| panic!("{link:?} leads out of the page"));
                assert!(ids.contains(target), "{link:?} leads nowhere");
            }
            for name in ["aria-labelledby", "aria-describedby"] {
                for id in node.attribute(name).into_iter().flat_map(str::split_whitespace) {
                    assert!(ids.contains(id), "{name} {id:?} is not there");
                }
            }
        }
    }
}

#[test]
fn nothing_is_loaded_and_nothing_runs() {
    for page in pages() {
        let document = parse(&page);
        for name in ["script", "link", "img", "iframe", "object", "embed", "form", "base"] {
            assert_eq!(named(&document, name).count(), 0, "<{name}>");
        }
        for node in document.descendants() {
            for attribute in node.attributes() {
                assert!(
                    !attribute.name().starts_with("on") && attribute.name() != "src",
                    "{}",
                    attribute.name()
                );
            }
        }
        let style: String = named(&document, "style").map(text).collect();
        assert!(!style.contains("url(") && !style.contains("@import"));
    }
}

#[test]
fn hostile_strings_are_shown_and_never_live() {
    let [_, _, page, _] = pages();
    assert!(!page.contains("<script") && !page.contains("\"'&"));
    assert!(
        !page
            .chars()
            .any(|c| (c.is_control() && c != '\n') || matches!(c, '\u{202e}' | '\u{ffff}'))
    );
    let shown = text(parse(&page).root());
    assert!(shown.contains("<script>alert(1)</script>\"'&]]>␛[31m␀\\u{202e}\\u{ffff}{{ 7 }}"));
}

#[test]
fn headings_descend_and_tables_have_headers() {
    for page in pages() {
        let document = parse(&page);
        let mut last = 0;
        for node in document.descendants().filter(Node::is_element) {
            let name = node.tag_name().name();
            if let Some(level) = name.strip_prefix('h').and_then(|level| level.parse::<u32>().ok()) {
                assert!(level <= last + 1, "h{level} after h{last}: {}", text(node));
                last = level;
            }
        }
        assert_eq!(named(&document, "h1").count(), 1);
        for table in named(&document, "table") {
            let scopes: Vec<_> = table
                .descendants()
                .filter(|node| node.has_tag_name(("http://www.w3.org/1999/xhtml", "th")))
                .map(|node| node.attribute("scope"))
                .collect();
            assert!(scopes.contains(&Some("col")) && scopes.contains(&Some("row")) && !scopes.contains(&None));
        }
        for landmark in ["header", "nav", "main", "footer"] {
            assert_eq!(named(&document, landmark).count(), 1, "{landmark}");
        }
    }
}

#[test]
fn sections_stand_in_the_order_a_reader_needs_them() {
    let [_, fail, ..] = pages();
    let document = parse(&fail);
    let headings: Vec<String> = named(&document, "h2").map(text).collect();
    let expected = [
        "Findings",
        "To decide more",
        "In numbers",
        "Limits of this statement",
        "Time line",
        "Reaction times",
        "Requirements by chapter",
        "Tests",
        "Monitors",
        "Applicability",
        "Declared deviations",
        "Environment",
        "Legend",
    ];
    assert_eq!(headings, expected);
}

#[test]
fn a_failure_shows_its_clause_its_nearest_miss_and_its_message() {
    let [_, fail, ..] = pages();
    let (result, _) = samples::fail();
    let document = parse(&fail);
    let witness = result.tests[0].decisions[1].witness.expect("witness");
    let id = format!("m{witness}");
    let message = document
        .descendants()
        .find(|node| node.attribute("id") == Some(&id))
        .expect("message");
    let marked: Vec<String> = message
        .descendants()
        .filter(|node| node.attribute("class") == Some("line deciding"))
        .map(text)
        .collect();
    let expected = ["▶ \"errorType\": \"orderError\",", "▶ \"errorReferences\": []"];
    assert_eq!(marked, expected, "the nearest misses are marked in the message");
    let source: Vec<String> = document
        .descendants()
        .filter(|node| node.attribute("class") == Some("line deciding"))
        .map(text)
        .filter(|line| line.contains("ORD-REJ"))
        .collect();
    assert_eq!(
        source,
        [
            "▶ 32 ORD-REJ-12:✕ ORD-REJ-12 fail",
            "▶ 34 ORD-REJ-14:! ORD-REJ-14 warning"
        ]
    );
    let shown = text(document.root());
    for words in [
        "no new error has errorType \"orderUpdateError\"",
        "Nearest miss",
        "#41 state (order-7c1e / 1 · at n1 (0) · 1 error: orderError)",
        "Firmware 4.2 reports orderError",
        "The table of error types is read as binding.",
        "vda5050-tck run --profile device.toml",
        "6 of the 13 messages recorded during this test",
    ] {
        assert!(shown.contains(words), "{words:?} is missing in\n{shown}");
    }
    assert!(fail.contains(&format!("<a href=\"#{id}\"><line")) || fail.contains(&format!("<a href=\"#{id}\">")));
}

#[test]
fn gaps_are_visible_and_told_apart() {
    let [_, fail, ..] = pages();
    let document = parse(&fail);
    let row = |id: &str| {
        let anchor = format!("r-{id}");
        text(
            document
                .descendants()
                .find(|node| node.attribute("id") == Some(&anchor))
                .expect(id),
        )
    };
    assert!(
        row("CONN-09").starts_with("∅ not testable")
            && row("CONN-09").contains("kept secret") | row("CONN-09").contains("keeps secret")
    );
    assert!(row("ORD-REJ-18").starts_with("– not applicable"));
    assert!(row("CONN-11").starts_with("· not decided") && row("CONN-11").contains("not selected"));
    assert!(row("ORD-REJ-12").starts_with("✕ fail") && row("ORD-REJ-12").contains("order/update-lower-id-refused"));
    assert_eq!(
        document
            .descendants()
            .filter(|node| node.attribute("class").is_some_and(|c| c.starts_with("cell ")))
            .count(),
        12
    );
}

#[test]
fn findings_stand_first_and_lead_to_each_other() {
    let [pass, fail, ..] = pages();
    let document = parse(&fail);
    let first = named(&document, "tr").nth(1).expect("a row of the findings");
    assert!(text(first).starts_with("✕ failORD-REJ-12"), "{}", text(first));
    let tests: Vec<&str> = named(&document, "details")
        .filter_map(|node| node.attribute("class"))
        .filter(|class| class.starts_with("test "))
        .collect();
    assert_eq!(tests.first(), Some(&"test of-fail fail"), "what is broken comes first");
    assert!(!tests[1..].contains(&"test of-fail fail"));
    let shown = text(document.root());
    assert!(shown.contains("all findings"));
    assert!(text(parse(&pass).root()).contains("None: no requirement that was decided is broken"));
}

#[test]
fn a_partial_run_says_so_before_anything_else() {
    let [pass, _, hostile, _] = pages();
    assert!(!pass.contains("class=\"partial\""));
    let banner = hostile.find("class=\"partial\"").expect("banner");
    assert!(banner < hostile.find("<h1").expect("h1"));
}

#[test]
fn messages_are_bounded_however_much_was_recorded() {
    let (result, mut recorder) = (samples::fail().0, samples::Recorder::new());
    let mut result = result;
    let big = serde_json::json!({ "errors": vec!["x".repeat(900); 1_100] });
    let last = (0..60)
        .map(|_| recorder.receive("state", &big))
        .last()
        .expect("message");
    result.tests[0].journal = Some((1, last));
    for (at, decision) in result.tests[0].decisions.iter_mut().enumerate() {
        decision.witness = Some(2 + 2 * at as u64);
    }
    result.tests[0].steps = (0..60)
        .map(|at| {
            let mut step = samples::fail().0.tests[0].steps[1].clone();
            step.took = Some(2 + 2 * at);
            step
        })
        .collect();
    let page = html::render(&result, &samples::sources(), Some(&recorder.journal)).expect("html");
    assert!(page.len() < 4_000_000, "{} bytes", page.len());
    assert!(page.contains("of the 60 messages recorded during this test"));
    assert!(
        page.matches("<details class=\"message\"").count() <= 26,
        "24 of the test, 2 of the monitor"
    );
    parse(&page);
}

/// For looking at the pages: `REPORT_SAMPLES=some/folder cargo test --test report -- --ignored`.
#[test]
#[ignore = "writes files for a person to look at"]
fn write_the_samples_for_a_person_to_look_at() {
    let dir = std::env::var("REPORT_SAMPLES").expect("REPORT_SAMPLES names a folder");
    let pages = pages().into_iter().chain([crate::course::page()]);
    for (name, page) in ["pass", "fail", "hostile", "bare", "course"].iter().zip(pages) {
        std::fs::write(format!("{dir}/{name}.html"), page).expect("write");
    }
}

#[test]
fn a_page_that_would_be_too_large_leaves_out_everything_but_what_shows_failures() {
    let (mut result, journal) = samples::fail();
    let broken = result.tests[0].clone();
    let whole = html::render(&result, &samples::sources(), Some(&journal)).expect("html");
    assert!(!whole.contains("Left out to keep this page small"));
    let mut long = result.tests[1].clone();
    long.steps = broken.steps.iter().cycle().take(40).cloned().collect();
    long.journal = broken.journal;
    for at in 0..400 {
        let (mut undecided, mut passed) = (long.clone(), long.clone());
        undecided.id = format!("connection/undecided-{at}");
        passed.id = format!("connection/passed-{at}");
        passed.verdict = Some(Verdict::Pass);
        passed.reason = None;
        passed.decisions.clear();
        result.tests.extend([undecided, passed]);
    }
    let page = html::render(&result, &samples::sources(), Some(&journal)).expect("html");
    assert!(page.len() < 5_000_000, "{} bytes", page.len());
    assert!(page.contains("Left out to keep this page small: the steps of tests that passed, and messages"));
    let card = |page: &str, id: &str| {
        let begin = page
            .find(&format!("<code>{id}</code></h3>"))
            .expect("a card of the test");
        let rest = &page[begin..];
        rest[..rest.find("\n</details>\n<details class=\"test").unwrap_or(rest.len())].to_owned()
    };
    // Two undecided tests have one cause: the first one is shown for all.
    assert!(card(&page, "connection/last-will").contains("the device did not connect again"));
    for id in ["connection/undecided-7", "connection/passed-7"] {
        let card = card(&page, id);
        assert!(card.contains("left out to keep the page small") && !card.contains("<table class=\"steps\">"));
    }
    let diagram = |page: &str| {
        let card = card(page, &broken.id);
        assert!(card.contains("<table class=\"steps\">"), "no steps");
        let begin = card.find("<svg").expect("a diagram");
        card[begin..].split("</details>").next().map(str::to_owned)
    };
    assert_eq!(diagram(&page), diagram(&whole), "what shows the failure is thinned");
}
