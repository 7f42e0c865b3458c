//! `OpenPLC` as a Modbus server: the simulation reads and writes its holding registers.
//!
//! The table of the server, from `modbus.cpp` of `OpenPLC` v3: holding registers 0 to 1023 are `%QW0` to `%QW1023`,
//! 1024 to 2047 are `%MW0` to `%MW1023`; the registers beyond are parts of wider variables.

use super::wired::{self, Wires};
use tickbus_base::toml_text::Mistakes;
use tickbus_bus_modbus::{ClientOptions, Table};
use tickbus_driver_cfg::Config;
use tickbus_image::signal::Area;

/// Number of registers of `%QW`, and also of `%MW`.
const WORDS: usize = 1024;

pub(super) fn text(config: &Config, options: &ClientOptions) -> Result<String, Mistakes> {
    let wrong = |what: String, right: &str| {
        Mistakes::of_file(&config.path.display().to_string(), what, right)
    };
    if config.table.stations.len() > 1 {
        return Err(wrong(
            "OpenPLC's Modbus server is one unit, and this file has several stations".to_owned(),
            "export from a driver.cfg for each OpenPLC, with the signals of its station",
        ));
    }
    if !options.at.is_empty() {
        return Err(wrong(
            "signals of [fieldbus.at] lie where a program for OpenPLC has them already".to_owned(),
            "remove [fieldbus.at] to export a program to which the simulation's images are laid",
        ));
    }
    let registers = |area: Area| -> Result<Vec<String>, Mistakes> {
        let bytes = config.table.stations[0].bytes(area);
        let blocks = options.blocks(area, bytes);
        let file = config.path.display().to_string();
        let blocks = blocks.map_err(|mistake| Mistakes::of(&file, mistake))?;
        let mut addresses = Vec::new();
        for block in blocks {
            if block.table != Table::HoldingRegisters || !block.byte.is_multiple_of(2) {
                return Err(wrong(
                    format!("byte {} of {area} lies in its {}", block.byte, block.table),
                    "let both images lie in holding registers, each part from an even byte on; they are %QW and %MW \
                     of OpenPLC",
                ));
            }
            for register in block.first..block.first + block.bytes.div_ceil(2) {
                addresses.push(match register {
                    0..WORDS => format!("%QW{register}"),
                    _ if register < 2 * WORDS => format!("%MW{}", register - WORDS),
                    _ => {
                        return Err(wrong(
                            format!("{area} reaches holding register {register}, counted from 0"),
                            "stay below 2048: OpenPLC has %QW0 to %QW1023 and %MW0 to %MW1023 there",
                        ));
                    }
                });
            }
        }
        Ok(addresses)
    };
    let addresses = [registers(Area::Input)?, registers(Area::Output)?];
    let shown = |addresses: &[String]| match addresses {
        [] => "nothing".to_owned(),
        [first, ..] => format!("{first} and on"),
    };
    let wires = Wires {
        what: "The PLC's half over Modbus: the simulation reads and writes the registers of OpenPLC.",
        steps: vec![
            "Under Settings of the runtime, enable the Modbus server; the simulation dials its port, 502 unless set."
                .to_owned(),
            format!(
                "The simulation writes {} and reads {}. Keep real outputs off these addresses.",
                shown(&addresses[0]),
                shown(&addresses[1])
            ),
            "It writes once driver.cfg has write_to = \"...\": OpenPLC does not say who it is, and the log tells what \
             to write then."
                .to_owned(),
        ],
        addresses,
    };
    Ok(wired::text(config, &wires))
}
