//! The block that communicates with the simulation: one body per bus.

use super::body::{Body, by_hand, time};
use super::members::Path;
use super::{Image, Plan, line, modbus, s7comm, socket, source};
use crate::exported::Exported;
use crate::record::PlacedSignal;
use crate::siemens::spelling;
use tickbus_bus_s7::Variable;
use tickbus_bus_socket::Message;
use tickbus_driver_cfg::Config;
use tickbus_fieldbus::Role;
use tickbus_image::signal::{DataType, Width};

/// The body for the bus of the driver.cfg.
pub(super) fn body(plan: &Plan<'_>, notes: &mut Vec<String>) -> Body {
    let mut body = match Exported::of(&plan.config.bus) {
        Exported::Socket(options) if matches!(options.message, Message::Axis { .. }) => {
            by_hand("socket with message = \"axis\"", notes)
        }
        Exported::Socket(options) => socket::body(plan, options, notes),
        Exported::ModbusServer(options) => modbus::client(plan, options, notes),
        Exported::ModbusClient(options) => modbus::server(plan, options, notes),
        Exported::S7Server(options) => s7comm::puts_and_gets(plan, options, notes),
        Exported::S7Client(options) => s7comm::nothing(plan, options),
        Exported::OpcuaClient => opcua_server(plan),
        Exported::OpcuaServer(options) => opcua_client(plan, &options.address.to_string()),
        Exported::Loopback | Exported::ByHand => by_hand(plan.config.bus.kind(), notes),
    };
    watch(plan, &mut body);
    body
}

/// Declares and sets `Alive`: from the heartbeats in the driver.cfg if there are any, otherwise from the data that the
/// bus has received.
fn watch(plan: &Plan<'_>, body: &mut Body) {
    let Config {
        life_signs,
        table,
        timing,
        ..
    } = plan.config;
    let prefix = &plan.prefix;
    let mut watched = Vec::new();
    for beat in life_signs.beats(table, Role::Device) {
        let places = &plan.inputs.record.places;
        let signal = &table.signals[beat.signal];
        let Some(place) = places
            .iter()
            .find(|place| std::ptr::eq(place.signal, signal))
        else {
            continue;
        };
        let number = watched.len() + 1;
        let (value, kind) = counting(plan, &plan.inputs, place);
        body.variables.push(format!("Last_beat_{number} : {kind};"));
        // A beat may be late, and a few may be missed.
        let within = timing.max_age.max(beat.every.times(5));
        let last = format!("#Last_beat_{number}");
        watched.push((
            format!("{value} <> {last}"),
            within,
            Some(format!("{last} := {value};")),
        ));
    }
    body.has_heartbeat = !watched.is_empty();
    if watched.is_empty() && !body.heard.is_empty() {
        watched.push((body.heard.clone(), timing.max_age, None));
    }
    let mut all = Vec::new();
    for (number, (heard, within, then)) in watched.iter().enumerate() {
        let number = number + 1;
        body.variables.extend([
            format!("Silence_{number} : TON_TIME;"),
            format!("Is_heard_{number} : Bool;"),
        ]);
        body.code.extend([
            String::new(),
            format!("IF {heard} THEN"),
            format!("   #Is_heard_{number} := TRUE;"),
            "END_IF;".to_owned(),
            format!(
                "#Silence_{number}(IN := \"{prefix}\".Simulated AND NOT ({heard}), PT := {});",
                time(*within)
            ),
            format!("IF #Silence_{number}.Q OR NOT \"{prefix}\".Simulated THEN"),
            format!("   #Is_heard_{number} := FALSE;"),
            "END_IF;".to_owned(),
        ]);
        body.code.extend(then.clone());
        all.push(format!("#Is_heard_{number}"));
    }
    if !all.is_empty() {
        body.code
            .push(format!("\"{prefix}\".Alive := {};", all.join(" AND ")));
    }
}

/// The part of a signal that changes with every count, and its type: the signal itself or its least
/// significant byte, at the place that the simulation reads or writes.
pub(super) fn counting(
    plan: &Plan<'_>,
    image: &Image<'_>,
    place: &PlacedSignal<'_>,
) -> (String, &'static str) {
    let least = place.signal.order.byte_position(place.size(), 0);
    if let Some(variable) = s7comm::direct(plan, place) {
        if place.data_type() == DataType::Bool {
            return (variable.to_string(), spelling(DataType::Bool));
        }
        let byte = Variable {
            byte: variable.byte + least,
            width: Width::Byte,
            data_type: None,
            ..variable
        };
        return (byte.to_string(), spelling(DataType::Byte));
    }
    match Path::of(place, plan.cpu) {
        Path::Value(name) => (image.member(&name), spelling(place.data_type())),
        Path::Bytes(names) => (image.member(&names[least]), spelling(DataType::Byte)),
    }
}

/// The second source.
pub(super) fn text(plan: &Plan<'_>, body: &Body) -> String {
    let mut text = source(plan, &body.what);
    let name = format!("{}_link", plan.prefix);
    line(&mut text, &format!("FUNCTION_BLOCK \"{name}\""));
    // With standard access, the data that the communication blocks send and receive are arranged as declared.
    line(&mut text, "{ S7_Optimized_Access := 'FALSE' }");
    line(&mut text, "VERSION : 0.1");
    for (kind, lines) in [("VAR", &body.variables), ("VAR_TEMP", &body.temporary)] {
        if !lines.is_empty() {
            line(&mut text, &format!("   {kind}"));
            for content in lines {
                line(&mut text, &format!("      {content}"));
            }
            line(&mut text, "   END_VAR");
        }
    }
    line(&mut text, "");
    line(&mut text, "BEGIN");
    let mut code = Vec::new();
    if body.receives || body.sends {
        code.push(format!("IF NOT \"{}\".Simulated THEN", plan.prefix));
        for (counts, member) in [(body.receives, "Received"), (body.sends, "Sent")] {
            if counts {
                code.push(format!("   \"{}\".{member} := 0;", plan.prefix));
            }
        }
        code.push("END_IF;".to_owned());
    }
    for content in code.iter().chain(&body.code) {
        line(&mut text, format!("   {content}").trim_end());
    }
    line(&mut text, "END_FUNCTION_BLOCK");
    line(&mut text, "");
    line(&mut text, &format!("DATA_BLOCK \"{name}_DB\""));
    line(&mut text, "{ S7_Optimized_Access := 'FALSE' }");
    line(&mut text, "VERSION : 0.1");
    line(&mut text, "NON_RETAIN");
    line(&mut text, &format!("\"{name}\""));
    line(&mut text, "BEGIN");
    line(&mut text, "END_DATA_BLOCK");
    text
}

/// The settings to be made in the project in addition to the sources.
pub(super) fn steps(plan: &Plan<'_>) -> Vec<String> {
    match Exported::of(&plan.config.bus) {
        Exported::Socket(options) => socket::steps(plan, options),
        Exported::S7Server(_) => s7comm::steps_for_puts_and_gets(),
        Exported::S7Client(options) => s7comm::steps_for_nothing(plan, options),
        Exported::OpcuaClient => vec![format!(
            "In the CPU's properties activate the OPC UA server and its licence. Share \"{}\" and \"{}\": accessible from OPC UA, \
             and the inputs writable. In driver.cfg let node_pattern name their members.",
            plan.outputs.block, plan.inputs.block
        )],
        Exported::Loopback
        | Exported::ModbusServer(_)
        | Exported::ModbusClient(_)
        | Exported::OpcuaServer(_)
        | Exported::ByHand => Vec::new(),
    }
}

/// The CPU is the OPC UA server, which gives access to single variables by name: those of both images.
fn opcua_server(plan: &Plan<'_>) -> Body {
    Body {
        what: "OPC UA carries the members of both images by themselves; no call is needed here."
            .to_owned(),
        code: vec![
            format!(
                ";   // In the CPU's properties activate the OPC UA server and its licence; \"{}\" and \"{}\" are then",
                plan.outputs.block, plan.inputs.block
            ),
            "    // accessible (and, the inputs, writable) from OPC UA, member by member."
                .to_owned(),
        ],
        ..Body::default()
    }
}

/// The CPU is the OPC UA client: TIA Portal generates the calls from the address space of the simulation's
/// server.
fn opcua_client(plan: &Plan<'_>, address: &str) -> Body {
    Body {
        what: "The PLC is the OPC UA client: its calls are made in TIA Portal.".to_owned(),
        code: vec![
            format!(
                ";   // OPC UA communication > Client interfaces: add one for the simulation's server (driver.cfg: {address}),"
            ),
            "    // with a read list of the inputs and a write list of the outputs; the nodes are ns=2;s=<signal>."
                .to_owned(),
            format!(
                "    // Here call OPC_UA_ReadList into \"{}\".Image and OPC_UA_WriteList from \"{}\".Image.",
                plan.inputs.block, plan.outputs.block
            ),
        ],
        ..Body::default()
    }
}
