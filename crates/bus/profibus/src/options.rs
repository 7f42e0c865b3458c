//! The bus's section of a driver.cfg.

mod details;
mod identity;
mod machine;
mod station;

use std::collections::BTreeMap;
use std::ops::RangeInclusive;
use std::path::Path;

use tickbus_base::Mistake;
use tickbus_base::os::{Parity, SerialSettings};
use tickbus_base::toml_text::{Collector, Key, Shape, Table, Value};
use tickbus_fieldbus::examine::Examination;
use tickbus_fieldbus::{
    At, Bus, BusKind, BusOptions, BusSetup, NamedFile, OBSERVES, OpenError, Role,
};
use tickbus_image::signal::{self, Area, Signal, SignalTable};
use tickbus_net::serial;

use crate::device::{LineOptions, ProfibusDevice, StationSetup};
use crate::drive::parameters;
use crate::layout::{Layout, Place};
use crate::observer::ProfibusObserver;
use crate::rates::{RATES, Rate, SLOT_TIME_LIMIT};
use crate::records::{RecordLayout, records};
use crate::station::Identity;
pub use station::{Device, StationOptions};
use station::{check_sizes, plain_acyclic, read_station};

/// The keys of the line, for the schema of a driver.cfg.
const KEYS: &[Key] = &[
    serial::DEVICE_KEY,
    Key::new("baud", Shape::Numbers(&BAUDS), "Bits per second").or("19200"),
    Key::new(
        "rs485",
        Shape::Boolean,
        "true: the port's driver switches the direction with RTS",
    )
    .or("false"),
    Key::new(
        "max_tsdr",
        Shape::whole(&MAX_TSDR),
        "In bits: an answer that would begin later is not sent; by the rate if it is left out",
    ),
];

const MAX_TSDR: RangeInclusive<i128> = 11..=SLOT_TIME_LIMIT as i128 - 1;

const BAUDS: [u32; RATES.len()] = {
    let mut bauds = [0; RATES.len()];
    let mut index = 0;
    while index < bauds.len() {
        bauds[index] = RATES[index].baud;
        index += 1;
    }
    bauds
};

/// The options of the bus `profibus-device`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Options {
    /// The serial line.
    pub line: LineOptions,
    /// The stations are observed; otherwise this end is them.
    observes: bool,
    /// The keys of a station in `[fieldbus]`.
    common: Keys,
    /// The keys of the `[[station]]` tables.
    own: Vec<Keys>,
    /// The positions of single signals in modules, by the signals' names, each with its offset.
    places: BTreeMap<String, (Place, usize)>,
    /// The offset of `[fieldbus]`.
    at: usize,
}

/// The keys of one station, as far as they could be read.
#[derive(Clone, Debug, PartialEq, Eq)]
enum Keys {
    Absent,
    /// The keys have mistakes, which are reported.
    Wrong,
    Right(Box<StationOptions>),
}

impl Keys {
    fn right(&self) -> Option<&StationOptions> {
        match self {
            Self::Right(options) => Some(&**options),
            Self::Absent | Self::Wrong => None,
        }
    }
}

impl BusKind for Options {
    const NAME: &'static str = "profibus-device";
    const KEYS: &'static [&'static [Key]] = &[KEYS, station::KEYS];
    const STATION_KEYS: &'static [Key] = station::OWN_KEYS;
    const CAN_OBSERVE: bool = true;

    fn read(role: Role, _moved: bool, table: &mut Table<'_>) -> Option<Self> {
        let device = table.require(
            "device",
            "name the serial port, such as device = \"/dev/ttyUSB0\"",
        );
        let baud = table.take("baud");
        let rs485 = table.take("rs485");
        let max_tsdr = table.take("max_tsdr");
        let common = read_station(table, false);
        if role == Role::Controller {
            table.wrong(
                "a \"profibus-device\" is the machine's end of the bus, a slave",
                "remove role = \"controller\"; tickbus is no PROFIBUS master",
            );
        }
        let device = device.and_then(|value| serial::read_device(&value));
        let rate = baud.map_or(Some(RATES[1]), |value| read_rate(&value));
        let rs485 = rs485.map_or(Some(false), |value| value.boolean());
        let max_tsdr = max_tsdr.map(|value| value.whole(MAX_TSDR));
        let rate = rate?;
        let max_tsdr = match max_tsdr {
            None => rate.max_tsdr,
            Some(stated) => u16::try_from(stated?).ok()?,
        };
        Some(Self {
            line: LineOptions {
                device: device?,
                settings: SerialSettings {
                    baud: rate.baud,
                    parity: Parity::Even,
                    two_stop_bits: false,
                    seven_bits: false,
                    rs485: rs485?,
                },
                max_tsdr,
            },
            observes: role == Role::Observer,
            common,
            own: Vec::new(),
            places: BTreeMap::new(),
            at: table.at(),
        })
    }
}

impl BusOptions for Options {
    fn summary(&self, _role: Role, _table: &SignalTable) -> Vec<String> {
        let line = [
            format!(
                "PROFIBUS DP on {} at {}",
                self.line.device, self.line.settings
            ),
            if self.observes {
                OBSERVES.to_owned()
            } else {
                format!("answers within {} bits", self.line.max_tsdr)
            },
        ];
        let stations = self.stations().map(|station| {
            let address = station.address;
            match &station.device {
                Device::Gsd { file, modules } if modules.is_empty() => {
                    format!("station {address} by {}", file.display())
                }
                Device::Gsd { file, modules } => {
                    let modules = modules.join("; ");
                    format!("station {address} by {} with {modules}", file.display())
                }
                Device::Plain { ident, .. } => format!("station {address} with ident {ident:04X}"),
            }
        });
        line.into_iter().chain(stations).collect()
    }

    fn files(&self) -> Vec<NamedFile> {
        let file = |station: &StationOptions| match &station.device {
            Device::Gsd { file, .. } => Some(NamedFile::Plain(file.clone())),
            Device::Plain { .. } => None,
        };
        self.stations().filter_map(file).collect()
    }

    fn open(&self, setup: &BusSetup<'_>) -> Result<Bus, OpenError> {
        let stations: Result<Vec<_>, _> = self.setups(setup.folder, setup.table).collect();
        let stations = stations.map_err(|(_, mistake)| OpenError::Config(mistake))?;
        Ok(Bus::Free(if self.observes {
            Box::new(ProfibusObserver::new(&self.line, stations))
        } else {
            Box::new(ProfibusDevice::new(&self.line, stations))
        }))
    }

    fn examine(&self, examination: &mut Examination<'_>) {
        self.examine_line(examination);
    }

    fn has_diagnosis(&self) -> bool {
        true
    }

    fn has_addresses(&self) -> bool {
        true
    }

    fn place_signals(&mut self, lines: &[At<'_>], table: &SignalTable) {
        for line in lines {
            let signal = &table.signals[line.signal];
            let place = line.text.parse().and_then(|place: Place| {
                place.suits(signal)?;
                Ok(place)
            });
            match place {
                Ok(place) => {
                    self.places.insert(signal.name.clone(), (place, line.at()));
                }
                Err(mistake) => line.refuse(mistake),
            }
        }
    }

    fn place(&self, signal: &Signal, _table: &SignalTable) -> String {
        let place = self.places.get(&signal.name);
        place.map_or_else(String::new, |(place, _)| place.to_string())
    }

    fn read_station(&mut self, _count: usize, table: &mut Table<'_>) {
        let read = read_station(table, true);
        if let Some(station) = read.right() {
            let same = |other: &&StationOptions| other.address == station.address;
            if let Some(twin) = self.own.iter().filter_map(Keys::right).find(same) {
                table.collector().report(
                    station.at,
                    format!("\"address\" is that of the station on line {}", twin.line),
                    "give each station an address of its own",
                );
            }
        }
        self.own.push(read);
    }

    fn check_files(&self, folder: &Path, table: &SignalTable, collector: &Collector<'_>) {
        for (at, mistake) in self.setups(folder, table).filter_map(Result::err) {
            collector.collect(at, mistake);
        }
    }

    fn details(&self, folder: &Path, table: &SignalTable) -> Vec<(String, String)> {
        let table = &table.as_in_plc();
        let stations = self.stations().enumerate().take(table.stations.len());
        let details = stations.map(|(index, station)| {
            let has_places = self.have_places(table, index);
            let line = (!self.observes).then_some(&self.line);
            let identity = self.identity(station, folder, table, index).ok()?;
            station.details(line, folder, &identity, has_places)
        });
        details.flatten().flatten().collect()
    }

    fn fit(&self, table: &SignalTable, collector: &Collector<'_>) {
        if self.own.is_empty() && self.common == Keys::Absent {
            collector.report(
                self.at,
                "the station has no address",
                "write address = 3, and gsd = \"device.gsd\" with its modules, or an ident",
            );
        }
        if let (Some(common), false) = (self.common.right(), self.own.is_empty()) {
            collector.report(
                common.at,
                "\"address\" stands in [fieldbus], but there are [[station]] tables",
                "write it, and what the device is, into those",
            );
            return;
        }
        if self.own.contains(&Keys::Wrong) {
            return;
        }
        let stations = self.stations().zip(&table.stations).enumerate();
        for (index, (station, signals)) in stations {
            let has_places = self.have_places(table, index);
            if let Device::Plain { configuration, .. } = &station.device
                && let Err(mistake) = check_sizes(configuration.as_ref(), signals, has_places)
            {
                collector.collect(station.at, mistake);
            }
        }
    }
}

impl Options {
    /// The identities of the stations; a mistake comes with its offset in the driver.cfg.
    fn setups(
        &self,
        folder: &Path,
        table: &SignalTable,
    ) -> impl Iterator<Item = Result<StationSetup, (usize, Mistake)>> {
        let table = table.as_in_plc();
        let stations = self.stations().enumerate().take(table.stations.len());
        stations.map(move |(index, station)| {
            let signals = &table.stations[index];
            let exchanged = self.exchanged(&table, index);
            let mut identity = station.identity(folder, &exchanged)?;
            let layout = |area| {
                let own = table.signals.iter();
                let own = own.filter(|signal| (signal.station, signal.area) == (index, area));
                Layout::new(own, &self.places, &identity.configuration, area)
            };
            let (inputs, outputs) = (layout(Area::Input)?, layout(Area::Output)?);
            station.check_modules(&identity, signals, self.have_places(&table, index))?;
            let records = self.add_records(station, &table, index, &mut identity)?;
            Ok(StationSetup {
                address: station.address,
                identity,
                inputs,
                outputs,
                records,
                sizes: [signals.input_bytes, signals.output_bytes],
            })
        })
    }

    /// The identity of a station, with its records.
    fn identity(
        &self,
        station: &StationOptions,
        folder: &Path,
        table: &SignalTable,
        index: usize,
    ) -> Result<Identity, (usize, Mistake)> {
        let mut identity = station.identity(folder, &self.exchanged(table, index))?;
        self.add_records(station, table, index, &mut identity)?;
        Ok(identity)
    }

    /// The station with the sizes of the signals that the exchange of data carries.
    fn exchanged(&self, table: &SignalTable, index: usize) -> signal::Station {
        let mut own = table.stations[index].clone();
        for (area, bytes) in [
            (Area::Input, &mut own.input_bytes),
            (Area::Output, &mut own.output_bytes),
        ] {
            let signals = table.signals.iter();
            let signals = signals.filter(|signal| (signal.station, signal.area) == (index, area));
            let is_exchanged = |signal: &&Signal| {
                let place = self.places.get(&signal.name);
                place.is_none_or(|(place, _)| place.is_exchanged())
            };
            let (exchanged, others): (Vec<_>, Vec<_>) = signals.partition(is_exchanged);
            if !others.is_empty() {
                let ends = exchanged.iter().map(|signal| signal.address().bits().end);
                *bytes = ends.max().unwrap_or(0).div_ceil(8);
            }
        }
        own
    }

    /// Adds the records of a station, and with them the services of a device without a GSD file; returns the positions
    /// of their signals.
    fn add_records(
        &self,
        station: &StationOptions,
        table: &SignalTable,
        index: usize,
        identity: &mut Identity,
    ) -> Result<Vec<RecordLayout>, (usize, Mistake)> {
        if let Device::Plain { ident, .. } = station.device {
            // Stations of one kind have the same services.
            let is_same = |(_, other): &(usize, &StationOptions)| matches!(other.device, Device::Plain { ident: of, .. } if of == ident);
            let mut same = self.stations().enumerate().filter(is_same);
            if same.any(|(index, other)| self.first_record(other, table, index).is_some()) {
                identity.dpv1 = true;
                identity.acyclic = plain_acyclic(&format!("ident {ident:04X}"));
            }
        }
        if let Some(at) = self.first_record(station, table, index) {
            station.check_records(identity, at)?;
        }
        let own = &mut identity.acyclic;
        (station.identity).complete(station.address, &mut own.nameplate);
        own.send_timeout = send_timeout(self.line.settings.baud);
        let signals = table.signals.iter();
        let (slots, room) = (identity.configuration.slots(), own.room());
        let all = records(
            &station.records,
            signals.filter(|signal| signal.station == index),
            &self.places,
            slots,
            room,
        )?;
        let (records, mut layouts): (Vec<_>, Vec<_>) = all.into_iter().unzip();
        own.records = records;
        let signals = table.signals.iter();
        let signals = signals.filter(|signal| signal.station == index);
        let image = &table.stations[index];
        let sizes = [image.input_bytes, image.output_bytes];
        let all = parameters(&station.parameters, signals, &self.places, sizes)?;
        let (parameters, more): (Vec<_>, Vec<_>) = all.into_iter().unzip();
        own.parameters = parameters;
        layouts.extend(more);
        station.check_indices(identity)?;
        Ok(layouts)
    }

    /// The offset of a record of the station in the driver.cfg, if there is any.
    fn first_record(
        &self,
        station: &StationOptions,
        table: &SignalTable,
        index: usize,
    ) -> Option<usize> {
        let records = station.records.iter().map(|(_, at)| *at);
        let parameters = station.parameters.iter().map(|(_, at)| *at);
        let fixed = records.chain(parameters);
        let signals = table.signals.iter().filter(|own| own.station == index);
        let places = signals.filter_map(|signal| self.places.get(&signal.name));
        let places = places.filter(|(place, _)| !place.is_exchanged());
        fixed.chain(places.map(|(_, at)| *at)).next()
    }

    /// True if any inputs, and any outputs, of a station have their own positions.
    fn have_places(&self, table: &SignalTable, station: usize) -> [bool; 2] {
        [Area::Input, Area::Output].map(|area| {
            let own = table.signals.iter();
            let mut own = own.filter(|signal| (signal.station, signal.area) == (station, area));
            own.any(|signal| self.places.contains_key(&signal.name))
        })
    }

    /// The stations without mistakes, in the order of the signal table.
    pub fn stations(&self) -> impl Iterator<Item = &StationOptions> {
        std::iter::once(&self.common)
            .chain(&self.own)
            .filter_map(Keys::right)
    }
}

/// `Send_Timeout` of the connections of other masters, in units of 10 ms: the values that devices with a common chip
/// have.
fn send_timeout(baud: u32) -> u16 {
    match baud {
        ..500_000 => 400,
        500_000 => 200,
        _ => 100,
    }
}

fn read_rate(value: &Value<'_>) -> Option<Rate> {
    let baud = value.whole(1..=i128::from(u32::MAX))?;
    let found = RATES.iter().find(|rate| i128::from(rate.baud) == baud);
    if found.is_none() {
        let rates: Vec<String> = RATES.iter().map(|rate| rate.baud.to_string()).collect();
        value.wrong(
            format!("{baud} is no rate of PROFIBUS"),
            format!("the rates are {}", rates.join(", ")),
        );
    }
    found.copied()
}
