//! The editor's own Modbus client, which is configured in the device tree (CODESYS) or called (TwinCAT's
//! TF6250).

use super::Editor;
use super::parts::{Link, dialled, loopback_note};
use crate::st::telegrams::Telegrams;
use tickbus_bus_modbus::{Coding, Line, ServerOptions};
use tickbus_driver_cfg::Config;

pub(super) fn link(config: &Config, options: &ServerOptions, editor: Editor, list: &str) -> Link {
    let mut steps = match (&options.line, editor) {
        (Line::Tcp(address), Editor::Codesys) => vec![format!(
            "Device tree: Ethernet > Modbus TCP Client > for each unit below a Modbus TCP Server with the address of the \
             simulation's computer ({}) and port {}.",
            dialled(address),
            address.port
        )],
        (Line::Serial(serial), Editor::Codesys) => vec![format!(
            "Device tree: Modbus COM, {} > Modbus Client, COM Port{} > for each unit below a Modbus Server, COM Port.",
            serial.settings,
            match serial.coding {
                Coding::Rtu => "",
                Coding::Ascii => ", transmission mode ASCII",
            }
        )],
        (Line::Udp(address), _) => vec![format!(
            "The editor has no client for Modbus over UDP: ask {} at port {} by a program of your own, or remove \
             `framing` from the driver.cfg and export again.",
            dialled(address),
            address.port
        )],
        (Line::RtuOverTcp(address), _) => vec![format!(
            "Modbus RTU with {}, on a serial port that a serial device server, as a TCP client, joins with {} and port {}.",
            match editor {
                Editor::Codesys => "Modbus COM > Modbus Client, COM Port in the device tree",
                Editor::TwinCat => "ModbusRtuMasterV2 of TF6255",
            },
            dialled(address),
            address.port
        )],
        (Line::Tcp(address), Editor::TwinCat) => vec![
            format!(
                "Install TF6250 (Modbus TCP) with its licence on the target; References > Add library: Tc2_ModbusSrv. \
                 Call FB_MBReadInputRegs and FB_MBWriteRegs in turn, with sIPAddr := '{}', nTCPPort := {}, and for each \
                 line below nUnitID, nMBAddr (the offset) and nQuantity (the length); pDestAddr and pSrcAddr := ADR of the \
                 element, cbLength := 2 * nQuantity.",
                dialled(address),
                address.port
            ),
            "Take FB_MBReadInputRegs and no read of holding registers: those are the PLC's own outputs here, unless \
             they begin at 1024 (`inputs`)."
                .to_owned(),
        ],
        (Line::Serial(serial), Editor::TwinCat) => vec![format!(
            "Install TF6255 (Modbus RTU) with its licence on the target, {}; for each line below call ReadInputRegs and \
             WriteRegs of ModbusRtuMasterV2{}.",
            serial.settings,
            match serial.coding {
                Coding::Rtu => "",
                Coding::Ascii => ", which has no ASCII: remove `framing` from the driver.cfg and export again",
            }
        )],
    };
    for telegrams in Telegrams::all(config, options) {
        let unit = telegrams.unit;
        for (way, what, element) in [
            (0, "function code 4 (read input registers)", "In"),
            (1, "function code 16 (write multiple registers)", "Out"),
        ] {
            let (first, count) = (telegrams.first[way], telegrams.count[way]);
            if count > 0 {
                let record = telegrams.record[way];
                steps.push(format!(
                    "Unit {unit}: {what}, offset {first}, length {count}: {list}.{element}[{record}] to {list}.{element}[{}].",
                    record + count - 1
                ));
            }
        }
    }
    if editor == Editor::Codesys {
        steps.push(
            "Do not take function code 23 for both: its read half reads holding registers, which are the PLC's own \
             outputs here, unless they begin at 1024 (`inputs`)."
                .to_owned(),
        );
    }
    let mut link = Link::of_steps(steps);
    if let Line::Tcp(address) | Line::RtuOverTcp(address) = &options.line {
        link.notes.extend(loopback_note(address));
    }
    link
}
