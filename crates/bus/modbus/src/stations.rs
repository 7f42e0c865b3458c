//! The units of the stations, from `[fieldbus]` and the `[[station]]` tables.

use crate::Identification;
use crate::identity::read_identity;
use tickbus_base::toml_text::{Table, Value};

/// The longest identity, in characters.
pub(super) const IDENTITY_LIMIT: usize = 1000;

/// The range of unit numbers on a line.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) enum UnitRange {
    /// All that fit into a byte.
    Tcp,
    /// With RTU 0 is the broadcast, and numbers above 247 are reserved.
    Serial,
    /// Like `Serial`, for a server, which has to know which requests on the line are addressed to it.
    ServedOnSerial,
}

/// The keys of one station, or of all of them.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct Keys {
    /// The unit.
    pub unit: Option<u8>,
    /// The identity of the device that may be written to.
    pub write_to: Option<String>,
    /// The identity of the device that this end is.
    pub identity: Option<Identification>,
}

/// The units of a driver.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Stations {
    units: UnitRange,
    /// The keys in `[fieldbus]`.
    common: Keys,
    /// The keys in the `[[station]]` tables, with their offsets; empty without such tables.
    own: Vec<(Keys, usize)>,
}

impl Stations {
    /// Reads the unit in `[fieldbus]`.
    pub(super) fn read(units: UnitRange, unit: Option<&Value<'_>>) -> Option<Self> {
        let stated = unit.map(|value| read_unit(units, value));
        let unit = match stated {
            None => None,
            Some(stated) => Some(stated?),
        };
        // The lowest number of a unit.
        let unit = unit.or((units == UnitRange::ServedOnSerial).then_some(1));
        Some(Self {
            units,
            common: Keys {
                unit,
                ..Keys::default()
            },
            own: Vec::new(),
        })
    }

    /// Sets the identity stated in `[fieldbus]`.
    pub(super) fn allow(&mut self, write_to: Option<String>) {
        self.common.write_to = write_to;
    }

    /// Sets the identity of this end stated in `[fieldbus]`.
    pub(super) fn name(&mut self, identity: Option<Identification>) {
        self.common.identity = identity;
    }

    /// Reads the keys of the next of `count` `[[station]]` tables; `write_to` only if this end may write, and `identity`
    /// otherwise.
    pub fn read_station(&mut self, count: usize, guarded: bool, table: &mut Table<'_>) {
        let unit = if count > 1 {
            table.require(
                "unit",
                "write the number of its Modbus unit, such as unit = 1",
            )
        } else {
            table.take("unit")
        };
        let write_to = guarded.then(|| table.take("write_to")).flatten();
        let identity = (!guarded).then(|| table.take("identity")).flatten();
        let mut keys = Keys {
            unit: None,
            identity: identity.as_ref().and_then(read_identity),
            write_to: write_to.as_ref().and_then(read_write_to),
        };
        let mut line = 0;
        if let Some(value) = unit {
            keys.unit = read_unit(self.units, &value);
            line = value.line();
            let twin = self
                .own
                .iter()
                .find(|(other, _)| keys.unit.is_some() && other.unit == keys.unit);
            if let Some((_, first)) = twin {
                value.wrong(
                    format!("\"unit\" is that of the station on line {first}"),
                    "give each station a unit of its own",
                );
            }
        }
        self.own.push((keys, line));
    }

    /// The unit of a station; `None` if any number is accepted.
    pub fn unit(&self, station: usize) -> Option<u8> {
        let own = self.own.get(station).and_then(|(keys, _)| keys.unit);
        own.or(self.common.unit)
    }

    /// The units as text; `default` is the unit of a station that states none. `None` if any number is accepted.
    pub fn shown(&self, default: Option<u8>) -> Option<String> {
        let stations = 0..self.own.len().max(1);
        let units = stations.map(|station| Some(self.unit(station).or(default)?.to_string()));
        let units: Vec<String> = units.collect::<Option<_>>()?;
        let word = if units.len() == 1 { "unit" } else { "units" };
        Some(format!("{word} {}", units.join(" ")))
    }

    /// The identity of the device that a station is, if stated.
    pub fn identity(&self, station: usize) -> Option<&Identification> {
        let own = self.own.get(station);
        let own = own.and_then(|(keys, _)| keys.identity.as_ref());
        own.or(self.common.identity.as_ref())
    }

    /// The identity of the device that a station may write to.
    pub fn write_to(&self, station: usize) -> Option<&str> {
        let own = self.own.get(station);
        let own = own.and_then(|(keys, _)| keys.write_to.as_deref());
        own.or(self.common.write_to.as_deref())
    }
}

fn read_unit(units: UnitRange, value: &Value<'_>) -> Option<u8> {
    let range = match units {
        UnitRange::Tcp => 0..=255,
        UnitRange::Serial | UnitRange::ServedOnSerial => 1..=247,
    };
    value.whole(range).and_then(|unit| u8::try_from(unit).ok())
}

/// Reads the identity of a device.
pub(super) fn read_write_to(value: &Value<'_>) -> Option<String> {
    let right = "write the identity that the device reports; the log and the statistics have it";
    value.label(IDENTITY_LIMIT, right).map(str::to_owned)
}
