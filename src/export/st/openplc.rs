//! One program for `OpenPLC`, or for whatever else compiles with `iec2c`.

use super::registers::kind;
use super::{add, comment, copies, records, remark, source, temporaries};
use crate::driver::Config;
use crate::export::record::{Record, block_prefix};
use crate::export::{Export, File};
use crate::signal::{Area, DataType};

/// Where `OpenPLC` puts the first register of its first slave device.
const SLAVE: usize = 100;

/// The numbers of a REAL out of its bits and back, in the arithmetic that IEC 61131-3 has: `iec2c` converts a DWORD to
/// the REAL of the same value, not of the same bits.
const FUNCTIONS: &str = "\
FUNCTION tickbus_real : REAL
  VAR_INPUT
    bits : DWORD;
  END_VAR
  VAR
    exponent : INT;
    number : REAL;
  END_VAR

  exponent := UINT_TO_INT(WORD_TO_UINT(DWORD_TO_WORD(SHR(bits, 23) AND DWORD#16#000000FF)));
  number := UDINT_TO_REAL(DWORD_TO_UDINT(bits AND DWORD#16#007FFFFF));
  IF exponent = 0 THEN
    number := 0.0; (* smaller than any number in full precision *)
  ELSIF exponent = 255 THEN
    number := 3.402823E38; (* no number *)
  ELSE
    number := number + 8388608.0;
    WHILE exponent > 150 DO
      number := number * 2.0;
      exponent := exponent - 1;
    END_WHILE;
    WHILE exponent < 150 DO
      number := number / 2.0;
      exponent := exponent + 1;
    END_WHILE;
  END_IF;
  IF (bits AND DWORD#16#80000000) <> DWORD#16#00000000 THEN
    number := 0.0 - number;
  END_IF;
  tickbus_real := number;
END_FUNCTION

FUNCTION tickbus_bits : DWORD
  VAR_INPUT
    number : REAL;
  END_VAR
  VAR
    exponent : UINT;
    bits : DWORD;
    size : REAL;
  END_VAR

  size := ABS(number);
  IF size > 3.402823E38 THEN
    size := 3.402823E38;
  END_IF;
  bits := DWORD#16#00000000;
  (* smaller ones, and what is no number, become zero *)
  IF size >= 1.1754944E-38 THEN
    exponent := 150;
    WHILE size >= 16777216.0 DO
      size := size / 2.0;
      exponent := exponent + 1;
    END_WHILE;
    WHILE size < 8388608.0 DO
      size := size * 2.0;
      exponent := exponent - 1;
    END_WHILE;
    bits := UDINT_TO_DWORD(REAL_TO_UDINT(size - 8388608.0));
    bits := bits OR SHL(WORD_TO_DWORD(UINT_TO_WORD(exponent)), 23);
  END_IF;
  IF number < 0.0 THEN
    bits := bits OR DWORD#16#80000000;
  END_IF;
  tickbus_bits := bits;
END_FUNCTION

";

/// The source for `config`.
pub(in crate::export) fn export(config: &Config) -> Export {
    let mut notes = Vec::new();
    let text = if config.bus.kind().starts_with("modbus") {
        polled(config)
    } else {
        hosted(config, &mut notes)
    };
    let name = format!("{}.st", block_prefix(&config.name));
    Export {
        files: vec![File { name, text }],
        notes,
    }
}

const EDITOR: &str = "OpenPLC, or another editor that compiles with iec2c";

const COMPILED: &str =
    "Read by the parser of another project in our tests, never compiled by iec2c.";

/// `OpenPLC` as a Modbus client of the simulation: registers of a slave device.
fn polled(config: &Config) -> String {
    let registers = |area| {
        let sizes = config
            .table
            .stations
            .iter()
            .map(|station| station.bytes(area));
        sizes.sum::<usize>().div_ceil(2)
    };
    let (incoming, outgoing) = (registers(Area::Input), registers(Area::Output));
    let own = (0..incoming).map(|register| format!("in_{register}"));
    let own = own.chain((0..outgoing).map(|register| format!("out_{register}")));
    let records = records(config, own);
    let [inputs, outputs] = &records;
    let mut text = source(
        config,
        "The PLC's half over Modbus TCP: OpenPLC polls the simulation.",
        EDITOR,
        COMPILED,
    );
    for line in [
        "In the web interface of the runtime, under Slave Devices, add a Generic Modbus TCP Device as the first one:".to_owned(),
        "address and port of the simulation, slave ID 1; nothing but input registers and holding registers (write):".to_owned(),
        format!("input registers: start 0, size {incoming}; they come to %IW{SLAVE} and on"),
        format!("holding registers, write: start 0, size {outgoing}; they go from %QW{SLAVE} and on"),
    ] {
        add(&mut text, &comment(&line));
    }
    add(&mut text, "");
    let reals = |record: &Record<'_>| {
        record
            .places
            .iter()
            .any(|place| place.data_type() == DataType::Real)
    };
    if reals(inputs) || reals(outputs) {
        text.push_str(FUNCTIONS);
    }
    let prefix = block_prefix(&config.name);
    add(&mut text, &format!("PROGRAM {prefix}"));
    if incoming + outgoing > 0 {
        add(&mut text, "  VAR");
        for register in 0..incoming {
            add(
                &mut text,
                &format!("    in_{register} AT %IW{} : WORD;", SLAVE + register),
            );
        }
        for register in 0..outgoing {
            add(
                &mut text,
                &format!("    out_{register} AT %QW{} : WORD;", SLAVE + register),
            );
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
            let remark = comment(&remark(place, std::ptr::eq(record, inputs)));
            add(
                &mut text,
                &format!("    {} : {}; {remark}", place.name, kind(place)),
            );
        }
        add(&mut text, "  END_VAR");
    }
    add(&mut text, "  VAR");
    add(
        &mut text,
        "    Simulated : BOOL := TRUE; (* FALSE: neither inputs nor outputs are copied *)",
    );
    for variable in temporaries(outputs) {
        add(&mut text, &format!("    {variable}"));
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
    add(
        &mut text,
        "  (* Your program goes here: it reads the inputs above and writes the outputs. *)",
    );
    add(&mut text, "");
    guarded(&mut text, &take);
    add(&mut text, "END_PROGRAM");
    configuration(&mut text, &prefix);
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

/// A program that tickbus itself hosts: located variables are the image.
fn hosted(config: &Config, notes: &mut Vec<String>) -> String {
    let records = records(config, []);
    let mut text = source(
        config,
        "The PLC's half for a program that tickbus hosts: docs/own-plc-program.md tells how.",
        EDITOR,
        COMPILED,
    );
    add(
        &mut text,
        &comment("Addresses count elements, as OpenPLC does: %QW1 is the second word."),
    );
    add(&mut text, "");
    let prefix = block_prefix(&config.name);
    add(&mut text, &format!("PROGRAM {prefix}"));
    let mut odd = 0;
    for (record, what) in records.iter().zip([
        "inputs: the simulation writes them",
        "outputs: the simulation reads them",
    ]) {
        if record.places.is_empty() {
            continue;
        }
        add(&mut text, &format!("  VAR {}", comment(what)));
        for place in &record.places {
            let (size, area) = (place.size(), place.signal.area);
            let remark = comment(&place.remark());
            let letter = place.data_type().width().letter();
            if place.data_type() == DataType::Bool {
                let (byte, bit) = (place.byte, place.bit());
                add(
                    &mut text,
                    &format!("    {} AT {area}X{byte}.{bit} : BOOL; {remark}", place.name),
                );
            } else if place.byte.is_multiple_of(size) {
                let element = place.byte / size;
                add(
                    &mut text,
                    &format!(
                        "    {} AT {area}{letter}{element} : {}; {remark}",
                        place.name,
                        place.data_type()
                    ),
                );
            } else {
                // Elements begin at multiples of their size alone: this one lies there in bytes.
                odd += 1;
                for number in 0..size {
                    let remark = if number == 0 { remark.as_str() } else { "" };
                    let line = format!(
                        "    {}_at{number} AT {area}B{} : BYTE; {remark}",
                        place.name,
                        place.byte + number
                    );
                    add(&mut text, line.trim_end());
                }
            }
        }
        add(&mut text, "  END_VAR");
    }
    if odd > 0 {
        notes.push(format!(
            "{odd} signals do not begin at a multiple of their size, where no element does: they are there as bytes"
        ));
    }
    add(&mut text, "");
    add(&mut text, "  (* Your program goes here. *)");
    add(&mut text, "  ;");
    add(&mut text, "END_PROGRAM");
    configuration(&mut text, &prefix);
    text
}

fn configuration(text: &mut String, prefix: &str) {
    for line in [
        "",
        "CONFIGURATION config",
        "  RESOURCE plc ON PLC",
        "    TASK every_scan(INTERVAL := T#10ms, PRIORITY := 0);",
        &format!("    PROGRAM {prefix}_instance WITH every_scan : {prefix};"),
        "  END_RESOURCE",
        "END_CONFIGURATION",
    ] {
        add(text, line);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_signal_that_is_called_as_a_register_gets_another_name() {
        let text = "[driver]\nname = \"rig\"\nid = 1\n[fieldbus]\nkind = \"modbus-server\"\n\
                    [[signal]]\nname = \"in 1\"\naddress = \"%IX0.0\"\n\
                    [[signal]]\nname = \"motor\"\naddress = \"%IW2\"\n\
                    [[signal]]\nname = \"OUT_0\"\naddress = \"%QW0\"\n";
        let config = Config::parse("driver.cfg", text).expect("it is right");
        let text = export(&config).files.remove(0).text.to_lowercase();
        for declared in ["in_0 at", "in_1 at", "in_1_2 : ", "out_0 at", "out_0_2 : "] {
            let count = text.matches(&format!("\n    {declared}")).count();
            assert_eq!(count, 1, "{declared}\n{text}");
        }
        for twice in ["in_1 : ", "out_0 : "] {
            assert!(!text.contains(&format!("\n    {twice}")), "{twice}\n{text}");
        }
    }
}
