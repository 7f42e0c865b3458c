//! Programs for `OpenPLC`, compiled by its own compiler, `iec2c`, called as its runtime does.
#![allow(missing_docs, unreachable_pub, reason = "a test")]

use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::path::Path;
use std::process::Command;

use crate::harness::iec2c::Compiler;
use crate::harness::{Absent, Test};
use tickbus::driver_cfg::Config;
use tickbus::export::{Target, export};

pub(crate) const TESTS: &[(&str, Test)] = &[
    (
        "every_program_for_openplc_compiles",
        every_program_for_openplc_compiles,
    ),
    (
        "signals_may_be_called_as_anything_in_the_library_of_iec2c",
        signals_may_be_called_as_anything_in_the_library_of_iec2c,
    ),
    (
        "drivers_may_be_called_as_anything_in_the_library_of_iec2c",
        drivers_may_be_called_as_anything_in_the_library_of_iec2c,
    ),
    (
        "a_program_without_a_statement_is_refused",
        a_program_without_a_statement_is_refused,
    ),
    (
        "c_code_that_openplc_editor_appends_as_comments_is_left_out",
        c_code_that_openplc_editor_appends_as_comments_is_left_out,
    ),
];

/// Names from machines, and words that have a meaning in C, to `iec2c` or in the generated text.
const NAMES: &str = "\
    Config Config0 Res0 PLC plc Ramp PID Integral Derivative Hysteresis Run Cycle Auto Busy Error T TR SP ET CV PV Q Q1 IN \
    PT CU CD CLK R S S1 R1 Start Stop Reset Enable Alarm Fault Status Mode Speed Position Home Step Time Date Day Left \
    Right Mid Find Limit Max Min Sel Mux Move Mod Log Exp Sin Not Set Timer Counter Value Index Level Ready Done Open \
    Close Weekend_program End_function_done Simulated In Out in_0 out_0 bits_32 bits_64 bits number exponent size tickbus_real tickbus_bits every_scan \
    Task Program Resource Configuration Function Interval Priority Single OVERFLOW UNDERFLOW DOMAIN EOF NAN INFINITY \
    NULL M_PI M_E MAX_INPUT LINE_MAX BUFSIZ RAND_MAX INT_MAX SECONDS_PER_DAY errno int main double struct register volatile TIME_TO_OPEN INT_TO_REAL ADD_TIME \
    CTU_DINT ANY_STRING ANY_DERIVED ANY_ELEMENTARY ANY_MAGNITUDE REF_TO RTC SEMA data retain global located";

/// The `[fieldbus]` lines of each bus that has a program.
const BUSES: [&str; 4] = [
    "kind = \"loopback\"\nprogram = \"rig\"",
    "kind = \"socket\"\naddress = \"127.0.0.1:2000\"",
    "kind = \"modbus-server\"",
    "kind = \"modbus-client\"",
];

fn config(driver: &str, bus: &str, names: &[&str]) -> Config {
    let types = ["BOOL", "BYTE", "INT", "REAL", "LINT", "LREAL"];
    let mut text = format!("[driver]\nid = 1\nname = \"{driver}\"\n[fieldbus]\n{bus}\n");
    let mut bytes = [0_usize; 2];
    for (number, name) in names.iter().enumerate() {
        let (side, kind) = (number % 2, number / 2 % types.len());
        let (letter, size) = [("X", 1), ("B", 1), ("W", 2), ("D", 4), ("L", 8), ("L", 8)][kind];
        // One signal in three starts at an odd byte.
        let byte = if kind == 1 {
            bytes[side]
        } else {
            bytes[side].next_multiple_of(size) + number / 12 % 2
        };
        let bit = if kind == 0 { ".3" } else { "" };
        let area = ["I", "Q"][side];
        writeln!(
            text,
            "[[signal]]\nname = \"{name}\"\naddress = \"%{area}{letter}{byte}{bit}\"\ntype = \"{}\"",
            types[kind]
        )
        .expect("a String takes all");
        bytes[side] = byte + size;
    }
    Config::parse("driver.cfg", &text, &tickbus::KINDS)
        .unwrap_or_else(|mistakes| panic!("{mistakes}\n{text}"))
}

fn program(config: &Config) -> String {
    let made = export(config, Target::OpenPlc).unwrap_or_else(|mistakes| panic!("{mistakes}"));
    made.files.into_iter().next().expect("a program").text
}

/// Every word in the compiler's library: blocks and functions, their variables, types and keywords.
fn words(compiler: &Compiler) -> Vec<String> {
    let files = std::fs::read_dir(&compiler.library).expect("its folder");
    let mut words = BTreeSet::new();
    for file in files {
        let path = file.expect("an entry").path();
        if path.extension().is_some_and(|extension| extension == "txt") {
            let text = std::fs::read_to_string(&path).expect("a text");
            let own = text.split(|c: char| !c.is_ascii_alphanumeric() && c != '_');
            let own = own.filter(|word| word.starts_with(|c: char| c.is_ascii_alphabetic()));
            words.extend(own.map(str::to_ascii_uppercase));
        }
    }
    assert!(words.len() > 1000, "{} words", words.len());
    words.into_iter().collect()
}

/// Compiles a program as the runtime of `OpenPLC` v3 does, and the resulting C.
///
/// # Errors
///
/// The compilers' messages, or the file required by `OpenPLC` that is missing.
fn compile(compiler: &Compiler, text: &str) -> Result<(), String> {
    let folder = tempfile::tempdir().expect("a folder");
    let source = folder.path().join("program.st");
    std::fs::write(&source, text).expect("the file is written");
    let output = Command::new(&compiler.program)
        .args(["-f", "-l", "-p", "-r", "-R", "-a", "-I"])
        .arg(&compiler.library)
        .arg("-T")
        .arg(folder.path())
        .arg(&source)
        .output()
        .expect("iec2c runs");
    if !output.status.success() {
        let told = String::from_utf8_lossy(&output.stderr).into_owned();
        return Err(format!("iec2c: {}\n{told}", output.status));
    }
    // Files that OpenPLC's build moves and compiles by name.
    for name in [
        "POUS.c",
        "POUS.h",
        "LOCATED_VARIABLES.h",
        "VARIABLES.csv",
        "Config0.c",
        "Config0.h",
        "Res0.c",
    ] {
        if !folder.path().join(name).is_file() {
            return Err(format!("iec2c did not write {name}"));
        }
    }
    let output = Command::new("cc")
        .args(["-fsyntax-only", "-w", "-I"])
        .arg(compiler.library.join("C"))
        .args(["Config0.c", "Res0.c"])
        .current_dir(folder.path())
        .output()
        .expect("cc runs");
    if output.status.success() {
        Ok(())
    } else {
        Err(String::from_utf8_lossy(&output.stderr).into_owned())
    }
}

fn every_program_for_openplc_compiles() -> Result<(), Absent> {
    let compiler = Compiler::find()?;
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut files = vec![root.join("driver.cfg")];
    for folder in ["tests/export/right", "tests/right", "plc/peeler"] {
        let entries = std::fs::read_dir(root.join(folder)).expect("a folder");
        let paths = entries.map(|entry| entry.expect("an entry").path());
        files.extend(paths.filter(|path| path.extension() == Some("cfg".as_ref())));
    }
    let mut kinds = BTreeSet::new();
    for file in files {
        let config =
            Config::load(&file, &tickbus::KINDS).unwrap_or_else(|mistakes| panic!("{mistakes}"));
        if export(&config, Target::OpenPlc).is_err() {
            continue;
        }
        kinds.insert(config.bus.kind());
        compiles(&compiler, &config);
    }
    let kinds: Vec<&str> = kinds.into_iter().collect();
    assert_eq!(
        kinds,
        ["loopback", "modbus-client", "modbus-server", "socket"]
    );
    Ok(())
}

fn signals_may_be_called_as_anything_in_the_library_of_iec2c() -> Result<(), Absent> {
    let compiler = Compiler::find()?;
    let words = words(&compiler);
    let names: BTreeSet<&str> = NAMES
        .split(' ')
        .chain(words.iter().map(String::as_str))
        .collect();
    let names: Vec<&str> = names.into_iter().collect();
    // All words on the bus whose programs compile fastest, those in NAMES on each bus.
    for names in names.chunks(150) {
        compiles(&compiler, &config("Test rig", BUSES[2], names));
    }
    let names: Vec<&str> = NAMES.split(' ').collect();
    for bus in BUSES {
        compiles(&compiler, &config("Test rig", bus, &names));
    }
    Ok(())
}

fn compiles(compiler: &Compiler, config: &Config) {
    let text = program(config);
    let made = compile(compiler, &text);
    made.unwrap_or_else(|why| panic!("{} {}: {why}\n{text}", config.name, config.bus.kind()));
}

fn drivers_may_be_called_as_anything_in_the_library_of_iec2c() -> Result<(), Absent> {
    let compiler = Compiler::find()?;
    let words = words(&compiler);
    // The program is called PREFIX_program, its instance PREFIX_instance: no word may equal these.
    let alike = |word: &&String| word.ends_with("_PROGRAM") || word.ends_with("_INSTANCE");
    assert_eq!(words.iter().find(alike), None);
    for name in [
        "Run",
        "Cycle",
        "T",
        "TR",
        "PID",
        "plc",
        "config",
        "Config0",
        "Res0",
        "PROGRAM",
        "INT_TO_REAL",
        "every scan",
        "Week end",
    ] {
        // A signal with the driver's name, and two with the names of its program and instance.
        let signals = [
            name,
            &format!("{name} program"),
            &format!("{name} instance"),
        ];
        compiles(&compiler, &config(name, BUSES[2], &signals));
    }
    Ok(())
}

fn c_code_that_openplc_editor_appends_as_comments_is_left_out() -> Result<(), Absent> {
    let compiler = Compiler::find()?;
    let text = program(&config("Test rig", BUSES[0], &["Run"]));
    let appended =
        "(*DBG:#include \"POUS.h\"*)\r\n(*DBG:  return (void *)&RUN;*)\n(*FILE:LAMP (a *) b*)\n";
    let folder = tempfile::tempdir().expect("a folder");
    compiler.build(&format!("{text}\n{appended}"), folder.path());
    // Messages keep their lines.
    let wrong = folder.path().join("wrong.st");
    let before = format!("{text}\n{appended}");
    let line = before.lines().count() + 3;
    std::fs::write(
        &wrong,
        format!("{before}PROGRAM Press\nVAR Lamp : BOOL; END_VAR\nLamp := Nobody;\nEND_PROGRAM\n"),
    )
    .expect("the file is written");
    let output = Command::new(Path::new(env!("CARGO_MANIFEST_DIR")).join("plc/build"))
        .arg(&wrong)
        .env("IEC2C", &compiler.program)
        .env("IEC2C_LIB", &compiler.library)
        .output()
        .expect("plc/build runs");
    let told = String::from_utf8_lossy(&output.stderr);
    assert!(told.starts_with(&format!("wrong.st:{line}")), "{told}");
    Ok(())
}

fn a_program_without_a_statement_is_refused() -> Result<(), Absent> {
    let compiler = Compiler::find()?;
    let text = program(&config("Test rig", BUSES[0], &["Run"]));
    let broken = text.replace("  RETURN;\n", "  ;\n");
    assert_ne!(text, broken);
    let why = compile(&compiler, &broken).expect_err("a lone semicolon is no statement");
    assert!(why.contains("error"), "{why}");
    Ok(())
}
