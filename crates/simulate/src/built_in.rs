//! The built-in devices under test, as a run needs to know them.

use std::collections::BTreeMap;

use serde_json::{Map, Value};

use super::driver::RunningDevice;
use super::fleet::Fleet;
use super::reference_agv::ReferenceAgv;
use super::reference_master_control::ReferenceMasterControl;
use super::unknown_name::UnknownName;
use tck_base::clock::WallClock;
use tck_base::device::Device;
use tck_course::Layout;
use tck_net::bench::endpoint::Endpoint;
use tck_pack::Participant;
use tck_pack::Role;
use tck_profile::TimeLimits;
use tck_reference::Fault;
use tck_reference::deviations::agv::Tolerance;
use tck_reference::deviations::{agv as vehicles, master_control as deviations};

/// A built-in device under test.
#[derive(Clone, Debug)]
#[expect(clippy::large_enum_variant, reason = "there are a few of them in a process")]
pub enum BuiltIn {
    /// The reference AGV.
    Agv(ReferenceAgv),
    /// The reference master control, with the mock AGVs it commands.
    MasterControl(ReferenceMasterControl),
}

impl From<ReferenceAgv> for BuiltIn {
    fn from(device: ReferenceAgv) -> Self {
        Self::Agv(device)
    }
}

impl From<ReferenceMasterControl> for BuiltIn {
    fn from(device: ReferenceMasterControl) -> Self {
        Self::MasterControl(device)
    }
}

impl BuiltIn {
    /// Which side it is.
    #[must_use]
    pub fn role(&self) -> Role {
        self.subject().role
    }

    /// Who it says it is.
    #[must_use]
    pub fn subject(&self) -> &Participant {
        match self {
            Self::Agv(device) => &device.subject,
            Self::MasterControl(device) => &device.subject,
        }
    }

    /// The floor.
    #[must_use]
    pub fn layout(&self) -> &Layout {
        match self {
            Self::Agv(device) => &device.layout,
            Self::MasterControl(device) => &device.layout,
        }
    }

    /// Its part of the timing contract.
    #[must_use]
    pub fn time(&self) -> &TimeLimits {
        match self {
            Self::Agv(device) => &device.time,
            Self::MasterControl(device) => &device.time,
        }
    }

    /// The mock AGVs it is tested with.
    #[must_use]
    pub fn fleet(&self) -> Option<&Fleet> {
        match self {
            Self::Agv(_) => None,
            Self::MasterControl(device) => Some(&device.fleet),
        }
    }

    /// `device.*` beside identity and factsheet.
    #[must_use]
    pub fn device_bindings(&self) -> Map<String, Value> {
        match self {
            Self::Agv(device) => device.device_bindings(),
            Self::MasterControl(device) => device.device_bindings(),
        }
    }

    /// What a profile would state about it.
    #[must_use]
    pub fn statements(&self) -> BTreeMap<String, bool> {
        match self {
            Self::Agv(device) => device.statements(),
            Self::MasterControl(device) => device.statements(),
        }
    }

    /// The hooks it understands as commands.
    #[must_use]
    pub fn hooks(&self) -> &'static [&'static str] {
        match self {
            Self::Agv(_) => ReferenceAgv::HOOKS,
            Self::MasterControl(_) => ReferenceMasterControl::HOOKS,
        }
    }

    /// Its faults, and the ones that end in a warning only.
    #[must_use]
    pub fn faults(role: Role) -> &'static [Fault] {
        match role {
            Role::Agv => &vehicles::FAULTS,
            Role::MasterControl => &deviations::FAULTS,
        }
    }

    /// The liberties it can take.
    #[must_use]
    pub fn tolerances(role: Role) -> &'static [Tolerance] {
        match role {
            Role::Agv => &vehicles::TOLERANCES,
            Role::MasterControl => &deviations::TOLERANCES,
        }
    }

    /// Why a fault ends in less than a failure.
    #[must_use]
    pub fn lapse(role: Role, fault: &str) -> Option<&'static str> {
        match role {
            Role::Agv => vehicles::lapse(fault),
            Role::MasterControl => deviations::lapse(fault),
        }
    }

    /// Every kind of the device of this role that tests are proven with.
    #[must_use]
    pub fn variants(role: Role, pack: &tck_pack::Pack) -> Vec<Self> {
        match role {
            Role::Agv => ReferenceAgv::variants(pack).into_iter().map(Self::Agv).collect(),
            Role::MasterControl => vec![Self::MasterControl(ReferenceMasterControl::new(pack))],
        }
    }

    /// Lets it take a liberty, and gives it the time it then needs.
    ///
    /// # Errors
    /// When there is none of that name.
    pub fn tolerate(&mut self, name: &str) -> Result<(), UnknownName> {
        match self {
            Self::Agv(device) => device
                .tolerate(name)
                .map_err(|unknown| UnknownName(unknown.to_string())),
            Self::MasterControl(device) => device.tolerate(name),
        }
    }

    /// In a hurry, for runs over real sockets.
    pub fn hurry(&mut self) {
        match self {
            Self::Agv(device) => device.hurry(),
            Self::MasterControl(device) => device.hurry(),
        }
    }

    /// What restricts the statement about it, in one sentence.
    #[must_use]
    pub fn limit(&self, in_virtual_time: bool) -> String {
        let what = match self {
            Self::Agv(_) => "reference AGV",
            Self::MasterControl(_) => "reference master control",
        };
        let how = if in_virtual_time { ", run in virtual time" } else { "" };
        format!("The device is the built-in {what}{how}.")
    }

    /// The device itself, with these faults, for a bench in memory.
    ///
    /// # Errors
    /// When there is no fault of such a name.
    pub fn peer(&self, faults: &[&str]) -> Result<Box<dyn Device>, UnknownName> {
        Ok(match self {
            Self::Agv(device) => {
                let agv = vehicles::built(device.config.clone(), faults);
                Box::new(agv.map_err(|unknown| UnknownName(unknown.to_string()))?)
            }
            Self::MasterControl(device) => {
                let master_control = deviations::built(device.config.clone(), &device.liberties, faults);
                Box::new(master_control.map_err(|unknown| UnknownName(unknown.to_string()))?)
            }
        })
    }

    /// Starts the device with these faults against a real broker or tap.
    ///
    /// # Errors
    /// When there is no fault of such a name.
    pub fn start(&self, faults: &[&str], endpoint: Endpoint, clock: WallClock) -> Result<RunningDevice, UnknownName> {
        Ok(match self {
            Self::Agv(device) => {
                let agv = vehicles::built(device.config.clone(), faults);
                let agv = agv.map_err(|unknown| UnknownName(unknown.to_string()))?;
                RunningDevice::start(agv, endpoint, clock, None)
            }
            Self::MasterControl(device) => {
                let master_control = deviations::built(device.config.clone(), &device.liberties, faults);
                let master_control = master_control.map_err(|unknown| UnknownName(unknown.to_string()))?;
                RunningDevice::start(master_control, endpoint, clock, None)
            }
        })
    }

    /// The mock AGVs, for a bench in memory.
    pub fn mock_peers(&self) -> impl Iterator<Item = Box<dyn Device>> {
        let vehicles = self.fleet().into_iter().flat_map(|fleet| &fleet.vehicles);
        vehicles.map(|vehicle| Box::new(vehicles::mock(vehicle.config.clone())) as Box<dyn Device>)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_hook_of_a_built_in_device_is_one_of_the_suites_and_named_once() {
        let hooks = &tck_testing::library().rules.hooks;
        for (role, names) in [
            (Role::Agv, ReferenceAgv::HOOKS),
            (Role::MasterControl, ReferenceMasterControl::HOOKS),
        ] {
            for (at, name) in names.iter().enumerate() {
                assert!(hooks.find(name, role).is_some(), "{role}: {name}");
                assert!(!names[..at].contains(name), "{role}: {name}");
            }
        }
    }
}
