//! The kind `socket`, for the list of bus kinds.

use tickbus_base::Mistake;
use tickbus_base::time::Nanos;
use tickbus_base::toml_text::{Collector, Key, Table};
use tickbus_fieldbus::examine::{Complaint, Examination};
use tickbus_fieldbus::{Bus, BusKind, BusOptions, BusSetup, CYCLE, NamedFile, OpenError, Role};
use tickbus_image::signal::SignalTable;

use super::{Message, Options, Sending, Socket, TcpRole, options};

impl BusKind for Options {
    const NAME: &'static str = "socket";
    const KEYS: &'static [&'static [Key]] = &[options::KEYS];
    const STATION_KEYS: &'static [Key] = options::STATION_KEYS;

    fn read(role: Role, moved: bool, table: &mut Table<'_>) -> Option<Self> {
        Self::read(role, moved, table)
    }
}

impl BusOptions for Options {
    fn summary(&self, _role: Role, _table: &SignalTable) -> Vec<String> {
        let address = &self.address;
        let each: Vec<String> = self.stations.iter().map(ToString::to_string).collect();
        let mut parts = vec![
            match self.tcp {
                TcpRole::Listen if !each.is_empty() => {
                    format!("listens on {}, one station each", each.join(" and "))
                }
                TcpRole::Listen => format!("listens on {address}"),
                TcpRole::Connect => format!("connects to {address}"),
            },
            match self.sending {
                Sending::Cyclic => "sends every cycle".to_owned(),
                Sending::OnChange => "sends on change".to_owned(),
                Sending::Reply => "replies to each record".to_owned(),
            },
        ];
        if self.min_interval > Nanos::ZERO {
            parts.push(format!("at most every {}", self.min_interval));
        }
        if let Message::Axis { .. } = self.message {
            parts.push("one axis in each message".to_owned());
        }
        parts
    }

    fn files(&self) -> Vec<NamedFile> {
        Vec::new()
    }

    fn open(&self, setup: &BusSetup<'_>) -> Result<Bus, OpenError> {
        let socket = Socket::new(self, setup.table, setup.role, setup.cycle);
        Ok(Bus::Free(Box::new(socket)))
    }

    fn cycle(&self) -> Option<Nanos> {
        Some(CYCLE)
    }

    fn connects(&self) -> bool {
        self.tcp == TcpRole::Connect
    }

    fn address(&self) -> Option<String> {
        Some(self.address.to_string())
    }

    fn set_address(&mut self, address: &str) -> Option<Result<(), Mistake>> {
        Some(self.set_address(address))
    }

    fn read_station(&mut self, _count: usize, table: &mut Table<'_>) {
        self.read_station(table);
    }

    fn fit(&self, table: &SignalTable, collector: &Collector<'_>) {
        self.fit(table, collector);
    }

    fn examine(&self, examination: &mut Examination<'_>) {
        self.examine(examination);
    }

    fn complaints(&self) -> Option<&'static [Complaint]> {
        (self.tcp == TcpRole::Listen).then_some(&[])
    }
}
