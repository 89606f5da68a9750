//! The examples in `deploy/` are what the schedulers they are for take: held against the schemas of these schedulers.
#![allow(clippy::expect_used, clippy::panic, reason = "a test may fail by panicking")]

use std::path::{Path, PathBuf};

use serde_json::{Value, json};
use vda5050_tck::diagnostic::Source;
use vda5050_tck::yaml;

/// The kinds of Kubernetes that the examples use, as its schema names them.
const KINDS: [(&str, &str); 5] = [
    ("ConfigMap", "io.k8s.api.core.v1.ConfigMap"),
    ("Job", "io.k8s.api.batch.v1.Job"),
    ("PersistentVolumeClaim", "io.k8s.api.core.v1.PersistentVolumeClaim"),
    ("Service", "io.k8s.api.core.v1.Service"),
    ("StatefulSet", "io.k8s.api.apps.v1.StatefulSet"),
];

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

fn schema(name: &str) -> Value {
    let path = root().join("fixtures/deploy").join(format!("{name}.schema.json"));
    let text = std::fs::read_to_string(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    serde_json::from_str(&text).expect("JSON")
}

/// What is wrong with a document.
fn wrong(schema: &Value, document: &Value) -> Vec<String> {
    let validator = jsonschema::validator_for(schema).expect("a schema");
    let errors = validator.iter_errors(document);
    errors
        .map(|error| format!("{}: {error}", error.instance_path()))
        .collect()
}

/// What is wrong with an object of Kubernetes.
fn wrong_object(document: &Value) -> Vec<String> {
    let kind = document["kind"].as_str().unwrap_or_default();
    let Some((_, name)) = KINDS.iter().find(|(known, _)| *known == kind) else {
        return vec![format!("no schema of the kind `{kind}` is here")];
    };
    let mut schema = schema("kubernetes");
    schema["$ref"] = json!(format!("#/definitions/{name}"));
    wrong(&schema, document)
}

/// The documents of a YAML file.
fn documents(path: &Path) -> Vec<Value> {
    let text = std::fs::read_to_string(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    let each = text.split("\n---\n").map(|part| {
        let source = Source::new(path.display().to_string(), part.to_owned());
        let tree = yaml::tree(&source).unwrap_or_else(|all| panic!("{}", all[0]));
        yaml::value(&tree)
    });
    each.collect()
}

fn manifests() -> Vec<PathBuf> {
    let entries = std::fs::read_dir(root().join("deploy/kubernetes")).expect("manifests");
    let mut all: Vec<PathBuf> = entries.map(|entry| entry.expect("entry").path()).collect();
    all.sort();
    all
}

#[test]
fn manifests_are_objects_of_kubernetes() {
    let all = manifests();
    assert_eq!(all.len(), 4, "{all:?}");
    for path in &all {
        for document in documents(path) {
            let wrong = wrong_object(&document);
            assert!(wrong.is_empty(), "{}: {wrong:#?}", path.display());
        }
    }
    let mut document = documents(&root().join("deploy/kubernetes/merge.yaml")).remove(0);
    document["spec"]["template"]["spec"]["containers"][0]["volumeMount"] = json!([]);
    assert!(!wrong_object(&document).is_empty(), "a misspelled member is none");
}

#[test]
fn indexed_jobs_say_of_how_many_parts_each_is_one() {
    let mut seen = 0;
    for document in manifests().iter().flat_map(|path| documents(path)) {
        let spec = &document["spec"];
        if spec["completionMode"] != "Indexed" {
            continue;
        }
        let environment = spec["template"]["spec"]["containers"][0]["env"]
            .as_array()
            .expect("variables");
        let said = environment.iter().find(|one| one["name"] == vda5050_tck::shard::SHARDS);
        let said = said.map(|one| one["value"].clone());
        assert_eq!(
            said,
            Some(json!(spec["completions"].to_string())),
            "{}",
            document["metadata"]
        );
        seen += 1;
    }
    assert_eq!(seen, 2);
}

#[test]
fn pipelines_are_what_gitlab_and_github_take() {
    for (file, name) in [
        ("gitlab-ci.yml", "gitlab-ci"),
        ("github-workflow.yml", "github-workflows"),
    ] {
        let schema = schema(name);
        let mut document = documents(&root().join("deploy").join(file)).remove(0);
        assert_eq!(wrong(&schema, &document), Vec::<String>::new(), "{file}");
        // A job that does not say what it does is refused.
        let job = if file.starts_with("gitlab") {
            &mut document["whole"]
        } else {
            &mut document["jobs"]["whole"]
        };
        *job = json!({ "whenever": true });
        assert!(
            !wrong(&schema, &document).is_empty(),
            "{file}: the schema refuses nothing"
        );
    }
}
