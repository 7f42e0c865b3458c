//! What a driver.cfg says to the bus.

use std::fs;
use std::path::{Path, PathBuf};

use tickbus_axis::Axis;
use tickbus_base::Mistake;
use tickbus_base::os::{Parity, SerialSettings};
use tickbus_base::toml_text::{Collector, Table, Value};
use tickbus_fieldbus::{Bus, BusKind, BusOptions, BusSetup, OpenError, Role, serial};
use tickbus_image::signal::{self, SignalTable};

use crate::configuration::Configuration;
use crate::device::{LineOptions, ProfibusDevice};
use crate::gsd::Gsd;
use crate::station::Identity;
use crate::telegram::DATA_LIMIT;

/// The rates of the standard, in bits per second, each with the longest wait before an answer, in bits.
const RATES: [(u32, u16); 10] = [
    (9_600, 60),
    (19_200, 60),
    (45_450, 60),
    (93_750, 60),
    (187_500, 60),
    (500_000, 100),
    (1_500_000, 150),
    (3_000_000, 250),
    (6_000_000, 450),
    (12_000_000, 800),
];

/// The longest path of a GSD file, in characters.
const PATH_LIMIT: usize = 1000;

/// The longest name of a module, in characters.
const NAME_LIMIT: usize = 200;

/// The most modules of a station.
const MODULE_LIMIT: usize = 244;

/// A GSD file is at most this long, in bytes.
const GSD_LIMIT: u64 = 16 << 20;

/// The options of the bus `profibus-device`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Options {
    /// The serial line.
    pub line: LineOptions,
    /// The keys of a station in `[fieldbus]`.
    common: Keys,
    /// Those of the `[[station]]` tables.
    own: Vec<Keys>,
    /// The offset of `[fieldbus]`.
    at: usize,
}

/// The keys of one station, as far as they could be read.
#[derive(Clone, Debug, PartialEq, Eq)]
enum Keys {
    Absent,
    /// They have mistakes, which are reported.
    Wrong,
    Right(StationOptions),
}

impl Keys {
    fn right(&self) -> Option<&StationOptions> {
        match self {
            Self::Right(options) => Some(options),
            Self::Absent | Self::Wrong => None,
        }
    }
}

/// The keys of one station.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct StationOptions {
    /// Its address on the line.
    pub address: u8,
    /// Which device it is.
    pub device: Device,
    /// The offset of its address, and the line.
    at: usize,
    line: usize,
}

/// Which device a station is.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Device {
    /// That of a GSD file, with these modules.
    Gsd {
        /// The file as written: relative to the folder of the driver.cfg.
        file: PathBuf,
        /// Their names.
        modules: Vec<String>,
    },
    /// One without a file.
    Plain {
        /// The number of its kind.
        ident: u16,
        /// Its modules; `None` for any that have the sizes of its signals.
        configuration: Option<Configuration>,
    },
}

impl BusKind for Options {
    const NAME: &'static str = "profibus-device";

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
        let max_tsdr = max_tsdr.map(|value| value.whole(11..=65_535));
        let (baud, standard) = rate?;
        let max_tsdr = match max_tsdr {
            None => standard,
            Some(stated) => u16::try_from(stated?).ok()?,
        };
        Some(Self {
            line: LineOptions {
                device: device?,
                settings: SerialSettings {
                    baud,
                    parity: Parity::Even,
                    two_stop_bits: false,
                    rs485: rs485?,
                },
                max_tsdr,
            },
            common,
            own: Vec::new(),
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
            format!("answers within {} bits", self.line.max_tsdr),
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

    fn open(&self, setup: &BusSetup<'_>) -> Result<Bus, OpenError> {
        let stations = self.stations().zip(&setup.table.stations);
        let identities: Result<Vec<_>, _> = stations
            .map(|(station, signals)| {
                let identity = station.identity(setup.folder, signals);
                Ok((station.address, identity.map_err(OpenError::Config)?))
            })
            .collect();
        Ok(Bus::Free(Box::new(ProfibusDevice::new(
            &self.line,
            identities?,
        ))))
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

    fn fit(&self, table: &SignalTable, _axes: &[Axis], collector: &Collector<'_>) {
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
        for (station, signals) in self.stations().zip(&table.stations) {
            if let Device::Plain { configuration, .. } = &station.device
                && let Err(mistake) = check_sizes(configuration.as_ref(), signals)
            {
                collector.collect(station.at, mistake);
            }
        }
    }
}

impl Options {
    /// The stations, in the order of the signal table; none of those with mistakes.
    pub fn stations(&self) -> impl Iterator<Item = &StationOptions> {
        std::iter::once(&self.common)
            .chain(&self.own)
            .filter_map(Keys::right)
    }
}

/// Whether signals of these sizes fit into the modules, or into any station.
fn check_sizes(
    configuration: Option<&Configuration>,
    signals: &signal::Station,
) -> Result<(), Mistake> {
    let limits = configuration.map_or([DATA_LIMIT; 2], |own| [own.inputs(), own.outputs()]);
    let sizes = [("%I", signals.input_bytes), ("%Q", signals.output_bytes)];
    for ((area, size), limit) in sizes.into_iter().zip(limits) {
        if size > limit {
            let right = if configuration.is_some() {
                "give it more modules, or the signals lower addresses"
            } else {
                "spread the signals over several stations"
            };
            let what = format!("the signals have {size} bytes of {area}, and the station {limit}");
            return Err(Mistake::new(what, right));
        }
    }
    Ok(())
}

impl StationOptions {
    /// The device that it is, whose signals have these sizes.
    fn identity(&self, folder: &Path, signals: &signal::Station) -> Result<Identity, Mistake> {
        let (file, modules) = match &self.device {
            Device::Gsd { file, modules } => (folder.join(file), modules),
            Device::Plain {
                ident,
                configuration,
            } => {
                let by_sizes =
                    || Configuration::of_sizes(signals.input_bytes, signals.output_bytes);
                return Ok(Identity {
                    ident: *ident,
                    configuration: configuration.clone().unwrap_or_else(by_sizes),
                    sync: true,
                    freeze: true,
                    fail_safe: false,
                    dpv1: false,
                });
            }
        };
        let name = file.display();
        let size = fs::metadata(&file).map(|file| file.len());
        if size.is_ok_and(|size| size > GSD_LIMIT) {
            return Err(Mistake::new(
                format!("{name} is larger than 16 MiB, and no GSD file"),
                "name another one in \"gsd\"",
            ));
        }
        let bytes = fs::read(&file).map_err(|error| {
            Mistake::new(
                format!("cannot read the GSD file {name} ({error})"),
                "correct \"gsd\", or put the file there",
            )
        })?;
        let gsd = Gsd::read(&bytes).map_err(|why| {
            Mistake::new(
                format!("{name}: {why}"),
                "name the GSD file that the PLC's project has, too",
            )
        })?;
        let of_station = |mistake: Mistake| {
            let what = format!("station {}: {}", self.address, mistake.what);
            Mistake::new(what, mistake.right)
        };
        let identity = gsd.identity(modules).map_err(of_station)?;
        check_sizes(Some(&identity.configuration), signals).map_err(of_station)?;
        Ok(identity)
    }
}

fn read_rate(value: &Value<'_>) -> Option<(u32, u16)> {
    let baud = value.whole(1..=i128::from(u32::MAX))?;
    let found = RATES.iter().find(|(rate, _)| i128::from(*rate) == baud);
    if found.is_none() {
        let rates: Vec<String> = RATES.iter().map(|(rate, _)| rate.to_string()).collect();
        value.wrong(
            format!("{baud} is no rate of PROFIBUS"),
            format!("the rates are {}", rates.join(", ")),
        );
    }
    found.copied()
}

/// Reads the keys of a station, which has to be there or not.
fn read_station(table: &mut Table<'_>, is_required: bool) -> Keys {
    const ADDRESS: &str = "write the station's address in the PLC's project, such as address = 3";
    let address = if is_required {
        table.require("address", ADDRESS)
    } else {
        table.take("address")
    };
    let gsd = table.take("gsd");
    let modules = table.take("modules");
    let ident = table.take("ident");
    let config = table.take("config");
    let others = [&gsd, &modules, &ident, &config];
    if !is_required && address.is_none() {
        let Some(stray) = others.into_iter().flatten().next() else {
            return Keys::Absent;
        };
        stray.wrong("the station has no address", ADDRESS);
        return Keys::Wrong;
    }
    for (key, value) in [("ident", &ident), ("config", &config)] {
        if let (Some(_), Some(value)) = (&gsd, value) {
            let what = format!("\"{key}\" stands beside \"gsd\", which says that");
            value.wrong(what, "remove one of the two");
        }
    }
    if let (Some(modules), None) = (&modules, &gsd) {
        modules.wrong(
            "\"modules\" stands without \"gsd\"",
            "name the GSD file that has them, or write config = [0x50, 0x60]",
        );
    }
    let line = address.as_ref().map_or(0, Value::line);
    let at = address.as_ref().map_or(table.at(), Value::at);
    let address = address.and_then(|value| value.whole(0..=125));
    let address = address.and_then(|address| u8::try_from(address).ok());
    let device = match (gsd, ident) {
        (Some(gsd), ident) => {
            let file = gsd.label(PATH_LIMIT, "name the device's GSD file");
            let modules = modules.map_or(Some(Vec::new()), |value| read_modules(&value));
            let is_right = ident.is_none() && config.is_none();
            is_right
                .then_some(())
                .and_then(|()| Some((file?, modules?)))
                .map(|(file, modules)| Device::Gsd {
                    file: file.into(),
                    modules,
                })
        }
        (None, Some(ident)) => {
            let ident = ident.whole(0..=0xFFFF);
            let configuration = config.map(|value| read_config(&value));
            let is_right = modules.is_none();
            let configuration = match configuration {
                Some(read) => read.map(Some),
                None => Some(None),
            };
            is_right
                .then_some(())
                .and_then(|()| Some((u16::try_from(ident?).ok()?, configuration?)))
                .map(|(ident, configuration)| Device::Plain {
                    ident,
                    configuration,
                })
        }
        (None, None) => {
            if table.is_whole() {
                table.collector().report(
                    at,
                    "it is not said which device the station is",
                    "write gsd = \"device.gsd\" with its modules, or an ident such as ident = 0x80E0",
                );
            }
            None
        }
    };
    match (address, device) {
        (Some(address), Some(device)) => Keys::Right(StationOptions {
            address,
            device,
            at,
            line,
        }),
        _ => Keys::Wrong,
    }
}

fn read_modules(value: &Value<'_>) -> Option<Vec<String>> {
    let right = "write the names of the modules as the GSD file has them, such as [\"2 words in\"]";
    let names = value.list(right)?;
    if names.len() > MODULE_LIMIT {
        value.wrong(
            format!("there are {} modules", names.len()),
            format!("a station has at most {MODULE_LIMIT}"),
        );
        return None;
    }
    let names = names
        .iter()
        .map(|name| name.label(NAME_LIMIT, right).map(str::to_owned));
    names.collect()
}

fn read_config(value: &Value<'_>) -> Option<Configuration> {
    let octets = value.list("write the octets of the configuration, such as [0x50, 0x60]")?;
    let octets = octets.iter().map(|octet| {
        let octet = octet.whole(0..=255)?;
        u8::try_from(octet).ok()
    });
    let octets: Vec<u8> = octets.collect::<Option<_>>()?;
    let right = "write the identifiers that the PLC's project has for the station";
    if octets.is_empty() || octets.len() > DATA_LIMIT {
        value.wrong(format!("there are {} octets", octets.len()), right);
        return None;
    }
    match Configuration::of_bytes(&octets) {
        Ok(own) if own.inputs().max(own.outputs()) <= DATA_LIMIT => Some(own),
        Ok(own) => {
            let most = own.inputs().max(own.outputs());
            let what = format!("the modules have {most} bytes in one direction");
            value.wrong(what, format!("a station has at most {DATA_LIMIT}"));
            None
        }
        Err(why) => {
            value.wrong(why, right);
            None
        }
    }
}
