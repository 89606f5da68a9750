//! Attestations of `CycloneDX` (CDXA): the requirements of the standard, a claim about the device for each that was decided, and the
//! evidence, known by the hashes of the bundle.
//!
//! What is broken is a counter claim. What was not decided has neither, and no score: nobody can read conformance out of it. Signing is
//! left to tools proven for that.

use serde_json::{Value, json};

use super::allure::uuid;
use super::clean::line;
use super::findings::{Finding, findings};
use super::manifest::Manifest;
use super::sources::Sources;
use super::statement;
use super::time::{finished, rfc3339};
use tck_base::verdict::Verdict;
use tck_result::{RequirementResult, RunResult};

/// The version of `CycloneDX`; it has nothing to do with the protocol.
const SPECIFICATION: [u8; 2] = [1, 6];
/// The reference of what was tested.
const DEVICE: &str = "device";
/// The reference of who tested.
const ASSESSOR: &str = "assessor";

/// The attestations about a run whose bundle has this manifest.
#[must_use]
pub fn render(result: &RunResult, sources: &Sources, manifest: &Manifest) -> String {
    let found = findings(result, sources);
    let rows: Vec<Row<'_>> = result
        .requirements
        .iter()
        .map(|requirement| Row {
            requirement,
            finding: found.iter().find(|finding| finding.requirement == requirement.id),
        })
        .collect();
    let decided = || rows.iter().filter(|row| row.is_decided());
    let files = manifest.files.iter().map(|file| {
        json!({
            "type": "file",
            "bom-ref": format!("file:{}", file.path),
            "name": line(&file.path),
            "hashes": [{ "alg": "SHA-256", "content": file.sha256 }],
        })
    });
    let [major, minor] = SPECIFICATION;
    let (tool, version) = result.tool.rsplit_once(' ').unwrap_or((result.tool.as_str(), ""));
    let said = |name: &str| result.setting(name).map(|value| line(value).into_owned());
    let target = device(result);
    let mut subject = target.clone();
    // A reference stands for one thing alone.
    subject["bom-ref"] = "subject".into();
    let selection = statement::is_selection(result);
    let document = json!({
        "$schema": format!("http://cyclonedx.org/schema/bom-{major}.{minor}.schema.json"),
        "bomFormat": "CycloneDX",
        "specVersion": format!("{major}.{minor}"),
        "serialNumber": format!("urn:uuid:{}", uuid(&manifest.root)),
        "version": 1,
        "metadata": {
            "timestamp": rfc3339(finished(result)),
            "tools": { "components": [{ "type": "application", "name": line(tool), "version": line(version) }] },
            "component": subject,
            "properties": [
                property("vda5050-tck:run", &result.run),
                property("vda5050-tck:root", &format!("sha256:{}", manifest.root)),
                property("vda5050-tck:suites", &format!("sha256:{}", result.suites_sha256)),
                property("vda5050-tck:verdict", result.verdict.map_or("not decided", Verdict::word)),
                property("vda5050-tck:complete", if statement::trouble(result).is_none() { "yes" } else { "no" }),
            ],
        },
        "components": files.collect::<Vec<Value>>(),
        "definitions": { "standards": [{
            "bom-ref": "standard",
            "name": "VDA 5050",
            "version": line(&result.protocol),
            "requirements": rows.iter().map(|row| row.asked(sources)).collect::<Vec<Value>>(),
        }] },
        "declarations": {
            "assessors": [{
                "bom-ref": ASSESSOR,
                "organization": { "name": said("certificate.laboratory").unwrap_or_else(|| "not stated".to_owned()) },
            }],
            "attestations": [{
                "summary": statement::statement(result),
                "assessor": ASSESSOR,
                "map": rows.iter().map(|row| row.attested(selection)).collect::<Vec<Value>>(),
            }],
            "claims": decided().map(|row| row.claim(result, manifest)).collect::<Vec<Value>>(),
            "evidence": decided().map(|row| row.evidence(result)).collect::<Vec<Value>>(),
            "targets": { "components": [target] },
        },
    });
    format!("{document:#}\n")
}

/// Whether a text can stand where an address is due.
fn is_address(text: &str) -> bool {
    let plain = |byte: u8| byte.is_ascii_graphic() && !b"<>\"{}|\\^`%".contains(&byte);
    !text.is_empty() && text.bytes().all(plain)
}

fn property(name: &str, value: &str) -> Value {
    json!({ "name": name, "value": line(value) })
}

/// What was tested.
fn device(result: &RunResult) -> Value {
    let device = &result.device;
    let kind = if result.role == "agv" { "device" } else { "application" };
    let mut component = json!({
        "type": kind,
        "bom-ref": DEVICE,
        "manufacturer": { "name": line(&device.manufacturer) },
        "name": statement::device(result),
    });
    if let Some(version) = result.setting("certificate.firmware-version") {
        component["version"] = line(version).into();
    }
    component
}

/// One requirement, and what was found of it.
struct Row<'r> {
    requirement: &'r RequirementResult,
    finding: Option<&'r Finding<'r>>,
}

impl Row<'_> {
    fn is_decided(&self) -> bool {
        matches!(
            self.requirement.verdict,
            Some(Verdict::Pass | Verdict::Warning | Verdict::Fail)
        )
    }

    fn reference(&self, what: &str) -> String {
        format!("{what}:{}", line(&self.requirement.id))
    }

    /// The requirement itself.
    fn asked(&self, sources: &Sources) -> Value {
        let id = &self.requirement.id;
        let mut asked = json!({ "bom-ref": self.reference("requirement"), "identifier": line(id) });
        if let Some(known) = sources.requirement(id) {
            asked["title"] = line(&known.text).into();
            asked["properties"] = json!([
                property("vda5050-tck:section", &known.section),
                property("vda5050-tck:mood", &known.mood),
            ]);
            if let Some(link) = known.link.as_deref().filter(|link| is_address(link)) {
                asked["externalReferences"] = json!([{ "type": "documentation", "url": link }]);
            }
        }
        asked
    }

    /// What the attestation says of it; `selection` says that only some of the tests were run.
    fn attested(&self, selection: bool) -> Value {
        let mut attested = json!({ "requirement": self.reference("requirement") });
        let claims = || json!([self.reference("claim")]);
        let seen = || self.finding.map_or_else(String::new, |finding| finding.seen.clone());
        match self.requirement.verdict {
            Some(Verdict::Pass) if selection => {
                attested["claims"] = claims();
                attested["conformance"] = json!({ "rationale": "never found broken by the tests that were selected" });
            }
            Some(Verdict::Pass) => {
                attested["claims"] = claims();
                attested["conformance"] = json!({ "score": 1, "rationale": "decided, and never found broken" });
            }
            Some(Verdict::Warning) => {
                attested["claims"] = claims();
                attested["conformance"] =
                    json!({ "rationale": line(&format!("nothing binding is broken, with a remark: {}", seen())) });
            }
            Some(Verdict::Fail) => {
                attested["counterClaims"] = claims();
                attested["conformance"] = json!({ "score": 0, "rationale": line(&format!("broken: {}", seen())) });
            }
            Some(Verdict::Inconclusive | Verdict::Error) | None => {
                let why = match &self.requirement.not_decided {
                    Some(why) => why.to_string(),
                    None => "no test came to a decision".to_owned(),
                };
                attested["confidence"] = json!({ "rationale": line(&format!("not decided: {why}")) });
            }
        }
        attested
    }

    fn claim(&self, result: &RunResult, manifest: &Manifest) -> Value {
        let id = line(&self.requirement.id);
        let standard = format!("VDA 5050 {}", line(&result.protocol));
        let journal = manifest.files.iter().find(|file| file.path == result.journal);
        let journal = journal.filter(|journal| is_address(&journal.path));
        let mut claim = json!({
            "bom-ref": self.reference("claim"),
            "target": DEVICE,
            "predicate": match self.requirement.verdict {
                Some(Verdict::Fail) => format!("breaks {id} of {standard}"),
                _ => format!("was not found to break {id} of {standard}"),
            },
            "reasoning": line(&format!("decided by {}", self.requirement.decided_by.join(", "))),
            "evidence": [self.reference("evidence")],
        });
        if let Some(journal) = journal {
            claim["externalReferences"] = json!([{
                "type": "evidence",
                "url": journal.path,
                "hashes": [{ "alg": "SHA-256", "content": journal.sha256 }],
            }]);
        }
        claim
    }

    /// Where in the journal it was seen.
    fn evidence(&self, result: &RunResult) -> Value {
        let id = &self.requirement.id;
        let decisions = result.tests.iter().flat_map(|test| &test.decisions);
        let witnesses = decisions
            .filter(|one| one.requirement == *id)
            .filter_map(|one| one.witness);
        let findings = result.monitors.iter().flat_map(|monitor| &monitor.findings);
        let found = findings
            .filter(|one| one.requirement == *id)
            .flat_map(|one| one.first.iter().copied());
        let mut records: Vec<u64> = witnesses.chain(found).collect();
        records.sort_unstable();
        records.dedup();
        let records: Vec<String> = records.iter().map(|record| format!("#{record}")).collect();
        let description = match records.as_slice() {
            [] => "the recorded messages".to_owned(),
            some => format!("the recorded messages; decided by {}", some.join(", ")),
        };
        let mut evidence = json!({ "bom-ref": self.reference("evidence"), "description": description });
        if is_address(&result.journal) {
            evidence["data"] = json!([{ "name": result.journal, "contents": { "url": result.journal } }]);
        }
        evidence
    }
}
