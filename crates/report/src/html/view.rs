//! The parts of the page that are tables of the result: head, numbers, monitors, deviations, legend.

use super::Anchors;
use super::messages::Gallery;
use crate::sources::Sources;
use crate::statement::{self, Gap, seconds};
use tck_base::verdict::Verdict;
use tck_result::{CommandedVehicle, FleetResult, RequirementResult, RunResult};

/// Most occurrences of a monitor's finding whose messages are shown.
const OCCURRENCES: usize = 2;

/// A verdict as sign and word; never by colour alone.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Badge {
    /// CSS class.
    pub class: &'static str,
    /// One character.
    pub sign: &'static str,
    /// The word.
    pub word: &'static str,
}

impl Badge {
    /// For a verdict, or for none.
    pub fn of(verdict: Option<Verdict>) -> Self {
        let (class, sign) = match verdict {
            Some(Verdict::Pass) => ("pass", "✓"),
            Some(Verdict::Warning) => ("warning", "!"),
            Some(Verdict::Inconclusive) => ("inconclusive", "?"),
            Some(Verdict::Error) => ("error", "‼"),
            Some(Verdict::Fail) => ("fail", "✕"),
            None => ("none", "–"),
        };
        Self {
            class,
            sign,
            word: verdict.map_or("not decided", Verdict::word),
        }
    }

    /// For a requirement: a gap is told from what does not apply and what cannot be tested.
    pub fn of_requirement(requirement: &RequirementResult) -> Self {
        match statement::gap(requirement) {
            None => Self::of(requirement.verdict),
            Some(Gap::NotApplicable) => Self::NOT_APPLICABLE,
            Some(Gap::NotTestable) => Self::NOT_TESTABLE,
            Some(Gap::NotDecided) => Self::NOT_DECIDED,
        }
    }

    pub const NOT_APPLICABLE: Self = Self {
        class: "none",
        sign: "–",
        word: "not applicable",
    };
    pub const NOT_TESTABLE: Self = Self {
        class: "none untestable",
        sign: "∅",
        word: "not testable",
    };
    pub const NOTHING_TO_JUDGE: Self = Self {
        class: "none",
        sign: "–",
        word: "nothing to judge",
    };
    pub const NOT_DECIDED: Self = Self {
        class: "none gap",
        sign: "·",
        word: "not decided",
    };
}

/// What stands in the title bar.
pub fn verdict_title(result: &RunResult) -> &'static str {
    match result.verdict {
        Some(Verdict::Pass | Verdict::Warning) if result.partial => "nothing broken until it ended",
        Some(Verdict::Fail) => "does not conform",
        Some(Verdict::Pass) => "conforms",
        Some(Verdict::Warning) => "conforms, with remarks",
        Some(Verdict::Inconclusive) => "undecided",
        Some(Verdict::Error) => "no statement",
        None => "nothing decided",
    }
}

/// Who, what, when.
pub fn identity(result: &RunResult) -> Vec<(&'static str, String)> {
    let device = &result.device;
    let mut rows = vec![
        ("Manufacturer", device.manufacturer.clone()),
        ("Serial number", device.serial_number.clone()),
    ];
    rows.extend(device.series_name.clone().map(|name| ("Series", name)));
    let suites = if result.suites_modified {
        "modified, "
    } else {
        "as delivered, "
    };
    let vantage = match result.vantage.as_str() {
        "tap" => "at the level of MQTT packets (proxy)",
        "subscriber" => "as a subscriber: only what the broker delivered",
        other => other,
    };
    rows.extend([
        ("Role", statement::role(result).to_owned()),
        ("Protocol", format!("VDA 5050 {}", result.protocol)),
        ("Started", started(&result.started)),
        ("Length", seconds(result.seconds)),
        ("Observation", vantage.to_owned()),
        ("Tool", result.tool.clone()),
        ("Suites", format!("{suites}SHA-256 {}", result.suites_sha256)),
        ("Run", result.run.clone()),
    ]);
    if let Some(shard) = &result.shard {
        rows.push(("Part", format!("{} of {} ({})", shard.index, shard.of, shard.origin)));
    }
    rows
}

/// `2026-01-31 12:00:00 UTC`; as it stands there when it is no time.
pub fn started(text: &str) -> String {
    text.parse::<jiff::Timestamp>().map_or_else(
        |_| text.to_owned(),
        |started| started.strftime("%Y-%m-%d %H:%M:%S UTC").to_string(),
    )
}

/// One of the parts that were joined.
pub struct PartRow {
    pub number: String,
    pub badge: Badge,
    pub run: String,
    pub device: String,
    pub began: String,
    pub tests: usize,
    /// Where its evidence is, and its hash.
    pub journal: String,
    pub sha256: String,
}

/// The parts that were joined.
pub fn parts(result: &RunResult) -> Vec<PartRow> {
    let all = result.merged.iter().flat_map(|merged| &merged.parts);
    let rows = all.map(|part| PartRow {
        number: match (part.index, part.counts) {
            (0, _) => "none".to_owned(),
            (index, true) => index.to_string(),
            (index, false) => format!("{index}, not joined"),
        },
        badge: Badge::of(part.verdict),
        run: part.run.clone(),
        device: part.serial_number.clone(),
        began: started(&part.started),
        tests: part.tests.len(),
        journal: format!("{}/{}", part.bundle, part.journal),
        sha256: part.journal_sha256.clone(),
    });
    rows.collect()
}

/// `part 1` or `parts 1, 3`: in which of the parts that were joined a requirement was decided.
pub fn in_parts(requirement: &RequirementResult) -> Option<String> {
    let numbers: Vec<String> = requirement.shards.iter().map(ToString::to_string).collect();
    match numbers.as_slice() {
        [] => None,
        [one] => Some(format!("in part {one}")),
        all => Some(format!("in parts {}", all.join(", "))),
    }
}

/// One row of the numbers at the top, with its bar.
pub struct CountRow {
    pub name: &'static str,
    pub total: usize,
    /// How many have which badge, best verdict first.
    pub cells: Vec<(Badge, usize)>,
}

impl CountRow {
    fn of(name: &'static str, badges: impl Iterator<Item = Badge>, without: &[Badge]) -> Self {
        let verdicts = Verdict::ALL.iter().map(|verdict| Badge::of(Some(*verdict)));
        let mut cells: Vec<(Badge, usize)> = verdicts
            .chain(without.iter().copied())
            .map(|badge| (badge, 0))
            .collect();
        let mut total = 0;
        for badge in badges {
            total += 1;
            for cell in cells.iter_mut().filter(|cell| cell.0 == badge) {
                cell.1 += 1;
            }
        }
        Self { name, total, cells }
    }
}

/// Tests, monitors and requirements by verdict.
pub fn counts(result: &RunResult) -> Vec<CountRow> {
    let requirements = result.requirements.iter().map(Badge::of_requirement);
    let tests = result.tests.iter().map(|test| match statement::test_verdict(test) {
        None => Badge::NOT_APPLICABLE,
        verdict => Badge::of(verdict),
    });
    let monitors = result.monitors.iter().map(|monitor| match monitor.verdict {
        None => Badge::NOTHING_TO_JUDGE,
        verdict => Badge::of(verdict),
    });
    let gaps = [Badge::NOT_DECIDED, Badge::NOT_TESTABLE, Badge::NOT_APPLICABLE];
    vec![
        CountRow::of("Requirements", requirements, &gaps),
        CountRow::of("Tests", tests, &[Badge::NOT_APPLICABLE]),
        CountRow::of("Monitors", monitors, &[Badge::NOTHING_TO_JUDGE]),
    ]
}

/// One monitor.
pub struct MonitorView {
    pub anchor: String,
    pub badge: Badge,
    pub id: String,
    pub title: String,
    pub why: String,
    pub judged: u64,
    pub findings: Vec<FindingView>,
}

/// One finding of a monitor.
pub struct FindingView {
    pub badge: Badge,
    pub requirement: String,
    pub link: Option<String>,
    pub count: u64,
    /// Number, and whether the page shows it.
    pub first: Vec<(u64, bool)>,
    pub message: String,
    pub interpretation: Option<String>,
}

pub fn monitors(
    result: &RunResult,
    sources: &Sources,
    anchors: &Anchors,
    gallery: &mut Gallery<'_>,
) -> Vec<MonitorView> {
    result
        .monitors
        .iter()
        .enumerate()
        .map(|(at, monitor)| MonitorView {
            anchor: format!("monitor-{}", at + 1),
            badge: match monitor.verdict {
                None => Badge::NOTHING_TO_JUDGE,
                verdict => Badge::of(verdict),
            },
            id: monitor.id.clone(),
            title: monitor.title.clone(),
            why: sources
                .monitor(&monitor.id)
                .map(|source| source.why.clone())
                .unwrap_or_default(),
            judged: monitor.judged,
            findings: monitor
                .findings
                .iter()
                .map(|finding| {
                    for seq in finding.first.iter().take(OCCURRENCES) {
                        gallery.show(*seq, finding.verdict.word(), &[]);
                    }
                    FindingView {
                        badge: Badge::of(Some(finding.verdict)),
                        link: anchors.requirement(&finding.requirement),
                        requirement: finding.requirement.clone(),
                        count: finding.count,
                        first: finding
                            .first
                            .iter()
                            .take(10)
                            .map(|seq| (*seq, gallery.shows(*seq)))
                            .collect(),
                        message: finding.message.clone(),
                        interpretation: finding.interpretation.clone(),
                    }
                })
                .collect(),
        })
        .collect()
}

/// A declared deviation and what became of its requirement.
pub struct Deviation {
    pub requirement: String,
    pub link: Option<String>,
    pub reason: String,
    pub badge: Badge,
}

pub fn deviations(result: &RunResult, anchors: &Anchors) -> Vec<Deviation> {
    result
        .deviations
        .iter()
        .map(|(id, reason)| {
            let verdict = result.requirements.iter().find(|requirement| requirement.id == *id);
            Deviation {
                requirement: id.clone(),
                link: anchors.requirement(id),
                reason: reason.clone(),
                badge: Badge::of(verdict.and_then(|requirement| requirement.verdict)),
            }
        })
        .collect()
}

/// A verdict and its definition.
pub struct LegendRow {
    pub badge: Badge,
    pub meaning: &'static str,
}

pub fn legend() -> Vec<LegendRow> {
    let row = |badge, meaning| LegendRow { badge, meaning };
    let verdict = |verdict, meaning| row(Badge::of(Some(verdict)), meaning);
    vec![
        verdict(
            Verdict::Pass,
            "The obligation was seen to be met, every time it was looked at.",
        ),
        verdict(
            Verdict::Warning,
            "A recommendation (should) was not followed, or a ruling of the catalogue asks for a remark. Conformance is not affected.",
        ),
        verdict(
            Verdict::Inconclusive,
            "The precondition was not reached, or the fact could not be observed from where the harness stood. It says nothing for or against the device.",
        ),
        verdict(
            Verdict::Error,
            "The harness, its broker, a suite or the host broke. It says nothing about the device.",
        ),
        verdict(
            Verdict::Fail,
            "A binding obligation (shall) was seen to be broken. It stands on its evidence; nothing that came later can lift it.",
        ),
        row(
            Badge::NOT_APPLICABLE,
            "The device declares that it lacks what the obligation is about, so there is nothing to test.",
        ),
        row(
            Badge::NOT_TESTABLE,
            "The catalogue gives a reason why no test can decide it from outside.",
        ),
        row(
            Badge::NOT_DECIDED,
            "Nothing in this run decided it. This is a gap, not a pass.",
        ),
    ]
}

/// One vehicle of a fleet.
pub struct VehicleRow {
    pub serial_number: String,
    pub orders: usize,
    pub median: String,
    pub longest: String,
}

/// The vehicles of a fleet: those without an order first, then by their longest wait.
pub fn vehicles(fleet: &FleetResult) -> Vec<VehicleRow> {
    let mut each: Vec<_> = fleet.each.iter().collect();
    each.sort_by(|one, other| {
        let waits = |vehicle: &CommandedVehicle| vehicle.longest.unwrap_or(f64::MAX);
        waits(other).total_cmp(&waits(one))
    });
    let time = |millis: Option<f64>| millis.map_or_else(|| "–".to_owned(), crate::fleet::millis);
    let rows = each.into_iter().map(|vehicle| VehicleRow {
        serial_number: vehicle.serial_number.clone(),
        orders: vehicle.orders,
        median: time(vehicle.median),
        longest: time(vehicle.longest),
    });
    rows.collect()
}
