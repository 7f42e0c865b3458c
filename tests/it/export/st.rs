//! The sources in Structured Text, run by our interpreter on the syntax tree of another project's parser.

use proptest::prelude::*;
use tickbus::driver_cfg::Config;
use tickbus::export::{Target, export};
use tickbus::signal::{Area, DataType, Signal};

use crate::export::machine::{Machine, Value, units};
use crate::export::plcopen;
use crate::export::tables;

/// Each signal of an area with its first byte in the record of all stations.
fn placed(config: &Config, area: Area) -> Vec<(usize, &Signal)> {
    let table = &config.table;
    let start = |station: usize| {
        table.stations[..station]
            .iter()
            .map(|s| s.bytes(area))
            .sum::<usize>()
    };
    let signals = table.signals.iter().filter(|signal| signal.area == area);
    let mut placed: Vec<_> = signals
        .map(|signal| (start(signal.station) + signal.byte, signal))
        .collect();
    placed.sort_by_key(|(byte, signal)| (*byte, signal.bit));
    placed
}

fn bytes(config: &Config, area: Area) -> usize {
    config
        .table
        .stations
        .iter()
        .map(|station| station.bytes(area))
        .sum()
}

/// The bytes of a signal's value, least significant first.
fn lies(byte: usize, signal: &Signal) -> impl Iterator<Item = usize> + use<'_> {
    let size = signal.data_type.size_bytes();
    (0..size).map(move |significance| byte + signal.order.byte_position(size, significance))
}

fn bits_of(record: &[u8], byte: usize, signal: &Signal) -> u64 {
    if signal.data_type == DataType::Bool {
        return u64::from(record[byte] >> signal.bit & 1);
    }
    let bytes = lies(byte, signal).enumerate();
    bytes
        .map(|(significance, at)| u64::from(record[at]) << (8 * significance))
        .sum()
}

/// The names in a list of declarations, in order: those of an area's signals.
fn names(declarations: &str, area: Area) -> Vec<String> {
    let of_area = declarations
        .lines()
        .filter(|line| line.contains(&format!("(* {area}")));
    of_area
        .map(|line| {
            line.trim()
                .split([' ', ':'])
                .next()
                .expect("a name")
                .to_owned()
        })
        .collect()
}

fn file(config: &Config, target: Target, ending: &str) -> String {
    let made = export(config, target).expect("sources");
    let file = made
        .files
        .into_iter()
        .find(|file| file.name.ends_with(ending));
    file.map(|file| file.text).unwrap_or_default()
}

/// Runs the statements of `unit` with registers called by `register` and variables called by `variable`:
/// inputs must have the record's values, and outputs must be at their places in the record.
fn assert_copied(
    config: &Config,
    record: &[u8],
    declarations: &str,
    [begin, end]: [(&str, &str); 2],
    functions: &str,
    variable: impl Fn(&str) -> String,
    register: impl Fn(Area, usize) -> String,
) {
    let functions = units(functions);
    for (area, (name, source)) in [(Area::Input, begin), (Area::Output, end)] {
        let signals = placed(config, area);
        let names = names(declarations, area);
        assert_eq!(names.len(), signals.len(), "{declarations}");
        let record = &record[..bytes(config, area)];
        let mut machine = Machine::with_functions(&functions);
        machine
            .variables
            .insert(variable("Simulated"), Value::Bool(true));
        for (number, pair) in record.chunks(2).enumerate() {
            let word = u64::from(pair[0]) << 8 | u64::from(pair.get(1).copied().unwrap_or(0));
            let word = if area == Area::Input { word } else { 0xDEAD };
            machine
                .variables
                .insert(register(area, number), Value::of_bits(DataType::Word, word));
        }
        for ((byte, signal), name) in signals.iter().zip(&names) {
            let bits = if area == Area::Input {
                0
            } else {
                bits_of(record, *byte, signal)
            };
            machine
                .variables
                .insert(variable(name), Value::of_bits(signal.data_type, bits));
        }
        for (name, kind) in [("bits_32", DataType::Dword), ("bits_64", DataType::Lword)] {
            machine
                .variables
                .insert(name.to_owned(), Value::of_bits(kind, 0));
        }
        let unit = units(source)
            .into_iter()
            .find(|unit| unit.name == name)
            .expect("the program");
        machine.run(&unit.body);
        let mut made = vec![0_u8; record.len()];
        for ((byte, signal), name) in signals.iter().zip(&names) {
            let expected = bits_of(record, *byte, signal);
            if area == Area::Input {
                let found = machine.variables[&variable(name)].bits();
                assert_eq!(
                    found,
                    expected,
                    "{} {}\n{source}",
                    signal.name,
                    signal.address()
                );
            } else if signal.data_type == DataType::Bool {
                made[*byte] |= u8::try_from(expected).unwrap() << signal.bit;
            } else {
                for at in lies(*byte, signal) {
                    made[at] = record[at];
                }
            }
        }
        if area == Area::Output {
            let used = signals.iter().flat_map(|(byte, signal)| {
                *byte / 2..=(byte + signal.data_type.size_bytes() - 1) / 2
            });
            for number in used {
                let expected = u64::from(made[2 * number]) << 8
                    | u64::from(made.get(2 * number + 1).copied().unwrap_or(0));
                let found = machine.variables[&register(area, number)].bits();
                assert_eq!(found, expected, "register {number}\n{source}");
            }
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, ..ProptestConfig::default() })]

    #[test]
    fn programs_for_codesys_and_twincat_copy_each_value_between_its_variable_and_its_registers(
        config in tables::any_table(),
        record in prop::collection::vec(any::<u8>(), 1300),
    ) {
        // The interpreter does not support pointers, so the functions are those using arithmetic.
        for target in [Target::Codesys, Target::TwinCat] {
            let (declarations, units) = plcopen::structured_text(&file(&config, target, ".xml"));
            // Calls of the editors' libraries precede the inputs and follow the outputs.
            let text = |name: &str| {
                let (_, text) = units.iter().find(|(unit, _)| unit == name).expect("the program");
                let (head, _) = text.split_once('\n').expect("a head");
                let (_, rest) = text.split_once("IF Cell_1_io.Simulated THEN\n").expect("its own part");
                let (body, _) = rest.split_once("ELSE\n    ; (* Not simulated").expect("the end of its part");
                let locals = "VAR\n    bits_32 : DWORD;\n    bits_64 : LWORD;\nEND_VAR";
                format!("{head}\n{locals}\nIF Cell_1_io.Simulated THEN\n{body}END_IF;\nEND_PROGRAM\n")
            };
            let calm = calmed(&config, record.clone());
            assert_copied(
                &config,
                &calm,
                &declarations,
                [("Cell_1_begin", &text("Cell_1_begin")), ("Cell_1_end", &text("Cell_1_end"))],
                &portable_functions(),
                |name| if name.starts_with("bits_") { name.to_owned() } else { format!("Cell_1_io.{name}") },
                |area, number| format!("Cell_1_io.{}[{number}]", if area == Area::Input { "In" } else { "Out" }),
            );
        }
    }

    /// REAL and its bits, by the arithmetic for compilers that cannot overlay memory: exact for all normal
    /// numbers.
    #[test]
    fn the_arithmetic_of_reals_gives_their_bits_and_back(bits in any::<u32>()) {
        let number = f32::from_bits(bits);
        prop_assume!(number.is_normal() && number.abs() <= 3.402_823e38);
        let functions = units(&portable_functions());
        let mut machine = Machine::with_functions(&functions);
        machine.variables.insert("bits".to_owned(), Value::of_bits(DataType::Dword, bits.into()));
        machine.variables.insert("number".to_owned(), Value::Real(0.0));
        let program = "PROGRAM p\nVAR\nx : INT;\nEND_VAR\nnumber := tickbus_real(bits);\nbits := tickbus_bits(number);\nEND_PROGRAM\n";
        machine.run(&units(program)[0].body);
        prop_assert_eq!(machine.variables["number"], Value::Real(number));
        prop_assert_eq!(machine.variables["bits"].bits(), u64::from(bits));
    }
}

/// The functions included in the export for `OpenPLC`.
fn portable_functions() -> String {
    let text = "[driver]\nid = 7\nname = \"Cell 1\"\n[fieldbus]\nkind = \"modbus-server\"\n\
                [[signal]]\nname = \"r\"\naddress = \"%QD0\"\ntype = \"REAL\"\n";
    let config = Config::parse("driver.cfg", text, &tickbus::KINDS)
        .unwrap_or_else(|mistakes| panic!("{mistakes}"));
    let source = file(&config, Target::OpenPlc, ".st");
    source
        .split("PROGRAM")
        .next()
        .expect("functions")
        .to_owned()
}

/// Replaces the REALs in a record by normal numbers, for which the arithmetic is meant.
fn calmed(config: &Config, mut record: Vec<u8>) -> Vec<u8> {
    for area in [Area::Input, Area::Output] {
        for (byte, signal) in placed(config, area) {
            if signal.data_type == DataType::Real {
                let top: Vec<usize> = lies(byte, signal).collect();
                // Exponents from 64 to 127, and some bits below.
                record[top[3]] = record[top[3]] & 0x9F | 0x20;
            }
        }
    }
    record
}

#[test]
fn the_program_for_openplc_copies_between_registers_and_variables() {
    let path = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/tests/export/right/modbus-server.cfg"
    );
    let config = Config::load(path.as_ref(), &tickbus::KINDS)
        .unwrap_or_else(|mistakes| panic!("{mistakes}"));
    let source = file(&config, Target::OpenPlc, ".st");
    let functions = portable_functions();
    let record: Vec<u8> = (0..40)
        .map(|byte: u8| byte.wrapping_mul(29).wrapping_add(64))
        .collect();
    let record = calmed(&config, record);
    // A single program does both: it copies inputs to local variables.
    let (begin, end) = source
        .split_once("(* Your program goes here")
        .expect("a place for the program");
    let begin = format!("{begin} END_PROGRAM\n");
    let head = begin.split("IF Simulated THEN").next().unwrap().to_owned();
    let end = format!("{head} (* {end}")
        .split("END_PROGRAM\n")
        .next()
        .unwrap()
        .to_owned()
        + "END_PROGRAM\n";
    assert_copied(
        &config,
        &record,
        &source,
        [("Drive_program", &begin), ("Drive_program", &end)],
        &functions,
        str::to_owned,
        |area, number| {
            format!(
                "{}_{number}",
                if area == Area::Input { "in" } else { "out" }
            )
        },
    );
}
