//! Records over TCP: `TSEND_C` and `TRCV_C` on one connection.

use super::Plan;
use super::body::{Body, time};
use super::connection;
use tickbus_base::time::Nanos;
use tickbus_bus_socket::{Options, TcpRole};

/// The default cycle of the socket bus.
const CYCLE: Nanos = Nanos::from_millis(10);

/// The longest record that every CPU supports.
const LONGEST: usize = 8192;

#[expect(
    clippy::too_many_lines,
    reason = "one block of the PLC, from its head to its end"
)]
pub(super) fn body(plan: &Plan<'_>, options: &Options, notes: &mut Vec<String>) -> Body {
    let (sent, received) = (plan.outputs.record.bytes, plan.inputs.record.bytes);
    if sent.max(received) > LONGEST {
        notes.push(format!(
            "a record has {} bytes; an S7-1200 sends and receives at most {LONGEST}",
            sent.max(received)
        ));
    }
    let mut variables = vec![
        "Connection : TCON_IP_v4;".to_owned(),
        "Is_prepared : Bool;".to_owned(),
    ];
    let mut code = connection::lines(&options.address, options.tcp == TcpRole::Listen, notes);
    let prefix = &plan.prefix;
    let cycle = plan.config.timing.cycle.unwrap_or(CYCLE);
    let mut add = |lines: &[&str]| code.extend(lines.iter().map(|line| (*line).to_owned()));
    if received > 0 {
        variables.extend([
            "Receive : TRCV_C;".to_owned(),
            format!("Incoming : \"{}\";", plan.inputs.type_name),
        ]);
        add(&[
            "",
            "// TRCV_C and TSEND_C share the connection: they name the same description.",
            &format!("// A record is complete with {received} bytes, however TCP cuts the stream."),
            "#Receive(EN_R := TRUE,",
            &format!("         CONT := \"{prefix}\".Simulated,"),
            &format!("         LEN := {received},"),
            "         CONNECT := #Connection,",
            "         DATA := #Incoming);",
            "IF #Receive.DONE THEN",
            &format!("   \"{}\".Image := #Incoming;", plan.inputs.block),
            &format!("   \"{prefix}\".Received := \"{prefix}\".Received + 1;"),
            "END_IF;",
            "IF #Receive.ERROR THEN",
            &format!("   \"{prefix}\".Errors := \"{prefix}\".Errors + 1;"),
            &format!("   \"{prefix}\".Last_error := #Receive.STATUS;"),
            "END_IF;",
        ]);
    }
    if sent > 0 {
        variables.extend([
            "Send : TSEND_C;".to_owned(),
            format!("Outgoing : \"{}\";", plan.outputs.type_name),
            "Clock : TON_TIME;".to_owned(),
            "Last : Time;".to_owned(),
            "Is_due : Bool;".to_owned(),
            "Is_asked : Bool;".to_owned(),
            "Is_busy : Bool;".to_owned(),
        ]);
        let cycle = time(cycle);
        add(&[
            "",
            "// A record goes out in each cycle. The time is counted on, so that the calls of OB1 add nothing to it.",
            "#Clock(IN := NOT #Clock.Q, PT := T#24D);",
            "#Now := #Clock.ET;",
            "IF #Now < #Last THEN",
            "   #Last := T#0ms;   // the clock has begun anew",
            "END_IF;",
            &format!("IF #Now - #Last >= {cycle} THEN"),
            &format!("   #Last := #Last + {cycle};"),
            &format!("   IF #Now - #Last >= {cycle} THEN"),
            "      #Last := #Now;   // late by a whole cycle: what was missed is not sent in a burst",
            "   END_IF;",
            "   #Is_due := TRUE;",
            "END_IF;",
            "// What is being sent must not change until it is gone, and REQ needs a rising edge.",
            "IF NOT #Is_busy THEN",
            &format!("   #Outgoing := \"{}\".Image;", plan.outputs.block),
            "END_IF;",
            &format!(
                "#Is_asked := #Is_due AND NOT #Is_busy AND NOT #Is_asked AND \"{prefix}\".Simulated;"
            ),
            "#Send(REQ := #Is_asked,",
            &format!("      CONT := \"{prefix}\".Simulated,"),
            &format!("      LEN := {sent},"),
            "      CONNECT := #Connection,",
            "      DATA := #Outgoing);",
            "#Is_busy := #Send.BUSY;",
            "IF #Is_asked THEN",
            "   #Is_due := FALSE;",
            "END_IF;",
            "IF #Send.DONE THEN",
            &format!("   \"{prefix}\".Sent := \"{prefix}\".Sent + 1;"),
            "END_IF;",
            "IF #Send.ERROR THEN",
            &format!("   \"{prefix}\".Errors := \"{prefix}\".Errors + 1;"),
            &format!("   \"{prefix}\".Last_error := #Send.STATUS;"),
            "END_IF;",
        ]);
    }
    Body {
        what: format!(
            "Records over TCP: {sent} bytes to the simulation every {cycle}, {received} bytes from it."
        ),
        variables,
        temporary: if sent > 0 {
            vec!["Now : Time;".to_owned()]
        } else {
            Vec::new()
        },
        code,
        receives: received > 0,
        sends: sent > 0,
        // TCP accepting a record proves nothing about the other end.
        heard: if received > 0 {
            "#Receive.DONE".to_owned()
        } else {
            String::new()
        },
        ..Body::default()
    }
}

pub(super) fn steps(plan: &Plan<'_>, options: &Options) -> Vec<String> {
    let mut steps = vec![
        "In the link source, check InterfaceId (the hardware identifier of the interface, 64 on most CPUs), ID and \
         address."
            .to_owned(),
    ];
    steps.push(format!(
        "Let OB1 take less than half of the driver's cycle ({}). One record is taken in each call: what comes faster grows \
         old in the buffers. Sending counts the time: on average one record per cycle, each at most one OB1 late. For \
         even distances call \"{}_link_DB\" in a cyclic interrupt OB of that period instead of in \"{}_begin\".",
        plan.config.timing.cycle.unwrap_or(CYCLE),
        plan.prefix,
        plan.prefix
    ));
    if options.tcp == TcpRole::Listen {
        steps.push("Let the firewall of the simulator's computer pass the port.".to_owned());
    }
    steps
}
