//! The bus `modbus-client`: this end reads and writes a server's tables.

mod area_mapping;
mod at;
mod examine;
mod options;
mod plan;
mod request;
mod search;
mod session;

use std::net::SocketAddr;
use std::sync::Arc;

use tickbus_base::time::{Nanos, Stop};
use tickbus_fieldbus::WriteGuard;
use tickbus_fieldbus::tcp::{Call, dial};
use tickbus_fieldbus::{BusError, CYCLE, Free, Medium, Port, Role};
use tickbus_image::signal::SignalTable;
use tickbus_net::{Address, Datagrams, serial};

use super::{Coding, Line, tls};
use crate::tls::ClientSide;
pub use area_mapping::Block;
pub(crate) use area_mapping::{PART_KEYS, PARTS};
pub use options::ClientOptions;
pub use plan::{Capabilities, queries};
pub use request::{AnswerError, Region, Request};
pub(crate) use search::SEARCH;
use session::{ClientSession, Framing, Station};

/// The time for a server to acknowledge sent data, as a multiple of `max_age`.
const PATIENCE: i64 = 4;

/// The time for a server to show its certificate.
const HANDSHAKE: Nanos = Nanos::from_secs(5);

/// The bus of kind `modbus-client`.
#[derive(Debug)]
pub struct ModbusClient {
    options: ClientOptions,
    cycle: Nanos,
    stations: Vec<Station>,
    guards: Vec<WriteGuard>,
    tls: Option<ClientSide>,
}

impl ModbusClient {
    /// The bus that `options` describe, for the end with `role`, with a bus cycle of `cycle` if stated.
    pub fn new(
        options: &ClientOptions,
        table: &SignalTable,
        role: Role,
        cycle: Option<Nanos>,
    ) -> Self {
        let (writes, reads) = role.areas();
        let stations = table.stations.iter().enumerate();
        let stations = stations.map(|(index, station)| {
            Station::new(
                options.unit(index),
                options.pieces(table, index, reads),
                options.pieces(table, index, writes),
                station.bytes(reads),
            )
        });
        let stations: Vec<Station> = stations.collect();
        let guards = (0..stations.len())
            .map(|station| WriteGuard::of(role, options.stations.write_to(station)))
            .collect();
        Self {
            options: options.clone(),
            cycle: cycle.unwrap_or(CYCLE),
            stations,
            guards,
            tls: None,
        }
    }

    /// The same client within TLS, if `tls` is there.
    pub(crate) fn within(mut self, tls: Option<ClientSide>) -> Self {
        self.tls = tls;
        self
    }

    fn session(
        &mut self,
        framing: Framing,
        peer: String,
        port: &Port,
        now: Nanos,
    ) -> ClientSession<'_> {
        let timeout = self.options.patience(self.stations.len(), port.max_age());
        ClientSession::new(
            &mut self.stations,
            &mut self.guards,
            framing,
            self.options.capabilities(),
            (self.cycle, timeout),
            peer,
            now,
        )
    }
}

/// Opens a socket for datagrams to `address` and from there; `None` if `stop` came first.
fn connect(
    address: &Address,
    port: &mut Port,
    stop: &Stop,
) -> Result<Option<(Datagrams, SocketAddr)>, BusError> {
    port.opening(&format!("looking for {address}"));
    let clock = Arc::clone(port.clock());
    let Some((stream, peer)) = Datagrams::connect(address, &*clock, stop)? else {
        return Ok(None);
    };
    port.tell("address", &peer.to_string());
    port.opening(&format!("asking {peer}; waiting for its first answer"));
    Ok(Some((stream, peer)))
}

impl Free for ModbusClient {
    fn run(&mut self, port: &mut Port, stop: &Stop) -> Result<(), BusError> {
        let line = self.options.line.clone();
        match line {
            Line::Tcp(ref address) | Line::RtuOverTcp(ref address) => {
                let patience = port.max_age().times(PATIENCE);
                let Some((mut call, peer)) = dial(address, patience, port, stop)? else {
                    return Ok(());
                };
                port.opening(&format!(
                    "connected with {peer}; waiting for its first answer"
                ));
                port.carried_by(Medium::Tcp);
                let inbox = Vec::new();
                let framing = match line {
                    Line::RtuOverTcp(_) => Framing::RtuOverTcp { inbox },
                    _ => Framing::Tcp {
                        transaction: 0,
                        inbox,
                    },
                };
                let (tls, peer) = (self.tls.clone(), peer.to_string());
                let mut session = self.session(framing, peer.clone(), port, port.clock().now());
                match tls {
                    None => call.run(&mut session, port, stop),
                    Some(side) => {
                        let peer = (peer, HANDSHAKE);
                        tls::call(&side, &mut call, &mut session, peer, port, stop)
                    }
                }
            }
            Line::Udp(ref address) => {
                let Some((stream, peer)) = connect(address, port, stop)? else {
                    return Ok(());
                };
                let now = port.clock().now();
                let framing = Framing::Udp {
                    transaction: 0,
                    again: now,
                };
                let mut session = self.session(framing, peer.to_string(), port, now);
                Call::new(stream).run(&mut session, port, stop)
            }
            Line::Serial(line) => {
                let mut call = Call::new(serial::open(&line.device, line.settings)?);
                port.carried_by(Medium::Serial {
                    character: line.settings.character(),
                });
                port.tell("device", &line.device);
                port.opening(&format!("asking on {}", line.device));
                let now = port.clock().now();
                let (character, silence) = match line.coding {
                    Coding::Rtu => (crate::rtu::character(line.settings.baud), line.silence),
                    // A colon begins a telegram, whatever was before it.
                    Coding::Ascii => (line.settings.character(), Nanos::ZERO),
                };
                let framing = Framing::Serial {
                    coding: line.coding,
                    inbox: Vec::new(),
                    ascii: crate::ascii::Framer::new(line.silence),
                    character,
                    silence,
                    quiet_until: now + silence,
                    echo: line.new_echo(),
                };
                let mut session = self.session(framing, line.device, port, now);
                call.run(&mut session, port, stop)
            }
        }
    }
}
