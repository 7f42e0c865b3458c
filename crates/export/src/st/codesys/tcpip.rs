//! Records over TCP in TwinCAT, by the library `Tc2_TcpIp` of TF6310.

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
    globals.extend([
        variable("Is_connected", Kind::Basic("BOOL")),
        variable("Is_lost", Kind::Basic("BOOL")),
        variable("Socket", Kind::Block("T_HSOCKET")),
    ]);
    Link {
        globals,
        before: before(stream),
        after: after(stream),
        steps: vec![
            "Install TF6310 (TCP/IP) with its licence on the target; References > Add library: Tc2_TcpIp.".to_owned(),
            format!(
                "In the first program check the address of the simulation's computer, '{host}', port {port}; let its \
                 firewall pass the port. Records have {received} bytes from the simulation, {sent} bytes to it."
            ),
            "Each call of TF6310 is answered by a service of Windows or TwinCAT/BSD after some cycles of the task: expect \
             tens of milliseconds."
                .to_owned(),
        ],
        notes: Vec::new(),
        is_by_name: false,
    }
}

#[expect(
    clippy::too_many_lines,
    reason = "one program of the PLC, from its head to its end"
)]
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
            variable("State", Kind::Basic("UINT")),
            variable("Connect", Kind::Block("FB_SocketConnect")),
            variable("Close", Kind::Block("FB_SocketClose")),
            variable("Pause", Kind::Block("TON")),
        ],
        lines: [
            "(* The connection; one that is lost is closed, and dialled again after a second. *)",
            "CASE State OF",
            &format!("0: IF {list}.Simulated THEN State := 1; END_IF;"),
            "1:",
            &format!(
                "    Connect(sSrvNetId := '', sRemoteHost := '{host}', nRemotePort := {port}, bExecute := TRUE, tTimeout := T#5S);"
            ),
            "    IF NOT Connect.bBusy THEN",
            "        Connect(bExecute := FALSE);",
            "        IF Connect.bError THEN",
            &format!("            {list}.Errors := {list}.Errors + 1;"),
            "            State := 4;",
            "        ELSE",
            &format!("            {list}.Socket := Connect.hSocket;"),
            &format!("            {list}.Is_lost := FALSE;"),
            &format!("            {list}.Is_connected := TRUE;"),
            "            State := 2;",
            "        END_IF;",
            "    END_IF;",
            &format!("2: IF {list}.Is_lost OR NOT {list}.Simulated THEN"),
            &format!("        {list}.Is_connected := FALSE;"),
            "        State := 3;",
            "    END_IF;",
            "3:",
            &format!("    Close(sSrvNetId := '', hSocket := {list}.Socket, bExecute := TRUE, tTimeout := T#5S);"),
            "    IF NOT Close.bBusy THEN",
            "        Close(bExecute := FALSE);",
            "        State := 4;",
            "    END_IF;",
            "4: IF Pause.Q THEN State := 0; END_IF;",
            "END_CASE;",
            "Pause(IN := State = 4, PT := T#1S);",
        ]
        .map(str::to_owned)
        .into(),
    };
    if *bytes == 0 {
        part.lines
            .push(format!("{list}.Alive := {list}.Is_connected;"));
        return part;
    }
    part.locals.extend([
        variable("Receive", Kind::Block("FB_SocketReceive")),
        variable("Is_receiving", Kind::Basic("BOOL")),
        variable("Incoming", Kind::Array(2 * count, "BYTE")),
        variable("Filled", Kind::Basic("UDINT")),
        variable("Number", Kind::Basic("UINT")),
        variable("Is_new", Kind::Basic("BOOL")),
        variable("Silence", Kind::Block("TON")),
    ]);
    let mut lines = vec![
        format!("(* A record is complete with {bytes} bytes, however TCP cuts the stream. *)"),
        "Is_new := FALSE;".to_owned(),
        "IF Is_receiving THEN".to_owned(),
        "    Receive(bExecute := TRUE);".to_owned(),
        "    IF NOT Receive.bBusy THEN".to_owned(),
        "        Is_receiving := FALSE;".to_owned(),
        "        Receive(bExecute := FALSE);".to_owned(),
        "        IF Receive.bError THEN".to_owned(),
        format!("            {list}.Errors := {list}.Errors + 1;"),
        format!("            {list}.Is_lost := TRUE;"),
        "        ELSE".to_owned(),
        "            Filled := Filled + Receive.nRecBytes;".to_owned(),
        "        END_IF;".to_owned(),
        format!("        IF Filled >= {bytes} THEN"),
        "            Filled := 0;".to_owned(),
        "            Is_new := TRUE;".to_owned(),
    ];
    lines.extend(registers(list, count, true).map(|line| format!("            {line}")));
    lines.extend([
        format!("            {list}.Received := {list}.Received + 1;"),
        "        END_IF;".to_owned(),
        "    END_IF;".to_owned(),
        "END_IF;".to_owned(),
        format!("IF NOT {list}.Is_connected THEN"),
        "    Filled := 0;".to_owned(),
        "ELSIF NOT Is_receiving THEN".to_owned(),
        format!(
            "    Receive(sSrvNetId := '', hSocket := {list}.Socket, cbLen := {bytes} - Filled, pDest := ADR(Incoming[Filled]), bExecute := TRUE, tTimeout := T#5S);"
        ),
        "    Is_receiving := TRUE;".to_owned(),
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
        "IF Is_sending THEN".to_owned(),
        "    Send(bExecute := TRUE);".to_owned(),
        "    IF NOT Send.bBusy THEN".to_owned(),
        "        Is_sending := FALSE;".to_owned(),
        "        Send(bExecute := FALSE);".to_owned(),
        "        IF Send.bError THEN".to_owned(),
        format!("            {list}.Errors := {list}.Errors + 1;"),
        format!("            {list}.Is_lost := TRUE;"),
        "        ELSE".to_owned(),
        format!("            {list}.Sent := {list}.Sent + 1;"),
        "        END_IF;".to_owned(),
        "    END_IF;".to_owned(),
        "END_IF;".to_owned(),
        "(* A record goes out in each cycle; none is made up for. *)".to_owned(),
        format!("IF {list}.Is_connected AND NOT Is_sending AND TIME() - Sent_at >= {cycle} THEN"),
        format!("    Sent_at := Sent_at + {cycle};"),
        format!("    IF TIME() - Sent_at >= {cycle} THEN Sent_at := TIME(); END_IF;"),
    ];
    lines.extend(registers(list, count, false).map(|line| format!("    {line}")));
    lines.extend([
        format!(
            "    Send(sSrvNetId := '', hSocket := {list}.Socket, cbLen := {bytes}, pSrc := ADR(Outgoing), bExecute := TRUE, tTimeout := T#5S);"
        ),
        "    Is_sending := TRUE;".to_owned(),
        "END_IF;".to_owned(),
    ]);
    Part {
        locals: vec![
            variable("Send", Kind::Block("FB_SocketSend")),
            variable("Outgoing", Kind::Array(2 * count, "BYTE")),
            variable("Number", Kind::Basic("UINT")),
            variable("Is_sending", Kind::Basic("BOOL")),
            variable("Sent_at", Kind::Basic("TIME")),
        ],
        lines,
    }
}
