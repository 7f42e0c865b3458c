//! Records over TCP in CODESYS, by the library CAA Net Base Services, which is always installed.

use super::parts::{Link, Part, Stream, assembly, incoming, outgoing, sending, silence, taken};
use crate::plcopen::{Kind, variable};

pub(super) fn link(stream: &Stream<'_>) -> Link {
    let globals = [variable("Client", Kind::Block("NBS.TCP_Client"))];
    let last = format!(
        "Give the task an interval of at most {}: one record is taken in each call, and what comes faster grows old \
         in the buffers.",
        stream.cycle
    );
    Link::of_records(
        stream,
        globals,
        [before(stream), after(stream)],
        "Library Manager > Add Library: CAA Net Base Services (namespace NBS).",
        last,
    )
}

fn before(stream: &Stream<'_>) -> Part {
    let Stream {
        list,
        host,
        port,
        bytes: [bytes, _],
        ..
    } = stream;
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
    part.locals
        .push(variable("Reader", Kind::Block("NBS.TCP_Read")));
    part.locals.extend(incoming(stream, "UINT"));
    let mut lines = assembly(stream).to_vec();
    lines.extend([
        format!("IF NOT {list}.Client.xActive THEN Filled := 0; END_IF;"),
        format!(
            "Reader(xEnable := {list}.Client.xActive, hConnection := {list}.Client.hConnection, szSize := {bytes} - Filled, pData := ADR(Incoming[Filled]));"
        ),
        format!("IF {list}.Client.xActive AND Reader.xReady THEN"),
        "    Filled := Filled + ANY_TO_UINT(Reader.szCount);".to_owned(),
    ]);
    lines.extend(taken(stream, 4));
    lines.push("END_IF;".to_owned());
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
    let mut lines = sending(stream, &format!("{list}.Client.xActive"));
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
        locals: outgoing(stream, variable("Writer", Kind::Block("NBS.TCP_Write"))),
        lines,
    }
}
