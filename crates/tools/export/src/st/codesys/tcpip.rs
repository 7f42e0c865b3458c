//! Records over TCP in TwinCAT, using the library `Tc2_TcpIp` of TF6310.

use super::parts::{Calls, Link, Part, Stream};
use crate::plcopen::{Kind, variable};

pub(super) fn link(stream: &Stream<'_>) -> Link {
    let Stream {
        list,
        bytes: [received, sent],
        ..
    } = stream;
    let received_some = [
        "IF Is_receiving THEN",
        "    Receive(bExecute := TRUE);",
        "    IF NOT Receive.bBusy THEN",
        "        Is_receiving := FALSE;",
        "        Receive(bExecute := FALSE);",
        "        IF Receive.bError THEN",
        &format!("            {list}.Errors := {list}.Errors + 1;"),
        &format!("            {list}.Is_lost := TRUE;"),
        "        ELSE",
        "            Filled := Filled + Receive.nRecBytes;",
        "        END_IF;",
    ];
    let receive = [
        "    END_IF;",
        "END_IF;",
        &format!("IF NOT {list}.Is_connected THEN"),
        "    Filled := 0;",
        "ELSIF NOT Is_receiving THEN",
        &format!(
            "    Receive(sSrvNetId := '', hSocket := {list}.Socket, cbLen := {received} - Filled, pDest := ADR(Incoming[Filled]), bExecute := TRUE, tTimeout := T#5S);"
        ),
        "    Is_receiving := TRUE;",
        "END_IF;",
    ];
    let sent_all = [
        "IF Is_sending THEN",
        "    Send(bExecute := TRUE);",
        "    IF NOT Send.bBusy THEN",
        "        Is_sending := FALSE;",
        "        Send(bExecute := FALSE);",
        "        IF Send.bError THEN",
        &format!("            {list}.Errors := {list}.Errors + 1;"),
        &format!("            {list}.Is_lost := TRUE;"),
        "        ELSE",
        &format!("            {list}.Sent := {list}.Sent + 1;"),
        "        END_IF;",
        "    END_IF;",
        "END_IF;",
    ];
    let send: [&str; 3] = [
        &format!(
            "    Send(sSrvNetId := '', hSocket := {list}.Socket, cbLen := {sent}, pSrc := ADR(Outgoing), bExecute := TRUE, tTimeout := T#5S);"
        ),
        "    Is_sending := TRUE;",
        "END_IF;",
    ];
    let calls = Calls {
        steps: [
            "Install TF6310 (TCP/IP) with its licence on the target; References > Add library: Tc2_TcpIp.",
            "Each call of TF6310 is answered by a service of Windows or TwinCAT/BSD after some cycles of the task: expect \
             tens of milliseconds.",
        ],
        globals: vec![
            variable("Is_connected", Kind::Basic("BOOL")),
            variable("Is_lost", Kind::Basic("BOOL")),
            variable("Socket", Kind::Block("T_HSOCKET")),
        ],
        connected: "Is_connected",
        connection: connection(stream),
        receiver: vec![
            variable("Receive", Kind::Block("FB_SocketReceive")),
            variable("Is_receiving", Kind::Basic("BOOL")),
        ],
        count: "UDINT",
        receive: [&received_some, &receive],
        indent: 8,
        sender: variable("Send", Kind::Block("FB_SocketSend")),
        send: [&sent_all, &send],
    };
    Link::of_records(stream, &calls)
}

/// Connects, and dials again after a second when the connection is lost.
fn connection(stream: &Stream<'_>) -> Part {
    let Stream {
        list, host, port, ..
    } = stream;
    let lines = [
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
        &format!(
            "    Close(sSrvNetId := '', hSocket := {list}.Socket, bExecute := TRUE, tTimeout := T#5S);"
        ),
        "    IF NOT Close.bBusy THEN",
        "        Close(bExecute := FALSE);",
        "        State := 4;",
        "    END_IF;",
        "4: IF Pause.Q THEN State := 0; END_IF;",
        "END_CASE;",
        "Pause(IN := State = 4, PT := T#1S);",
    ];
    Part {
        locals: vec![
            variable("State", Kind::Basic("UINT")),
            variable("Connect", Kind::Block("FB_SocketConnect")),
            variable("Close", Kind::Block("FB_SocketClose")),
            variable("Pause", Kind::Block("TON")),
        ],
        lines: lines.map(str::to_owned).into(),
    }
}
