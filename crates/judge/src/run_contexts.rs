//! What is known before anything happens, from the first record of a journal.

use std::collections::BTreeMap;
use std::sync::{Arc, OnceLock};

use serde_json::{Map, Value};

use super::rules::{JudgeError, Rules};
use tck_base::pattern::Bindings;
use tck_base::time::TimeLimits;
use tck_check::Check;
use tck_journal::event::{RunHeader, Waiver};
use tck_pack::{Catalogue, Hooks, Pack, Role};
use tck_view::{FactsheetView, MessageView, Topic};
use tck_world::Setting;

/// What does not change during a run.
pub struct Ground {
    /// The named checks.
    pub checks: &'static [Check],
    /// The protocol version.
    pub pack: Arc<Pack>,
    /// The requirements.
    pub catalogue: Arc<Catalogue>,
    /// Full topic by topic name.
    pub topics: BTreeMap<String, String>,
    /// The side under test.
    pub role: Role,
    /// Manufacturer and serial number; of the vehicle that is commanded, when a master control is tested.
    pub identity: (String, String),
    /// `time`, `device`.
    pub bindings: Arc<Map<String, Value>>,
    /// The factsheet among them, once it was asked for.
    factsheet: OnceLock<Option<Arc<FactsheetView>>>,
    /// The limits among them.
    pub time: TimeLimits,
    /// What can be done to the device, and what follows from it.
    pub hooks: Arc<Hooks>,
    /// Lasting mistakes of the vehicle that do not stand in the way any more.
    pub waivers: Vec<Waiver>,
    /// Why what is found at present may stem from somebody else: one on the tap, or who has interrupted the run.
    pub interference: Option<Arc<str>>,
    /// Whether the run was interrupted. Then nothing is held against the device any more, not even as a remark.
    pub is_interrupted: bool,
}

impl Ground {
    /// The factsheet of the device, where the run knows it, as it was published.
    #[must_use]
    pub fn factsheet_json(&self) -> Option<&Value> {
        self.bindings.get("device")?.get("factsheet")
    }

    /// The factsheet of the device, where the run knows it.
    #[must_use]
    pub fn factsheet(&self) -> Option<Arc<FactsheetView>> {
        let read = || {
            let message = MessageView::of_value(Topic::Factsheet, self.factsheet_json()?, self.pack.names());
            message.factsheet().map(Arc::clone)
        };
        self.factsheet.get_or_init(read).clone()
    }

    /// A variable gets its value for the whole run.
    pub(super) fn set(&mut self, name: &str, value: Value) {
        let mut bindings = Bindings::above(vec![Arc::clone(&self.bindings)]);
        bindings.set(name, value);
        self.bindings = Arc::new(bindings.to_map());
        self.factsheet = OnceLock::new();
        self.time = TimeLimits::of_bindings(&self.bindings);
    }

    /// What monitors and facts may know besides the records.
    pub(super) fn setting(&self) -> Setting<'_> {
        Setting {
            pack: &self.pack,
            topics: &self.topics,
            role: self.role,
            identity: (&self.identity.0, &self.identity.1),
            bindings: &self.bindings,
            time: &self.time,
            hooks: &self.hooks,
        }
    }
}

/// What every judge of a run stands on.
pub(super) struct RunContexts {
    /// The side under test.
    pub role: Role,
    /// Of the device; of the first vehicle, when a master control is tested.
    pub ground: Ground,
    /// Of further vehicles.
    pub vehicles: Vec<Ground>,
}

impl RunContexts {
    /// Reads a header.
    pub fn of(rules: &Rules, header: &RunHeader) -> Result<Self, JudgeError> {
        let pack_of = |version: &String| {
            let pack = rules.packs.get(version);
            pack.ok_or_else(|| JudgeError::Version(version.clone()))
        };
        let pack = pack_of(&header.protocol)?;
        let role = [Role::Agv, Role::MasterControl]
            .into_iter()
            .find(|role| role.word() == header.role)
            .ok_or_else(|| JudgeError::Role(header.role.clone()))?;
        let bindings = Arc::new(header.bindings.clone());
        let ground_of = |pack: &Arc<Pack>, topics: &BTreeMap<String, String>, identity: (&String, &String)| Ground {
            checks: rules.checks,
            pack: Arc::clone(pack),
            catalogue: Arc::clone(&rules.catalogue),
            topics: topics.clone(),
            role,
            identity: (identity.0.clone(), identity.1.clone()),
            bindings: Arc::clone(&bindings),
            factsheet: OnceLock::new(),
            time: TimeLimits::of_bindings(&bindings),
            hooks: Arc::clone(&rules.hooks),
            waivers: Vec::new(),
            interference: None,
            is_interrupted: false,
        };
        // What a master control sends names the vehicle it is for.
        let mut vehicles = Vec::with_capacity(header.vehicles.len());
        for vehicle in &header.vehicles {
            let own = vehicle.protocol.as_ref().map_or(Ok(pack), pack_of)?;
            let identity = (&vehicle.manufacturer, &vehicle.serial_number);
            vehicles.push(ground_of(own, &vehicle.topics, identity));
        }
        let mut vehicles = vehicles.into_iter();
        let device = (&header.manufacturer, &header.serial_number);
        let ground = vehicles
            .next()
            .unwrap_or_else(|| ground_of(pack, &header.topics, device));
        Ok(Self {
            role,
            ground,
            vehicles: vehicles.collect(),
        })
    }
}
