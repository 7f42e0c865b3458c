//! Records over TCP in TwinCAT, by the library `Tc2_TcpIp` of TF6310.

use super::parts::{Link, Part, Stream, assembly, incoming, outgoing, sending, silence, taken};
use crate::plcopen::{Kind, variable};

pub(super) fn link(stream: &Stream<'_>) -> Link {
    let globals = [
        variable("Is_connected", Kind::Basic("BOOL")),
        variable("Is_lost", Kind::Basic("BOOL")),
        variable("Socket", Kind::Block("T_HSOCKET")),
    ];
    let last = "Each call of TF6310 is answered by a service of Windows or TwinCAT/BSD after some cycles of the task: expect \
                tens of milliseconds.";
    Link::of_records(
        stream,
        globals,
        [before(stream), after(stream)],
        "Install TF6310 (TCP/IP) with its licence on the target; References > Add library: Tc2_TcpIp.",
        last.to_owned(),
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
    ]);
    part.locals.extend(incoming(stream, "UDINT"));
    let mut lines = assembly(stream).to_vec();
    lines.extend([
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
    ]);
    lines.extend(taken(stream, 8));
    lines.extend([
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
    ];
    lines.extend(sending(stream, &format!("{list}.Is_connected")));
    lines.extend([
        format!(
            "    Send(sSrvNetId := '', hSocket := {list}.Socket, cbLen := {bytes}, pSrc := ADR(Outgoing), bExecute := TRUE, tTimeout := T#5S);"
        ),
        "    Is_sending := TRUE;".to_owned(),
        "END_IF;".to_owned(),
    ]);
    Part {
        locals: outgoing(stream, variable("Send", Kind::Block("FB_SocketSend"))),
        lines,
    }
}
