//! A program whose images are 16-bit registers of `OpenPLC`'s runtime.

use super::real::FUNCTIONS;
use super::{COMPILED, EDITOR, configuration, declared, program, remarks};
use crate::record::Record;
use crate::st::life::{self, ALIVE, Life};
use crate::st::registers::kind;
use crate::st::{add, comment, copies, records, remark, source, taken, temporaries};
use tickbus_driver_cfg::Config;
use tickbus_image::signal::DataType;

/// The addresses of both images' registers, and how they are transferred.
pub(super) struct Wires {
    /// The program's description, for its head.
    pub(super) what: &'static str,
    /// The settings to be made in the runtime, line by line.
    pub(super) steps: Vec<String>,
    /// The addresses of the registers of both images, inputs first.
    pub(super) addresses: [Vec<String>; 2],
}

/// The names of registers, inputs first.
const CALLED: [&str; 2] = ["in", "out"];

pub(super) fn text(config: &Config, wires: &Wires) -> String {
    let registers: Vec<(String, &String)> = wires
        .addresses
        .iter()
        .zip(CALLED)
        .flat_map(|(addresses, called)| {
            let numbered = addresses.iter().enumerate();
            numbered.map(move |(number, address)| (format!("{called}_{number}"), address))
        })
        .collect();
    let own = registers.iter().map(|(name, _)| name.clone());
    let mut names = taken(declared(config).chain(life::declared(config)).chain(own));
    let records = records(config, 2, &mut names);
    let [inputs, outputs] = &records;
    let mut text = source(config, 2, wires.what, EDITOR, COMPILED);
    remarks(&mut text, &wires.steps);
    let is_real = |record: &&Record<'_>| {
        let mut places = record.places.iter();
        places.any(|place| place.data_type() == DataType::Real)
    };
    if records.iter().any(|record| is_real(&record)) {
        text.push_str(FUNCTIONS);
    }
    let [name, _] = program(config);
    add(&mut text, &format!("PROGRAM {name}"));
    if !registers.is_empty() {
        add(&mut text, "  VAR");
        for (name, address) in &registers {
            add(&mut text, &format!("    {name} AT {address} : WORD;"));
        }
        add(&mut text, "  END_VAR");
    }
    for (record, what) in [
        (inputs, "inputs: the simulation writes them"),
        (outputs, "outputs: the simulation reads them"),
    ] {
        if record.places.is_empty() {
            continue;
        }
        add(&mut text, &format!("  VAR {}", comment(what)));
        for place in &record.places {
            let remark = comment(&remark(place));
            let (name, kind) = (&place.name, kind(place));
            add(&mut text, &format!("    {name} : {kind}; {remark}"));
        }
        add(&mut text, "  END_VAR");
    }
    add(&mut text, "  VAR");
    add(
        &mut text,
        "    Simulated : BOOL := TRUE; (* FALSE: neither inputs nor outputs are copied *)",
    );
    let life = Life::of(
        config,
        &records,
        &kind,
        &str::to_owned,
        [ALIVE, "Simulated"],
        false,
    );
    if life.is_beating() {
        add(
            &mut text,
            &format!("    {ALIVE} : BOOL; (* the heartbeat of the simulation was seen lately *)"),
        );
    }
    let own = life
        .locals
        .iter()
        .map(|(name, kind)| (name.as_str(), *kind));
    for (name, kind) in temporaries(outputs).into_iter().chain(own) {
        add(&mut text, &format!("    {name} : {kind};"));
    }
    add(&mut text, "  END_VAR");
    add(&mut text, "");
    let [bring, take] = copies(
        &records,
        &str::to_owned,
        &|register| format!("in_{register}"),
        &|register| format!("out_{register}"),
    );
    guarded(&mut text, &bring);
    for line in &life.before {
        add(&mut text, &format!("  {line}"));
    }
    add(
        &mut text,
        "  (* Your program goes here: it reads the inputs above and writes the outputs. *)",
    );
    add(&mut text, "");
    for line in &life.after {
        add(&mut text, &format!("  {line}"));
    }
    guarded(&mut text, &take);
    if bring.is_empty() && take.is_empty() {
        // iec2c does not accept a program without statements.
        add(&mut text, "  RETURN;");
    }
    add(&mut text, "END_PROGRAM");
    configuration(&mut text, config);
    text
}

fn guarded(text: &mut String, lines: &[String]) {
    if lines.is_empty() {
        return;
    }
    add(text, "  IF Simulated THEN");
    for line in lines {
        add(text, &format!("    {line}"));
    }
    add(text, "  END_IF;");
    add(text, "");
}
