//! `--vehicle`: the kinds of reference AGVs as words of the command line.

use clap::ValueEnum;
use clap::builder::PossibleValue;

use tck_simulate::Vehicle;

/// A kind of reference AGV.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct VehicleKind(pub Vehicle);

impl ValueEnum for VehicleKind {
    fn value_variants<'a>() -> &'a [Self] {
        const ALL: [VehicleKind; Vehicle::ALL.len()] = {
            let mut all = [VehicleKind(Vehicle::Usual); Vehicle::ALL.len()];
            let mut at = 0;
            while at < all.len() {
                all[at] = VehicleKind(Vehicle::ALL[at]);
                at += 1;
            }
            all
        };
        &ALL
    }

    fn to_possible_value(&self) -> Option<PossibleValue> {
        let (name, what) = self.0.named();
        Some(PossibleValue::new(name).help(what))
    }
}
