//! The kind `interbus-ddi`, for the list of bus kinds.

use tickbus_base::time::Nanos;
use tickbus_base::toml_text::{Key, Table};
use tickbus_fieldbus::{
    Bus, BusKind, BusOptions, BusSetup, CYCLE, CardBus, CardOptions, NamedFile, OpenError, Role,
};
use tickbus_image::signal::SignalTable;

use super::card::Ddi;
use super::options::{self, LIBRARY, Options};

impl BusKind for Options {
    const NAME: &'static str = "interbus-ddi";
    const KEYS: &'static [&'static [Key]] = &[options::KEYS, CardOptions::KEYS];

    fn read(_role: Role, _moved: bool, table: &mut Table<'_>) -> Option<Self> {
        Self::read(table)
    }
}

impl BusOptions for Options {
    fn summary(&self, _role: Role, _table: &SignalTable) -> Vec<String> {
        let mut parts = vec![format!("device {}", self.device)];
        parts.extend(self.card.summary());
        let service = self.activate;
        parts.extend(service.map(|service| format!("activates by service {service:04X}")));
        parts
    }

    fn files(&self) -> Vec<NamedFile> {
        Vec::new()
    }

    fn open(&self, setup: &BusSetup<'_>) -> Result<Bus, OpenError> {
        let path = (self.card).library(LIBRARY.unwrap_or_default(), setup.folder)?;
        let driver = Ddi(self.clone());
        Ok(Bus::Free(Box::new(CardBus::new(driver, path, setup))))
    }

    fn cycle(&self) -> Option<Nanos> {
        Some(CYCLE)
    }
}
