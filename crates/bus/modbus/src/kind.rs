//! The kinds `modbus-server` and `modbus-client`, for the list of bus kinds.

use std::path::Path;

use crate::tls_options::Tls;
use tickbus_base::Mistake;
use tickbus_base::time::Nanos;
use tickbus_base::toml_text::{Collector, Key, Table};
use tickbus_fieldbus::examine::{Complaint, Examination, Search};
use tickbus_fieldbus::faults::AnswerCodes;
use tickbus_fieldbus::tcp::Writers;
use tickbus_fieldbus::{At, Bus, BusKind, BusOptions, BusSetup, CYCLE, NamedFile, OpenError, Role};
use tickbus_image::signal::{Signal, SignalTable};
use tickbus_net::Address;

use super::{ClientOptions, Line, ModbusClient, ModbusServer, ServerOptions, client, keys, tls};
use crate::tls::{ClientSide, ServerSide};

/// The meaning of a server's counters for its clients.
const COMPLAINTS: &[Complaint] = &[
    Complaint {
        counter: "modbus-server.unknown_unit",
        cause: "wrong-unit",
        what: "the PLC asks for a unit that no station has",
        next: "write the same unit in the PLC and in the driver.cfg; without \"unit\" a single station answers every unit",
    },
    Complaint {
        counter: "modbus-server.illegal_data_address",
        cause: "address-refused",
        what: "the PLC asks for elements that do not exist here",
        next: "compare its addresses and lengths with those of tickbus check FILE",
    },
    Complaint {
        counter: "modbus-server.illegal_function",
        cause: "function-refused",
        what: "the PLC uses a function that does not exist here, or may not write",
        next: "let the PLC use functions 1 to 6, 15, 16, 22 or 23",
    },
    Complaint {
        counter: "modbus-server.illegal_data_value",
        cause: "request-refused",
        what: "the PLC sends requests with a wrong length or value",
        next: "compare its lengths with those of tickbus check FILE",
    },
];

impl BusKind for ServerOptions {
    const NAME: &'static str = "modbus-server";
    const LEARNS_OF_WRITES: bool = true;
    const KEYS: &'static [&'static [Key]] = &[keys::LINE, keys::SERVER, Writers::KEYS];
    const STATION_KEYS: &'static [Key] = keys::SERVED_STATION;

    fn read(role: Role, _moved: bool, table: &mut Table<'_>) -> Option<Self> {
        Self::read(role, table)
    }
}

impl BusOptions for ServerOptions {
    fn summary(&self, _role: Role, table: &SignalTable) -> Vec<String> {
        self.shown(table)
    }

    fn files(&self) -> Vec<NamedFile> {
        self.tls.as_ref().map_or_else(Vec::new, Tls::files)
    }

    fn check_files(&self, folder: &Path, _table: &SignalTable, collector: &Collector<'_>) {
        if let Some(own) = &self.tls
            && let Err(mistake) = tls::check(own, folder, true)
        {
            collector.collect(own.at, mistake);
        }
    }

    fn open(&self, setup: &BusSetup<'_>) -> Result<Bus, OpenError> {
        let tls = self.tls.as_ref();
        let tls = tls
            .map(|tls| ServerSide::load(tls, setup.folder))
            .transpose()?;
        let server = ModbusServer::new(self, setup).within(tls);
        Ok(Bus::Free(Box::new(server)))
    }

    fn summary_of_writes(&self) -> Option<&'static str> {
        Some("every write")
    }

    fn address(&self) -> Option<String> {
        self.line.address().map(Address::to_string)
    }

    fn set_address(&mut self, address: &str) -> Option<Result<(), Mistake>> {
        Some(self.line.set_address(address, |_| Ok(())))
    }

    fn read_station(&mut self, count: usize, table: &mut Table<'_>) {
        self.stations.read_station(count, false, table);
    }

    fn has_addresses(&self) -> bool {
        true
    }

    fn has_answers(&self) -> bool {
        true
    }

    fn answer_codes(&self) -> AnswerCodes {
        AnswerCodes {
            has_pauses: matches!(self.line, Line::Tcp(_) | Line::RtuOverTcp(_)),
            ..AnswerCodes::BYTE
        }
    }

    fn place_signals(&mut self, lines: &[At<'_>], table: &SignalTable) {
        self.place_signals(lines, table);
    }

    fn fit(&self, table: &SignalTable, collector: &Collector<'_>) {
        self.fit(table, collector);
    }

    fn place(&self, signal: &Signal, _table: &SignalTable) -> String {
        self.place(signal)
    }

    fn examine(&self, examination: &mut Examination<'_>) {
        self.examine(examination);
    }

    fn complaints(&self) -> Option<&'static [Complaint]> {
        Some(COMPLAINTS)
    }
}

impl BusKind for ClientOptions {
    const NAME: &'static str = "modbus-client";
    const CAN_OBSERVE: bool = true;
    const SEARCH: Option<Search> = Some(client::SEARCH);
    const KEYS: &'static [&'static [Key]] = &[keys::LINE, keys::CLIENT];
    const STATION_KEYS: &'static [Key] = keys::POLLED_STATION;

    fn read(role: Role, moved: bool, table: &mut Table<'_>) -> Option<Self> {
        Self::read(role, moved, table)
    }
}

impl BusOptions for ClientOptions {
    fn summary(&self, role: Role, table: &SignalTable) -> Vec<String> {
        self.shown(role, table)
    }

    fn files(&self) -> Vec<NamedFile> {
        self.tls.as_ref().map_or_else(Vec::new, Tls::files)
    }

    fn check_files(&self, folder: &Path, _table: &SignalTable, collector: &Collector<'_>) {
        if let Some(own) = &self.tls
            && let Err(mistake) = tls::check(own, folder, false)
        {
            collector.collect(own.at, mistake);
        }
    }

    fn open(&self, setup: &BusSetup<'_>) -> Result<Bus, OpenError> {
        let tls = match (&self.tls, &self.line) {
            (Some(tls), Line::Tcp(address)) => Some(ClientSide::load(tls, address, setup.folder)?),
            _ => None,
        };
        let client = ModbusClient::new(self, setup.table, setup.role, setup.cycle).within(tls);
        Ok(Bus::Free(Box::new(client)))
    }

    fn cycle(&self) -> Option<Nanos> {
        Some(CYCLE)
    }

    fn is_client(&self) -> bool {
        true
    }

    fn address(&self) -> Option<String> {
        self.line.address().map(Address::to_string)
    }

    fn set_address(&mut self, address: &str) -> Option<Result<(), Mistake>> {
        Some(self.line.set_address(address, Address::check_dialled))
    }

    fn read_station(&mut self, count: usize, table: &mut Table<'_>) {
        self.stations.read_station(count, true, table);
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
        let (station, signal) = (&table.stations[signal.station], signal.as_in_plc());
        self.place(&signal, station.plc_bytes(signal.area))
    }

    fn requests(&self, table: &SignalTable) -> Vec<String> {
        self.shown_requests(table)
    }

    fn examine(&self, examination: &mut Examination<'_>) {
        self.examine(examination);
    }

    fn both_ways(&self, table: &SignalTable) -> Vec<(usize, usize)> {
        self.both_ways(table)
    }
}
