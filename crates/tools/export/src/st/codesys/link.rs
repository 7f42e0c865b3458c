//! How the registers are received and sent, per bus.

use super::parts::{Link, Stream, dialled, loopback_note};
use super::{Editor, modbus, socket, tcpip};
use crate::exported::Exported;
use tickbus_base::time::Nanos;
use tickbus_bus_socket::{Message, TcpRole};
use tickbus_driver_cfg::Config;
use tickbus_image::signal::Area;

/// The default cycle of the socket bus.
const CYCLE: Nanos = Nanos::from_millis(10);

impl Link {
    pub(super) fn of(config: &Config, editor: Editor, list: &str) -> Self {
        match Exported::of(&config.bus) {
            Exported::Socket(options)
                if options.tcp == TcpRole::Listen
                    && !matches!(options.message, Message::Axis { .. }) =>
            {
                let stations = &config.table.stations;
                let bytes = [Area::Input, Area::Output]
                    .map(|area| stations.iter().map(|station| station.bytes(area)).sum());
                let stream = Stream {
                    list,
                    host: dialled(&options.address),
                    port: options.address.port,
                    bytes,
                    cycle: config.timing.cycle.unwrap_or(CYCLE),
                    max_age: config.timing.max_age,
                };
                let mut link = match editor {
                    Editor::Codesys => socket::link(&stream),
                    Editor::TwinCat => tcpip::link(&stream),
                };
                link.notes.extend(loopback_note(&options.address));
                link
            }
            Exported::ModbusServer(options) => modbus::link(config, options, editor, list),
            Exported::ModbusClient(options) if editor == Editor::Codesys && options.at.is_empty() => Self::of_steps([
                format!(
                    "Device tree: Ethernet > ModbusTCP Server Device. Its holding registers are what the simulation writes: map \
                     them to {list}.In. Its input registers are what the simulation reads: map them to {list}.Out."
                ),
                "So in driver.cfg write inputs = \"holding-register offset:0\" and outputs = \"input-register offset:0\"."
                    .to_owned(),
            ]),
            // Copying registers that are never received would overwrite what OPC UA has written.
            Exported::OpcuaClient | Exported::OpcuaServer(_) => Self {
                is_by_name: true,
                ..Self::of_steps([format!(
                    "OPC UA carries the variables themselves: share {list} with its server (in CODESYS the symbol \
                     configuration, in TwinCAT the attribute OPC.UA.DA). The registers In and Out of other buses are not there."
                )])
            },
            Exported::Loopback
            | Exported::Socket(_)
            | Exported::ModbusClient(_)
            | Exported::S7Server(_)
            | Exported::S7Client(_)
            | Exported::ByHand => {
                let kind = config.bus.kind();
                let mut link = Self::of_steps([format!(
                    "What brings {list}.In and takes {list}.Out is to be written by hand: the bus \"{kind}\" of this file has \
                     no block of its own here."
                )]);
                link.notes.push(format!(
                    "the bus \"{kind}\" of this file has no block of its own here: what brings the images is to be written \
                     by hand; kind = \"socket\" (which listens, with whole records) and \"modbus-server\" have"
                ));
                link
            }
        }
    }
}
