//! The bus `ivi-reader`: a simulated reader whose heads are stations.

use std::io;

use tickbus_base::time::{Nanos, Pace, Stop};
use tickbus_base::toml_text::Table;
use tickbus_fieldbus::tcp::{Call, Caller};
use tickbus_fieldbus::{BusError, Free, Port};
use tickbus_image::signal::SignalTable;
use tickbus_net::serial::{self, gone};

use crate::heads::HeadNumbers;
use crate::{Carrier, CarrierType, HEADS, Head, LineOptions, Reader, Status};

/// The machine's inputs to a head, before the initial data of a carrier.
pub(crate) const INPUTS: [&str; 8] = [
    "flags", "fault", "unused", "unused", "number", "number", "number", "number",
];

/// The machine's outputs from a head, before its carrier's data.
pub(crate) const OUTPUTS: [&str; 8] = [
    "flags", "writes", "unused", "unused", "unused", "unused", "unused", "unused",
];

/// The lengths of these.
pub(crate) const BEFORE_DATA: [usize; 2] = [INPUTS.len(), OUTPUTS.len()];

/// A carrier is in front of the head; in the machine's outputs: the head has taken it over.
const PRESENT: u8 = 1;
/// The head's cable is unplugged.
const UNPLUGGED: u8 = 2;
/// The carrier is protected against writing.
const PROTECTED: u8 = 4;

/// The options of the bus `ivi-reader`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ReaderOptions {
    /// The line.
    pub line: LineOptions,
    pub(crate) heads: HeadNumbers,
}

impl ReaderOptions {
    /// Reads the keys of the bus.
    pub(crate) fn read(table: &mut Table<'_>) -> Option<Self> {
        let line = LineOptions::read(table, true);
        let heads = HeadNumbers::read(table);
        Some(Self {
            line: line?,
            heads: heads?,
        })
    }
}

/// The bus of kind `ivi-reader`.
#[derive(Debug)]
pub(crate) struct IviReader {
    options: ReaderOptions,
    cycle: Nanos,
    stations: Vec<Station>,
    /// Kept when the line breaks: its carriers hold the written data.
    reader: Reader,
}

/// A station, which is a head.
#[derive(Debug)]
struct Station {
    head: u8,
    /// The frame that the machine reads.
    frame: Vec<u8>,
}

impl IviReader {
    pub(crate) fn new(options: &ReaderOptions, table: &SignalTable, cycle: Nanos) -> Self {
        let stations = table.stations.iter().enumerate();
        let stations = stations.map(|(index, station)| Station {
            head: options.heads.of(index),
            frame: vec![0; station.output_bytes],
        });
        let stations: Vec<Station> = stations.collect();
        let mut heads: [Head; HEADS] = Default::default();
        for station in &stations {
            heads[usize::from(station.head) - 1].is_connected = true;
        }
        Self {
            options: options.clone(),
            cycle,
            stations,
            // A reader has no time-out.
            reader: Reader::new(heads, options.line.timing(Nanos::ZERO)),
        }
    }
}

impl Free for IviReader {
    fn run(&mut self, port: &mut Port, stop: &Stop) -> Result<(), BusError> {
        let line = self.options.line.clone();
        // The carrier may have changed while there was no port.
        let now = port.clock().now();
        take(&mut self.reader, &self.stations, line.carriers, now, port);
        if let Some(link) = line.made() {
            let terminal = tickbus_base::os::LinkedTerminal::open(link).map_err(|error| {
                if error.kind() == io::ErrorKind::Unsupported {
                    return BusError::Link(error.to_string());
                }
                BusError::Link(format!(
                    "cannot make the pseudo-terminal {} ({error}); remove what is there, or name a folder that can be \
                     written",
                    link.display()
                ))
            })?;
            return self.serve(Call::new(terminal), port, stop);
        }
        let device = serial::open(&line.device, line.settings())?;
        self.serve(Call::new(device), port, stop)
    }
}

impl IviReader {
    fn serve<S: tickbus_net::Stream>(
        &mut self,
        mut call: Call<S>,
        port: &mut Port,
        stop: &Stop,
    ) -> Result<(), BusError> {
        let device = self.options.line.port();
        port.tell("device", device);
        port.opening(&format!("listening on {device}"));
        self.reader.unplug();
        let mut serving = Serving {
            line: &self.options.line,
            stations: &mut self.stations,
            reader: &mut self.reader,
            pace: Pace::new(port.clock().now(), self.cycle),
            is_heard: false,
            is_up: true,
        };
        call.run(&mut serving, port, stop)
    }
}

/// A reader on a line.
struct Serving<'a> {
    line: &'a LineOptions,
    stations: &'a mut [Station],
    reader: &'a mut Reader,
    pace: Pace,
    /// A command has come since the last report to the machine.
    is_heard: bool,
    /// The line is not down by an injected fault.
    is_up: bool,
}

impl Serving<'_> {
    fn take(&mut self, now: Nanos, port: &mut Port) {
        take(self.reader, self.stations, self.line.carriers, now, port);
    }

    /// Reports the current content of the carriers to the machine.
    fn tell(&mut self, now: Nanos, port: &mut Port) {
        if !std::mem::take(&mut self.is_heard) {
            return;
        }
        port.together(|port| {
            for (index, station) in self.stations.iter_mut().enumerate() {
                show(self.reader.head(station.head), &mut station.frame);
                port.received(index, now, &station.frame);
            }
        });
        port.running("a client is asking");
    }

    fn count(heard: crate::Heard, port: &Port) -> bool {
        for _ in 0..heard.damaged {
            port.count("ivi-reader.damaged");
        }
        heard.commands > 0
    }
}

/// Takes over the machine's settings of its heads and carriers.
fn take(reader: &mut Reader, stations: &[Station], kind: CarrierType, now: Nanos, port: &mut Port) {
    let Some(mut frames) = port.look(0..stations.len(), now) else {
        return;
    };
    for (index, station) in stations.iter().enumerate() {
        place(reader.head_mut(station.head), frames.frame(index), kind);
    }
    let receipt = frames.receipt();
    port.sent(&receipt);
}

/// Sets a head up as the machine writes it. A carrier that stays keeps its octets.
fn place(head: &mut Head, frame: &[u8], kind: CarrierType) {
    let [flags, fault, ..] = *frame else {
        return;
    };
    head.is_connected = flags & UNPLUGGED == 0;
    head.fault = (fault != 0).then_some(Status(fault));
    if flags & PRESENT == 0 {
        head.carrier = None;
        return;
    }
    let carrier = head.carrier.get_or_insert_with(|| {
        let data = &frame[INPUTS.len()..];
        let mut carrier = Carrier::new(kind, &data[..data.len().min(kind.size())]);
        let number = &frame[4..INPUTS.len()];
        if number != [0; 4] {
            carrier.number.extend_from_slice(number);
        }
        carrier
    });
    carrier.is_protected = flags & PROTECTED != 0;
}

/// Writes the frame that the machine reads of a head. The data of a carrier that has left stay until the next one
/// comes.
fn show(head: &Head, frame: &mut [u8]) {
    let (before, data) = frame.split_at_mut(OUTPUTS.len());
    before[0] = if head.carrier.is_some() { PRESENT } else { 0 };
    before[1] = head.writes;
    if let Some(carrier) = &head.carrier {
        let count = data.len().min(carrier.octets.len());
        data[..count].copy_from_slice(&carrier.octets[..count]);
    }
}

impl Caller for Serving<'_> {
    fn hear(&mut self, now: Nanos, bytes: &[u8], port: &mut Port) -> Result<(), BusError> {
        // An injected fault has taken the line down; nothing passes.
        if !port.is_up(now) {
            return Ok(());
        }
        self.take(now, port);
        let heard = self.reader.hear(now, bytes);
        self.is_heard |= Self::count(heard, port);
        self.tell(now, port);
        Ok(())
    }

    fn turn(&mut self, now: Nanos, port: &mut Port) -> Result<(), BusError> {
        if self.pace.take(now) {
            self.take(now, port);
        }
        self.is_up = port.is_up(now);
        if self.is_up {
            let heard = self.reader.turn(now);
            self.is_heard |= Self::count(heard, port);
            self.tell(now, port);
        }
        Ok(())
    }

    fn to_write(&self, _now: Nanos) -> &[u8] {
        self.reader.to_write()
    }

    fn wrote(&mut self, _now: Nanos, count: usize, _port: &mut Port) {
        self.reader.wrote(count);
    }

    fn deadline(&self, port: &Port) -> Nanos {
        let stale = port.stale_at(port.clock().now());
        let due = if self.is_up {
            self.reader.deadline()
        } else {
            Nanos::MAX
        };
        due.min(self.pace.due()).min(stale)
    }

    fn left(&mut self) -> BusError {
        gone(self.line.port(), "it was closed").into()
    }

    fn broke(&mut self, error: &io::Error) -> BusError {
        gone(self.line.port(), error).into()
    }
}
