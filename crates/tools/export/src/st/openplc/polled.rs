//! `OpenPLC` as a Modbus client of the simulation: registers of slave devices.
//!
//! Limits from `modbus_master.cpp` of `OpenPLC` v3: one request per device and table, which libmodbus refuses
//! if it exceeds the registers of a telegram, and one array of 400 registers for all devices.

use super::wired::{self, Wires};
use crate::st::telegrams::Telegrams;
use tickbus_base::time::Nanos;
use tickbus_base::toml_text::Mistakes;
use tickbus_bus_modbus::{Coding, Line, Serial, ServerOptions};
use tickbus_driver_cfg::Config;
use tickbus_image::signal::Area;

/// The first register of the first slave device in `OpenPLC`.
const FIRST: usize = 100;

/// The number of registers of all devices together, in each direction.
const ROOM: usize = 400;

/// A `max_age` that tolerates `OpenPLC`'s polling on a busy machine: ten of its default periods.
const MAX_AGE: Nanos = Nanos::from_secs(1);

pub(super) fn text(
    config: &Config,
    options: &ServerOptions,
    notes: &mut Vec<String>,
) -> Result<String, Mistakes> {
    let stations = &config.table.stations;
    let areas = [Area::Input, Area::Output];
    let counts = areas.map(|area| {
        let registers = stations
            .iter()
            .map(|station| station.bytes(area).div_ceil(2));
        registers.sum::<usize>()
    });
    for (count, direction) in counts.iter().zip(["read", "write"]) {
        if *count > ROOM {
            return Err(Mistakes::of_file(
                &config.path.display().to_string(),
                format!("OpenPLC would {direction} {count} registers"),
                format!(
                    "it has room for {ROOM} of all its slave devices together; make the image smaller, or leave gaps out"
                ),
            ));
        }
    }
    let mut steps = vec![
        format!(
            "In the web interface of the runtime, under Slave Devices, add these before any others, {}.",
            place(&options.line)
        ),
        "Leave discrete inputs, coils and \"holding registers, read\" at size 0: bits and words in separate requests \
         would be of different scans."
            .to_owned(),
    ];
    for (number, telegrams) in Telegrams::all(config, options).iter().enumerate() {
        let part = |way: usize| match telegrams.count[way] {
            0 => "size 0".to_owned(),
            size => format!("start {}, size {size}", telegrams.first[way]),
        };
        steps.push(format!(
            "Device {}: slave ID {}; input registers: {}; holding registers, write: {}.",
            number + 1,
            telegrams.unit,
            part(0),
            part(1)
        ));
    }
    steps.extend([
        format!(
            "Their input registers come to %IW{FIRST} and on, their holding registers go from %QW{FIRST} and on."
        ),
        "Under Settings, set the polling period of slave devices to 10 to 20 ms; it is 100 ms unless set.".to_owned(),
        format!("In driver.cfg, write max_age = \"{MAX_AGE}\" or more: a poll comes late on a busy machine."),
    ]);
    if config.timing.max_age < MAX_AGE {
        notes.push(format!(
            "OpenPLC polls every 100 ms unless set otherwise, and late on a busy machine: with max_age = {} the data \
             may become stale; write max_age = \"{MAX_AGE}\" in [fieldbus]",
            config.timing.max_age
        ));
    }
    let addresses = ["%IW", "%QW"].into_iter().zip(counts).map(|(area, count)| {
        let numbers = FIRST..FIRST + count;
        numbers.map(|number| format!("{area}{number}")).collect()
    });
    let addresses: Vec<Vec<String>> = addresses.collect();
    let wires = Wires {
        what: "The PLC's half over Modbus: OpenPLC polls the simulation.",
        steps,
        addresses: addresses.try_into().expect("two directions"),
    };
    Ok(wired::text(config, &wires))
}

/// The type of the device, and its address.
fn place(line: &Line) -> String {
    match line {
        Line::Tcp(address) => format!(
            "as Generic Modbus TCP Device with the address of the simulation's computer and port {}",
            address.port
        ),
        Line::RtuOverTcp(address) => format!(
            "as Generic Modbus RTU Device on a serial port that a serial device server, as a TCP client, joins with the \
             simulation's computer and port {}",
            address.port
        ),
        Line::Udp(_) => "over TCP, since OpenPLC speaks no Modbus over UDP: remove `framing` from the driver.cfg and \
                         export again"
            .to_owned(),
        Line::Serial(Serial {
            coding: Coding::Ascii,
            ..
        }) => "with RTU, since OpenPLC speaks no ASCII: remove `framing` from the driver.cfg and export again".to_owned(),
        Line::Serial(serial) => format!(
            "as Generic Modbus RTU Device on the port that is wired to the simulation's, {}",
            serial.settings
        ),
    }
}
