//! The files for the pipelines of others: they keep to the schemas of GitHub and GitLab, name what they take by its hash, and
//! attest what is published.
#![allow(clippy::expect_used, clippy::panic, reason = "a test may fail by panicking")]

use std::path::Path;

use serde_json::Value;
use vda5050_tck::diagnostic::Source;
use vda5050_tck::yaml;

fn text(path: &str) -> String {
    std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join(path)).expect(path)
}

/// A document of YAML. The key `on` of a workflow is a truth value to some readers, and a text to GitHub.
fn read(name: &str, text: &str) -> Value {
    let text = text.replace("\non:\n", "\n\"on\":\n");
    let tree = yaml::tree(&Source::new(name, text));
    yaml::value(&tree.unwrap_or_else(|wrong| panic!("{name}: {}", wrong[0])))
}

/// What a schema says of a document, one line each.
fn wrong_with(schema: &str, document: &Value) -> Vec<String> {
    let schema = text(&format!("fixtures/pipelines/{schema}.schema.json"));
    let schema = serde_json::from_str(&schema).expect("a schema");
    let validator = jsonschema::draft7::new(&schema).expect("a schema of draft 7");
    let errors = validator.iter_errors(document);
    errors
        .map(|error| format!("{}: {error}", error.instance_path()))
        .collect()
}

const WORKFLOWS: [&str; 2] = [".github/workflows/ci.yml", ".github/workflows/release.yml"];
const ACTION: &str = "action.yml";
const COMPONENT: &str = "templates/conformance.yml";

#[test]
fn the_files_keep_to_the_schemas_and_broken_ones_do_not() {
    for path in WORKFLOWS {
        let workflow = read(path, &text(path));
        assert_eq!(wrong_with("github-workflow", &workflow), Vec::<String>::new(), "{path}");
        let mut broken = workflow.clone();
        broken["jobs"] = serde_json::json!({ "one": { "steps": [{ "use": "x" }] } });
        assert!(!wrong_with("github-workflow", &broken).is_empty());
    }
    let action = read(ACTION, &text(ACTION));
    assert_eq!(wrong_with("github-action", &action), Vec::<String>::new());
    let mut broken = action.clone();
    // A step of an action has to name its shell.
    broken["runs"]["steps"] = serde_json::json!([{ "run": "true" }]);
    assert!(!wrong_with("github-action", &broken).is_empty());
}

/// The head of the component, and its job with the inputs at their defaults, as GitLab fills them in.
fn component() -> (Value, Value) {
    let all = text(COMPONENT);
    let (head, job) = all.split_once("\n---\n").expect("a head and a job");
    let head = read(COMPONENT, head);
    let mut job = job.to_owned();
    for (name, input) in head["spec"]["inputs"].as_object().expect("inputs") {
        let place = format!("$[[ inputs.{name} ]]");
        assert!(job.contains(&place), "{name} is an input, and nothing uses it");
        let default = match &input["default"] {
            Value::String(text) => text.clone(),
            other => other.to_string(),
        };
        job = job.replace(&place, &default);
    }
    assert!(!job.contains("$[["), "an input is used that there is none of:\n{job}");
    (head, read(COMPONENT, &job))
}

#[test]
fn the_component_keeps_to_the_schema_of_gitlab_and_publishes_what_it_writes() {
    let (head, job) = component();
    assert_eq!(wrong_with("gitlab-ci", &head), Vec::<String>::new());
    assert_eq!(wrong_with("gitlab-ci", &job), Vec::<String>::new());
    let conformance = &job["conformance"];
    let script = conformance["script"][0].as_str().expect("a script");
    let reports = &conformance["artifacts"]["reports"];
    for (kind, report) in [("junit", "junit"), ("code-quality", "codequality")] {
        let file = reports[report].as_str().expect(report);
        assert!(script.contains(&format!("--as {kind}={file}")), "{script}");
    }
    assert_eq!(conformance["artifacts"]["when"], "always");
    let mut broken = job.clone();
    broken["conformance"]["artifacts"]["when"] = "sometimes".into();
    assert!(!wrong_with("gitlab-ci", &broken).is_empty());
}

/// The steps of all jobs of a workflow, or of an action.
fn steps(file: &Value) -> Vec<&Value> {
    let jobs = file["jobs"].as_object().into_iter().flat_map(|jobs| jobs.values());
    let of_jobs = jobs.flat_map(|job| job["steps"].as_array().into_iter().flatten());
    of_jobs
        .chain(file["runs"]["steps"].as_array().into_iter().flatten())
        .collect()
}

#[test]
fn what_is_taken_from_others_is_named_by_its_hash_and_its_version() {
    let mut count = 0;
    for path in [WORKFLOWS[0], WORKFLOWS[1], ACTION] {
        let text = text(path);
        for step in steps(&read(path, &text)) {
            let Some(uses) = step["uses"].as_str() else { continue };
            count += 1;
            let (_, hash) = uses.split_once('@').expect("a version");
            assert!(
                hash.len() == 40 && hash.bytes().all(|byte| byte.is_ascii_hexdigit()),
                "{path}: {uses}"
            );
            assert!(
                text.contains(&format!("{uses} # v")),
                "{path}: the version of {uses} is not said"
            );
        }
    }
    assert!(count > 8, "{count} steps");
}

#[test]
fn a_release_attests_every_file_that_it_publishes() {
    let workflow = read(WORKFLOWS[1], &text(WORKFLOWS[1]));
    let publish = &workflow["jobs"]["publish"];
    for right in ["contents", "id-token", "attestations"] {
        assert_eq!(publish["permissions"][right], "write", "{right}");
    }
    assert_eq!(workflow["permissions"]["contents"], "read");
    let steps = publish["steps"].as_array().expect("steps");
    let uses = |name: &str| {
        let is_it = |step: &&Value| step["uses"].as_str().is_some_and(|uses| uses.starts_with(name));
        steps
            .iter()
            .find(is_it)
            .unwrap_or_else(|| panic!("nothing uses {name}"))
    };
    let subjects = |step: &Value| -> Vec<String> {
        let paths = step["with"]["subject-path"].as_str().expect("subjects");
        paths.lines().map(str::to_owned).collect()
    };
    let attested = subjects(uses("actions/attest-build-provenance@"));
    let run = steps.iter().filter_map(|step| step["run"].as_str());
    let publishing = run
        .clone()
        .find(|run| run.contains("gh release create"))
        .expect("a release");
    let files: Vec<&str> = publishing
        .split_whitespace()
        .filter(|word| word.contains("SHA256SUMS") || word.contains('*'))
        .map(|word| word.trim_start_matches("./"))
        .collect();
    assert_eq!(attested, files);
    let sbom = uses("actions/attest-sbom@");
    assert!(subjects(sbom).iter().all(|path| attested.contains(path)));
    let list = sbom["with"]["sbom-path"].as_str().expect("a list");
    let made = text(WORKFLOWS[1]);
    assert!(list.ends_with(".cdx.json") && made.contains("--override-filename \"vda5050-tck-${GITHUB_REF_NAME}.cdx\""));
}
