//! `attestation.json`: the outcome of a run as an in-toto statement about its bundle, for any signer of DSSE envelopes.
//!
//! The subject is `manifest.json`, which holds the hash of everything else. Signing is left to tools proven for that.

use serde::Serialize;
use serde_json::{Value, json};
use sha2::{Digest, Sha256};

use super::clean::line;
use super::statement;
use super::time::{finished, rfc3339};
use tck_base::verdict::Verdict;
use tck_journal::event::hex;
use tck_result::RunResult;

/// The type of an in-toto statement.
const STATEMENT: &str = "https://in-toto.io/Statement/v1";
/// The type of what it says.
const PREDICATE: &str = "https://in-toto.io/attestation/test-result/v0.1";

/// The type of a statement of what was verified, and nothing else.
const SIMPLE: &str = "https://in-toto.io/attestation/svr/v0.1";

/// A statement about the bundle of a run.
#[derive(Debug, Serialize)]
#[serde(rename_all = "camelCase")]
pub struct Attestation {
    #[serde(rename = "_type")]
    kind: &'static str,
    subject: Vec<Value>,
    predicate_type: &'static str,
    predicate: Predicate,
}

#[derive(Debug, Serialize)]
#[serde(rename_all = "camelCase")]
struct Predicate {
    result: &'static str,
    configuration: Vec<Value>,
    passed_tests: Vec<String>,
    warned_tests: Vec<String>,
    failed_tests: Vec<String>,
}

impl Attestation {
    /// About a run, whose bundle has this manifest and this root hash.
    ///
    /// in-toto knows passed, warned and failed. What was not decided is no pass: it stands among the warned tests, and
    /// makes the result a warning, if nothing failed.
    #[must_use]
    pub fn of(result: &RunResult, manifest: &[u8], root: &str) -> Self {
        let named = |wanted: &[Verdict]| {
            let tests = result
                .tests
                .iter()
                .map(|test| (&test.id, statement::test_verdict(test)));
            let monitors = result.monitors.iter().map(|monitor| (&monitor.id, monitor.verdict));
            let all = tests.chain(monitors);
            all.filter(|(_, verdict)| verdict.is_some_and(|verdict| wanted.contains(&verdict)))
                .map(|(id, _)| id.clone())
                .collect()
        };
        let device = &result.device;
        Self {
            kind: STATEMENT,
            subject: vec![json!({
                "name": super::manifest::NAME,
                "digest": { "sha256": hex(&Sha256::digest(manifest)) },
                "annotations": {
                    "root": format!("sha256:{root}"),
                    "manufacturer": device.manufacturer,
                    "serialNumber": device.serial_number,
                    "hardwareVersion": result.setting("certificate.hardware-version"),
                    "firmwareVersion": result.setting("certificate.firmware-version"),
                },
            })],
            predicate_type: PREDICATE,
            predicate: Predicate {
                result: match result.verdict {
                    Some(Verdict::Pass) if !result.partial => "PASSED",
                    Some(Verdict::Fail) => "FAILED",
                    _ => "WARNED",
                },
                configuration: vec![
                    json!({
                        "name": "suites",
                        "digest": { "sha256": result.suites_sha256 },
                        "annotations": { "modified": result.suites_modified },
                    }),
                    json!({
                        "name": result.tool,
                        "annotations": {
                            "run": result.run,
                            "mode": result.mode,
                            "role": result.role,
                            "protocol": result.protocol,
                            "started": result.started,
                            "partial": result.partial,
                        },
                    }),
                ],
                passed_tests: named(&[Verdict::Pass]),
                warned_tests: named(&[Verdict::Warning, Verdict::Inconclusive, Verdict::Error]),
                failed_tests: named(&[Verdict::Fail]),
            },
        }
    }

    /// As JSON.
    ///
    /// # Errors
    /// When it cannot be serialized; it has no reason to.
    pub fn to_json(&self) -> Result<String, serde_json::Error> {
        Ok(serde_json::to_string_pretty(self)? + "\n")
    }
}

/// A simple verification result: what a run has shown to hold, and nothing else, so that whoever admits a device need not know this
/// tool. The subject is `manifest.json`.
///
/// A property is a requirement that was decided and never found broken; a remark is none. `CONFORMS` is there when a run of `certify`
/// broke nothing. Of a run that is not complete, is only a part, had other suites, or had only some of the tests, nothing is said
/// to hold.
#[must_use]
pub fn simple(result: &RunResult, manifest: &[u8], root: &str) -> String {
    let (tool, version) = result.tool.rsplit_once(' ').unwrap_or((result.tool.as_str(), ""));
    let scope = format!("VDA5050_{}_{}", result.protocol, result.role.to_ascii_uppercase());
    let whole = statement::trouble(result).is_none()
        && result.shard.is_none()
        && result.mixed.is_none()
        && !result.suites_modified
        && !result.ran_out_of_time();
    let conforms = matches!(result.verdict, Some(Verdict::Pass | Verdict::Warning)) && result.certifies();
    let held = result
        .requirements
        .iter()
        .filter(|requirement| requirement.verdict == Some(Verdict::Pass));
    let mut properties: Vec<String> = Vec::new();
    if whole {
        properties.extend(conforms.then(|| format!("{scope}_CONFORMS")));
        // What tests that somebody chose have shown is not what all of them would have.
        if result.certifies() || !statement::is_selection(result) {
            properties.extend(held.map(|requirement| format!("{scope}_{}", line(&requirement.id))));
        }
    }
    let statement = json!({
        "_type": STATEMENT,
        "subject": [{
            "name": super::manifest::NAME,
            "digest": { "sha256": hex(&Sha256::digest(manifest)) },
            "annotations": { "root": format!("sha256:{root}"), "device": statement::device(result) },
        }],
        "predicateType": SIMPLE,
        "predicate": {
            "verifier": {
                "id": format!("{}@{}", env!("CARGO_PKG_REPOSITORY"), line(version)),
                "name": line(tool),
                "policy": { "name": "suites", "digest": { "sha256": line(&result.suites_sha256) } },
            },
            "timeCreated": rfc3339(finished(result)),
            "properties": properties,
        },
    });
    format!("{statement:#}\n")
}
