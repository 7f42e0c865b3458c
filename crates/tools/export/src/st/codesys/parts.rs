//! The parts of the texts for the buses. The texts are independent of one another.

use crate::plcopen::{Kind, Variable, variable};
use crate::st::life::{ALIVE, time};
use tickbus_base::time::Nanos;
use tickbus_net::{Address, Host};

/// Statements, and the variables that they need.
#[derive(Clone, Debug, Default)]
pub(super) struct Part {
    pub(super) locals: Vec<Variable>,
    pub(super) lines: Vec<String>,
}

/// How the registers are received and sent.
#[derive(Clone, Debug, Default)]
pub(super) struct Link {
    /// Global variables beside those of signals.
    pub(super) globals: Vec<Variable>,
    /// The part before the inputs are copied.
    pub(super) before: Part,
    /// The part after the outputs are copied.
    pub(super) after: Part,
    /// The settings to be made in the editor.
    pub(super) steps: Vec<String>,
    /// Notes for the user.
    pub(super) notes: Vec<String>,
    /// True if the bus reads and writes the variables of signals directly: no registers are copied.
    pub(super) is_by_name: bool,
}

/// The data for the texts about records over TCP.
#[derive(Clone, Debug)]
pub(super) struct Stream<'a> {
    /// The list of global variables.
    pub(super) list: &'a str,
    /// The simulation's host and port.
    pub(super) host: String,
    pub(super) port: u16,
    /// The size in bytes of a record from the simulation, and of a record to the simulation.
    pub(super) bytes: [usize; 2],
    pub(super) cycle: Nanos,
    pub(super) max_age: Nanos,
}

/// The library calls of an editor for records over TCP.
#[derive(Debug)]
pub(super) struct Calls<'a> {
    /// The set-up that comes first, and the note for the user that comes last.
    pub(super) steps: [&'a str; 2],
    /// Global variables of the connection.
    pub(super) globals: Vec<Variable>,
    /// The global variable that is TRUE while connected.
    pub(super) connected: &'a str,
    /// Makes the connection, and reconnects when it is lost.
    pub(super) connection: Part,
    /// The variables of the receiving block, and the type in which that block counts bytes.
    pub(super) receiver: Vec<Variable>,
    pub(super) count: &'static str,
    /// Receives bytes to `Incoming`: the statements before and after a complete record is taken.
    pub(super) receive: [&'a [&'a str]; 2],
    /// The indentation of the statements that take a record.
    pub(super) indent: usize,
    /// The sending block.
    pub(super) sender: Variable,
    /// Sends `Outgoing`: the statements before and after a record is made, which leaves an `IF` open.
    pub(super) send: [&'a [&'a str]; 2],
}

impl Link {
    /// Records over TCP.
    pub(super) fn of_records(stream: &Stream<'_>, calls: &Calls<'_>) -> Self {
        let Stream {
            host,
            port,
            bytes: [received, sent],
            ..
        } = stream;
        let [first, last] = calls.steps;
        let steps = [
            first.to_owned(),
            format!(
                "In the first program check the address of the simulation's computer, '{host}', port {port}; let its \
                 firewall pass the port. Records have {received} bytes from the simulation, {sent} bytes to it."
            ),
            last.to_owned(),
        ];
        let mut globals = Self::counters();
        globals.extend_from_slice(&calls.globals);
        Self {
            globals,
            before: receiving(stream, calls),
            after: sending(stream, calls),
            ..Self::of_steps(steps)
        }
    }

    pub(super) fn of_steps(steps: impl Into<Vec<String>>) -> Self {
        Self {
            steps: steps.into(),
            ..Self::default()
        }
    }

    /// The counters and the sign of life of a link that sees its traffic.
    fn counters() -> Vec<Variable> {
        [
            (ALIVE, "BOOL", "the simulation was heard of lately"),
            ("Received", "UDINT", "images that came"),
            ("Sent", "UDINT", "images that went"),
            (
                "Errors",
                "UDINT",
                "requests that failed, and connections that were lost",
            ),
        ]
        .map(|(name, kind, comment)| Variable {
            comment: comment.to_owned(),
            ..variable(name, Kind::Basic(kind))
        })
        .into()
    }
}

/// The simulation's host as the PLC dials it. If the simulation listens on all addresses, its own address is unknown.
pub(super) fn dialled(address: &Address) -> String {
    match &address.host {
        Host::Ip(ip) if !ip.is_unspecified() => ip.to_string(),
        Host::Ip(_) => "192.168.0.20".to_owned(),
        Host::Name(name) => name.clone(),
    }
}

/// The note about an address that the PLC can reach only on the simulation's own computer.
pub(super) fn loopback_note(address: &Address) -> Option<String> {
    let is_loopback = match &address.host {
        Host::Ip(ip) => ip.is_loopback(),
        Host::Name(name) => name.eq_ignore_ascii_case("localhost"),
    };
    is_loopback.then(|| {
        format!(
            "the address {address} is reached from the simulation's computer alone: a PLC elsewhere needs that computer's own, \
             in driver.cfg and here"
        )
    })
}

/// The statements that detect a silence that is too long.
pub(super) fn silence(list: &str, max_age: Nanos) -> [String; 2] {
    [
        format!(
            "Silence(IN := {list}.Simulated AND NOT Is_new, PT := {});",
            time(max_age)
        ),
        format!("{list}.Alive := {list}.Simulated AND {list}.Received > 0 AND NOT Silence.Q;"),
    ]
}

/// Converts the bytes of a record to registers, or back.
fn registers(list: &str, count: usize, incoming: bool) -> [String; 3] {
    let last = count.saturating_sub(1);
    let body = if incoming {
        format!(
            "    {list}.In[Number] := SHL(BYTE_TO_WORD(Incoming[2 * Number]), 8) OR BYTE_TO_WORD(Incoming[2 * Number + 1]);"
        )
    } else {
        format!(
            "    Outgoing[2 * Number] := WORD_TO_BYTE(SHR({list}.Out[Number], 8)); Outgoing[2 * Number + 1] := \
             WORD_TO_BYTE({list}.Out[Number] AND WORD#16#00FF);"
        )
    };
    [
        format!("FOR Number := 0 TO {last} DO"),
        body,
        "END_FOR;".to_owned(),
    ]
}

/// Makes the connection, and assembles records from the received bytes.
fn receiving(stream: &Stream<'_>, calls: &Calls<'_>) -> Part {
    let Stream {
        list,
        bytes: [bytes, _],
        ..
    } = stream;
    let Part {
        mut locals,
        mut lines,
    } = calls.connection.clone();
    if *bytes == 0 {
        lines.push(format!("{list}.Alive := {list}.{};", calls.connected));
        return Part { locals, lines };
    }
    locals.extend_from_slice(&calls.receiver);
    locals.extend([
        variable("Incoming", Kind::Array(2 * bytes.div_ceil(2), "BYTE")),
        variable("Filled", Kind::Basic(calls.count)),
        variable("Number", Kind::Basic("UINT")),
        variable("Is_new", Kind::Basic("BOOL")),
        variable("Silence", Kind::Block("TON")),
    ]);
    let [before, after] = calls.receive;
    lines.extend([
        format!("(* A record is complete with {bytes} bytes, however TCP cuts the stream. *)"),
        "Is_new := FALSE;".to_owned(),
    ]);
    lines.extend(owned(before));
    let indent = " ".repeat(calls.indent);
    lines.extend([
        format!("{indent}IF Filled >= {bytes} THEN"),
        format!("{indent}    Filled := 0;"),
        format!("{indent}    Is_new := TRUE;"),
    ]);
    let registers = registers(list, bytes.div_ceil(2), true);
    lines.extend(registers.map(|line| format!("{indent}    {line}")));
    lines.extend([
        format!("{indent}    {list}.Received := {list}.Received + 1;"),
        format!("{indent}END_IF;"),
    ]);
    lines.extend(owned(after));
    lines.extend(silence(list, stream.max_age));
    Part { locals, lines }
}

/// Makes and sends a record when it is due.
fn sending(stream: &Stream<'_>, calls: &Calls<'_>) -> Part {
    let Stream {
        list,
        bytes: [_, bytes],
        ..
    } = stream;
    if *bytes == 0 {
        return Part::default();
    }
    let cycle = time(stream.cycle);
    let [before, after] = calls.send;
    let mut lines = owned(before);
    lines.extend([
        "(* A record goes out in each cycle; none is made up for. *)".to_owned(),
        format!(
            "IF {list}.{} AND NOT Is_sending AND TIME() - Sent_at >= {cycle} THEN",
            calls.connected
        ),
        format!("    Sent_at := Sent_at + {cycle};"),
        format!("    IF TIME() - Sent_at >= {cycle} THEN Sent_at := TIME(); END_IF;"),
    ]);
    let registers = registers(list, bytes.div_ceil(2), false);
    lines.extend(registers.map(|line| format!("    {line}")));
    lines.extend(owned(after));
    let locals = vec![
        calls.sender.clone(),
        variable("Outgoing", Kind::Array(2 * bytes.div_ceil(2), "BYTE")),
        variable("Number", Kind::Basic("UINT")),
        variable("Is_sending", Kind::Basic("BOOL")),
        variable("Sent_at", Kind::Basic("TIME")),
    ];
    Part { locals, lines }
}

fn owned(lines: &[&str]) -> Vec<String> {
    lines.iter().map(|&line| line.to_owned()).collect()
}
