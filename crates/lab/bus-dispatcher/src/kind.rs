//! The kind `dispatcher`, for the list of bus kinds.

use std::path::Path;

use tickbus_base::Mistake;
use tickbus_base::time::Nanos;
use tickbus_base::toml_text::{Collector, Key, Table};
use tickbus_dispatcher::Kind;
use tickbus_fieldbus::examine::Examination;
use tickbus_fieldbus::{At, Bus, BusKind, BusOptions, BusSetup, CYCLE, NamedFile, OpenError, Role};
use tickbus_image::signal::{Signal, SignalTable};

use super::{DispatcherBus, Options, options};

impl BusKind for Options {
    const NAME: &'static str = "dispatcher";
    const KEYS: &'static [&'static [Key]] = &[options::KEYS];

    fn read(role: Role, moved: bool, table: &mut Table<'_>) -> Option<Self> {
        Self::read(role, moved, table)
    }
}

impl BusOptions for Options {
    fn summary(&self, _role: Role, table: &SignalTable) -> Vec<String> {
        let counts = self.channels(table).counts;
        let counts = Kind::ALL.map(|kind| format!("{}{:02}", kind.letters(), counts.of(kind)));
        let mut who = self.part().keyword().to_owned();
        if let Some(name) = &self.name {
            who = format!("{who} {name}");
        }
        let mut parts = vec![format!(
            "joins the dispatcher at {} as {who} {}",
            self.address,
            counts.join(" ")
        )];
        if !self.cables.is_empty() {
            let cables = self.cables.iter().map(|(_, cable)| cable.to_string());
            parts.push(format!("asks for {}", cables.collect::<Vec<_>>().join(" ")));
        }
        parts
    }

    fn files(&self) -> Vec<NamedFile> {
        let key = self.key_file.iter().cloned();
        key.map(NamedFile::Secret).collect()
    }

    fn check_files(&self, folder: &Path, _table: &SignalTable, collector: &Collector<'_>) {
        self.check_key(folder, collector);
    }

    fn open(&self, setup: &BusSetup<'_>) -> Result<Bus, OpenError> {
        let bus = DispatcherBus::new(self, setup).map_err(OpenError::Config)?;
        Ok(Bus::Free(Box::new(bus)))
    }

    fn cycle(&self) -> Option<Nanos> {
        Some(CYCLE)
    }

    fn connects(&self) -> bool {
        true
    }

    fn address(&self) -> Option<String> {
        Some(self.address.to_string())
    }

    fn set_address(&mut self, address: &str) -> Option<Result<(), Mistake>> {
        Some(self.set_address(address))
    }

    fn has_addresses(&self) -> bool {
        true
    }

    fn place_signals(&mut self, lines: &[At<'_>], table: &SignalTable) {
        self.place_signals(lines, table);
    }

    fn fit(&self, table: &SignalTable, collector: &Collector<'_>) {
        self.fit(table, collector);
    }

    fn place(&self, signal: &Signal, table: &SignalTable) -> String {
        let mut channels = table.signals.iter().zip(self.channels(table).list);
        let own = channels.find(|(other, _)| other.name == signal.name);
        own.map_or_else(String::new, |(_, channel)| channel.to_string())
    }

    fn examine(&self, examination: &mut Examination<'_>) {
        self.examine(examination);
    }
}
