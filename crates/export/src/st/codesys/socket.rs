//! Records over TCP in CODESYS, by the library CAA Net Base Services, which is always installed.

use super::link::{Link, Part, Stream, registers, silence};
use crate::plcopen::{Kind, variable};
use crate::st::life::time;

pub(super) fn link(stream: &Stream<'_>) -> Link {
    let Stream {
        host,
        port,
        bytes: [received, sent],
        ..
    } = stream;
    let mut globals = Link::counters();
    globals.push(variable("Client", Kind::Block("NBS.TCP_Client")));
    Link {
        globals,
        before: before(stream),
        after: after(stream),
        steps: vec![
            "Library Manager > Add Library: CAA Net Base Services (namespace NBS).".to_owned(),
            format!(
                "In the first program check the address of the simulation's computer, '{host}', port {port}; let its \
                 firewall pass the port. Records have {received} bytes from the simulation, {sent} bytes to it."
            ),
            format!(
                "Give the task an interval of at most {}: one record is taken in each call, and what comes faster grows old \
                 in the buffers.",
                stream.cycle
            ),
        ],
        notes: Vec::new(),
        is_by_name: false,
    }
}

fn before(stream: &Stream<'_>) -> Part {
    let Stream {
        list,
        host,
        port,
        bytes: [bytes, _],
        ..
    } = stream;
    let count = bytes.div_ceil(2);
    let mut part = Part {
        locals: vec![
            variable("Address", Kind::Block("NBS.IP_ADDR")),
            variable("Is_lost", Kind::Basic("BOOL")),
            variable("Pause", Kind::Block("TON")),
        ],
        lines: [
            "(* The connection; one that is lost is dialled again after a second. *)",
            &format!("Address.sAddr := '{host}';"),
            &format!(
                "{list}.Client(xEnable := {list}.Simulated AND NOT Is_lost, udiTimeOut := 1000000, ipAddr := Address, uiPort := {port});"
            ),
            &format!("IF {list}.Client.xDone OR {list}.Client.xError THEN"),
            &format!("    IF NOT Is_lost THEN {list}.Errors := {list}.Errors + 1; END_IF;"),
            "    Is_lost := TRUE;",
            "END_IF;",
            "Pause(IN := Is_lost, PT := T#1S);",
            "IF Pause.Q THEN Is_lost := FALSE; END_IF;",
        ]
        .map(str::to_owned)
        .into(),
    };
    if *bytes == 0 {
        part.lines
            .push(format!("{list}.Alive := {list}.Client.xActive;"));
        return part;
    }
    part.locals.extend([
        variable("Reader", Kind::Block("NBS.TCP_Read")),
        variable("Incoming", Kind::Array(2 * count, "BYTE")),
        variable("Filled", Kind::Basic("UINT")),
        variable("Number", Kind::Basic("UINT")),
        variable("Is_new", Kind::Basic("BOOL")),
        variable("Silence", Kind::Block("TON")),
    ]);
    let mut lines = vec![
        format!("(* A record is complete with {bytes} bytes, however TCP cuts the stream. *)"),
        "Is_new := FALSE;".to_owned(),
        format!("IF NOT {list}.Client.xActive THEN Filled := 0; END_IF;"),
        format!(
            "Reader(xEnable := {list}.Client.xActive, hConnection := {list}.Client.hConnection, szSize := {bytes} - Filled, pData := ADR(Incoming[Filled]));"
        ),
        format!("IF {list}.Client.xActive AND Reader.xReady THEN"),
        "    Filled := Filled + ANY_TO_UINT(Reader.szCount);".to_owned(),
        format!("    IF Filled >= {bytes} THEN"),
        "        Filled := 0;".to_owned(),
        "        Is_new := TRUE;".to_owned(),
    ];
    lines.extend(registers(list, count, true).map(|line| format!("        {line}")));
    lines.extend([
        format!("        {list}.Received := {list}.Received + 1;"),
        "    END_IF;".to_owned(),
        "END_IF;".to_owned(),
    ]);
    lines.extend(silence(list, stream.max_age));
    part.lines.extend(lines);
    part
}

fn after(stream: &Stream<'_>) -> Part {
    let Stream {
        list,
        bytes: [_, bytes],
        ..
    } = stream;
    if *bytes == 0 {
        return Part::default();
    }
    let count = bytes.div_ceil(2);
    let cycle = time(stream.cycle);
    let mut lines = vec![
        "(* A record goes out in each cycle; none is made up for. *)".to_owned(),
        format!("IF {list}.Client.xActive AND NOT Is_sending AND TIME() - Sent_at >= {cycle} THEN"),
        format!("    Sent_at := Sent_at + {cycle};"),
        format!("    IF TIME() - Sent_at >= {cycle} THEN Sent_at := TIME(); END_IF;"),
    ];
    lines.extend(registers(list, count, false).map(|line| format!("    {line}")));
    lines.extend([
        "    Is_sending := TRUE;".to_owned(),
        "END_IF;".to_owned(),
        format!(
            "Writer(xExecute := Is_sending AND {list}.Client.xActive, udiTimeOut := 1000000, hConnection := {list}.Client.hConnection, szSize := {bytes}, pData := ADR(Outgoing));"
        ),
        format!("IF Writer.xDone OR Writer.xError OR NOT {list}.Client.xActive THEN"),
        format!("    IF Writer.xDone THEN {list}.Sent := {list}.Sent + 1; END_IF;"),
        format!("    IF Writer.xError THEN {list}.Errors := {list}.Errors + 1; END_IF;"),
        "    Is_sending := FALSE;".to_owned(),
        "    Writer(xExecute := FALSE);".to_owned(),
        "END_IF;".to_owned(),
    ]);
    Part {
        locals: vec![
            variable("Writer", Kind::Block("NBS.TCP_Write")),
            variable("Outgoing", Kind::Array(2 * count, "BYTE")),
            variable("Number", Kind::Basic("UINT")),
            variable("Is_sending", Kind::Basic("BOOL")),
            variable("Sent_at", Kind::Basic("TIME")),
        ],
        lines,
    }
}
