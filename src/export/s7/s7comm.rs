//! S7 communication: `PUT` and `GET` where the simulation serves, nothing where it dials.

use super::Plan;
use super::link::{Body, by_hand, time};
use crate::fieldbus::s7::{ClientOptions, ServerOptions};
use crate::signal::Area;

/// What one PUT or GET surely carries between two CPUs of the S7-1500.
const SURE: usize = 400;

/// The simulation serves as a CPU: its I and Q are the images.
pub(super) fn puts_and_gets(
    plan: &Plan<'_>,
    options: &ServerOptions,
    notes: &mut Vec<String>,
) -> Body {
    if plan.config.table.stations.len() > 1 {
        return by_hand("s7-server with several stations", notes);
    }
    let (received, sent) = (plan.inputs.record.bytes, plan.outputs.record.bytes);
    if received.max(sent) > SURE {
        notes.push(format!(
            "an image has {} bytes, and one PUT or GET may carry fewer: the manual of the CPU tells; then split the call",
            received.max(sent)
        ));
    }
    if options.address.port != 102 {
        notes.push(format!(
            "PUT and GET of a CPU dial port 102 and no other; driver.cfg listens on {}: docs/s7.md tells how to get port 102",
            options.address
        ));
    }
    let prefix = &plan.prefix;
    let mut variables = Vec::new();
    let mut code =
        vec!["// The S7 connection of the hardware configuration has this ID.".to_owned()];
    let mut add = |lines: &[&str]| code.extend(lines.iter().map(|line| (*line).to_owned()));
    if received > 0 {
        variables.extend([
            "Get_inputs : GET;".to_owned(),
            format!("Incoming : \"{}\";", plan.inputs.type_name),
            "Is_getting : Bool;".to_owned(),
            "Silence : TON_TIME;".to_owned(),
        ]);
        add(&[
            &format!("#Get_inputs(REQ := #Is_getting AND \"{prefix}\".Simulated,"),
            "            ID := W#16#100,",
            &format!("            ADDR_1 := P#I0.0 BYTE {received},"),
            "            RD_1 := #Incoming);",
            "IF NOT #Is_getting THEN",
            "   #Is_getting := TRUE;",
            "ELSIF #Get_inputs.NDR THEN",
            "   #Is_getting := FALSE;",
            &format!("   \"{}\".Image := #Incoming;", plan.inputs.block),
            &format!("   \"{prefix}\".Received := \"{prefix}\".Received + 1;"),
            "ELSIF #Get_inputs.ERROR THEN",
            "   #Is_getting := FALSE;",
            &format!("   \"{prefix}\".Errors := \"{prefix}\".Errors + 1;"),
            &format!("   \"{prefix}\".Last_error := #Get_inputs.STATUS;"),
            "END_IF;",
            &format!(
                "#Silence(IN := \"{prefix}\".Simulated AND NOT #Get_inputs.NDR, PT := {});",
                time(plan.config.timing.max_age)
            ),
            &format!(
                "\"{prefix}\".Alive := \"{prefix}\".Simulated AND \"{prefix}\".Received > 0 AND NOT #Silence.Q;"
            ),
            "",
        ]);
    }
    if sent > 0 {
        variables.extend([
            "Put_outputs : PUT;".to_owned(),
            format!("Outgoing : \"{}\";", plan.outputs.type_name),
            "Is_putting : Bool;".to_owned(),
        ]);
        add(&[
            "IF NOT #Is_putting THEN",
            &format!("   #Outgoing := \"{}\".Image;", plan.outputs.block),
            "END_IF;",
            &format!("#Put_outputs(REQ := #Is_putting AND \"{prefix}\".Simulated,"),
            "             ID := W#16#100,",
            &format!("             ADDR_1 := P#Q0.0 BYTE {sent},"),
            "             SD_1 := #Outgoing);",
            "IF NOT #Is_putting THEN",
            "   #Is_putting := TRUE;",
            "ELSIF #Put_outputs.DONE THEN",
            "   #Is_putting := FALSE;",
            &format!("   \"{prefix}\".Sent := \"{prefix}\".Sent + 1;"),
            "ELSIF #Put_outputs.ERROR THEN",
            "   #Is_putting := FALSE;",
            &format!("   \"{prefix}\".Errors := \"{prefix}\".Errors + 1;"),
            &format!("   \"{prefix}\".Last_error := #Put_outputs.STATUS;"),
            "END_IF;",
        ]);
    }
    Body {
        what: format!(
            "S7 communication: GET brings {received} bytes from the simulation, PUT takes {sent} bytes to it."
        ),
        variables,
        temporary: Vec::new(),
        code,
    }
}

/// The simulation dials and reads and writes the data blocks by itself.
pub(super) fn nothing(plan: &Plan<'_>, options: &ClientOptions) -> Body {
    let mut code =
        vec![";   // The simulation reads and writes by itself, as driver.cfg says:".to_owned()];
    for (area, image) in [(Area::Output, &plan.outputs), (Area::Input, &plan.inputs)] {
        let place = options.place(0, area);
        let place = place.map_or_else(|| "nowhere".to_owned(), |start| start.to_string());
        code.push(format!(
            "    // {area} at {place}; \"{}\".Image is meant for that",
            image.block
        ));
    }
    Body {
        what: "The simulation reads and writes the data blocks by S7 communication; no call is needed here.".to_owned(),
        code,
        ..Body::default()
    }
}

/// What is to be set in the project.
pub(super) fn steps_for_puts_and_gets() -> Vec<String> {
    vec![
        "Devices & networks > Connections > S7 connection: partner unspecified, the IP address of the simulator's computer, \
         partner TSAP 03.01 (rack 0, slot 1); its ID is W#16#100 in the link source."
            .to_owned(),
    ]
}

/// What is to be set in the project.
pub(super) fn steps_for_nothing(plan: &Plan<'_>) -> Vec<String> {
    vec![
        "CPU properties > Protection & Security > Connection mechanisms: permit access with PUT/GET communication.".to_owned(),
        format!(
            "Give \"{}\" and \"{}\" the numbers that driver.cfg names as output and input (properties of the block, \
             numbering by hand).",
            plan.outputs.block, plan.inputs.block
        ),
    ]
}
