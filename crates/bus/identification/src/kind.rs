//! The kinds `ivi-client` and `ivi-reader`, for the list of bus kinds.

use tickbus_base::time::Nanos;
use tickbus_base::toml_text::{Collector, Key, Table};
use tickbus_fieldbus::examine::Examination;
use tickbus_fieldbus::{Bus, BusKind, BusOptions, BusSetup, CYCLE, NamedFile, OpenError, Role};
use tickbus_image::signal::{Area, Signal, SignalTable};

use crate::heads::meaning;
use crate::{ClientOptions, ReaderOptions, client_bus, heads, line, reader_bus};

impl BusKind for ClientOptions {
    const NAME: &'static str = "ivi-client";
    const KEYS: &'static [&'static [Key]] = &[line::KEYS, heads::KEYS, client_bus::KEYS];
    const STATION_KEYS: &'static [Key] = heads::KEYS;

    fn read(role: Role, _moved: bool, table: &mut Table<'_>) -> Option<Self> {
        if role == Role::Device {
            table.wrong(
                "an \"ivi-client\" is the controller's end of the line, which asks the reader",
                "write role = \"controller\"; the machine's end is kind = \"ivi-reader\"",
            );
        }
        Self::read(table)
    }
}

impl BusOptions for ClientOptions {
    fn summary(&self, _role: Role, table: &SignalTable) -> Vec<String> {
        vec![
            format!("asks a reader on {}", self.line),
            self.heads.shown(table),
            format!("carriers {}", self.line.carriers.name()),
        ]
    }

    fn files(&self) -> Vec<NamedFile> {
        Vec::new()
    }

    fn is_client(&self) -> bool {
        true
    }

    fn examine(&self, examination: &mut Examination<'_>) {
        self.line.examine(examination);
    }

    fn open(&self, setup: &BusSetup<'_>) -> Result<Bus, OpenError> {
        let cycle = setup.cycle.or(self.cycle()).unwrap_or(CYCLE);
        let bus = client_bus::IviClient::new(self, setup.table, cycle);
        Ok(Bus::Free(Box::new(bus)))
    }

    fn cycle(&self) -> Option<Nanos> {
        Some(self.line.cycle(self.heads.count()))
    }

    fn read_station(&mut self, count: usize, table: &mut Table<'_>) {
        self.heads.read_station(count, table);
    }

    fn fit(&self, table: &SignalTable, collector: &Collector<'_>) {
        self.heads.fit(table, client_bus::BEFORE_DATA, collector);
    }

    fn place(&self, signal: &Signal, _table: &SignalTable) -> String {
        meaning(
            signal.byte,
            match signal.area {
                Area::Input => &client_bus::INPUTS,
                Area::Output => &client_bus::OUTPUTS,
            },
        )
    }
}

impl BusKind for ReaderOptions {
    const NAME: &'static str = "ivi-reader";
    const KEYS: &'static [&'static [Key]] = &[line::KEYS, heads::KEYS];
    const STATION_KEYS: &'static [Key] = heads::KEYS;

    fn read(role: Role, _moved: bool, table: &mut Table<'_>) -> Option<Self> {
        if role == Role::Controller {
            table.wrong(
                "an \"ivi-reader\" is the machine's end of the line, a simulated reader",
                "remove role = \"controller\"; the controller's end is kind = \"ivi-client\"",
            );
        }
        Self::read(table)
    }
}

impl BusOptions for ReaderOptions {
    fn summary(&self, _role: Role, table: &SignalTable) -> Vec<String> {
        vec![
            format!("a simulated reader on {}", self.line),
            self.heads.shown(table),
            format!("carriers {}", self.line.carriers.name()),
        ]
    }

    fn files(&self) -> Vec<NamedFile> {
        Vec::new()
    }

    fn examine(&self, examination: &mut Examination<'_>) {
        self.line.examine(examination);
    }

    fn open(&self, setup: &BusSetup<'_>) -> Result<Bus, OpenError> {
        let cycle = setup.cycle.or(self.cycle()).unwrap_or(CYCLE);
        let bus = reader_bus::IviReader::new(self, setup.table, cycle);
        Ok(Bus::Free(Box::new(bus)))
    }

    fn cycle(&self) -> Option<Nanos> {
        Some(self.line.cycle(self.heads.count()))
    }

    fn read_station(&mut self, count: usize, table: &mut Table<'_>) {
        self.heads.read_station(count, table);
    }

    fn fit(&self, table: &SignalTable, collector: &Collector<'_>) {
        self.heads.fit(table, reader_bus::BEFORE_DATA, collector);
    }

    fn place(&self, signal: &Signal, _table: &SignalTable) -> String {
        meaning(
            signal.byte,
            match signal.area {
                Area::Input => &reader_bus::INPUTS,
                Area::Output => &reader_bus::OUTPUTS,
            },
        )
    }
}
