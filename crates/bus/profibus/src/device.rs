//! The bus: moves bytes between the serial port and the stations, and frames between the stations and the image.

mod diagnosis;
mod line;

use tickbus_base::os::SerialSettings;
use tickbus_base::time::{Nanos, Stop};
use tickbus_fieldbus::{BusError, Cause, Free, PlcState, Port, Receipt};

use crate::event::{Event, Leaving};
use crate::layout::Layout;
use crate::records::RecordLayout;
use crate::station::{Identity, Process};

/// The line's message while it has no master.
const WAITS: &str = "waiting for a master";

/// The line of a driver.cfg.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LineOptions {
    /// The system's name of the serial port.
    pub device: String,
    /// The settings of the port.
    pub settings: SerialSettings,
    /// The device drops an answer that is more than this many bits late: the master repeats its request by then, and
    /// both would collide.
    pub max_tsdr: u16,
}

/// The bus of kind `profibus-device`.
#[derive(Debug)]
pub struct ProfibusDevice {
    options: LineOptions,
    stations: Vec<StationSetup>,
}

/// A station of the line.
#[derive(Clone, Debug)]
pub(crate) struct StationSetup {
    pub(crate) address: u8,
    pub(crate) identity: Identity,
    /// The positions of the signals among the bytes that the station sends and receives.
    pub(crate) inputs: Layout,
    pub(crate) outputs: Layout,
    /// The positions of the signals in each record.
    pub(crate) records: Vec<RecordLayout>,
    /// The bytes of `%I` and of `%Q` in the PLC's image.
    pub(crate) sizes: [usize; 2],
}

impl ProfibusDevice {
    /// The bus that `options` describe, with its stations.
    pub(crate) fn new(options: &LineOptions, stations: Vec<StationSetup>) -> Self {
        Self {
            options: options.clone(),
            stations,
        }
    }
}

impl Free for ProfibusDevice {
    fn run(&mut self, port: &mut Port, stop: &Stop) -> Result<(), BusError> {
        line::serve(&self.options, &self.stations, port, stop)
    }
}

/// The driver's side of the stations.
#[derive(Debug)]
struct Stations {
    /// In the order of the signal table.
    all: Vec<Side>,
}

#[derive(Debug)]
struct Side {
    address: u8,
    /// Receipt for the inputs that the master may have by now.
    receipt: Option<Receipt>,
    exchanges: bool,
    inputs: Layout,
    outputs: Layout,
    /// The outputs in the layout of the image.
    frame: Vec<u8>,
    /// The records, each with its octets as a master last wrote them.
    records: Vec<(RecordLayout, Vec<u8>)>,
    /// A master has written a record since the last outputs.
    is_written: bool,
    is_cleared: bool,
}

impl Side {
    /// Copies the outputs in all records into the frame of the image.
    fn take_records(&mut self) {
        for (layout, octets) in &self.records {
            layout.take(octets, &mut self.frame);
        }
    }
}

impl Stations {
    fn new(setups: &[StationSetup], port: &Port) -> Self {
        let side = |(index, setup): (usize, &StationSetup)| Side {
            address: setup.address,
            receipt: None,
            exchanges: false,
            inputs: setup.inputs.clone(),
            outputs: setup.outputs.clone(),
            frame: vec![0; port.sizes(index).1],
            records: {
                let own = &setup.identity.acyclic;
                let records = own.records.iter().map(|record| record.octets.clone());
                let parameters = own.parameters.iter().map(|own| own.octets.clone());
                let octets = records.chain(parameters);
                setup.records.iter().cloned().zip(octets).collect()
            },
            is_written: false,
            is_cleared: false,
        };
        Self {
            all: setups.iter().enumerate().map(side).collect(),
        }
    }

    /// The line is gone, and with it the masters of all stations.
    fn lost(&mut self, port: &mut Port, why: &str) {
        let now = port.clock().now();
        for (index, side) in self.all.iter_mut().enumerate() {
            if std::mem::take(&mut side.exchanges) {
                port.station_left(index, now, Cause::Link, why);
            }
        }
    }

    /// The addresses of the stations that exchange data, as text.
    fn exchanging(&self) -> Option<String> {
        let exchanging = self.all.iter().filter(|side| side.exchanges);
        let all: Vec<String> = exchanging.map(|side| side.address.to_string()).collect();
        (!all.is_empty()).then(|| all.join(" "))
    }
}

/// The stations and the port, while a telegram is served.
struct Machine<'a> {
    stations: &'a mut Stations,
    port: &'a mut Port,
}

const fn cause(why: &Leaving) -> Cause {
    match why {
        Leaving::Watchdog(_) => Cause::Link,
        Leaving::Released { .. } => Cause::Left,
        _ => Cause::Refused,
    }
}

impl Machine<'_> {
    /// The index of the station in the signal table.
    fn index(&self, address: u8) -> usize {
        let all = &self.stations.all;
        let found = all.iter().position(|side| side.address == address);
        found.expect("only own stations are served")
    }

    fn tell_exchanging(&self) {
        let all = self.stations.exchanging();
        self.port
            .tell("exchanging", all.as_deref().unwrap_or("none"));
    }

    fn left(&mut self, address: u8, why: &Leaving) {
        let text = format!("station {address}: {why}");
        if let Some(others) = self.stations.exchanging() {
            self.port.log(
                log::Level::Warn,
                "station left",
                format_args!("{text}; data are exchanged with {others}"),
            );
            return;
        }
        let error = match cause(why) {
            Cause::Link => BusError::Link(text),
            Cause::Left => BusError::Left(text),
            _ => BusError::Refused(text),
        };
        self.port.lost(&error, WAITS);
    }
}

impl Process for Machine<'_> {
    fn is_up(&mut self, station: u8, now: Nanos) -> bool {
        let index = self.index(station);
        self.port.is_station_up(index, now)
    }

    fn inputs(&mut self, station: u8, now: Nanos, inputs: &mut [u8]) -> bool {
        let index = self.index(station);
        let Some(mut frames) = self.port.take(index..index + 1, now) else {
            return false;
        };
        let side = &mut self.stations.all[index];
        // The modules may have more bytes than the signals.
        side.inputs.send(frames.frame(index), inputs);
        side.receipt = Some(frames.receipt());
        true
    }

    fn delivered(&mut self, station: u8) {
        let index = self.index(station);
        if let Some(receipt) = self.stations.all[index].receipt.take() {
            self.port.sent(&receipt);
        }
    }

    fn outputs(&mut self, station: u8, now: Nanos, outputs: &[u8]) {
        let index = self.index(station);
        let side = &mut self.stations.all[index];
        side.is_written = false;
        if side.records.is_empty() {
            let frame = side.outputs.receive(outputs, &mut side.frame);
            return self.port.received(index, now, frame);
        }
        side.outputs.take(outputs, &mut side.frame);
        side.take_records();
        self.port.received(index, now, &side.frame);
    }

    fn alive(&mut self, station: u8, now: Nanos) {
        let index = self.index(station);
        let side = &mut self.stations.all[index];
        if side.is_cleared || !std::mem::take(&mut side.is_written) {
            return self.port.touch(index, now);
        }
        side.take_records();
        self.port.received(index, now, &side.frame);
    }

    fn read_record(&mut self, station: u8, now: Nanos, record: usize, octets: &mut [u8]) {
        let index = self.index(station);
        self.port.count("profibus-device.records_read");
        // The line is up: a request has come over it.
        if let Some(mut frames) = self.port.look(index..index + 1, now) {
            let side = &self.stations.all[index];
            let (layout, _) = &side.records[record];
            layout.fill(frames.frame(index), octets);
            layout.reflect(&side.frame, octets);
        }
    }

    /// The outputs in the record become those of the image with the next exchange, which shows that the master lives.
    fn wrote_record(&mut self, station: u8, _now: Nanos, record: usize, octets: &[u8]) {
        let index = self.index(station);
        self.port.count("profibus-device.records_written");
        let side = &mut self.stations.all[index];
        side.records[record].1.copy_from_slice(octets);
        side.is_written = true;
    }

    fn tell(&mut self, station: u8, now: Nanos, event: Event) {
        let index = self.index(station);
        match event {
            Event::Parameterised { master } => {
                log::debug!("station {station}: parameters of master {master}");
            }
            Event::Exchanges { master } => {
                self.stations.all[index].exchanges = true;
                self.port.plc_state(index, now, PlcState::Run);
                self.tell_exchanging();
                self.port
                    .running(&format!("master {master} exchanges data"));
            }
            Event::Cleared => {
                self.stations.all[index].is_cleared = true;
                self.port.plc_state(index, now, PlcState::Stop);
            }
            Event::Operates => {
                self.stations.all[index].is_cleared = false;
                self.port.plc_state(index, now, PlcState::Run);
            }
            Event::RecordRefused {
                master,
                writes,
                slot,
                index,
                why,
            } => {
                let verb = if writes { "write" } else { "read" };
                self.port.log(
                    log::Level::Warn,
                    "record refused",
                    format_args!(
                        "station {station}: master {master} cannot {verb} record {index} of slot {slot}: {why}"
                    ),
                );
            }
            Event::AlarmDropped { kind, slot } => self.port.log(
                log::Level::Warn,
                "alarm dropped",
                format_args!(
                    "station {station}: no {kind} alarm of slot {slot} was sent: the master's parameters do not enable this \
                     type, or the device's GSD file does not have it"
                ),
            ),
            Event::Left(why) => {
                self.stations.all[index].receipt = None;
                self.stations.all[index].is_cleared = false;
                if std::mem::take(&mut self.stations.all[index].exchanges) {
                    // The outputs are cleared at once, however recent they are.
                    let reason = format!("station {station}: {why}");
                    self.port.station_left(index, now, cause(&why), &reason);
                    self.tell_exchanging();
                }
                self.left(station, &why);
            }
        }
    }
}
