//! One world for each vehicle: all facts, learned of each record once, before anybody judges it.

use std::cell::RefCell;
use std::rc::Rc;

use crate::displaced::Displaced;
use crate::factsheets::Factsheets;
use crate::fleet::FleetSeen;
use crate::instant::InstantActionsSent;
use crate::malformed::MalformedOrders;
use crate::mock::MockVehicle;
use crate::observation::Observation;
use crate::orders::OrdersSent;
use crate::restarts::Restarts;
use crate::setting::Setting;
use crate::shown::ShownOrder;
use crate::starts::Starts;
use crate::way::Way;
use crate::zones::ZonesSeen;

/// A fact of the world, by name: what somebody reads says so, and nothing else is learned.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fact {
    /// [`World::restarts`].
    Restarts,
    /// [`World::displaced`].
    Displaced,
    /// [`World::orders`].
    Orders,
    /// [`World::malformed`].
    Malformed,
    /// [`World::instant`].
    Instant,
    /// [`World::shown`].
    Shown,
    /// [`World::way`].
    Way,
    /// [`World::mock`].
    Mock,
    /// [`World::factsheets`].
    Factsheets,
    /// [`World::starts`].
    Starts,
    /// [`World::zones`].
    Zones,
}

impl Fact {
    /// The facts that are learned from this one.
    const fn rests_on(self) -> &'static [Self] {
        match self {
            Self::Displaced => &[Self::Restarts],
            Self::Malformed => &[Self::Orders],
            Self::Way => &[Self::Orders, Self::Shown],
            Self::Starts => &[Self::Mock],
            _ => &[],
        }
    }
}

/// A set of facts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Facts(u32);

impl Facts {
    fn add(&mut self, fact: Fact) {
        self.0 |= 1 << fact as u32;
        for other in fact.rests_on() {
            self.add(*other);
        }
    }

    const fn has(self, fact: Fact) -> bool {
        self.0 & (1 << fact as u32) != 0
    }
}

/// What is known of one vehicle.
///
/// There is one world for the monitors of a vehicle. A check in a test has a world of its own, which knows what the test has
/// shown.
#[derive(Debug, Default)]
pub struct World {
    learned: Facts,
    restarts: Restarts,
    displaced: Displaced,
    orders: OrdersSent,
    malformed: MalformedOrders,
    instant: InstantActionsSent,
    shown: ShownOrder,
    way: Way,
    mock: MockVehicle,
    factsheets: Factsheets,
    starts: Starts,
    zones: ZonesSeen,
    fleet: Rc<RefCell<FleetSeen>>,
}

impl World {
    /// A world of which nothing is read yet, of one vehicle of a fleet.
    #[must_use]
    pub fn of_fleet(fleet: &Rc<RefCell<FleetSeen>>) -> Self {
        Self {
            fleet: Rc::clone(fleet),
            ..Self::default()
        }
    }

    /// From now on these facts are read. It has to be said before the first record.
    pub fn reads(&mut self, facts: &[Fact]) {
        for fact in facts {
            self.learned.add(*fact);
        }
    }

    /// Learns from the next record.
    pub fn learn(&mut self, record: &Observation<'_>, setting: &Setting<'_>) {
        let learns = |fact: Fact| self.learned.has(fact);
        if learns(Fact::Restarts) {
            self.restarts.learn(record);
        }
        if learns(Fact::Displaced) {
            self.displaced.learn(record, &self.restarts);
        }
        if learns(Fact::Orders) {
            self.orders.learn(record);
        }
        if learns(Fact::Malformed) {
            self.malformed.learn(record, setting, &self.orders);
        }
        if learns(Fact::Instant) {
            self.instant.learn(record, setting);
        }
        if learns(Fact::Shown) {
            self.shown.learn(record);
        }
        if learns(Fact::Way) {
            self.way.learn(record, &self.shown, &self.orders);
        }
        if learns(Fact::Mock) {
            self.mock.learn(record, setting);
        }
        if learns(Fact::Factsheets) {
            self.factsheets.learn(record, setting);
        }
        if learns(Fact::Starts) {
            self.starts.learn(record, &self.mock);
        }
        if learns(Fact::Zones) {
            self.zones.learn(record);
        }
    }

    /// Whoever reads a fact has said so before: nothing is known otherwise.
    fn read<'w, F>(&self, fact: Fact, known: &'w F) -> &'w F {
        debug_assert!(self.learned.has(fact), "{fact:?} is read, and nobody has said so");
        known
    }

    /// Whether the vehicle may have been restarted.
    #[must_use]
    pub fn restarts(&self) -> &Restarts {
        self.read(Fact::Restarts, &self.restarts)
    }

    /// Whether something else than driving may have changed its position.
    #[must_use]
    pub fn displaced(&self) -> &Displaced {
        self.read(Fact::Displaced, &self.displaced)
    }

    /// The orders that were sent to it.
    #[must_use]
    pub fn orders(&self) -> &OrdersSent {
        self.read(Fact::Orders, &self.orders)
    }

    /// Those of them that no vehicle should take over.
    #[must_use]
    pub fn malformed(&self) -> &MalformedOrders {
        self.read(Fact::Malformed, &self.malformed)
    }

    /// The instant actions that are sent to it.
    #[must_use]
    pub fn instant(&self) -> &InstantActionsSent {
        self.read(Fact::Instant, &self.instant)
    }

    /// The order its states show.
    #[must_use]
    pub fn shown(&self) -> &ShownOrder {
        self.read(Fact::Shown, &self.shown)
    }

    /// Where it is on its way.
    #[must_use]
    pub fn way(&self) -> &Way {
        self.read(Fact::Way, &self.way)
    }

    /// What a mock vehicle showed, and what was done to it.
    #[must_use]
    pub fn mock(&self) -> &MockVehicle {
        self.read(Fact::Mock, &self.mock)
    }

    /// The factsheets its master control may go by.
    #[must_use]
    pub fn factsheets(&self) -> &Factsheets {
        self.read(Fact::Factsheets, &self.factsheets)
    }

    /// The orders its master control has begun.
    #[must_use]
    pub fn starts(&self) -> &Starts {
        self.read(Fact::Starts, &self.starts)
    }

    /// The zones that hold for it, and where it is in them.
    #[must_use]
    pub fn zones(&self) -> &ZonesSeen {
        self.read(Fact::Zones, &self.zones)
    }

    /// What came to all vehicles of its fleet; nothing for a check in a test.
    #[must_use]
    pub fn fleet(&self) -> &Rc<RefCell<FleetSeen>> {
        &self.fleet
    }
}
