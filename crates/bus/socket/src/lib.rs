//! Records of fixed size over TCP.
//!
//! A record is the frames of all stations in one direction, one after another in the order of the driver.cfg, with no
//! header and no trailer: any program that can open a TCP connection can be the other end. An end that listens may do
//! so at a separate address for each station; a record is then the frame of that station. If the image consists of
//! axes, they can be sent one at a time, each in a message with its number.
//!
//! [`Session`] is the complete protocol, without I/O; the rest transfers its bytes.

mod connect;
mod connection;
mod connection_states;
mod end_reason;
mod examine;
mod frames;
mod kind;
mod listen;
mod options;
mod parts;
mod record;
mod session;

use tickbus_base::time::{Nanos, Stop};
use tickbus_image::signal::{Area, SignalTable};

use tickbus_fieldbus::{BusError, CYCLE, Free, Port, Role};

pub use end_reason::EndReason;
use frames::ConnectionFrames;
pub use options::{Message, Options, TcpRole};
pub use parts::Parts;
pub use record::{Partial, Records};
pub use session::{Sending, Session, SessionParameters};

/// The bus of kind `socket`: TCP connections, initiated by this end or the other; a single one, or one per
/// station.
#[derive(Debug)]
pub struct Socket {
    options: Options,
    cycle: Nanos,
    /// The frames of each connection, and the name of its station if it has its own.
    lines: Vec<(String, ConnectionFrames)>,
}

impl Socket {
    /// The bus that `options` describe, for the end with `role`, with a bus cycle of `cycle` if stated.
    pub fn new(options: &Options, table: &SignalTable, role: Role, cycle: Option<Nanos>) -> Self {
        let stations = table.stations.len();
        let lines = if options.stations.is_empty() {
            let frames = ConnectionFrames::new(table, role, 0..stations);
            let frames = match options.message {
                Message::Image => frames,
                Message::Axis { .. } => {
                    let (tx, rx) = role.areas();
                    let parts = |area| divide(table, area);
                    frames.in_parts(parts(tx), parts(rx))
                }
            };
            vec![(String::new(), frames)]
        } else {
            let line = |station: usize| {
                let name = table.stations[station].name.clone();
                (
                    name,
                    ConnectionFrames::new(table, role, station..station + 1),
                )
            };
            (0..stations).map(line).collect()
        };
        Self {
            options: options.clone(),
            cycle: cycle.unwrap_or(CYCLE),
            lines,
        }
    }

    fn terms(
        &self,
        (sends, receives): (usize, usize),
        port: &Port,
    ) -> Result<SessionParameters, BusError> {
        if self.options.sending == Sending::Reply && receives == 0 {
            return Err(BusError::Refused(
                "send = \"reply\" answers the peer's records, but by its signals this end receives \
                 none; use send = \"cyclic\" or \"on-change\""
                    .to_owned(),
            ));
        }
        Ok(SessionParameters {
            sending: self.options.sending,
            cycle: self.cycle,
            min_interval: self.options.min_interval,
            max_age: port.max_age(),
            receives,
            sends,
        })
    }
}

/// Splits an area into its structures.
fn divide(table: &SignalTable, area: Area) -> Parts {
    let structures = table.structures.iter();
    let structures = structures.map(|structure| structure.bytes(area));
    Parts::new(table.stations[0].bytes(area), structures)
}

impl Free for Socket {
    fn run(&mut self, port: &mut Port, stop: &Stop) -> Result<(), BusError> {
        let terms: Result<Vec<SessionParameters>, BusError> = self
            .lines
            .iter()
            .map(|(_, frames)| self.terms(frames.sizes(port), port))
            .collect();
        let mut terms = terms?.into_iter();
        let Options {
            address, stations, ..
        } = &self.options;
        match self.options.tcp {
            TcpRole::Listen => {
                let addresses = stations.iter().chain([address]);
                let places = self.lines.iter_mut().zip(addresses).zip(&mut terms);
                let places = places.map(|(((name, frames), address), terms)| listen::Endpoint {
                    address,
                    name: name.clone(),
                    terms,
                    frames,
                });
                listen::listen(places.collect(), port, stop)
            }
            TcpRole::Connect => {
                let [(_, frames)] = &mut self.lines[..] else {
                    unreachable!("only an end that listens has several connections");
                };
                let terms = terms.next().expect("one for each line");
                connect::connect(address, terms, frames, port, stop)
            }
        }
    }
}
