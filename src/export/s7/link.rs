//! The block that talks to the simulation: one body for each bus.

use super::{Plan, line, modbus, s7comm, socket, source};
use crate::fieldbus::Options;
use crate::fieldbus::socket::Message;

/// A body: what it declares and what it does.
#[derive(Default)]
pub(super) struct Body {
    /// What it is, for the head.
    pub(super) what: String,
    /// Lines between `VAR` and `END_VAR`.
    pub(super) variables: Vec<String>,
    /// Lines between `VAR_TEMP` and `END_VAR`.
    pub(super) temporary: Vec<String>,
    pub(super) code: Vec<String>,
}

/// The second source.
pub(super) fn text(plan: &Plan<'_>, notes: &mut Vec<String>) -> String {
    let body = match &plan.config.bus {
        Options::Socket(options) if matches!(options.message, Message::Axis { .. }) => {
            by_hand("socket with message = \"axis\"", notes)
        }
        Options::Socket(options) => socket::body(plan, options, notes),
        Options::ModbusServer(options) => modbus::client(plan, options, notes),
        Options::ModbusClient(options) => modbus::server(plan, options, notes),
        Options::S7Server(options) => s7comm::puts_and_gets(plan, options, notes),
        Options::S7Client(options) => s7comm::nothing(plan, options),
        Options::OpcuaClient(_) | Options::OpcuaServer(_) => opcua(plan),
        bus @ (Options::Loopback(_) | Options::Plugin(_)) => by_hand(bus.kind(), notes),
    };
    let mut text = source(plan, &body.what);
    let name = format!("{}_link", plan.prefix);
    line(&mut text, &format!("FUNCTION_BLOCK \"{name}\""));
    // Standard access: what the communication blocks send and receive lies as it is declared.
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
    let prefix = &plan.prefix;
    for content in [
        format!("IF NOT \"{prefix}\".Simulated THEN"),
        format!("   \"{prefix}\".Received := 0;"),
        format!("   \"{prefix}\".Sent := 0;"),
        "END_IF;".to_owned(),
    ]
    .iter()
    .chain(&body.code)
    {
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

/// What is to be set in the project beside the sources.
pub(super) fn steps(plan: &Plan<'_>) -> Vec<String> {
    match &plan.config.bus {
        Options::Socket(options) => socket::steps(options),
        Options::S7Server(_) => s7comm::steps_for_puts_and_gets(),
        Options::S7Client(_) => s7comm::steps_for_nothing(plan),
        _ => Vec::new(),
    }
}

/// A bus for which there is no block: the user's own goes here.
pub(super) fn by_hand(kind: &str, notes: &mut Vec<String>) -> Body {
    notes.push(format!(
        "the bus \"{kind}\" has no block of its own for S7: what brings the images is to be written by hand"
    ));
    Body {
        what: format!("The bus \"{kind}\" needs no call here, or one that only you can write."),
        code: vec![
            ";   // Put here what receives \"…_in\".Image and sends \"…_out\".Image.".to_owned(),
        ],
        ..Body::default()
    }
}

/// OPC UA carries single variables, by name: those of both images.
fn opcua(plan: &Plan<'_>) -> Body {
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

/// A duration for a timer, in whole milliseconds, at least one.
pub(super) fn time(span: crate::time::Nanos) -> String {
    format!("T#{}ms", span.0.div_euclid(1_000_000).max(1))
}
