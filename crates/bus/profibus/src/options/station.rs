//! The keys of a station: its address and its device.

use std::fs;
use std::path::{Path, PathBuf};
use std::str::FromStr;

use tickbus_base::Mistake;
use tickbus_base::toml_text::{Key, Shape, Table, Value};
use tickbus_image::signal;

use super::Keys;
use super::identity::{IDENTITY_KEYS, StatedIdentity, read_identity};
use crate::acyclic::{Acyclic, AlarmSupport, Nameplate, PARAMETERS};
use crate::configuration::Configuration;
use crate::drive::FixedParameter;
use crate::gsd::Gsd;
use crate::records::Fixed;
use crate::station::Identity;
use crate::telegram::DATA_LIMIT;
use crate::user_parameters::UserParameters;

/// The longest path of a GSD file, in characters.
const PATH_LIMIT: usize = 1000;

/// The longest name of a module, in characters.
const NAME_LIMIT: usize = 200;

/// The most modules of a station.
const MODULE_LIMIT: usize = 244;

/// The longest text of a record, in characters.
const RECORD_TEXT_LIMIT: usize = 1000;

/// The most records of a station.
const RECORDS_LIMIT: usize = 1000;

/// A GSD file is at most this long, in bytes.
const GSD_LIMIT: u64 = 16 << 20;

/// The keys of a station, for the schema of a driver.cfg.
pub(crate) const KEYS: &[Key] = &[
    Key::new(
        "address",
        Shape::Whole(0, 125),
        "The station's address in the PLC's project",
    ),
    Key::new(
        "gsd",
        Shape::Label(PATH_LIMIT),
        "The device's GSD file, relative to the folder of this file",
    ),
    Key::new(
        "modules",
        Shape::List(&Shape::Label(NAME_LIMIT), 0, MODULE_LIMIT),
        "The names of the modules, slot by slot, as the GSD file has them",
    ),
    Key::new(
        "ident",
        Shape::Whole(0, 0xFFFF),
        "Instead of a GSD file: the number of the kind of device",
    ),
    Key::new(
        "records",
        Shape::List(&Shape::Label(RECORD_TEXT_LIMIT), 0, RECORDS_LIMIT),
        "Records with octets, such as \"slot 2 record 10 = 00 64\"",
    ),
    Key::new(
        "parameters",
        Shape::List(&Shape::Label(RECORD_TEXT_LIMIT), 0, RECORDS_LIMIT),
        "Parameters of a drive with values, such as \"945 Unsigned16 = 1355 0 0\"",
    ),
    Key::new(
        "identity",
        Shape::Table(IDENTITY_KEYS),
        "The nameplate of the device (I&M)",
    ),
    Key::new(
        "config",
        Shape::List(&Shape::Whole(0, 255), 1, DATA_LIMIT),
        "Beside \"ident\": the identifiers of the modules",
    ),
];

/// The keys of a `[[station]]`, which always has an address.
pub(crate) const OWN_KEYS: &[Key] = &[
    Key {
        is_required: true,
        ..KEYS[0]
    },
    KEYS[1],
    KEYS[2],
    KEYS[3],
    KEYS[4],
    KEYS[5],
    KEYS[6],
    KEYS[7],
];

/// The keys of one station.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct StationOptions {
    /// The address on the line.
    pub address: u8,
    /// The device.
    pub device: Device,
    /// The records with their octets, each with its offset.
    pub(super) records: Vec<(Fixed, usize)>,
    /// The parameters of a drive with their values, each with its offset.
    pub(super) parameters: Vec<(FixedParameter, usize)>,
    /// The nameplate, as far as it is stated.
    pub(super) identity: StatedIdentity,
    /// The offset of the address, and the line.
    pub(super) at: usize,
    pub(super) line: usize,
    /// The offsets of `gsd` and `modules`.
    gsd_at: usize,
    modules_at: usize,
}

/// The device of a station.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Device {
    /// A device with a GSD file and these modules.
    Gsd {
        /// The file as written: relative to the folder of the driver.cfg.
        file: PathBuf,
        /// The names of the modules.
        modules: Vec<String>,
    },
    /// A device without a GSD file.
    Plain {
        /// The ident number.
        ident: u16,
        /// The modules; `None` for any modules with the sizes of the signals.
        configuration: Option<Configuration>,
    },
}

/// Checks that signals of these sizes fit into the modules, or into any station. An area in which signals have their
/// own positions is checked with those.
pub(super) fn check_sizes(
    configuration: Option<&Configuration>,
    signals: &signal::Station,
    has_places: [bool; 2],
) -> Result<(), Mistake> {
    let limits = configuration.map_or([DATA_LIMIT; 2], |own| [own.inputs(), own.outputs()]);
    let sizes = [("%I", signals.input_bytes), ("%Q", signals.output_bytes)];
    for (((area, size), limit), has_places) in sizes.into_iter().zip(limits).zip(has_places) {
        if size > limit && !has_places {
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
    /// The identity of the device, whose signals have these sizes; a mistake comes with its offset in the driver.cfg.
    pub(super) fn identity(
        &self,
        folder: &Path,
        signals: &signal::Station,
    ) -> Result<Identity, (usize, Mistake)> {
        match &self.device {
            Device::Gsd { file, modules } => {
                let gsd = read_gsd(&folder.join(file)).map_err(|mistake| (self.gsd_at, mistake))?;
                gsd.identity(modules)
                    .map_err(|mistake| self.of_modules(mistake))
            }
            Device::Plain {
                ident,
                configuration,
            } => Ok(plain(*ident, configuration.as_ref(), signals)),
        }
    }

    /// Checks that the device has records; `at` is the offset of the first.
    pub(super) fn check_records(
        &self,
        identity: &Identity,
        at: usize,
    ) -> Result<(), (usize, Mistake)> {
        if identity.acyclic.is_any() {
            return Ok(());
        }
        let what = format!(
            "station {}: the device has no records: its GSD file has neither C1_Read_Write_supp=1 nor \
             C2_Read_Write_supp=1",
            self.address
        );
        let right = "remove the record, or take the GSD file of a device with DP-V1";
        Err((at, Mistake::new(what, right)))
    }
}

impl StationOptions {
    /// Checks that no record has the index of the parameters.
    pub(super) fn check_indices(&self, identity: &Identity) -> Result<(), (usize, Mistake)> {
        let own = &identity.acyclic;
        let mut records = own.records.iter();
        if own.parameters.is_empty() || records.all(|record| record.index != PARAMETERS) {
            return Ok(());
        }
        let what = format!(
            "station {}: record {PARAMETERS} has the parameters of the drive",
            self.address
        );
        Err((self.at, Mistake::new(what, "give the record another index")))
    }
}

/// The acyclic services of a device without a GSD file: all, with two connections of other masters.
pub(super) fn plain_acyclic(name: &str) -> Acyclic {
    Acyclic {
        class_1: true,
        connections: 2,
        alarms: AlarmSupport::ALL,
        nameplate: Nameplate {
            order: name.to_owned(),
            ..Nameplate::default()
        },
        ..Acyclic::default()
    }
}

impl StationOptions {
    /// A mistake in the modules of the GSD file.
    fn of_modules(&self, Mistake { what, right }: Mistake) -> (usize, Mistake) {
        let what = format!("station {}: {what}", self.address);
        (self.modules_at, Mistake::new(what, right))
    }

    /// Checks that the signals fit into the modules of the GSD file; the sizes of other devices are checked without a
    /// file.
    pub(super) fn check_modules(
        &self,
        identity: &Identity,
        signals: &signal::Station,
        has_places: [bool; 2],
    ) -> Result<(), (usize, Mistake)> {
        match self.device {
            Device::Gsd { .. } => check_sizes(Some(&identity.configuration), signals, has_places)
                .map_err(|mistake| self.of_modules(mistake)),
            Device::Plain { .. } => Ok(()),
        }
    }
}

/// A device without a GSD file, whose signals have these sizes.
pub(super) fn plain(
    ident: u16,
    configuration: Option<&Configuration>,
    signals: &signal::Station,
) -> Identity {
    let by_sizes = || Configuration::of_sizes(signals.input_bytes, signals.output_bytes);
    Identity {
        ident,
        configuration: configuration.cloned().unwrap_or_else(by_sizes),
        user: UserParameters::default(),
        sync: true,
        freeze: true,
        fail_safe: false,
        dpv1: false,
        max_diagnosis: DATA_LIMIT,
        acyclic: Acyclic::default(),
    }
}

/// Reads the GSD file at `path`; mistakes name the file and the line.
pub(super) fn read_gsd(path: &Path) -> Result<Gsd, Mistake> {
    let name = path.display();
    let size = fs::metadata(path).map(|file| file.len());
    if size.is_ok_and(|size| size > GSD_LIMIT) {
        return Err(Mistake::new(
            format!("{name} is larger than 16 MiB, and no GSD file"),
            "name another one in \"gsd\"",
        ));
    }
    let bytes = fs::read(path).map_err(|error| {
        Mistake::new(
            format!("cannot read the GSD file {name} ({error})"),
            "correct \"gsd\", or put the file there",
        )
    })?;
    Gsd::read(&bytes).map_err(|error| {
        let Mistake { what, right } = error.mistake;
        Mistake::new(format!("{name}:{}: {what}", error.line), right)
    })
}

/// Reads the keys of a station; `is_required` tells whether they must be present.
pub(super) fn read_station(table: &mut Table<'_>, is_required: bool) -> Keys {
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
    let records = table.take("records");
    let parameters = table.take("parameters");
    let identity = table.take("identity");
    let others = [
        &gsd,
        &modules,
        &ident,
        &config,
        &records,
        &parameters,
        &identity,
    ];
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
    let gsd_at = gsd.as_ref().map_or(0, Value::at);
    let modules_at = modules.as_ref().map_or(gsd_at, Value::at);
    let at = address.as_ref().map_or(table.at(), Value::at);
    let address = address.and_then(|value| value.whole(0..=125));
    let address = address.and_then(|address| u8::try_from(address).ok());
    let device = read_device(table, at, [gsd, modules, ident, config]);
    let records = records.map_or(Some(Vec::new()), |value| {
        read_texts(&value, "records", "slot 2 record 10 = 00 64")
    });
    let parameters = parameters.map_or(Some(Vec::new()), |value| {
        read_texts(&value, "parameters", "945 Unsigned16 = 1355 0 0")
    });
    let identity = identity.map_or(Some(StatedIdentity::default()), |value| {
        read_identity(&value)
    });
    match (address, device, records, parameters, identity) {
        (Some(address), Some(device), Some(records), Some(parameters), Some(identity)) => {
            Keys::Right(Box::new(StationOptions {
                address,
                device,
                records,
                parameters,
                identity,
                at,
                line,
                gsd_at,
                modules_at,
            }))
        }
        _ => Keys::Wrong,
    }
}

/// The device that the keys `gsd`, `modules`, `ident` and `config` say.
fn read_device(table: &Table<'_>, at: usize, keys: [Option<Value<'_>>; 4]) -> Option<Device> {
    let [gsd, modules, ident, config] = keys;
    match (gsd, ident) {
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

/// Reads records or parameters, each with its offset.
fn read_texts<T: FromStr<Err = Mistake>>(
    value: &Value<'_>,
    what: &str,
    example: &str,
) -> Option<Vec<(T, usize)>> {
    let right = format!("write the {what}, such as [\"{example}\"]");
    let texts = value.list(&right)?;
    if texts.len() > RECORDS_LIMIT {
        value.wrong(
            format!("there are {} {what}", texts.len()),
            format!("a station has at most {RECORDS_LIMIT}"),
        );
        return None;
    }
    let read = |text: &Value<'_>| match text.label(RECORD_TEXT_LIMIT, &right)?.parse() {
        Ok(own) => Some((own, text.at())),
        Err(mistake) => {
            text.refuse(mistake);
            None
        }
    };
    // All mistakes are reported, not only the first.
    let all: Vec<_> = texts.iter().map(read).collect();
    all.into_iter().collect()
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
