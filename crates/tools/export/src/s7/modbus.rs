//! Modbus TCP: `MB_CLIENT` if the simulation is the server, `MB_SERVER` if it connects.

use super::Plan;
use super::body::{Body, by_hand};
use super::connection;
use tickbus_bus_modbus::{ClientOptions, Line, ServerOptions, Table};
use tickbus_image::signal::Area;

/// The most registers of one read request, and of one write request.
const READ: usize = 125;
const WRITE: usize = 123;

/// `MB_MODE` for function codes 4 and 16 with wire addresses, which start at 0.
const INPUT_REGISTERS: u8 = 104;
const HOLDING_REGISTERS: u8 = 116;

/// The simulation is the server: the PLC reads its inputs and writes its outputs alternately.
pub(super) fn client(plan: &Plan<'_>, options: &ServerOptions, notes: &mut Vec<String>) -> Body {
    let (Line::Tcp(address), None) = (&options.line, &options.tls) else {
        return by_hand("modbus-server with RTU, ASCII, UDP or TLS", notes);
    };
    if plan.config.table.stations.len() > 1 {
        return by_hand("modbus-server with several units", notes);
    }
    let (inputs, outputs) = (registers(plan, Area::Input), registers(plan, Area::Output));
    let mut variables = vec![
        "Connection : TCON_IP_v4;".to_owned(),
        "Is_prepared : Bool;".to_owned(),
        "Client : MB_CLIENT;".to_owned(),
        format!("Piece : Array[0..{}] of Word;", READ - 1),
        "Job : Int;".to_owned(),
        "Mode : USInt;".to_owned(),
        "First : UDInt;".to_owned(),
        "Count : UInt;".to_owned(),
        "Is_asking : Bool;".to_owned(),
    ];
    views(plan, &mut variables, inputs, outputs);
    let mut code = connection::lines(address, true, notes);
    if let Some(unit) = options.stations.unit(0) {
        code.push(format!("#Client.MB_Unit_ID := {unit};"));
    }
    code.extend(turns(plan, inputs, outputs));
    Body {
        what: format!(
            "Modbus TCP: {inputs} input registers are read from the simulation, {outputs} holding registers written to it, in turns."
        ),
        variables,
        temporary: vec!["Register : Int;".to_owned()],
        code,
        receives: inputs > 0,
        sends: outputs > 0,
        heard: "#Client.DONE".to_owned(),
        ..Body::default()
    }
}

/// One request after another; each is held until its answer has arrived, followed by one call without a
/// request.
fn turns(plan: &Plan<'_>, inputs: usize, outputs: usize) -> Vec<String> {
    let prefix = &plan.prefix;
    let mut code = vec![
        String::new(),
        "// One request after another; each is held until its answer has come, and rests for one call.".to_owned(),
    ];
    code.push("CASE #Job OF".to_owned());
    let mut jobs = 0;
    for (mode, total, most) in [
        (INPUT_REGISTERS, inputs, READ),
        (HOLDING_REGISTERS, outputs, WRITE),
    ] {
        for first in (0..total).step_by(most) {
            let count = most.min(total - first);
            code.push(format!(
                "   {jobs}: #Mode := {mode}; #First := {first}; #Count := {count};"
            ));
            jobs += 1;
        }
    }
    code.push("END_CASE;".to_owned());
    let mut add = |lines: &[&str]| code.extend(lines.iter().map(|line| (*line).to_owned()));
    if outputs > 0 {
        add(&[
            "IF #Job = 0 AND NOT #Is_asking THEN",
            &format!("   #Outgoing := \"{}\".Image;", plan.outputs.block),
            "END_IF;",
            &format!("IF #Mode = {HOLDING_REGISTERS} AND NOT #Is_asking THEN"),
            "   FOR #Register := 0 TO UINT_TO_INT(#Count) - 1 DO",
            "      #Piece[#Register] := #Outgoing_words[UDINT_TO_INT(#First) + #Register];",
            "   END_FOR;",
            "END_IF;",
        ]);
    }
    add(&[
        &format!("#Client(REQ := #Is_asking AND \"{prefix}\".Simulated,"),
        &format!("        DISCONNECT := NOT \"{prefix}\".Simulated,"),
        "        MB_MODE := #Mode,",
        "        MB_DATA_ADDR := #First,",
        "        MB_DATA_LEN := #Count,",
        "        MB_DATA_PTR := #Piece,",
        "        CONNECT := #Connection);",
        "IF NOT #Is_asking THEN",
        "   #Is_asking := TRUE;",
        "ELSIF #Client.DONE THEN",
        "   #Is_asking := FALSE;",
    ]);
    if inputs > 0 {
        add(&[
            &format!("   IF #Mode = {INPUT_REGISTERS} THEN"),
            "      FOR #Register := 0 TO UINT_TO_INT(#Count) - 1 DO",
            "         #Incoming_words[UDINT_TO_INT(#First) + #Register] := #Piece[#Register];",
            "      END_FOR;",
            "   END_IF;",
        ]);
    }
    add(&[
        "   #Job := #Job + 1;",
        &format!("   IF #Job >= {jobs} THEN"),
        "      #Job := 0;",
    ]);
    if inputs > 0 {
        add(&[
            &format!("      \"{}\".Image := #Incoming;", plan.inputs.block),
            &format!("      \"{prefix}\".Received := \"{prefix}\".Received + 1;"),
        ]);
    }
    if outputs > 0 {
        add(&[&format!(
            "      \"{prefix}\".Sent := \"{prefix}\".Sent + 1;"
        )]);
    }
    add(&[
        "   END_IF;",
        "ELSIF #Client.ERROR THEN",
        "   #Is_asking := FALSE;",
        "   #Job := 0;",
        &format!("   \"{prefix}\".Errors := \"{prefix}\".Errors + 1;"),
        &format!("   \"{prefix}\".Last_error := #Client.STATUS;"),
        "END_IF;",
    ]);
    code
}

/// The simulation connects: the PLC serves an array of registers.
pub(super) fn server(plan: &Plan<'_>, options: &ClientOptions, notes: &mut Vec<String>) -> Body {
    let (Line::Tcp(address), None) = (&options.line, &options.tls) else {
        return by_hand("modbus-client with RTU, ASCII, UDP or TLS", notes);
    };
    if plan.config.table.stations.len() > 1 {
        return by_hand("modbus-client with several units", notes);
    }
    if !options.at.is_empty() {
        return by_hand(
            "modbus-client with [fieldbus.at], whose signals lie where the program has them",
            notes,
        );
    }
    let place = |area| {
        let bytes = plan.config.table.stations[0].bytes(area);
        let blocks = options.blocks(area, bytes).ok()?;
        match blocks.as_slice() {
            [block] if block.table == Table::HoldingRegisters => Some(block.first),
            _ => None,
        }
    };
    let (Some(from), Some(to)) = (place(Area::Output), place(Area::Input)) else {
        return by_hand(
            "modbus-client with other tables than holding registers",
            notes,
        );
    };
    let (inputs, outputs) = (registers(plan, Area::Input), registers(plan, Area::Output));
    let prefix = &plan.prefix;
    let last = (from + outputs).max(to + inputs).max(1) - 1;
    let mut variables = vec![
        "Connection : TCON_IP_v4;".to_owned(),
        "Is_prepared : Bool;".to_owned(),
        "Server : MB_SERVER;".to_owned(),
        format!("Registers : Array[0..{last}] of Word;"),
    ];
    views(plan, &mut variables, inputs, outputs);
    let mut code = connection::lines(address, false, notes);
    let mut add = |lines: &[&str]| code.extend(lines.iter().map(|line| (*line).to_owned()));
    add(&[""]);
    if outputs > 0 {
        add(&[
            &format!("#Outgoing := \"{}\".Image;", plan.outputs.block),
            &format!("FOR #Register := 0 TO {} DO", outputs - 1),
            &format!("   #Registers[{from} + #Register] := #Outgoing_words[#Register];"),
            "END_FOR;",
        ]);
    }
    add(&[
        &format!("#Server(DISCONNECT := NOT \"{prefix}\".Simulated,"),
        "        MB_HOLD_REG := #Registers,",
        "        CONNECT := #Connection);",
    ]);
    if inputs > 0 {
        add(&[
            "IF #Server.NDR THEN",
            &format!("   \"{prefix}\".Received := \"{prefix}\".Received + 1;"),
            &format!("   FOR #Register := 0 TO {} DO", inputs - 1),
            &format!("      #Incoming_words[#Register] := #Registers[{to} + #Register];"),
            "   END_FOR;",
            &format!("   \"{}\".Image := #Incoming;", plan.inputs.block),
            "END_IF;",
        ]);
    }
    if outputs > 0 {
        add(&[
            "IF #Server.DR THEN",
            &format!("   \"{prefix}\".Sent := \"{prefix}\".Sent + 1;"),
            "END_IF;",
        ]);
    }
    add(&[
        "IF #Server.ERROR THEN",
        &format!("   \"{prefix}\".Errors := \"{prefix}\".Errors + 1;"),
        &format!("   \"{prefix}\".Last_error := #Server.STATUS;"),
        "END_IF;",
    ]);
    Body {
        what: format!(
            "Modbus TCP: the simulation reads {outputs} holding registers from {from} on and writes {inputs} from {to} on."
        ),
        variables,
        temporary: vec!["Register : Int;".to_owned()],
        code,
        receives: inputs > 0,
        sends: outputs > 0,
        heard: "#Server.NDR OR #Server.DR".to_owned(),
        ..Body::default()
    }
}

fn registers(plan: &Plan<'_>, area: Area) -> usize {
    let image = match area {
        Area::Input => &plan.inputs,
        Area::Output => &plan.outputs,
    };
    image.record.bytes.div_ceil(2)
}

/// Both images, each overlaid by an array of words. The bytes of a structure fill whole words.
fn views(plan: &Plan<'_>, variables: &mut Vec<String>, inputs: usize, outputs: usize) {
    for (name, image, words) in [
        ("Incoming", &plan.inputs, inputs),
        ("Outgoing", &plan.outputs, outputs),
    ] {
        if words > 0 {
            variables.push(format!("{name} : \"{}\";", image.type_name));
            variables.push(format!(
                "{name}_words AT {name} : Array[0..{}] of Word;",
                words - 1
            ));
        }
    }
}
