//! What the texts for the buses are made of: they know nothing of one another.

use crate::plcopen::{Kind, Variable, variable};
use crate::st::life::{ALIVE, time};
use tickbus_base::time::Nanos;
use tickbus_fieldbus::tcp::{Address, Host};

/// Statements, and the variables that they need.
#[derive(Clone, Debug, Default)]
pub(super) struct Part {
    pub(super) locals: Vec<Variable>,
    pub(super) lines: Vec<String>,
}

/// How the registers come and go.
#[derive(Clone, Debug, Default)]
pub(super) struct Link {
    /// Global variables beside those of signals.
    pub(super) globals: Vec<Variable>,
    /// Before the inputs are copied.
    pub(super) before: Part,
    /// After the outputs are copied.
    pub(super) after: Part,
    /// What is to be set in the editor.
    pub(super) steps: Vec<String>,
    /// What a person should know.
    pub(super) notes: Vec<String>,
    /// The variables of signals come and go by themselves: there are no registers to copy from and to.
    pub(super) is_by_name: bool,
}

/// What the texts for records over TCP need to know.
#[derive(Clone, Debug)]
pub(super) struct Stream<'a> {
    /// The list of global variables.
    pub(super) list: &'a str,
    /// The simulation's host and port.
    pub(super) host: String,
    pub(super) port: u16,
    /// Bytes of a record from the simulation, and of one to it.
    pub(super) bytes: [usize; 2],
    pub(super) cycle: Nanos,
    pub(super) max_age: Nanos,
}

impl Link {
    /// Records over TCP: what is to be set up `first`, and what is to be known at `last`.
    pub(super) fn of_records(
        stream: &Stream<'_>,
        globals: impl IntoIterator<Item = Variable>,
        [before, after]: [Part; 2],
        first: &str,
        last: String,
    ) -> Self {
        let Stream {
            host,
            port,
            bytes: [received, sent],
            ..
        } = stream;
        let steps = [
            first.to_owned(),
            format!(
                "In the first program check the address of the simulation's computer, '{host}', port {port}; let its \
                 firewall pass the port. Records have {received} bytes from the simulation, {sent} bytes to it."
            ),
            last,
        ];
        Self {
            globals: Self::counters().into_iter().chain(globals).collect(),
            before,
            after,
            ..Self::of_steps(steps)
        }
    }

    pub(super) fn of_steps(steps: impl Into<Vec<String>>) -> Self {
        Self {
            steps: steps.into(),
            ..Self::default()
        }
    }

    /// The counters and the sign of life of a route that sees what comes and goes.
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

/// The simulation's host as the PLC dials it; one that listens everywhere does not say where it is.
pub(super) fn dialled(address: &Address) -> String {
    match &address.host {
        Host::Ip(ip) if !ip.is_unspecified() => ip.to_string(),
        Host::Ip(_) => "192.168.0.20".to_owned(),
        Host::Name(name) => name.clone(),
    }
}

/// What is to be known of an address that the PLC can reach only on the computer of the simulation itself.
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

/// What tells that nothing came for too long.
pub(super) fn silence(list: &str, max_age: Nanos) -> [String; 2] {
    [
        format!(
            "Silence(IN := {list}.Simulated AND NOT Is_new, PT := {});",
            time(max_age)
        ),
        format!("{list}.Alive := {list}.Simulated AND {list}.Received > 0 AND NOT Silence.Q;"),
    ]
}

/// Registers out of the bytes of a record, or back.
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

/// The variables of one who puts records together; `count` is the type of a number of bytes.
pub(super) fn incoming(stream: &Stream<'_>, count: &'static str) -> [Variable; 5] {
    let [bytes, _] = stream.bytes;
    [
        variable("Incoming", Kind::Array(2 * bytes.div_ceil(2), "BYTE")),
        variable("Filled", Kind::Basic(count)),
        variable("Number", Kind::Basic("UINT")),
        variable("Is_new", Kind::Basic("BOOL")),
        variable("Silence", Kind::Block("TON")),
    ]
}

/// What begins with the assembly of records.
pub(super) fn assembly(stream: &Stream<'_>) -> [String; 2] {
    let [bytes, _] = stream.bytes;
    [
        format!("(* A record is complete with {bytes} bytes, however TCP cuts the stream. *)"),
        "Is_new := FALSE;".to_owned(),
    ]
}

/// What takes a record that has come as a whole, so many spaces in.
pub(super) fn taken(stream: &Stream<'_>, indent: usize) -> Vec<String> {
    let Stream {
        list,
        bytes: [bytes, _],
        ..
    } = stream;
    let indent = " ".repeat(indent);
    let mut lines = vec![
        format!("{indent}IF Filled >= {bytes} THEN"),
        format!("{indent}    Filled := 0;"),
        format!("{indent}    Is_new := TRUE;"),
    ];
    let registers = registers(list, bytes.div_ceil(2), true);
    lines.extend(registers.map(|line| format!("{indent}    {line}")));
    lines.extend([
        format!("{indent}    {list}.Received := {list}.Received + 1;"),
        format!("{indent}END_IF;"),
    ]);
    lines
}

/// The variables of one who sends records by the block `block`.
pub(super) fn outgoing(stream: &Stream<'_>, block: Variable) -> Vec<Variable> {
    let [_, bytes] = stream.bytes;
    vec![
        block,
        variable("Outgoing", Kind::Array(2 * bytes.div_ceil(2), "BYTE")),
        variable("Number", Kind::Basic("UINT")),
        variable("Is_sending", Kind::Basic("BOOL")),
        variable("Sent_at", Kind::Basic("TIME")),
    ]
}

/// What begins to send a record when it is time, while the PLC is `connected`; the condition stays open.
pub(super) fn sending(stream: &Stream<'_>, connected: &str) -> Vec<String> {
    let Stream {
        list,
        bytes: [_, bytes],
        ..
    } = stream;
    let cycle = time(stream.cycle);
    let mut lines = vec![
        "(* A record goes out in each cycle; none is made up for. *)".to_owned(),
        format!("IF {connected} AND NOT Is_sending AND TIME() - Sent_at >= {cycle} THEN"),
        format!("    Sent_at := Sent_at + {cycle};"),
        format!("    IF TIME() - Sent_at >= {cycle} THEN Sent_at := TIME(); END_IF;"),
    ];
    let registers = registers(list, bytes.div_ceil(2), false);
    lines.extend(registers.map(|line| format!("    {line}")));
    lines
}
