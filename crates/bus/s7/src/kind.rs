//! The kinds `s7-server` and `s7-client`, for the list of bus kinds.

use tickbus_base::Mistake;
use tickbus_base::time::Nanos;
use tickbus_base::toml_text::{Collector, Key, Table, shown};
use tickbus_fieldbus::examine::{Complaint, Examination, Search};
use tickbus_fieldbus::faults::{AnswerCodes, WrongAnswer};
use tickbus_fieldbus::tcp::Writers;
use tickbus_fieldbus::{
    At, Bus, BusKind, BusOptions, BusSetup, CYCLE, NamedFile, OBSERVES, OpenError, Role,
};
use tickbus_image::signal::{Signal, SignalTable};

use super::{ClientOptions, S7Client, S7Server, ServerOptions, Variable, client, keys};

impl BusKind for ServerOptions {
    const NAME: &'static str = "s7-server";
    const LEARNS_OF_WRITES: bool = true;
    const KEYS: &'static [&'static [Key]] = &[keys::SERVER, Writers::KEYS];
    const STATION_KEYS: &'static [Key] = keys::SERVED_STATION;

    fn read(role: Role, _moved: bool, table: &mut Table<'_>) -> Option<Self> {
        Self::read(role, table)
    }
}

impl BusOptions for ServerOptions {
    fn summary(&self, _role: Role, _table: &SignalTable) -> Vec<String> {
        let mut parts = vec![format!("listens on {}", self.address)];
        for block in &self.blocks {
            let of = match &block.station {
                Some(station) => format!(" of \"{}\"", shown(station)),
                None => String::new(),
            };
            parts.push(format!(
                "DB{} is {}{of} from byte {}",
                block.number, block.area, block.offset
            ));
        }
        if !self.variables.is_empty() {
            parts.push("has the variables of [fieldbus.at]".to_owned());
        }
        parts
    }

    fn files(&self) -> Vec<NamedFile> {
        Vec::new()
    }

    fn open(&self, setup: &BusSetup<'_>) -> Result<Bus, OpenError> {
        let server = S7Server::new(self, setup);
        Ok(Bus::Free(Box::new(server)))
    }

    fn has_answers(&self) -> bool {
        true
    }

    fn answer_codes(&self) -> AnswerCodes {
        // 255 is the code of an item that is done.
        AnswerCodes {
            range: (1, 0xFE),
            wrong: &[
                WrongAnswer::Truncated,
                WrongAnswer::Transaction,
                WrongAnswer::Unit,
            ],
            has_elements: false,
            ..AnswerCodes::BYTE
        }
    }

    fn address(&self) -> Option<String> {
        Some(self.address.to_string())
    }

    fn set_address(&mut self, address: &str) -> Option<Result<(), Mistake>> {
        Some(self.set_address(address))
    }

    fn read_station(&mut self, count: usize, table: &mut Table<'_>) {
        self.read_station(count, table);
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

    fn place(&self, signal: &Signal, _table: &SignalTable) -> String {
        let variable = self.variables.get(&signal.name);
        variable.map_or_else(String::new, Variable::to_string)
    }

    fn examine(&self, examination: &mut Examination<'_>) {
        if examination.can_listen(&self.address) {
            examination.sizes("the PLC asks for what it needs");
        }
    }

    fn complaints(&self) -> Option<&'static [Complaint]> {
        Some(&[])
    }
}

impl BusKind for ClientOptions {
    const NAME: &'static str = "s7-client";
    const CAN_OBSERVE: bool = true;
    const SEARCH: Option<Search> = Some(client::SEARCH);
    const KEYS: &'static [&'static [Key]] = &[keys::CLIENT];
    const STATION_KEYS: &'static [Key] = keys::POLLED_STATION;

    fn read(role: Role, moved: bool, table: &mut Table<'_>) -> Option<Self> {
        Self::read(role, moved, table)
    }
}

impl BusOptions for ClientOptions {
    fn summary(&self, role: Role, _table: &SignalTable) -> Vec<String> {
        let mut parts = vec![
            format!("connects to {}", self.address),
            format!("TSAP {}", self.called),
        ];
        for places in &self.places {
            for (area, place) in ["%I", "%Q"].iter().zip(places) {
                parts.extend(place.map(|place| format!("{area} at {place}")));
            }
        }
        parts.push(match &self.write_to {
            _ if role == Role::Observer => OBSERVES.to_owned(),
            // Always one line; shown completely, because every character matters.
            Some(identity) => format!("writes into \"{identity}\" alone"),
            None => "writes nothing".to_owned(),
        });
        parts
    }

    fn files(&self) -> Vec<NamedFile> {
        Vec::new()
    }

    fn open(&self, setup: &BusSetup<'_>) -> Result<Bus, OpenError> {
        let client = S7Client::new(self, setup.table, setup.role, setup.cycle);
        Ok(Bus::Free(Box::new(client)))
    }

    fn cycle(&self) -> Option<Nanos> {
        Some(CYCLE)
    }

    fn is_client(&self) -> bool {
        true
    }

    fn address(&self) -> Option<String> {
        Some(self.address.to_string())
    }

    fn set_address(&mut self, address: &str) -> Option<Result<(), Mistake>> {
        Some(self.set_address(address))
    }

    fn read_station(&mut self, count: usize, table: &mut Table<'_>) {
        self.read_station(count, table);
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

    fn place(&self, signal: &Signal, _table: &SignalTable) -> String {
        let variable = self.variable(signal);
        variable.map_or_else(String::new, |variable| variable.to_string())
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
