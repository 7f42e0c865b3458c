//! The options of the bus `s7-client` in a driver.cfg.

use std::collections::BTreeMap;

use crate::item::Object;
use crate::length::{LONGEST, read_length};
use crate::transport::PORT;
use crate::tsap::{RACK, SLOT};
use crate::{Start, Tsap, Variable};
use tickbus_base::Mistake;
use tickbus_base::toml_text::{Collector, Table, Value};
use tickbus_fieldbus::both_ways;
use tickbus_fieldbus::{At, Role};
use tickbus_image::signal::{Area, Signal, SignalTable};
use tickbus_net::Address;

/// The local TSAP, as of libraries and programming devices.
pub(super) const CALLING: [u8; 2] = [1, 0];

/// The longest identity, in characters.
pub(crate) const IDENTITY_LIMIT: usize = 200;

/// The options of the bus `s7-client`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ClientOptions {
    /// The CPU.
    pub address: Address,
    /// This end of the transport connection.
    pub calling: Tsap,
    /// The CPU's end of it.
    pub called: Tsap,
    /// The places of each station's `%I` and `%Q` in the CPU; one pair if there are no `[[station]]` tables.
    pub places: Vec<[Option<Start>; 2]>,
    /// The places of single signals, by name: the lines of `[fieldbus.at]`.
    pub variables: BTreeMap<String, Variable>,
    /// The longest PDU that is requested.
    pub pdu: u16,
    /// The identity of the CPU that may be written to.
    pub write_to: Option<String>,
    /// The offset of the `[fieldbus]` table, for mistakes, and whether `[[station]]` tables have been read.
    at: usize,
    has_stations: bool,
    pub(super) role: Role,
}

impl ClientOptions {
    /// Replaces the address of the driver.cfg.
    ///
    /// # Errors
    ///
    /// The text is not an address, or the address is not one to connect to.
    pub fn set_address(&mut self, address: &str) -> Result<(), Mistake> {
        self.address = parse_address(address)?;
        Ok(())
    }

    /// The place of an area of a station.
    pub fn place(&self, station: usize, area: Area) -> Option<Start> {
        let [input, output] = *self.places.get(station)?;
        match area {
            Area::Input => input,
            Area::Output => output,
        }
    }

    /// The place of a signal: from its line in `[fieldbus.at]`, or else within its station's area.
    pub fn variable(&self, signal: &Signal) -> Option<Variable> {
        if let Some(variable) = self.variables.get(&signal.name) {
            return Some(*variable);
        }
        let place = signal.plc_address();
        let start = self.place(signal.station, place.area)?;
        Some(Variable {
            object: start.object,
            byte: start.byte + place.byte,
            bit: signal.bit,
            width: signal.data_type.width(),
            data_type: Some(signal.data_type),
        })
    }

    /// Takes the lines of `[fieldbus.at]`.
    pub fn place_signals(&mut self, lines: &[At<'_>], table: &SignalTable) {
        for line in lines {
            let signal = &table.signals[line.signal];
            let variable: Variable = match line.text.parse() {
                Ok(variable) => variable,
                Err(what) => {
                    line.wrong(what, Variable::RIGHT);
                    continue;
                }
            };
            if let Err(mistake) = variable.check(signal) {
                line.refuse(mistake);
            }
            self.variables.insert(signal.name.clone(), variable);
        }
        self.report_overlaps(lines, table);
    }

    /// The signals that are written where another one is read, each with that one.
    pub fn both_ways(&self, table: &SignalTable) -> Vec<(usize, usize)> {
        let (sends, _) = self.role.areas();
        let is_placed = |signal: &Signal| self.variables.contains_key(&signal.name);
        both_ways(table, sends, is_placed, |signal| {
            let variable = self.variable(signal).into_iter();
            variable
                .map(|variable| {
                    let (first, bits) = variable.bits();
                    (variable.object, first..first + bits)
                })
                .collect()
        })
    }

    /// Reports signals that would overwrite one another. Reads may overlap.
    fn report_overlaps(&self, lines: &[At<'_>], table: &SignalTable) {
        let written = table.signals.iter().enumerate();
        let mut written: Vec<_> = written
            .filter(|(_, signal)| self.role.writes(signal.area))
            .filter_map(|(index, signal)| {
                let variable = self.variable(signal)?;
                let (first, bits) = variable.bits();
                Some((variable.object, first, first + bits, index))
            })
            .collect();
        written.sort_unstable();
        // The previous variable that reaches furthest.
        let mut last: Option<(Object, usize, usize)> = None;
        for (object, first, end, index) in written {
            if let Some((before, reach, other)) = last
                && before == object
                && first < reach
            {
                let line = |index| lines.iter().find(|line| line.signal == index);
                let (one, two) = (&table.signals[index].name, &table.signals[other].name);
                if let Some(line) = line(index).or_else(|| line(other)) {
                    line.wrong(
                        format!("\"{one}\" and \"{two}\" would be written over one another"),
                        "give each signal that is written bits of its own",
                    );
                }
            }
            if last.is_none_or(|(before, reach, _)| before != object || end > reach) {
                last = Some((object, end, index));
            }
        }
    }

    /// Reads `address`, `rack`, `slot`, `remote_tsap`, `local_tsap`, `input`, `output`, `pdu` and
    /// `write_to`. `moved` says that [`set_address`](Self::set_address) follows.
    pub fn read(role: Role, moved: bool, table: &mut Table<'_>) -> Option<Self> {
        let at = table.at();
        let address = if moved {
            table.take("address")
        } else {
            table.require(
                "address",
                "write the address of the CPU, such as \"192.168.0.1:102\"",
            )
        };
        let rack = table.take("rack");
        let slot = table.take("slot");
        let remote = table.take("remote_tsap");
        let local = table.take("local_tsap");
        let places = read_places(table);
        let unit = table.take("pdu");
        let write_to = table.take("write_to");

        let address = match (&address, moved) {
            (Some(value), false) => read_address(value),
            _ => Some(Address::local(PORT)),
        };
        if let (Some(value), true) = (&remote, rack.is_some() || slot.is_some()) {
            value.wrong(
                "\"remote_tsap\" stands beside \"rack\" or \"slot\"",
                "write the TSAP, or rack and slot from which it is made, and not both",
            );
        }
        let small = |value: Option<&Value<'_>>, range, otherwise| match value {
            None => Some(otherwise),
            Some(value) => value
                .whole(range)
                .and_then(|number| u8::try_from(number).ok()),
        };
        let (rack, slot) = (small(rack.as_ref(), RACK, 0), small(slot.as_ref(), SLOT, 1));
        let called = match &remote {
            Some(value) => read_tsap(value),
            None => rack.zip(slot).map(|(rack, slot)| Tsap::of_slot(rack, slot)),
        };
        let calling = local.as_ref().map_or(Some(Tsap::new(&CALLING)), read_tsap);
        let unit = unit.as_ref().map_or(Some(LONGEST), read_length);
        let write_to = write_to.map(|value| {
            let right = "write the identity that the CPU reports; log and statistics have it";
            value.label(IDENTITY_LIMIT, right).map(str::to_owned)
        });
        let [input, output] = places?;
        let first = |object| Start { object, byte: 0 };
        Some(Self {
            address: address?,
            calling: calling?,
            called: called?,
            places: vec![[
                input.or(Some(first(Object::Inputs))),
                output.or(Some(first(Object::Outputs))),
            ]],
            variables: BTreeMap::new(),
            pdu: unit?,
            write_to: match write_to {
                None => None,
                Some(write_to) => Some(write_to?),
            },
            at,
            has_stations: false,
            role,
        })
    }

    /// Reads `input` and `output` of the next of `count` `[[station]]` tables.
    pub fn read_station(&mut self, count: usize, table: &mut Table<'_>) {
        let own = read_places(table).unwrap_or_default();
        if count == 1 {
            // The keys in [fieldbus] apply to a single station as well.
            let [[input, output]] = self.places[..] else {
                return;
            };
            self.places = vec![[own[0].or(input), own[1].or(output)]];
            return;
        }
        if !std::mem::replace(&mut self.has_stations, true) {
            self.places.clear();
        }
        self.places.push(own);
    }

    /// Reports conflicts with the stations of the file.
    pub fn fit(&self, table: &SignalTable, collector: &Collector<'_>) {
        for (index, station) in table.stations.iter().enumerate() {
            for (area, key) in [(Area::Input, "input"), (Area::Output, "output")] {
                let mut signals = table.signals.iter();
                let is_nowhere = |signal: &Signal| {
                    (signal.station, signal.area) == (index, area)
                        && self.variable(signal).is_none()
                };
                if signals.any(is_nowhere) {
                    collector.report(
                        self.at,
                        format!(
                            "the station \"{}\" does not say where its {area} lies",
                            station.name
                        ),
                        format!(
                            "add {key} = \"DB10\", or another place, to its [[station]] table, or give each of \
                             its signals there a line in [fieldbus.at]"
                        ),
                    );
                }
            }
        }
    }
}

fn read_places(table: &mut Table<'_>) -> Option<[Option<Start>; 2]> {
    let [input, output] = [table.take("input"), table.take("output")].map(|value| match value {
        None => Some(None),
        Some(value) => read_place(&value).map(Some),
    });
    Some([input?, output?])
}

fn read_place(value: &Value<'_>) -> Option<Start> {
    const RIGHT: &str =
        "write where it begins, such as \"DB10\", \"%DB10.DBB4\", \"%QB0\", \"%IB0\" or \"%MB100\"";
    let text = value.text(RIGHT)?;
    text.parse()
        .map_err(|what: String| value.wrong(what, RIGHT))
        .ok()
}

fn read_tsap(value: &Value<'_>) -> Option<Tsap> {
    const RIGHT: &str =
        "write two hexadecimal numbers with a dot, as TIA Portal shows them, such as \"03.01\"";
    let text = value.text(RIGHT)?;
    text.parse()
        .map_err(|what: String| value.wrong(what, RIGHT))
        .ok()
}

fn read_address(value: &Value<'_>) -> Option<Address> {
    let text = value.text("write the CPU's address in quotes, such as \"192.168.0.1:102\"")?;
    parse_address(text)
        .map_err(|mistake| value.refuse(mistake))
        .ok()
}

/// Reads a host with or without a port; the default is the port of all CPUs.
fn parse_address(text: &str) -> Result<Address, Mistake> {
    let address: Address = match text.parse() {
        Err(_) if !text.contains(':') => format!("{text}:{PORT}").parse()?,
        parsed => parsed?,
    };
    address.check_dialled()?;
    Ok(address)
}
