//! `--like`: behaving as a known product does, as far as that is permitted where a device is judged.

use super::problem::Problem;
use tck_journal::event::Setting;
use tck_pack::Role;
use tck_run::Request;
use tck_simulate::{BuiltIn, Counterpart, Fleet};

/// Name of the setting of a run, in its report.
const SETTING: &str = "counterpart";

/// The counterpart of this name, which is to be of this side.
pub(super) fn named(name: Option<&str>, role: Role) -> Result<Option<Counterpart>, Problem> {
    let Some(name) = name else { return Ok(None) };
    let known = crate::assets::counterparts()?;
    Ok(Some(known.find(name, role)?.clone()))
}

/// Names that were asked for, and those of the habits of a counterpart.
pub(super) fn joined(
    asked: &[String],
    like: Option<&Counterpart>,
    of: fn(&Counterpart) -> Vec<&'static str>,
) -> Vec<String> {
    let habits = like.map(of).unwrap_or_default();
    let mut all = asked.to_vec();
    for habit in habits {
        if !all.iter().any(|name| name == habit) {
            all.push(habit.to_owned());
        }
    }
    all
}

/// How the harness of a run behaves: as it is, or like a known product.
#[derive(Clone, Debug, Default)]
pub(super) struct Harness(Option<Counterpart>);

impl Harness {
    /// As the command line asks for, when a device of this role is tested. What the run takes of the counterpart, and that it
    /// did, is noted in the request.
    pub(super) fn of_run(
        like: Option<&str>,
        tested: Role,
        request: &mut Request,
        tell: &dyn Fn(&str),
    ) -> Result<Self, Problem> {
        let other_side = match tested {
            Role::Agv => Role::MasterControl,
            Role::MasterControl => Role::Agv,
        };
        let like = named(like, other_side)?;
        if let Some(like) = &like {
            let limit = like.limit();
            tell(&format!("{limit} `vda5050-tck list counterparts` shows its habits."));
            request.limits.push(limit);
            request.manners = like.manners();
        }
        Ok(Self(like))
    }

    /// What the record of the run says.
    pub(super) fn setting(&self) -> Option<Setting> {
        self.0.as_ref().map(|like| {
            let effect = if like.in_run().is_empty() { " (no effect)" } else { "" };
            Setting::shown(SETTING, format!("{}{effect}", like.name), "flag")
        })
    }

    /// Lets the mock vehicles behave so.
    pub(super) fn shape(&self, fleet: Option<&mut Fleet>) {
        if let (Some(like), Some(fleet)) = (&self.0, fleet) {
            for vehicle in &mut fleet.vehicles {
                like.shape(vehicle);
            }
        }
    }

    /// Lets the mock vehicles of a built-in master control behave so.
    pub(super) fn shape_built_in(&self, device: &mut BuiltIn) {
        if let BuiltIn::MasterControl(device) = device {
            self.shape(Some(&mut device.fleet));
        }
    }
}
