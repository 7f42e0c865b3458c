//! Programs on virtual time, compiled by `iec2c` and hosted: the blocks of plc/iec61131, and the output of `tickbus
//! sync prepare`.
#![allow(missing_docs, unreachable_pub, reason = "a test")]

mod actions;
mod diagrams;
mod project;
mod stepped;

use std::path::Path;
use std::process::Command;

use crate::harness::iec2c::Compiler;
use crate::harness::{Absent, Test};
use actions::D;
use stepped::{Random, Stepped};
use tickbus::plc::blocks::{Rtc, Tof, Ton, Tp};
use tickbus::prepare::{Addresses, Settings, Source, prepare, undo};
use tickbus::time::Nanos;

pub(crate) const TESTS: &[(&str, Test)] = &[
    (
        "timers_follow_the_golden_rows",
        timers_follow_the_golden_rows,
    ),
    (
        "timers_are_those_of_the_built_in_programs",
        timers_are_those_of_the_built_in_programs,
    ),
    (
        "actions_follow_the_golden_rows",
        actions::actions_follow_the_golden_rows,
    ),
    (
        "actions_are_those_of_the_built_in_programs",
        actions::actions_are_those_of_the_built_in_programs,
    ),
    (
        "time_stands_still_between_steps",
        time_stands_still_between_steps,
    ),
    (
        "a_prepared_program_is_the_one_synchronised_by_hand",
        a_prepared_program_is_the_one_synchronised_by_hand,
    ),
    (
        "a_prepared_program_does_what_the_original_does",
        a_prepared_program_does_what_the_original_does,
    ),
    (
        "a_prepared_project_in_xml_does_what_the_original_does",
        a_prepared_project_in_xml_does_what_the_original_does,
    ),
    (
        "diagrams_do_what_they_show",
        diagrams::diagrams_do_what_they_show,
    ),
    (
        "prepared_diagrams_do_what_the_originals_do",
        diagrams::prepared_diagrams_do_what_the_originals_do,
    ),
    ("the_blocks_in_xml_compile", the_blocks_in_xml_compile),
    (
        "a_plc_makes_no_step_at_0_nor_out_of_turn_nor_while_the_copies_of_go_differ",
        a_plc_makes_no_step_at_0_nor_out_of_turn_nor_while_the_copies_of_go_differ,
    ),
    (
        "the_clock_of_oscat_is_virtual_time",
        the_clock_of_oscat_is_virtual_time,
    ),
    (
        "the_example_counts_virtual_time",
        the_example_counts_virtual_time,
    ),
    (
        "prepared_programs_of_the_exporter_compile",
        prepared_programs_of_the_exporter_compile,
    ),
    (
        "the_rig_prepared_does_what_the_original_does",
        the_rig_prepared_does_what_the_original_does,
    ),
    (
        "the_command_writes_beside_its_sources_and_never_over_them",
        || {
            the_command_writes_beside_its_sources_and_never_over_them();
            Ok(())
        },
    ),
    ("the_command_tells_what_is_wrong_and_writes_nothing", || {
        the_command_tells_what_is_wrong_and_writes_nothing();
        Ok(())
    }),
    ("the_command_writes_all_files_or_none", || {
        the_command_writes_all_files_or_none();
        Ok(())
    }),
    (
        "prepared_programs_with_our_names_in_other_places_compile",
        prepared_programs_with_our_names_in_other_places_compile,
    ),
    (
        "without_a_simulation_a_prepared_program_runs_on_the_plcs_time",
        without_a_simulation_a_prepared_program_runs_on_the_plcs_time,
    ),
];

fn text(path: &str) -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(path);
    std::fs::read_to_string(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

/// The blocks, followed by a program that uses them.
fn with_blocks(program: &str) -> String {
    let blocks = tickbus::prepare::SOURCES.map(|(_, text)| text);
    blocks.join("\n") + "\n" + program
}

fn bench() -> Result<Stepped, Absent> {
    let compiler = Compiler::find()?;
    Ok(Stepped::load(
        &compiler,
        &with_blocks(&text("tests/prepare/bench.st")),
    ))
}

/// The answer of bench.st to its inputs in the step at `ms`.
#[derive(Debug, PartialEq, Eq)]
struct Answer {
    bits: u8,
    et: [u32; 3],
    date: u64,
}

// Bits of the byte with the answers of bench.st.
const TON: u8 = 1;
const TOF: u8 = 2;
const TP: u8 = 4;
const RTC: u8 = 8;
const ACTION: u8 = 16;
const RAN: u8 = 32;
const CONFLICT: u8 = 64;

fn ask(
    bench: &mut Stepped,
    ms: u32,
    input: bool,
    final_scan: bool,
    preset: u16,
    on: u16,
) -> Answer {
    bench.inputs[8] = u8::from(input) | u8::from(final_scan) << 1;
    bench.inputs[10..12].copy_from_slice(&preset.to_be_bytes());
    bench.inputs[12..14].copy_from_slice(&on.to_be_bytes());
    bench.step(ms);
    let et = |at: usize| u32::from_be_bytes(bench.outputs[at..at + 4].try_into().expect("four"));
    Answer {
        bits: bench.outputs[4],
        et: [et(8), et(12), et(16)],
        date: u64::from_be_bytes(bench.outputs[24..32].try_into().expect("eight")),
    }
}

const IN: &str = "0111111001100100000011110000";

fn timers_follow_the_golden_rows() -> Result<(), Absent> {
    let mut bench = bench()?;
    let answers: Vec<Answer> = (IN.bytes().zip(0..))
        .map(|(input, scan)| ask(&mut bench, 10 * scan, input == b'1', false, 30, 0))
        .collect();
    for (bit, right) in [
        (TON, "0000111000000000000000010000"),
        (TOF, "0111111111111111100011111110"),
        (TP, "0111000001110111000011100000"),
        (RTC, IN),
    ] {
        let row: String = (answers.iter())
            .map(|answer| if answer.bits & bit == 0 { '0' } else { '1' })
            .collect();
        assert_eq!(row, right, "{bit}");
    }
    Ok(())
}

/// Seconds from 1970 to the PDT of bench.st, 2024-05-06-07:08:09.
const PRESET_DATE: i64 = 1_714_979_289;

/// Also with a PT of 0, and with one that changes while the timer runs, where iec2c's own timers differ.
fn timers_are_those_of_the_built_in_programs() -> Result<(), Absent> {
    let mut bench = bench()?;
    let mut random = Random(11);
    let (mut ton, mut tof, mut tp) = (Ton::default(), Tof::default(), Tp::default());
    let mut rtc = Rtc::default();
    let (mut input, mut preset) = (false, 0);
    for scan in 0..600 {
        if random.below(4) == 0 {
            input = !input;
        }
        if random.below(5) == 0 {
            preset = [0, 10, 20, 35, 60, 1000][random.below(6)];
        }
        let ms = 10 * scan;
        let (now, pt) = (
            Nanos::from_millis(i64::from(ms)),
            Nanos::from_millis(i64::from(preset)),
        );
        ton.call(now, input, pt);
        tof.call(now, input, pt);
        tp.call(now, input, pt);
        rtc.call(now, input, Nanos::from_secs(PRESET_DATE));
        let millis = |time: Nanos| u32::try_from(time.0 / 1_000_000).expect("small");
        let right = Answer {
            bits: [ton.q, tof.q, tp.q, rtc.q]
                .into_iter()
                .rev()
                .fold(0, |bits, q| bits << 1 | u8::from(q)),
            et: [millis(ton.et), millis(tof.et), millis(tp.et)],
            date: u64::try_from(rtc.cdt.0 / 1_000_000).expect("after 1970"),
        };
        let answer = ask(&mut bench, ms, input, false, preset, 0);
        assert_eq!(answer, right, "scan {scan}, PT {preset} ms");
    }
    Ok(())
}

/// Between two steps a PLC runs through any number of cycles, at any times.
fn time_stands_still_between_steps() -> Result<(), Absent> {
    let mut bench = bench()?;
    ask(&mut bench, 0, true, false, 30, D);
    for ms in [10, 20] {
        let before = ask(&mut bench, ms, true, false, 30, D);
        assert_eq!(before.bits & (TON | TP | ACTION), TP, "{ms} ms");
        assert_eq!(before.et[0], ms);
        bench.idle(50);
        // A step in which the task is not due is no step for the program either.
        bench.step(ms + 5);
        assert_eq!(bench.outputs[4], before.bits);
    }
    let after = ask(&mut bench, 30, true, false, 30, D);
    assert_eq!(after.bits & (TON | TP | ACTION), TON | ACTION);
    // 49 days, and back to 0.
    let far = ask(&mut bench, 4_294_967_290, false, false, 30, 0);
    assert_eq!(far.date, 4_294_967_290);
    Ok(())
}

fn a_plc_makes_no_step_at_0_nor_out_of_turn_nor_while_the_copies_of_go_differ() -> Result<(), Absent>
{
    let program = "PROGRAM count\nVAR steps AT %QW8 : UINT; END_VAR\nsteps := steps + 1;\nEND_PROGRAM\nCONFIGURATION c\n\
        RESOURCE r ON PLC\nTASK t(INTERVAL := T#10ms, PRIORITY := 0);\nPROGRAM p WITH t : count;\nEND_RESOURCE\n\
        END_CONFIGURATION\n";
    let second = |address: &str| Some(address.to_owned());
    let made = prepared_with(program, (second("%ID8"), second("%QD4")));
    let mut plc = Stepped::load(&Compiler::find()?, &made);
    let mut answer = |go: u32, go_end: u32| {
        plc.inputs[..4].copy_from_slice(&go.to_be_bytes());
        plc.inputs[8..12].copy_from_slice(&go_end.to_be_bytes());
        plc.idle(2);
        let double = |at: usize| u32::from_be_bytes(plc.outputs[at..][..4].try_into().expect("4"));
        assert_eq!(double(0), double(4));
        (
            double(0),
            u16::from_be_bytes(plc.outputs[8..10].try_into().expect("two")),
        )
    };
    // After a reset, a server begins with any number; each row: go, its copy, done, steps made.
    for (go, go_end, done, steps) in [
        (0, 0, 0, 0),
        (386, 0, 0, 0),
        (386, 386, 386, 1),
        (0, 0, 386, 1),
        (386, 386, 386, 1),
        (385, 385, 386, 1),
        (388, 388, 386, 1),
        (387, 386, 386, 1),
        (386, 387, 386, 1),
        (387, 387, 387, 2),
    ] {
        assert_eq!(answer(go, go_end), (done, steps), "{go} {go_end}");
    }
    Ok(())
}

/// By the pragma of OSCAT's edition for `iec2c`.
fn the_clock_of_oscat_is_virtual_time() -> Result<(), Absent> {
    let program = "FUNCTION T_PLC_MS : UDINT\nVAR tx : UDINT; END_VAR\nVAR_INPUT debug : BOOL; END_VAR\ntx := 0;\n\
        {extern unsigned long __tick;\nextern unsigned long long common_ticktime__;\n\
        UDINT plc_time = (UDINT)((common_ticktime__ / 1000000) * (unsigned long long)__tick);\nTX = plc_time}\n\
        T_PLC_MS := tx;\nEND_FUNCTION\n\
        PROGRAM watch\nVAR now AT %QD8 : UDINT; END_VAR\nnow := T_PLC_MS(en := TRUE);\nEND_PROGRAM\nCONFIGURATION c\n\
        RESOURCE r ON PLC\nTASK t(INTERVAL := T#20ms, PRIORITY := 0);\nPROGRAM p WITH t : watch;\nEND_RESOURCE\n\
        END_CONFIGURATION\n";
    let mut plc = Stepped::load(
        &Compiler::find()?,
        &prepared(&program.replace("now", "seen")),
    );
    for ms in [0, 20, 1980, 4_000_000_000] {
        plc.step(ms);
        let seen = u32::from_be_bytes(plc.outputs[8..12].try_into().expect("four"));
        assert_eq!(seen, ms);
    }
    Ok(())
}

fn the_example_counts_virtual_time() -> Result<(), Absent> {
    let compiler = Compiler::find()?;
    let mut cell = Stepped::load(&compiler, &with_blocks(&text("plc/iec61131/example.st")));
    let (mut running, mut clamp) = (String::new(), String::new());
    for step in 0..14 {
        cell.inputs[8] = u8::from(step >= 2);
        cell.step(10 * step);
        let mark = |bit| if cell.outputs[4] & bit == 0 { '.' } else { '1' };
        running.push(mark(1));
        clamp.push(mark(2));
    }
    assert_eq!(running, "..1111111.....");
    assert_eq!(clamp, "..111.........");
    assert_eq!(
        cell.outputs[6..10],
        [0, 1, 0, 7],
        "one part, and every second step"
    );
    Ok(())
}

/// A source, prepared with the server's variables at the addresses of [`Stepped`].
fn prepared(program: &str) -> String {
    prepared_with(program, (None, None))
}

/// The same with second copies of `go` and `done` at these addresses.
fn prepared_with(program: &str, (go_end, done_end): (Option<String>, Option<String>)) -> String {
    let source = |bytes: Vec<u8>| Source {
        name: "program.st".to_owned(),
        bytes,
    };
    let [go, ms, done] = ["%ID0", "%ID4", "%QD0"].map(|address| Some(address.to_owned()));
    let addresses = Addresses {
        go,
        ms,
        done,
        go_end,
        done_end,
    };
    let settings = Settings {
        addresses,
        // The body of this program is a pragma.
        no_clock: vec!["three".to_owned()],
        ..Settings::default()
    };
    let made = prepare(&[source(program.as_bytes().to_vec())], &settings);
    let made = made.unwrap_or_else(|mistakes| panic!("{}", mistakes[0]));
    let bytes = made.files.into_iter().next().expect("one");
    let original = undo(&source(bytes.clone())).unwrap_or_else(|mistakes| panic!("{mistakes}"));
    assert_eq!(original, program.as_bytes());
    String::from_utf8(bytes).expect("text")
}

/// The inputs of line.st, changed now and then.
fn play(random: &mut Random, plc: &mut Stepped) {
    for bit in 0..3 {
        if random.below(6) == 0 {
            plc.inputs[8] ^= 1 << bit;
        }
    }
}

fn a_prepared_program_is_the_one_synchronised_by_hand() -> Result<(), Absent> {
    let compiler = Compiler::find()?;
    let mut ours = Stepped::load(&compiler, &prepared(&text("tests/prepare/line.st")));
    let by_hand = with_blocks(&text("tests/prepare/line_by_hand.st"));
    let mut right = Stepped::load(&compiler, &by_hand);
    right.jumps = Random(99);
    let mut random = Random(5);
    for step in 0..2000 {
        play(&mut random, &mut ours);
        right.inputs.clone_from(&ours.inputs);
        ours.step(step * 5);
        right.step(step * 5);
        assert_eq!(ours.outputs, right.outputs, "step {step}");
    }
    assert_ne!(ours.outputs[6..8], [0, 0], "no part was counted");
    Ok(())
}

/// In each step the outputs equal those of the original in the scan at that time, hosted on that time.
fn equal(
    original: &str,
    prepared: &str,
    mut play: impl FnMut(&mut Random, &mut Stepped),
) -> Result<Vec<u8>, Absent> {
    let compiler = Compiler::find()?;
    let mut ours = Stepped::load(&compiler, prepared);
    let mut right = Stepped::load(&compiler, original);
    let mut random = Random(3);
    for step in 0..3000_u32 {
        play(&mut random, &mut ours);
        let length = right.inputs.len();
        right.inputs.copy_from_slice(&ours.inputs[..length]);
        ours.step(step * 10);
        right.scan(Nanos::from_millis(i64::from(step) * 10));
        assert_eq!(ours.outputs[4..], right.outputs[4..], "step {step}");
    }
    Ok(ours.outputs)
}

fn a_prepared_program_does_what_the_original_does() -> Result<(), Absent> {
    let original = text("tests/prepare/line.st");
    let outputs = equal(&original, &prepared(&original), play)?;
    let word = |at: usize| u16::from_be_bytes([outputs[at], outputs[at + 1]]);
    assert_eq!(
        (word(8), word(16)),
        (3000, 1000),
        "scans, and reports in every third step"
    );
    assert!(
        word(10) > 100 && word(12) > 10 && word(14) > 0 && word(18) > 10,
        "{outputs:?}"
    );
    Ok(())
}

fn a_prepared_project_in_xml_does_what_the_original_does() -> Result<(), Absent> {
    let original = text("tests/prepare/line.xml");
    let made = prepared(&original);
    let outputs = equal(
        &project::structured_text(&original),
        &project::structured_text(&made),
        play,
    )?;
    let word = |at: usize| u16::from_be_bytes([outputs[at], outputs[at + 1]]);
    assert_eq!((word(8), word(16)), (3000, 1000));
    assert!(word(14) > 10, "{outputs:?}");
    Ok(())
}

/// In the form that an editor reads.
fn the_blocks_in_xml_compile() -> Result<(), Absent> {
    let compiler = Compiler::find()?;
    let configuration = "<configuration name=\"c\"><resource name=\"r\"/></configuration>";
    let bench = text("tests/prepare/bench.st");
    let mut whole = String::new();
    for (name, _) in tickbus::prepare::SOURCES {
        let xml = text(&format!("plc/iec61131/{name}.xml"));
        let xml = xml.replace("<configurations/>", configuration);
        let blocks = project::structured_text(&xml);
        whole += blocks.split("CONFIGURATION").next().unwrap_or_default();
    }
    Stepped::load(&compiler, &(whole + bench.as_str())).step(10);
    Ok(())
}

/// The rig's addresses are moved, since it uses the first bytes itself.
fn the_rig_prepared_does_what_the_original_does() -> Result<(), Absent> {
    let mut moved = text("plc/rig/rig.st");
    for area in ["%IW", "%IX", "%QW", "%QB"] {
        let mut pieces = moved.split(area);
        let mut text = pieces.next().unwrap_or_default().to_owned();
        for piece in pieces {
            let end = piece
                .find(|c: char| !c.is_ascii_digit())
                .unwrap_or(piece.len());
            let number: u32 = piece[..end].parse().expect("a number");
            text.extend([area, &(number + 8).to_string(), &piece[end..]]);
        }
        moved = text;
    }
    let outputs = equal(&moved, &prepared(&moved), |random, plc| {
        for byte in 8..12 {
            if random.below(8) == 0 {
                plc.inputs[byte] ^= 1 << random.below(8);
            }
        }
        // The host's data are alive most of the time.
        plc.inputs[11] = u8::from(random.below(500) != 0);
    })?;
    assert_ne!(outputs[8..], [0; 8][..], "it did nothing");
    Ok(())
}

fn prepared_programs_of_the_exporter_compile() -> Result<(), Absent> {
    let compiler = Compiler::find()?;
    for file in ["modbus-client-openplc/Drive.st", "rig-openplc/Test_rig.st"] {
        let folder = tempfile::tempdir().expect("a folder");
        let made = prepared(&text(&format!("tests/export/right/{file}")));
        compiler.build(&made, folder.path());
    }
    Ok(())
}

fn without_a_simulation_a_prepared_program_runs_on_the_plcs_time() -> Result<(), Absent> {
    let compiler = Compiler::find()?;
    // All tasks at one interval: without a server every program runs in every cycle.
    let original = text("tests/prepare/line.st").replace("T#30ms", "T#10ms");
    let real = prepared(&original).replace(
        "tickbus_simulated : BOOL := TRUE",
        "tickbus_simulated : BOOL := FALSE",
    );
    let mut ours = Stepped::load(&compiler, &real);
    let mut right = Stepped::load(&compiler, &original);
    let mut random = Random(13);
    for scan in 0..1000 {
        play(&mut random, &mut ours);
        let length = right.inputs.len();
        right.inputs.copy_from_slice(&ours.inputs[..length]);
        let now = Nanos::from_millis(1000 + scan * 10);
        ours.scan(now);
        right.scan(now);
        assert_eq!(ours.outputs[4..], right.outputs[4..], "scan {scan}");
    }
    Ok(())
}

/// Runs `tickbus sync prepare`: its exit code, stdout and stderr.
fn command(folder: &Path, arguments: &[&str]) -> (Option<i32>, String, String) {
    let output = Command::new(env!("CARGO_BIN_EXE_tickbus"))
        .args(["sync", "prepare"])
        .args(arguments)
        .current_dir(folder)
        .output()
        .expect("tickbus runs");
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    let (stdout, stderr) = (text(&output.stdout), text(&output.stderr));
    (output.status.code(), stdout, stderr)
}

fn the_command_writes_beside_its_sources_and_never_over_them() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    let original = text("tests/prepare/line.st");
    std::fs::write(folder.join("line.st"), &original).expect("written");
    let read = |name: &str| std::fs::read_to_string(folder.join(name)).expect("a file");
    let addresses = ["--go", "%id0", "--ms", "%ID4", "--done", "%QD0"];
    let prepare = |more: &[&str]| command(folder, &[&["line.st"], &addresses[..], more].concat());

    let (code, stdout, stderr) = prepare(&[]);
    assert_eq!((code, stderr.as_str()), (Some(0), ""));
    assert_eq!(stdout, "prepared/line.st\nprepare: ok files=1\n");
    assert_eq!(read("line.st"), original);
    assert_eq!(read("prepared/line.st"), prepared(&original));

    let (code, _, stderr) = prepare(&[]);
    let told = "prepared/line.st: this file is there already; name another --out, or add --force\nprepare: failed mistakes=1\n";
    assert_eq!((code, stderr.as_str()), (Some(1), told));
    let (code, _, stderr) = prepare(&["--out", ".", "--force"]);
    assert_eq!(code, Some(1));
    assert!(
        stderr.starts_with("./line.st: this is one of the sources; "),
        "{stderr}"
    );
    assert_eq!(prepare(&["--force"]).0, Some(0));

    let (code, stdout, _) = command(folder, &["prepared/line.st", "--undo"]);
    assert_eq!(
        (code, stdout.as_str()),
        (Some(0), "prepared/original/line.st\nprepare: ok files=1\n")
    );
    assert_eq!(read("prepared/original/line.st"), original);
    assert_eq!(prepare(&["--in-place"]).0, Some(0));
    assert_eq!(read("line.st"), prepared(&original));
    assert_eq!(
        command(folder, &["line.st", "--undo", "--in-place"]).0,
        Some(0)
    );
    assert_eq!(read("line.st"), original);
}

fn the_command_tells_what_is_wrong_and_writes_nothing() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    let broken = text("tests/prepare/line.st").replace("run_on : TOF", "run_on : TONR");
    std::fs::write(folder.join("line.st"), broken).expect("written");
    let (code, stdout, stderr) = command(folder, &["line.st"]);
    assert_eq!((code, stdout.as_str()), (Some(1), ""));
    let told = "line.st:54:14: TONR runs on a clock of its own; ";
    assert!(
        stderr.starts_with(told) && stderr.ends_with("prepare: failed mistakes=1\n"),
        "{stderr}"
    );
    assert!(!folder.join("prepared").exists());
    let (code, _, stderr) = command(folder, &["none.st", "nor.st"]);
    assert_eq!(code, Some(1));
    assert!(stderr.ends_with("prepare: failed mistakes=2\n"), "{stderr}");
    let (code, _, stderr) = command(folder, &["line.st", "--go", "100"]);
    assert_eq!(code, Some(2));
    assert!(
        stderr.contains("write the address of a double word, such as %ID100"),
        "{stderr}"
    );
    let (code, _, stderr) = command(folder, &["line.st", "--undo"]);
    assert_eq!(code, Some(1));
    assert!(
        stderr.contains("there is nothing to take out of this file"),
        "{stderr}"
    );
}

fn the_command_writes_all_files_or_none() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    let original = text("tests/prepare/line.st");
    let types = "TYPE Unused : STRUCT n : INT; END_STRUCT; END_TYPE\n";
    std::fs::write(folder.join("line.st"), &original).expect("written");
    std::fs::write(folder.join("types.st"), types).expect("written");
    std::fs::create_dir_all(folder.join("prepared/types.st")).expect("a folder");
    let (code, stdout, stderr) = command(folder, &["line.st", "types.st", "--force"]);
    assert_eq!((code, stdout.as_str()), (Some(1), ""));
    assert!(
        stderr.starts_with("prepared/types.st: this file cannot be written: "),
        "{stderr}"
    );
    let left = std::fs::read_dir(folder.join("prepared")).expect("a folder");
    assert_eq!(left.count(), 1, "only the folder that was there");

    std::fs::remove_dir(folder.join("prepared/types.st")).expect("removed");
    assert_eq!(
        command(folder, &["line.st", "types.st", "--force"]).0,
        Some(0)
    );
    let both = ["prepared/line.st", "prepared/types.st", "--undo"];
    let (code, _, stderr) = command(folder, &both);
    assert_eq!(
        (code, stderr.as_str()),
        (
            Some(0),
            "note: prepared/types.st: there was nothing to take out\n"
        )
    );
    let read = |name: &str| std::fs::read_to_string(folder.join(name)).expect("a file");
    assert_eq!(read("prepared/original/line.st"), original);
    assert_eq!(read("prepared/original/types.st"), types);
}

fn prepared_programs_with_our_names_in_other_places_compile() -> Result<(), Absent> {
    let compiler = Compiler::find()?;
    let units = "FUNCTION_BLOCK Clock VAR n : INT; END_VAR n := 1; END_FUNCTION_BLOCK\n\
        FUNCTION since : INT VAR_INPUT n : INT; END_VAR since := n; END_FUNCTION\n\
        FUNCTION last : INT VAR_INPUT n : INT; END_VAR last := n; END_FUNCTION\n\
        TYPE started : STRUCT n : INT; ton : TIME; END_STRUCT; END_TYPE\n\
        TYPE Loaded : STRUCT n : INT; END_STRUCT; END_TYPE\n\
        PROGRAM one VAR t1 : TON; t2 : TOF; t3 : TP; t4 : RTC; c1 : Clock; n : INT; v : started; w : Loaded; END_VAR\n\
        t1(); t2(); t3(); t4(); c1(); n := since(last(n)); v.n := w.n; END_PROGRAM\n";
    let plant = "PROGRAM two VAR lamp AT %QX8.0 : BOOL; END_VAR lamp := TRUE; END_PROGRAM\n\
        PROGRAM three VAR n AT %IX8.0 : BOOL; END_VAR\n{(void)0;}\nEND_PROGRAM\n\
        CONFIGURATION plant RESOURCE cpu ON PLC TASK _fast(INTERVAL := T#10ms, PRIORITY := 0);\n\
        TASK Fast(INTERVAL := T#30ms, PRIORITY := 1); PROGRAM a WITH _fast : one; PROGRAM b WITH Fast : two;\n\
        PROGRAM c WITH Fast : three; END_RESOURCE END_CONFIGURATION\n";
    let mut plc = Stepped::load(&compiler, &prepared(&(units.to_owned() + plant)));
    plc.step(0);
    assert_eq!(plc.outputs[8], 1);
    Ok(())
}
