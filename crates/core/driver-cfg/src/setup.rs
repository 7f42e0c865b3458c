//! The facts of a driver.cfg that its bus gets when it opens, or when its line is examined.

use std::sync::Arc;

use tickbus_base::time::Clock;
use tickbus_fieldbus::{BusSetup, Hosted};

use crate::Config;

impl Config {
    /// Returns what the bus of this driver gets when it opens. `hosted` is the program that runs alone at this end; `None`
    /// for a simulation.
    pub fn bus_setup<'a>(
        &'a self,
        clock: &'a Arc<dyn Clock>,
        hosted: Option<Hosted<'a>>,
    ) -> BusSetup<'a> {
        BusSetup {
            name: &self.name,
            id: self.id,
            folder: self.folder(),
            role: self.role,
            table: &self.table,
            cycle: self.timing.cycle,
            max_age: self.timing.max_age,
            events: self.events,
            clock,
            hosted,
        }
    }
}
