//! What is known before anything happens, from the first record of a journal.

use std::collections::BTreeMap;
use std::sync::Arc;

use super::rules::{JudgeError, Rules};
use super::test::Ground;
use tck_base::time::TimeLimits;
use tck_journal::event::RunHeader;
use tck_pack::Role;

/// What every judge of a run stands on.
pub(super) struct Grounds {
    /// The side under test.
    pub role: Role,
    /// Of the device; of the first vehicle, when a master control is tested.
    pub ground: Ground,
    /// Of further vehicles.
    pub vehicles: Vec<Ground>,
}

impl Grounds {
    /// Reads a header.
    pub fn of(rules: &Rules, header: &RunHeader) -> Result<Self, JudgeError> {
        let pack = rules
            .packs
            .get(&header.protocol)
            .ok_or_else(|| JudgeError::Version(header.protocol.clone()))?;
        let role = [Role::Agv, Role::MasterControl]
            .into_iter()
            .find(|role| role.word() == header.role)
            .ok_or_else(|| JudgeError::Role(header.role.clone()))?;
        let bindings = Arc::new(header.bindings.clone());
        let ground_of = |topics: &BTreeMap<String, String>, manufacturer: &str, serial_number: &str| Ground {
            checks: rules.checks,
            pack: Arc::clone(pack),
            catalogue: Arc::clone(&rules.catalogue),
            topics: topics.clone(),
            role,
            identity: (manufacturer.to_owned(), serial_number.to_owned()),
            bindings: Arc::clone(&bindings),
            time: TimeLimits::of_bindings(&bindings),
            hooks: Arc::clone(&rules.hooks),
            waivers: Vec::new(),
            interference: None,
            is_interrupted: false,
        };
        // What a master control sends names the vehicle it is for.
        let mut of_vehicles = header
            .vehicles
            .iter()
            .map(|vehicle| ground_of(&vehicle.topics, &vehicle.manufacturer, &vehicle.serial_number));
        let ground = of_vehicles
            .next()
            .unwrap_or_else(|| ground_of(&header.topics, &header.manufacturer, &header.serial_number));
        Ok(Self {
            role,
            ground,
            vehicles: of_vehicles.collect(),
        })
    }
}
