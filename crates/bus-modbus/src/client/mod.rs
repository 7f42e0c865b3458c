//! The bus `modbus-client`: this end reads and writes a server's tables.

mod at;
mod lie;
mod options;
mod piece;
mod plan;
mod poll;
mod query;

use std::io::{self, Read, Write};
use std::net::TcpStream;

use rustix::fd::AsFd;

use tickbus_base::os::{Interest, Poller, Source};
use tickbus_base::time::{Nanos, Stop};
use tickbus_fieldbus::Guard;
use tickbus_fieldbus::tcp::{bow_out, connect, is_for_later, no_wait, prepare};
use tickbus_fieldbus::{BusError, CYCLE, Free, Port, Role};
use tickbus_image::signal::SignalTable;

use super::Line;
pub use lie::Block;
pub use options::ClientOptions;
pub use piece::Piece;
pub use plan::{Abilities, queries};
use poll::{Framing, Poll, Station};
pub use query::{Fault, Query, Region};

/// For how many times `max_age` a server may leave sent data unacknowledged.
const PATIENCE: i64 = 4;

/// The bus of kind `modbus-client`.
#[derive(Debug)]
pub struct ModbusClient {
    options: ClientOptions,
    cycle: Nanos,
    stations: Vec<Station>,
    guards: Vec<Guard>,
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
            .map(|station| Guard::new(options.stations.write_to(station)))
            .collect();
        Self {
            options: options.clone(),
            cycle: cycle.unwrap_or(CYCLE),
            stations,
            guards,
        }
    }

    fn poll(&mut self, framing: Framing, peer: String, port: &Port, now: Nanos) -> Poll<'_> {
        let timeout = self.options.patience(self.stations.len(), port.max_age());
        Poll::new(
            &mut self.stations,
            &mut self.guards,
            framing,
            self.options.abilities(),
            (self.cycle, timeout),
            peer,
            now,
        )
    }
}

impl Free for ModbusClient {
    fn run(&mut self, port: &mut Port, stop: &Stop) -> Result<(), BusError> {
        let mut poller = Poller::new(stop).map_err(|error| no_wait(&error))?;
        match self.options.line.clone() {
            Line::Tcp(address) => {
                let Some((stream, peer)) = connect(&address, &mut poller, port, stop)? else {
                    return Ok(());
                };
                let broken = |error: io::Error| {
                    BusError::Link(format!(
                        "the connection with {peer} broke ({error}); see whether the server still runs"
                    ))
                };
                prepare(&stream, port.max_age().times(PATIENCE)).map_err(broken)?;
                port.opening(&format!(
                    "connected with {peer}; waiting for its first answer"
                ));
                let framing = Framing::Tcp {
                    transaction: 0,
                    inbox: Vec::new(),
                };
                let poll = self.poll(framing, peer.to_string(), port, port.clock().now());
                let left = |asked_identity| {
                    BusError::Left(if asked_identity {
                        format!(
                            "{peer} closed the connection when it was asked who it is (function 43); if it does so \
                             again, it is not asked any more"
                        )
                    } else {
                        format!(
                            "{peer} closed the connection; if it serves one client at a time, end the other one"
                        )
                    })
                };
                let mut stream = Leaving(stream);
                serve(&mut stream, poll, &mut poller, port, stop, left, broken)
            }
            #[cfg(unix)]
            Line::Serial(line) => {
                use super::serial::{gone, open};
                let mut serial = open(&line)?;
                port.tell("device", &line.device);
                port.opening(&format!("asking on {}", line.device));
                let now = port.clock().now();
                let framing = Framing::Rtu {
                    inbox: Vec::new(),
                    character: super::rtu::character(line.settings.baud),
                    silence: line.silence,
                    quiet_until: now + line.silence,
                    echo: line.new_echo(),
                };
                let poll = self.poll(framing, line.device.clone(), port, now);
                let left = |_| gone(&line, "it was closed");
                let broken = |error| gone(&line, error);
                serve(&mut serial, poll, &mut poller, port, stop, left, broken)
            }
            #[cfg(not(unix))]
            Line::Serial(_) => Err(super::no_serial_port()),
        }
    }
}

/// A connection that is closed properly when dropped.
struct Leaving(TcpStream);

impl Drop for Leaving {
    fn drop(&mut self) {
        bow_out(&self.0);
    }
}

impl Read for Leaving {
    fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        self.0.read(bytes)
    }
}

impl Write for Leaving {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.0.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.0.flush()
    }
}

impl AsFd for Leaving {
    fn as_fd(&self) -> rustix::fd::BorrowedFd<'_> {
        self.0.as_fd()
    }
}

/// Transfers bytes between the line and the polling until `stop`.
fn serve(
    line: &mut (impl Read + Write + AsFd),
    mut poll: Poll<'_>,
    poller: &mut Poller,
    port: &mut Port,
    stop: &Stop,
    left: impl Fn(bool) -> BusError,
    broken: impl Fn(io::Error) -> BusError,
) -> Result<(), BusError> {
    let mut bytes = [0; 4096];
    let mut readable = false;
    while !stop.is_stopped() {
        let now = port.clock().now();
        if readable {
            match line.read(&mut bytes) {
                Ok(0) => return Err(left(poll.hung_up())),
                Ok(count) => poll.arrived(now, &bytes[..count], port)?,
                Err(error) if is_for_later(&error) => {}
                Err(error) => {
                    poll.hung_up();
                    return Err(broken(error));
                }
            }
        }
        poll.turn(now, port)?;
        let mut blocked = false;
        while !blocked && !poll.to_write(now).is_empty() {
            match line.write(poll.to_write(now)) {
                Ok(count) => poll.wrote(now, count),
                Err(error) if is_for_later(&error) => blocked = true,
                Err(error) => return Err(broken(error)),
            }
        }
        port.observe(now);
        let interest = if blocked {
            Interest::ReadWrite
        } else {
            Interest::Read
        };
        let mut sources = [Source::new(&*line, interest)];
        let deadline = poll.deadline().min(port.due());
        poller
            .wait(&**port.clock(), deadline, &mut sources)
            .map_err(|error| no_wait(&error))?;
        readable = sources[0].is_readable();
    }
    Ok(())
}
