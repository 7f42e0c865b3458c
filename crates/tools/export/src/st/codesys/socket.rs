//! Records over TCP in CODESYS, using the library CAA Net Base Services, which is always installed.

use super::parts::{Calls, Link, Part, Stream};
use crate::plcopen::{Kind, variable};

pub(super) fn link(stream: &Stream<'_>) -> Link {
    let Stream {
        list,
        host,
        port,
        bytes: [received, sent],
        cycle,
        ..
    } = stream;
    let connection = [
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
    ];
    let receive: [&str; 4] = [
        &format!("IF NOT {list}.Client.xActive THEN Filled := 0; END_IF;"),
        &format!(
            "Reader(xEnable := {list}.Client.xActive, hConnection := {list}.Client.hConnection, szSize := {received} - Filled, pData := ADR(Incoming[Filled]));"
        ),
        &format!("IF {list}.Client.xActive AND Reader.xReady THEN"),
        "    Filled := Filled + ANY_TO_UINT(Reader.szCount);",
    ];
    let send = [
        "    Is_sending := TRUE;",
        "END_IF;",
        &format!(
            "Writer(xExecute := Is_sending AND {list}.Client.xActive, udiTimeOut := 1000000, hConnection := {list}.Client.hConnection, szSize := {sent}, pData := ADR(Outgoing));"
        ),
        &format!("IF Writer.xDone OR Writer.xError OR NOT {list}.Client.xActive THEN"),
        &format!("    IF Writer.xDone THEN {list}.Sent := {list}.Sent + 1; END_IF;"),
        &format!("    IF Writer.xError THEN {list}.Errors := {list}.Errors + 1; END_IF;"),
        "    Is_sending := FALSE;",
        "    Writer(xExecute := FALSE);",
        "END_IF;",
    ];
    let last = format!(
        "Give the task an interval of at most {cycle}: one record is taken in each call, and what comes faster grows old \
         in the buffers."
    );
    let calls = Calls {
        steps: [
            "Library Manager > Add Library: CAA Net Base Services (namespace NBS).",
            &last,
        ],
        globals: vec![variable("Client", Kind::Block("NBS.TCP_Client"))],
        connected: "Client.xActive",
        connection: Part {
            locals: vec![
                variable("Address", Kind::Block("NBS.IP_ADDR")),
                variable("Is_lost", Kind::Basic("BOOL")),
                variable("Pause", Kind::Block("TON")),
            ],
            lines: connection.map(str::to_owned).into(),
        },
        receiver: vec![variable("Reader", Kind::Block("NBS.TCP_Read"))],
        count: "UINT",
        receive: [&receive, &["END_IF;"]],
        indent: 4,
        sender: variable("Writer", Kind::Block("NBS.TCP_Write")),
        send: [&[], &send],
    };
    Link::of_records(stream, &calls)
}
