//! How the registers are received and sent, per bus.

use super::{Editor, modbus, socket, tcpip};
use crate::plcopen::{Kind, Variable, variable};
use crate::st::life::{ALIVE, time};
use tickbus_base::time::Nanos;
use tickbus_bus_socket::{Message, TcpRole};
use tickbus_driver_cfg::Config;
use tickbus_driver_cfg::Exported;
use tickbus_fieldbus::tcp::{Address, Host};
use tickbus_image::signal::Area;

/// The default cycle of the socket bus.
const CYCLE: Nanos = Nanos::from_millis(10);

/// Statements, and the variables that they use.
#[derive(Clone, Debug, Default)]
pub(super) struct Part {
    pub(super) locals: Vec<Variable>,
    pub(super) lines: Vec<String>,
}

/// How the registers are received and sent.
#[derive(Clone, Debug, Default)]
pub(super) struct Link {
    /// Global variables in addition to those of signals.
    pub(super) globals: Vec<Variable>,
    /// Before the inputs are copied.
    pub(super) before: Part,
    /// After the outputs are copied.
    pub(super) after: Part,
    /// The settings to be made in the editor.
    pub(super) steps: Vec<String>,
    /// What the user should know.
    pub(super) notes: Vec<String>,
    /// The editor transfers the variables of signals itself: there are no registers to copy.
    pub(super) is_by_name: bool,
}

/// The parameters of the texts for records over TCP.
#[derive(Clone, Debug)]
pub(super) struct Stream<'a> {
    /// The list of global variables.
    pub(super) list: &'a str,
    /// The simulation's host and port.
    pub(super) host: String,
    pub(super) port: u16,
    /// Size in bytes of a record from the simulation, and of one to it.
    pub(super) bytes: [usize; 2],
    pub(super) cycle: Nanos,
    pub(super) max_age: Nanos,
}

impl Link {
    pub(super) fn of(config: &Config, editor: Editor, list: &str) -> Self {
        match config.bus.exported() {
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
            Exported::OpcuaClient(_) | Exported::OpcuaServer(_) => Self {
                is_by_name: true,
                ..Self::of_steps([format!(
                    "OPC UA carries the variables themselves: share {list} with its server (in CODESYS the symbol \
                     configuration, in TwinCAT the attribute OPC.UA.DA). The registers In and Out of other buses are not there."
                )])
            },
            Exported::Loopback(_)
            | Exported::Socket(_)
            | Exported::ModbusClient(_)
            | Exported::S7Server(_)
            | Exported::S7Client(_)
            | Exported::ByHand(_) => {
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

    pub(super) fn of_steps(steps: impl Into<Vec<String>>) -> Self {
        Self {
            steps: steps.into(),
            ..Self::default()
        }
    }

    /// The counters and the life sign, for links that can tell what is received and sent.
    pub(super) fn counters() -> Vec<Variable> {
        [
            (ALIVE, "BOOL", "the simulation was heard of lately"),
            ("Received", "UDINT", "images that came"),
            ("Sent", "UDINT", "images that went"),
            (
                "Errors",
                "UDINT",
                "requests that failed, and connections that were lost",
            ),
        ]
        .map(|(name, kind, comment)| Variable {
            comment: comment.to_owned(),
            ..variable(name, Kind::Basic(kind))
        })
        .into()
    }
}

/// The simulation's host as the PLC connects to it; a wildcard address does not tell where it is.
pub(super) fn dialled(address: &Address) -> String {
    match &address.host {
        Host::Ip(ip) if !ip.is_unspecified() => ip.to_string(),
        Host::Ip(_) => "192.168.0.20".to_owned(),
        Host::Name(name) => name.clone(),
    }
}

/// The note for an address that the PLC can only reach on the simulation's own computer.
pub(super) fn loopback_note(address: &Address) -> Option<String> {
    let is_loopback = match &address.host {
        Host::Ip(ip) => ip.is_loopback(),
        Host::Name(name) => name.eq_ignore_ascii_case("localhost"),
    };
    is_loopback.then(|| {
        format!(
            "the address {address} is reached from the simulation's computer alone: a PLC elsewhere needs that computer's own, \
             in driver.cfg and here"
        )
    })
}

/// The statements that detect that nothing has been received for too long.
pub(super) fn silence(list: &str, max_age: Nanos) -> [String; 2] {
    [
        format!(
            "Silence(IN := {list}.Simulated AND NOT Is_new, PT := {});",
            time(max_age)
        ),
        format!("{list}.Alive := {list}.Simulated AND {list}.Received > 0 AND NOT Silence.Q;"),
    ]
}

/// Converts the bytes of a record to registers, or back.
pub(super) fn registers(list: &str, count: usize, incoming: bool) -> [String; 3] {
    let last = count.saturating_sub(1);
    let body = if incoming {
        format!(
            "    {list}.In[Number] := SHL(BYTE_TO_WORD(Incoming[2 * Number]), 8) OR BYTE_TO_WORD(Incoming[2 * Number + 1]);"
        )
    } else {
        format!(
            "    Outgoing[2 * Number] := WORD_TO_BYTE(SHR({list}.Out[Number], 8)); Outgoing[2 * Number + 1] := \
             WORD_TO_BYTE({list}.Out[Number] AND WORD#16#00FF);"
        )
    };
    [
        format!("FOR Number := 0 TO {last} DO"),
        body,
        "END_FOR;".to_owned(),
    ]
}
