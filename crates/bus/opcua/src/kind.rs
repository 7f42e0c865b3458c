//! The kinds `opcua-client` and `opcua-server`, for the list of bus kinds.

#[cfg(feature = "opcua")]
use std::path::Path;

use tickbus_base::Mistake;
use tickbus_base::toml_text::{Collector, Key, Table, shown};
use tickbus_fieldbus::examine::{Complaint, Examination, Search};
use tickbus_fieldbus::faults::AnswerCodes;
use tickbus_fieldbus::tcp::Writers;
use tickbus_fieldbus::{
    At, Browsing, Bus, BusKind, BusOptions, BusSetup, NamedFile, OpenError, Role,
};
use tickbus_image::signal::{Signal, SignalTable};

use super::codes::CODES;
#[cfg(not(feature = "opcua"))]
use super::hello;
use super::{ClientOptions, ServerOptions, keys, options, search, security};

impl BusKind for ClientOptions {
    const NAME: &'static str = "opcua-client";
    const CAN_OBSERVE: bool = true;
    const BROWSES: bool = true;
    const SEARCH: Option<Search> = Some(search::SEARCH);
    const KEYS: &'static [&'static [Key]] = &[keys::CLIENT, security::KEYS];

    fn read(_role: Role, moved: bool, table: &mut Table<'_>) -> Option<Self> {
        Self::read(moved, table)
    }
}

impl BusOptions for ClientOptions {
    fn summary(&self, role: Role, _table: &SignalTable) -> Vec<String> {
        self.summary(role)
    }

    fn files(&self) -> Vec<NamedFile> {
        self.credentials.files(&[self.security])
    }

    #[cfg(feature = "opcua")]
    fn open(&self, setup: &BusSetup<'_>) -> Result<Bus, OpenError> {
        let client = super::Client::new(self, setup).map_err(OpenError::Config)?;
        Ok(Bus::Free(Box::new(client)))
    }

    #[cfg(not(feature = "opcua"))]
    fn open(&self, _setup: &BusSetup<'_>) -> Result<Bus, OpenError> {
        Err(not_in_this_build(Self::NAME))
    }

    fn is_client(&self) -> bool {
        true
    }

    fn address(&self) -> Option<String> {
        Some(self.url.address.to_string())
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
        self.place(signal, &table.stations[signal.station])
    }

    #[cfg(feature = "opcua")]
    fn examine(&self, examination: &mut Examination<'_>) {
        super::client::examine(self, examination);
    }

    #[cfg(not(feature = "opcua"))]
    fn examine(&self, examination: &mut Examination<'_>) {
        let Some((_, mut wire)) = examination.reach(&self.url.address) else {
            return;
        };
        if hello::says_hello(examination, &mut wire, &self.url) {
            examination.unexamined("OPC UA, which is not in this build,");
        }
    }

    #[cfg(feature = "opcua")]
    fn browse(
        &self,
        examination: &mut Examination<'_>,
        browsing: &mut dyn Browsing,
    ) -> Result<(), String> {
        super::client::browse(self, examination, browsing)
    }

    #[cfg(not(feature = "opcua"))]
    fn browse(
        &self,
        _examination: &mut Examination<'_>,
        _browsing: &mut dyn Browsing,
    ) -> Result<(), String> {
        match not_in_this_build(Self::NAME) {
            OpenError::Unsupported(why) => Err(why),
            OpenError::Config(mistake) => Err(mistake.to_string()),
        }
    }
}

impl BusKind for ServerOptions {
    const NAME: &'static str = "opcua-server";
    const LEARNS_OF_WRITES: bool = true;
    const KEYS: &'static [&'static [Key]] = &[keys::SERVER, security::KEYS, Writers::KEYS];
    const ONE_OF: &'static [&'static str] = &options::LOGINS;

    fn read(role: Role, _moved: bool, table: &mut Table<'_>) -> Option<Self> {
        Self::read(role, table)
    }
}

impl BusOptions for ServerOptions {
    fn summary(&self, _role: Role, _table: &SignalTable) -> Vec<String> {
        self.summary()
    }

    fn files(&self) -> Vec<NamedFile> {
        let nodesets = self.nodesets.iter().cloned();
        let mut files = self.credentials.files(&self.security);
        files.extend(nodesets.map(|file| NamedFile::Plain(file.into())));
        files
    }

    #[cfg(feature = "opcua")]
    fn open(&self, setup: &BusSetup<'_>) -> Result<Bus, OpenError> {
        let server = super::Server::new(self, setup).map_err(OpenError::Config)?;
        Ok(Bus::Free(Box::new(server)))
    }

    #[cfg(not(feature = "opcua"))]
    fn open(&self, _setup: &BusSetup<'_>) -> Result<Bus, OpenError> {
        Err(not_in_this_build(Self::NAME))
    }

    fn address(&self) -> Option<String> {
        Some(self.address.to_string())
    }

    fn set_address(&mut self, address: &str) -> Option<Result<(), Mistake>> {
        Some(self.set_address(address))
    }

    fn has_answers(&self) -> bool {
        true
    }

    fn answer_codes(&self) -> AnswerCodes {
        CODES
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

    #[cfg(feature = "opcua")]
    fn check_files(&self, folder: &Path, table: &SignalTable, collector: &Collector<'_>) {
        for (at, mistake) in super::check_nodesets(self, folder, table) {
            collector.collect(at, mistake);
        }
    }

    fn place(&self, signal: &Signal, _table: &SignalTable) -> String {
        let node = self.nodes.get(&signal.name);
        node.map_or_else(String::new, |node| {
            shown(&format!("{}{}", node.name, node.member))
        })
    }

    fn examine(&self, examination: &mut Examination<'_>) {
        if examination.can_listen(&self.address) {
            examination.sizes("the PLC subscribes to what it needs");
        }
    }

    fn complaints(&self) -> Option<&'static [Complaint]> {
        Some(&[
            Complaint {
                counter: "opcua.rejected_certificates",
                cause: "certificate-unknown",
                what: "the PLC shows a certificate that is not trusted here",
                next: "move it from the folder \"rejected\" below pki to \"trusted\"",
            },
            Complaint {
                counter: "opcua.refused_applications",
                cause: "application-refused",
                what: "the PLC's certificate belongs to another application",
                next: "let the PLC make a certificate with its own ApplicationUri",
            },
        ])
    }
}

#[cfg(not(feature = "opcua"))]
fn not_in_this_build(kind: &str) -> OpenError {
    OpenError::Unsupported(format!(
        "bus kind \"{kind}\" is not in this build of tickbus; use the library of a `make dist`, which has it, or build \
         with `cargo build --release --features opcua`"
    ))
}
