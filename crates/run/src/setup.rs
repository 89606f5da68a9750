//! The one assembly of a run: what is known of the device beforehand, from a profile or because it is built in, and what
//! follows from it for the first record and the course of the run, over sockets and in virtual time alike.

use std::collections::BTreeMap;
use std::sync::Arc;

use bytes::Bytes;
use serde_json::{Map, Value};

use super::capabilities::Capabilities;
use super::claims::{claims, statements};
use super::header::HeaderParts;
use super::request::Request;
use super::session::Setup;
use tck_base::diagnostic::Diagnostic;
use tck_course::Layout;
use tck_journal::event::{RunHeader, Setting};
use tck_journal::{Reason, Vantage};
use tck_judge::Library;
use tck_pack::Participant;
use tck_pack::{Pack, Packs, Role};
use tck_profile::{Effective, Profile, TimeLimits};
use tck_simulate::BuiltIn;
use tck_simulate::Fleet;
use tck_simulate::{ReferenceAgv, serial_number};

/// What is known of the device under test before it is there.
#[derive(Clone, Debug)]
pub struct DeviceUnderTest {
    /// Who it says it is.
    pub subject: Participant,
    /// The timing contract.
    pub time: TimeLimits,
    /// `device.*` beside identity and factsheet.
    pub bindings: Map<String, Value>,
    /// What it is like, by the words of a profile.
    pub statements: BTreeMap<String, bool>,
    /// What it can do beside its factsheet, or against it.
    pub claims: BTreeMap<String, bool>,
    /// Whether a claim may add to a factsheet that says otherwise. Not for a certificate.
    pub claims_add: bool,
    /// Whether a vehicle under test may drive; `Err` says why not.
    pub motion: Result<(), Reason>,
    /// Where it may drive.
    pub layout: Option<Layout>,
    /// The mock AGVs it is tested with, when it is a master control.
    pub fleet: Option<Fleet>,
    /// Map files it can read; `Err` says why none is known.
    pub maps: Result<Vec<Bytes>, Reason>,
    /// Deviations it declares: requirement id to reason.
    pub deviations: BTreeMap<String, String>,
    /// What restricts the statement from the start, one sentence each.
    pub limits: Vec<String>,
    /// Effective settings, for the record.
    pub settings: Vec<Setting>,
    /// SHA-256 of the files that make it what it is, by name.
    pub files: BTreeMap<String, String>,
}

impl DeviceUnderTest {
    /// A built-in device. It reads whatever it is served as a map.
    #[must_use]
    pub fn built_in(device: &BuiltIn, in_virtual_time: bool) -> Self {
        Self {
            subject: device.subject().clone(),
            time: device.time().clone(),
            bindings: device.device_bindings(),
            statements: device.statements(),
            claims: BTreeMap::new(),
            claims_add: true,
            motion: Ok(()),
            layout: Some(device.layout().clone()),
            fleet: device.fleet().cloned(),
            maps: Ok(Vec::new()),
            deviations: BTreeMap::new(),
            limits: vec![device.limit(in_virtual_time)],
            settings: Vec::new(),
            files: BTreeMap::new(),
        }
    }

    /// The device of a profile. A master control gets at least so many mock AGVs, and those of the profile, which are all when
    /// nothing is said.
    ///
    /// # Errors
    /// What the profile lacks, or a file that it names and that cannot be read.
    pub fn of_profile(
        effective: &Effective,
        packs: &Packs,
        pack: &Pack,
        vehicles: Option<usize>,
    ) -> Result<Self, Vec<Diagnostic>> {
        let profile = &effective.profile;
        let device = &profile.device;
        let subject = subject(profile)?;
        let layout = Layout::of_profile(profile)?.map(|layout| match subject.role {
            Role::Agv => layout,
            Role::MasterControl => layout.commanded_by_another(),
        });
        let fleet = match subject.role {
            Role::Agv => None,
            Role::MasterControl => {
                // A vehicle that the profile does not name is none of the site's.
                let mut fleet = fleet(profile, layout.as_ref(), vehicles.unwrap_or_default(), pack);
                join_others(&mut fleet, profile, layout.as_ref(), (packs, pack))?;
                Some(fleet)
            }
        };
        let motion = if fleet.is_some() || profile.motion.allowed {
            // The vehicles of a fleet are the harness's own.
            Ok(())
        } else {
            Err(Reason::MotionNotAllowed)
        };
        let deviations = profile.deviations.iter();
        Ok(Self {
            time: profile.time.clone(),
            bindings: device.bindings(),
            statements: statements(device),
            claims: claims(device),
            claims_add: true,
            motion,
            layout: layout.or_else(|| fleet.is_some().then(Layout::built_in)),
            maps: map_files(effective, fleet.is_some())?,
            deviations: deviations
                .map(|deviation| (deviation.requirement.as_str().to_owned(), deviation.reason.clone()))
                .collect(),
            limits: profile.time.contract().iter().map(ToString::to_string).collect(),
            settings: effective.settings.clone(),
            files: BTreeMap::new(),
            subject,
            fleet,
        })
    }

    /// Rules motion out. The mock AGVs of a fleet are the harness's own, and go on driving.
    pub fn stand_still(&mut self, why: Reason) {
        if self.fleet.is_none() {
            self.motion = Err(why);
        }
    }

    /// The topics that this side publishes.
    #[must_use]
    pub fn published(&self, pack: &Pack) -> Vec<String> {
        match &self.fleet {
            Some(fleet) => fleet.commanded(),
            None => self.subject.published(pack),
        }
    }

    /// The topics that the harness publishes: those of the other side.
    #[must_use]
    pub fn told(&self, pack: &Pack) -> Vec<String> {
        match &self.fleet {
            Some(fleet) => fleet.published(),
            None => {
                let other_side = Participant {
                    role: Role::MasterControl,
                    ..self.subject.clone()
                };
                other_side.published(pack)
            }
        }
    }

    /// The first record of the run, and its set-up, on a bench that can do so much.
    #[must_use]
    pub fn on(self, bench: BenchFacts, request: Request, library: &Library, pack: &Pack) -> (RunHeader, Setup) {
        let mocks = self
            .fleet
            .as_ref()
            .map_or_else(Vec::new, |fleet| fleet.mock_vehicles(pack));
        let vehicles = mocks.len();
        let header = HeaderParts {
            subject: &self.subject,
            pack,
            run: &request.run,
            certifies: request.certifies,
            vantage: bench.vantage,
            suites: &library.rules.sha256,
            modified: library.assets.modified(),
            time: self.time.bindings(),
            device: self.bindings.clone(),
            vehicles: mocks,
            fleet: self.fleet.as_ref().map_or_else(Vec::new, Fleet::bindings),
            settings: self.settings,
            files: self.files,
            shard: request.shard,
            command: request.command,
        };
        let header = header.header();
        let (map_file, maps) = match self.maps {
            Ok(files) => (Ok(()), files),
            Err(why) => (Err(why), Vec::new()),
        };
        let capabilities = Capabilities {
            factsheet: None,
            statements: self.statements,
            samples: self.bindings,
            claims: self.claims,
            vantage: bench.vantage,
            hooks: bench.hooks,
            unattended: bench.unattended,
            maps: bench.maps,
            secured_files: bench.secured_files,
            map_file,
            motion: self.motion,
            second_vehicle: vehicles > 1,
            claims_add: self.claims_add,
        };
        let setup = Setup {
            complete: request.tests.is_complete(),
            tests: request.tests.into_tests(),
            draw: request.draw,
            capabilities,
            layout: self.layout,
            vehicles,
            maps,
            deviations: self.deviations,
            limits: [self.limits, bench.limits, request.limits].concat(),
            run: request.run,
            fail_fast: request.fail_fast,
            repeat: request.repeat.max(1),
            budget: request.budget,
        };
        (header, setup)
    }
}

/// What a bench can do.
#[derive(Clone, Debug)]
pub struct BenchFacts {
    /// From where the harness sees.
    pub vantage: Vantage,
    /// Names of the hooks that can be run.
    pub hooks: Vec<String>,
    /// Names of the hooks that are prompts, where nobody can be asked.
    pub unattended: Vec<String>,
    /// Whether the device can reach the map server; `Err` says why not.
    pub maps: Result<(), Reason>,
    /// Whether files are served to it over TLS; `Err` says why not.
    pub secured_files: Result<(), Reason>,
    /// What the broker does not allow, and what cannot be said therefore.
    pub limits: Vec<String>,
}

/// The protocol version that a profile says; the latest where it says none.
///
/// # Errors
/// When there is no such version, or only its messages can be judged.
pub fn pack_of(library: &Library, effective: &Effective) -> Result<Arc<Pack>, Diagnostic> {
    let packs = &library.rules.packs;
    let Some(wanted) = &effective.profile.device.protocol else {
        return Ok(Arc::clone(packs.latest()));
    };
    packs
        .for_devices(wanted, effective.profile.device.role)
        .cloned()
        .map_err(|none| {
            let diagnostic = effective.complain("device.protocol", none.code(), none.to_string(), "this version");
            diagnostic.hint(none.hint())
        })
}

/// The names of the mock AGVs that a master control gets by a profile, where at least so many are asked for; in their order.
#[must_use]
pub fn fleet_names(profile: &Profile, vehicles: Option<usize>) -> Vec<String> {
    let wanted = &profile.vehicles;
    let own = (0..fleet_size(profile, vehicles.unwrap_or_default())).map(|before| {
        let serial = serial_number(&wanted.serial_numbers, before);
        format!("{}/{serial}", wanted.manufacturer)
    });
    let others = wanted.others.iter().flat_map(|group| {
        let serials = group.serial_numbers.iter();
        serials.map(|serial| format!("{}/{serial}", group.manufacturer))
    });
    own.chain(others).collect()
}

/// How many mock AGVs of a profile speak its version.
fn fleet_size(profile: &Profile, vehicles: usize) -> usize {
    vehicles.max(profile.vehicles.serial_numbers.len()).max(1)
}

fn subject(profile: &Profile) -> Result<Participant, Vec<Diagnostic>> {
    let missing = |setting: &str, flag: &str| {
        let title = format!("the device is not named: `{setting}` is missing");
        let hint = format!("set it in the profile, or with {flag}");
        vec![Diagnostic::whole("missing-setting", title).hint(hint)]
    };
    let device = &profile.device;
    let named = |name: &Option<String>, setting, flag| name.clone().ok_or_else(|| missing(setting, flag));
    Ok(Participant {
        role: device.role,
        manufacturer: named(&device.manufacturer, "device.manufacturer", "--manufacturer")?,
        serial_number: named(&device.serial_number, "device.serial-number", "--serial")?,
        topic_template: device.topic_template.clone(),
    })
}

/// A mock AGV on the floor of a profile.
fn mock(profile: &Profile, layout: Option<&Layout>, pack: &Pack) -> ReferenceAgv {
    let mut like = ReferenceAgv::new(pack);
    if let Some(layout) = layout {
        like.live_on(layout.clone());
    }
    like.furnish(&profile.device.sample_actions);
    like.subject.topic_template.clone_from(&profile.device.topic_template);
    like
}

/// Adds the vehicles of other makers and versions that a profile names.
fn join_others(
    fleet: &mut Fleet,
    profile: &Profile,
    layout: Option<&Layout>,
    (packs, pack): (&Packs, &Pack),
) -> Result<(), Vec<Diagnostic>> {
    for group in &profile.vehicles.others {
        let own: &Pack = match &group.protocol {
            None => pack,
            Some(version) => packs.for_devices(version, Role::MasterControl).map_err(|none| {
                let span = group.span.clone();
                let diagnostic = Diagnostic::new(none.code(), span, none.to_string(), "of these vehicles");
                vec![diagnostic.hint(none.hint())]
            })?,
        };
        let like = mock(profile, layout, own);
        let places: Vec<String> = like.places().into_iter().map(str::to_owned).collect();
        for serial in &group.serial_numbers {
            let mut vehicle = like.clone();
            let place = fleet.vehicles.len() % places.len().max(1);
            if let Some(place) = places.get(place) {
                vehicle.config.start_node.clone_from(place);
            }
            fleet.join(&vehicle, &group.manufacturer, serial, own);
        }
    }
    Ok(())
}

/// The mock AGVs of a profile that speak its version.
fn fleet(profile: &Profile, layout: Option<&Layout>, vehicles: usize, pack: &Pack) -> Fleet {
    let like = mock(profile, layout, pack);
    let wanted = &profile.vehicles;
    let count = fleet_size(profile, vehicles);
    let mut fleet = Fleet::new(&like, &wanted.manufacturer, &wanted.serial_numbers, count, pack);
    if let (Some(vehicle), Some(node)) = (fleet.vehicles.first_mut(), &wanted.start_node) {
        vehicle.config.start_node.clone_from(node);
    }
    fleet
}

/// The files of `[maps]`. A vehicle that is not ours is not judged by a file that nobody said it can read; mock AGVs
/// read any.
fn map_files(effective: &Effective, by_mock_vehicles: bool) -> Result<Result<Vec<Bytes>, Reason>, Vec<Diagnostic>> {
    let read = effective.profile.maps.iter().map(|file| {
        std::fs::read(file).map(Bytes::from).map_err(|error| {
            let title = format!("the map file {} cannot be read: {error}", file.display());
            vec![effective.complain("maps.files", "unreadable", title, "named here")]
        })
    });
    let files: Vec<Bytes> = read.collect::<Result<_, _>>()?;
    if files.is_empty() && !by_mock_vehicles {
        return Ok(Err(Reason::NoMapFile));
    }
    Ok(Ok(files))
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;
    use tck_base::clock::{Moment, Stamp};
    use tck_base::diagnostic::Source;
    use tck_journal::event::{self, Direction, Event, Record};
    use tck_journal::{Entry, Payload};
    use tck_judge::TrafficJudge;

    fn profile(others: &str) -> Effective {
        commanding("[\"a-1\", \"a-2\"]", others)
    }

    fn commanding(serials: &str, others: &str) -> Effective {
        let text = format!(
            "[device]\nrole = \"master-control\"\nmanufacturer = \"ACME\"\nserial-number = \"m\"\n\
             [vehicles]\nmanufacturer = \"ACME\"\nserial-numbers = {serials}\n{others}"
        );
        let hooks = &tck_testing::library().rules.hooks;
        tck_profile::check(&Source::new("device.toml", text), std::path::Path::new(""), hooks).expect("a profile")
    }

    const GLOBEX: &str = "[[vehicles.others]]\nmanufacturer = \"Globex\"\nserial-numbers = [\"g-7\"]\nprotocol = ";

    fn mixed() -> Vec<event::MockVehicle> {
        let packs = &tck_testing::library().rules.packs;
        let effective = profile(&format!("{GLOBEX}\"2.0\""));
        let device = DeviceUnderTest::of_profile(&effective, packs, packs.latest(), None).expect("a device");
        device.fleet.expect("a fleet").mock_vehicles(packs.latest())
    }

    #[test]
    fn a_fleet_may_be_of_several_makers_and_versions() {
        let vehicles = mixed();
        let names: Vec<_> = vehicles
            .iter()
            .map(|one| {
                (
                    one.manufacturer.as_str(),
                    one.serial_number.as_str(),
                    one.protocol.as_deref(),
                )
            })
            .collect();
        let expected = [
            ("ACME", "a-1", None),
            ("ACME", "a-2", None),
            ("Globex", "g-7", Some("2.0.0")),
        ];
        assert_eq!(names, expected);
        let packs = &tck_testing::library().rules.packs;
        let effective = profile(&format!("{GLOBEX}\"1.1\""));
        let wrong = DeviceUnderTest::of_profile(&effective, packs, packs.latest(), None);
        let wrong = wrong.expect_err("there is no pack for 1.1");
        assert!(wrong[0].title.contains("1.1") && wrong[0].span.is_some(), "{wrong:?}");
    }

    #[test]
    fn no_vehicle_is_invented_beside_the_one_that_a_profile_names() {
        let packs = &tck_testing::library().rules.packs;
        let effective = commanding("[\"a-1\"]", "");
        let count = |asked: Option<usize>| {
            let device = DeviceUnderTest::of_profile(&effective, packs, packs.latest(), asked).expect("a device");
            device.fleet.expect("a fleet").vehicles.len()
        };
        assert_eq!((count(None), count(Some(3))), (1, 3));
    }

    #[test]
    fn each_vehicle_of_a_fleet_is_spoken_to_in_its_own_version() {
        let library = tck_testing::library();
        let vehicles = mixed();
        let header = RunHeader {
            role: Role::MasterControl.word().to_owned(),
            protocol: library.rules.packs.latest().version.to_string(),
            topics: vehicles[0].topics.clone(),
            vehicles: vehicles.clone(),
            vantage: "subscriber".to_owned(),
            ..RunHeader::default()
        };
        let found = |number: usize, version: &str| -> Vec<String> {
            let at = Stamp {
                moment: Moment::START,
                utc: jiff::Timestamp::UNIX_EPOCH,
            };
            let record = |seq, event| Record {
                seq,
                at,
                source: event::Source::Link,
                direction: Some(Direction::FromDevice),
                event,
            };
            let vehicle = &vehicles[number];
            let message = json!({
                "headerId": 0, "timestamp": "2026-11-27T00:00:00.00Z", "version": version,
                "manufacturer": vehicle.manufacturer, "serialNumber": vehicle.serial_number,
            });
            let order = Event::Message {
                topic: vehicle.topics["order"].clone(),
                qos: 0,
                retain: false,
                dup: false,
                payload: Payload::keep(Bytes::from(message.to_string())),
            };
            let begun = Event::RunBegun {
                header: Box::new(header.clone()),
            };
            let only = |monitor: &tck_suite::model::Monitor| monitor.id == "header/version";
            let mut judge = TrafficJudge::begin(&library.rules, &header, &only).expect("a judge");
            judge.observe(&Entry::new(record(0, begun)));
            let found = judge.observe(&Entry::new(record(1, order))).into_iter();
            found.map(|one| one.finding.requirement).collect()
        };
        for (number, right, wrong) in [(0, "2.1.0", "2.0.0"), (2, "2.0.0", "2.1.0")] {
            assert!(found(number, right).is_empty(), "{number}");
            assert_eq!(found(number, wrong), ["HDR-04"], "{number}");
        }
    }
}
