//! What stands in the bundle of an audit.

use super::super::tests::traffic;
use super::super::{Audit, Options};
use super::*;
use tck_pack::Role;
use tck_report::course::CoursePicture;

#[test]
fn the_page_shows_each_vehicle_over_time_and_what_a_vehicle_says_is_only_text() {
    let library = tck_testing::library();
    let pack = library.rules.packs.latest();
    let mut messages = traffic(library, pack, Role::Agv, "order-acceptance/", &["horizon-not-reported"]);
    for message in &mut messages {
        let text = String::from_utf8_lossy(&message.payload).replace("\"AUTOMATIC\"", "\"<script>AUTO\"");
        message.payload = text.into_bytes().into();
    }
    let mut audit = Audit::new(&library.rules, Options::default()).expect("options");
    for message in messages {
        audit.observe(message);
    }
    let result = audit.finish(Vec::new());
    let folder = tempfile::tempdir().expect("folder");
    let into = folder.path().join("audits/monday");
    let root = write(&result, &library.rules, &into).expect("written");
    let found = Manifest::verify(&into).expect("a manifest");
    assert!(found.holds() && found.root == root, "{found:?}");
    let read = |name: &str| std::fs::read_to_string(into.join(name)).expect("file");
    let page = read("report.html");
    assert!(
        !page.contains("<script") && (page.contains("&#60;script") || page.contains("&lt;script")),
        "{page}"
    );
    assert!(
        page.contains("STATE-12") && page.contains("<svg") && page.contains("class=\"connection"),
        "{page}"
    );
    // First the overview, with a link to the vehicle and the sentence of each requirement.
    let at = |what: &str| page.find(what).unwrap_or(usize::MAX);
    assert!(at("id=\"overview\"") < at("id=\"requirements\"") && at("id=\"requirements\"") < at("id=\"v0\""));
    let sentence = &library.rules.catalogue.get("MODE-01").expect("known").text;
    let sentence = sentence.split([',', '\'', '&']).next().expect("a beginning");
    assert!(page.contains("href=\"#v0\"") && page.contains(sentence), "{page}");
    assert!(
        page.contains("&#34;operatingMode&#34;") || page.contains("&quot;operatingMode&quot;"),
        "{page}"
    );
    assert!(markdown(&result).contains("MODE-01") && !markdown(&result).contains("<script"));
    let quality: serde_json::Value = serde_json::from_str(&code_quality(&result)).expect("JSON");
    assert!(
        quality
            .as_array()
            .is_some_and(|all| all.iter().any(|one| one["check_name"] == "STATE-12"))
    );
    assert!(sarif(&result, &Sources::default()).contains("STATE-12"));
    let junit = read("junit.xml");
    let document = roxmltree::Document::parse(&junit).expect("XML");
    let failures = document.descendants().filter(|node| node.has_tag_name("failure"));
    let types: Vec<&str> = failures.filter_map(|node| node.attribute("type")).collect();
    // A failure for each mistake, by the requirement it is shown as.
    let sides = result.vehicles.iter().flat_map(|vehicle| &vehicle.sides);
    let mistakes = sides
        .flat_map(SideResult::mistakes)
        .filter(|mistake| mistake.worst.verdict == Verdict::Fail);
    let mistakes: Vec<Vec<String>> = mistakes
        .map(|mistake| mistake.requirements.iter().map(ToString::to_string).collect())
        .collect();
    let shown: std::collections::BTreeSet<&str> = mistakes.iter().map(|all| all[0].as_str()).collect();
    assert_eq!(types.iter().copied().collect::<std::collections::BTreeSet<_>>(), shown);
    for id in ["STATE-12", "MODE-01"] {
        assert!(mistakes.iter().flatten().any(|known| known == id), "{mistakes:?}");
    }
    let value: serde_json::Value = serde_json::from_str(&read("result.json")).expect("JSON");
    let saved: AuditResult = serde_json::from_value(value.clone()).expect("a result");
    let drawn = &saved.vehicles[0].courses;
    // Numbers may lose their last binary digit on the way.
    let orders = |all: &[CoursePicture]| all.iter().map(|one| one.order.clone()).collect::<Vec<_>>();
    assert!(!drawn.is_empty());
    assert_eq!(orders(drawn), orders(&result.vehicles[0].courses));
    assert_eq!(page.matches("class=\"course\"").count(), drawn.len());
    assert!(
        page.contains("<h3>Where it was in order ") && page.contains("Arrow 1"),
        "{page}"
    );
    assert!(
        value["vehicles"][0]["timeLine"]["order"]
            .as_array()
            .is_some_and(|spans| !spans.is_empty())
    );
}
