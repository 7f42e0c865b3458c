//! Texts for CODESYS: a list of global variables, functions, and two programs.

use super::registers::kind;
use super::{add, comment, copies, records, remark, source, temporaries};
use crate::driver::Config;
use crate::export::record::{Place, Record, block_prefix};
use crate::export::{Export, File};
use crate::fieldbus::Options;
use crate::signal::DataType;

const EDITOR: &str = "CODESYS V3 and editors made from it";

const COMPILED: &str =
    "Read by the parser of another project in our tests, never compiled in CODESYS.";

/// A REAL and its bits share their memory.
const FUNCTIONS: &str = "\
TYPE tickbus_overlay :
UNION
    number : REAL;
    bits : DWORD;
END_UNION
END_TYPE

FUNCTION tickbus_real : REAL
VAR_INPUT
    bits : DWORD;
END_VAR
VAR
    overlay : tickbus_overlay;
END_VAR
overlay.bits := bits;
tickbus_real := overlay.number;
END_FUNCTION

FUNCTION tickbus_bits : DWORD
VAR_INPUT
    number : REAL;
END_VAR
VAR
    overlay : tickbus_overlay;
END_VAR
overlay.number := number;
tickbus_bits := overlay.bits;
END_FUNCTION
";

/// The texts for `config`.
pub(in crate::export) fn export(config: &Config) -> Export {
    let prefix = block_prefix(&config.name);
    let records = records(config, []);
    let list = format!("{prefix}_io");
    let file = |name: String, text: String| File {
        name: format!("{name}.st"),
        text,
    };
    let mut files = vec![file(list.clone(), globals(config, &list, &records))];
    let is_real = |place: &Place<'_>| place.data_type() == DataType::Real;
    if records
        .iter()
        .any(|record| record.places.iter().any(is_real))
    {
        let mut text = source(
            config,
            "A REAL out of its bits, and back.",
            EDITOR,
            COMPILED,
        );
        text.push_str(FUNCTIONS);
        files.push(file(format!("{prefix}_functions"), text));
    }
    let [bring, take] = copies(
        &records,
        &|name| format!("{list}.{name}"),
        &|register| format!("{list}.In[{register}]"),
        &|register| format!("{list}.Out[{register}]"),
    );
    let name = format!("{prefix}_begin");
    let mut text = source(
        config,
        "The first program of the task: the simulated inputs come into their variables.",
        EDITOR,
        COMPILED,
    );
    let other = "Not simulated: copy the real inputs into the same variables here.";
    program(&mut text, &name, &list, &[], &bring, other);
    files.push(file(name, text));

    let name = format!("{prefix}_end");
    let mut text = source(
        config,
        "The last program of the task: the outputs go to the simulation.",
        EDITOR,
        COMPILED,
    );
    let other = "Not simulated: copy the variables to the real outputs here. While simulated they stay as they are.";
    program(
        &mut text,
        &name,
        &list,
        &temporaries(&records[1]),
        &take,
        other,
    );
    files.push(file(name, text));
    Export {
        files,
        notes: Vec::new(),
    }
}

fn globals(config: &Config, list: &str, records: &[Record<'_>; 2]) -> String {
    let [inputs, outputs] = records;
    let (incoming, outgoing) = (inputs.bytes.div_ceil(2), outputs.bytes.div_ceil(2));
    let what = format!("Global variable list {list}: one variable for each signal.");
    let mut text = source(config, &what, EDITOR, COMPILED);
    for line in how(&config.bus, list, incoming, outgoing) {
        add(&mut text, &comment(&line));
    }
    add(&mut text, "");
    add(&mut text, "{attribute 'qualified_only'}");
    add(&mut text, "VAR_GLOBAL");
    add(
        &mut text,
        "    Simulated : BOOL; (* TRUE: the simulation stands in for the machine *)",
    );
    for (name, registers, what) in [("In", incoming, "from"), ("Out", outgoing, "to")] {
        if registers > 0 {
            let remark = format!(
                "registers {what} the simulation: n holds bytes 2n and 2n + 1 of the record, the first one is the high byte"
            );
            let last = registers - 1;
            add(
                &mut text,
                &format!(
                    "    {name} : ARRAY[0..{last}] OF WORD; {}",
                    comment(&remark)
                ),
            );
        }
    }
    for (record, input) in [(inputs, true), (outputs, false)] {
        for place in &record.places {
            let remark = comment(&remark(place, input));
            add(
                &mut text,
                &format!("    {} : {}; {remark}", place.name, kind(place)),
            );
        }
    }
    add(&mut text, "END_VAR");
    text
}

/// One program: what it does while the simulation stands in, and where the user's own goes.
fn program(
    text: &mut String,
    name: &str,
    list: &str,
    variables: &[&str],
    lines: &[String],
    other: &str,
) {
    add(text, &format!("PROGRAM {name}"));
    if !variables.is_empty() {
        add(text, "VAR");
        for variable in variables {
            add(text, &format!("    {variable}"));
        }
        add(text, "END_VAR");
    }
    add(text, &format!("IF {list}.Simulated THEN"));
    for line in lines {
        add(text, &format!("    {line}"));
    }
    if lines.is_empty() {
        add(text, "    ;");
    }
    add(text, "ELSE");
    add(text, &format!("    ; {}", comment(other)));
    add(text, "END_IF;");
    add(text, "END_PROGRAM");
}

/// How the registers come and go, bus by bus.
fn how(bus: &Options, list: &str, incoming: usize, outgoing: usize) -> Vec<String> {
    let mut lines = vec![
        "Add each text by hand: a global variable list, a data type, functions and programs of these names, the texts pasted \
         into them."
            .to_owned(),
    ];
    match bus.kind() {
        "modbus-server" => lines.extend([
            "Device tree: Ethernet > Modbus TCP Client > Modbus TCP Server with address and port of the simulation, unit 1.".to_owned(),
            format!("Channel 1: function code 4, offset 0, length {incoming}; map it to {list}.In."),
            format!("Channel 2: function code 16, offset 0, length {outgoing}; map it to {list}.Out."),
            "A channel has at most 125 registers to read and 123 to write: use several, and map their elements.".to_owned(),
        ]),
        "opcua-client" | "opcua-server" => lines.push(
            "OPC UA carries the variables themselves: share this list in the symbol configuration; the registers In and \
             Out, and the programs, are not needed."
                .to_owned(),
        ),
        "socket" => lines.push(format!(
            "Records over TCP need a library of the PLC's maker: receive {} bytes and put bytes 2n and 2n + 1 into {list}.In[n], \
             high byte first; send {} bytes from {list}.Out likewise.",
            2 * incoming,
            2 * outgoing
        )),
        kind => lines.push(format!(
            "The bus \"{kind}\" has no block of its own for CODESYS: what brings {list}.In and takes {list}.Out is to be \
             written by hand."
        )),
    }
    lines
}
