//! The bus of kind `s7-client`: the peer is a CPU, whose memory this end reads and writes.

mod dialog;
mod options;
mod plan;
mod refusal;
mod terms;

use std::io::{Read as _, Write as _};
use std::net::{SocketAddr, TcpStream};

use crate::fieldbus::tcp::{self, bow_out, is_for_later, no_wait};
use crate::fieldbus::{BusError, CYCLE, Free, Guard, Port, Role};
use crate::os::{Interest, Poller, Source};
use crate::signal::SignalTable;
use crate::time::{Nanos, Pace, Stop};

use super::lists::Identity;

pub use dialog::Dialog;
pub use options::ClientOptions;
use plan::Image;
pub use refusal::Refusal;
pub use terms::{End, News, Terms};

/// How long an answer may take at least; in other cases four times `max_age`.
const PATIENCE: Nanos = Nanos::from_secs(2);

/// So many bytes are read at once.
const BUFFER: usize = 4096;

/// The bus of kind `s7-client`.
#[derive(Debug)]
pub struct S7Client {
    options: ClientOptions,
    cycle: Nanos,
    frames: Frames,
    guard: Guard,
    /// How many times in a row the CPU hung up when it was asked who it is.
    hang_ups: u8,
}

/// After so many of them it is not asked, for one connection.
const HANG_UPS: u8 = 2;

/// What is written into a CPU and read from it, and where it lies there.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Frames {
    written: Vec<Image>,
    read: Vec<Image>,
}

impl Frames {
    /// Those of the end with `role`.
    pub fn new(options: &ClientOptions, table: &SignalTable, role: Role) -> Self {
        let (sends, receives) = role.areas();
        let images = |area| {
            let stations = table.stations.iter().enumerate();
            let images = stations.filter_map(|(index, station)| {
                let start = options.place(index, area)?;
                let length = station.bytes(area);
                (length > 0).then_some(Image {
                    station: index,
                    object: start.object,
                    byte: start.byte,
                    length,
                })
            });
            images.collect()
        };
        Self {
            written: images(sends),
            read: images(receives),
        }
    }

    /// A dialog about them.
    pub fn dialog(&self, terms: Terms, now: Nanos) -> Dialog {
        Dialog::new(terms, now, self.written.clone(), self.read.clone())
    }
}

impl S7Client {
    /// The bus that `options` describe, for the end with `role`, with a bus cycle of `cycle` if one is stated.
    pub fn new(
        options: &ClientOptions,
        table: &SignalTable,
        role: Role,
        cycle: Option<Nanos>,
    ) -> Self {
        Self {
            frames: Frames::new(options, table, role),
            guard: Guard::new(options.write_to.as_deref()),
            cycle: cycle.unwrap_or(CYCLE),
            hang_ups: 0,
            options: options.clone(),
        }
    }
}

impl Free for S7Client {
    fn run(&mut self, port: &mut Port, stop: &Stop) -> Result<(), BusError> {
        self.guard.part();
        let mut poller = Poller::new(stop).map_err(|error| no_wait(&error))?;
        let reached = tcp::connect(&self.options.address, &mut poller, port, stop)?;
        let Some((stream, peer)) = reached else {
            return Ok(());
        };
        let patience = port.max_age().times(4).max(PATIENCE);
        tcp::prepare(&stream, patience).map_err(|error| {
            BusError::Link(format!("the connection with {peer} broke at once: {error}"))
        })?;
        port.opening(&format!("connected with {peer}; waiting for its answer"));
        let terms = Terms {
            calling: self.options.calling,
            called: self.options.called,
            pdu: self.options.pdu,
            patience,
            asks_who: self.hang_ups < HANG_UPS,
        };
        // When that connection is over, it is asked once more.
        self.hang_ups = self.hang_ups.min(HANG_UPS - 1);
        let now = port.clock().now();
        let mut connection = Connection {
            dialog: self.frames.dialog(terms, now),
            pace: Pace::new(now, self.cycle),
            has_identity: false,
            buffer: [0; BUFFER],
            stream,
            peer,
            bus: self,
        };
        let mut is_ready = (false, false);
        while !stop.is_stopped() {
            if let Err(error) = connection.turn(is_ready, port) {
                if connection.dialog.asks_who() {
                    connection.bus.hang_ups += 1;
                }
                return Err(error);
            }
            let mut sources = [connection.source()];
            let deadline = connection.deadline(port);
            poller
                .wait(&**port.clock(), deadline, &mut sources)
                .map_err(|error| no_wait(&error))?;
            is_ready = (sources[0].is_readable(), sources[0].is_writable());
        }
        Ok(())
    }
}

/// One connection with its socket: carries bytes between the socket, the dialog and the port.
struct Connection<'a> {
    bus: &'a mut S7Client,
    stream: TcpStream,
    peer: SocketAddr,
    dialog: Dialog,
    pace: Pace,
    has_identity: bool,
    buffer: [u8; BUFFER],
}

impl Connection<'_> {
    fn source(&self) -> Source<'_> {
        let interest = if self.dialog.to_write().is_empty() {
            Interest::Read
        } else {
            Interest::ReadWrite
        };
        Source::new(&self.stream, interest)
    }

    fn deadline(&self, port: &Port) -> Nanos {
        let mut deadline = self.dialog.deadline().min(port.due());
        if self.has_identity {
            deadline = deadline.min(self.pace.due());
        }
        deadline
    }

    fn turn(
        &mut self,
        (is_readable, is_writable): (bool, bool),
        port: &mut Port,
    ) -> Result<(), BusError> {
        let now = port.clock().now();
        if is_readable {
            self.read(now, port)?;
        }
        if self.has_identity && self.pace.take(now) {
            self.cycle(now, port);
        }
        if is_writable || !self.dialog.to_write().is_empty() {
            self.write()?;
        }
        self.dialog
            .check(now)
            .map_err(|end| end.into_error(self.peer))?;
        port.observe(now);
        Ok(())
    }

    fn read(&mut self, now: Nanos, port: &mut Port) -> Result<(), BusError> {
        let count = match self.stream.read(&mut self.buffer) {
            Ok(0) => return Err(self.left()),
            Ok(count) => count,
            Err(error) if is_for_later(&error) => return Ok(()),
            Err(error) => return Err(self.broke(&error)),
        };
        let mut count = count;
        loop {
            let news = self.dialog.hear(now, &self.buffer[..count]);
            count = 0;
            match news.map_err(|end| end.into_error(self.peer))? {
                None => return Ok(()),
                Some(News::Met(length, identity)) => self.meet(length, identity, port),
                Some(News::Done) => self.done(now, port),
            }
        }
    }

    fn meet(&mut self, length: u16, identity: Option<Identity>, port: &mut Port) {
        if identity.is_some() {
            self.bus.hang_ups = 0;
        }
        let line = identity.map(|identity| identity.line()).unwrap_or_default();
        let line = if line.is_empty() {
            let called = self.bus.options.called;
            format!("S7 CPU at {}, TSAP {called}", self.peer)
        } else {
            line
        };
        let may_write = self.bus.guard.meet(port, &line);
        self.dialog.allow(may_write);
        self.has_identity = true;
        port.tell("pdu", &length.to_string());
        port.running(&format!("connected with {}, {line}", self.peer));
    }

    /// A cycle is due.
    fn cycle(&mut self, now: Nanos, port: &mut Port) {
        if !self.dialog.is_idle() {
            port.count("s7.skipped");
            return;
        }
        if !port.sends(now) {
            return;
        }
        if self.bus.guard.may_write() {
            for image in &self.bus.frames.written {
                let frame = port.outgoing(image.station, now);
                self.dialog
                    .frame_to_write(image.station)
                    .copy_from_slice(frame);
            }
        }
        if let Some(News::Done) = self.dialog.begin(now) {
            self.done(now, port);
        }
    }

    /// A cycle is complete.
    fn done(&mut self, now: Nanos, port: &mut Port) {
        let asked = self.bus.guard.may_write() || !self.bus.frames.read.is_empty();
        for station in 0..port.stations() {
            let frame = self.dialog.frame_read(station);
            if !asked {
                // Nothing was read, and nothing may be written: the CPU has not been heard of.
            } else if frame.is_empty() {
                port.touch(station, now);
            } else {
                port.received(station, now, frame);
            }
            if self.bus.guard.may_write() {
                port.sent(station);
            }
        }
    }

    fn write(&mut self) -> Result<(), BusError> {
        loop {
            let rest = self.dialog.to_write();
            if rest.is_empty() {
                return Ok(());
            }
            match self.stream.write(rest) {
                Ok(count) => self.dialog.wrote(count),
                Err(error) if is_for_later(&error) => return Ok(()),
                Err(error) => return Err(self.broke(&error)),
            }
        }
    }

    fn left(&self) -> BusError {
        let peer = self.peer;
        BusError::Left(format!(
            "{peer} closed the connection; if it did so at once, check \"rack\" and \"slot\", and whether all its \
             connections are taken"
        ))
    }

    fn broke(&self, error: &std::io::Error) -> BusError {
        let peer = self.peer;
        BusError::Link(format!(
            "the connection with {peer} broke ({error}); see whether the CPU still runs"
        ))
    }
}

impl Drop for Connection<'_> {
    fn drop(&mut self) {
        bow_out(&self.stream);
    }
}
