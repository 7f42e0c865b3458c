//! The kind `profibus-device`, for the list of bus kinds.

use tickbus_axis::Axis;
use tickbus_base::toml_text::{Collector, Table};
use tickbus_fieldbus::{Bus, BusKind, BusOptions, BusSetup, OpenError, Role};
use tickbus_image::signal::SignalTable;

use crate::device::ProfibusDevice;
use crate::options::Options;

impl BusKind for Options {
    const NAME: &'static str = "profibus-device";

    fn read(role: Role, _moved: bool, table: Table<'_>) -> Option<Self> {
        Self::read(role, table)
    }
}

impl BusOptions for Options {
    fn events(&self) -> bool {
        self.events
    }

    fn summary(&self, _role: Role, _table: &SignalTable) -> Vec<String> {
        self.shown()
    }

    fn open(&self, setup: &BusSetup<'_>) -> Result<Bus, OpenError> {
        let identities = self.identities(setup.folder, setup.table)?;
        Ok(Bus::Free(Box::new(ProfibusDevice::new(self, identities))))
    }

    fn read_station(&mut self, _count: usize, table: &mut Table<'_>) {
        self.read_station(table);
    }

    fn fit(&self, table: &SignalTable, _axes: &[Axis], collector: &Collector<'_>) {
        self.fit(table, collector);
    }
}
