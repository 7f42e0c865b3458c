//! Users' own PLC programs: C code with iec2c's interface, compiled here by cc, loaded, and run.
#![allow(missing_docs, reason = "tests")]

mod fixture;
mod lockstep;

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use fixture::{Cpu, IEC, by_hand, compile, folder, options};
use tickbus::driver::{Code, Driver};
use tickbus::driver_cfg::Config;
use tickbus::plc::{self, HostedProgram, Program};
use tickbus::programs;
use tickbus::signal::{Addressing, Slot};
use tickbus::time::{Manual, Nanos};
use tickbus_test_log as logged;

#[test]
#[cfg_attr(any(windows, no_cc), ignore = "there is no C compiler, cc")]
fn timers_run_on_the_time_of_the_scan() {
    let folder = folder();
    let mut cpu = Cpu::load(&by_hand(folder.path(), &[]), &[IEC]);
    let mut lamp_since = None;
    for scan in 0..60 {
        cpu.inputs[0] = u8::from(scan >= 5);
        let now = cpu.now;
        cpu.scan();
        if cpu.outputs[0] & 1 != 0 {
            lamp_since.get_or_insert(scan);
        }
        if scan < 5 {
            assert_eq!(cpu.long(), now.0);
        }
    }
    assert_eq!(lamp_since, Some(55), "10 ms scans, T#500ms");
    cpu.now = Nanos(-1);
    cpu.inputs[0] = 0;
    cpu.scan();
    assert_eq!((cpu.long(), cpu.outputs[0] & 1), (-1, 0));
}

#[test]
#[cfg_attr(any(windows, no_cc), ignore = "there is no C compiler, cc")]
fn values_lie_where_their_addresses_say() {
    let folder = folder();
    let path = by_hand(folder.path(), &[]);
    for (order, word, real) in [
        ("ABCD", [0x01, 0x02], 3.0_f32.to_be_bytes()),
        ("DCBA", [0x02, 0x01], 3.0_f32.to_le_bytes()),
    ] {
        let mut cpu = Cpu::load(&path, &[IEC, ("order", order)]);
        assert_eq!(
            (cpu.program.input_bytes(), cpu.program.output_bytes()),
            (10, 16)
        );
        cpu.inputs[2..4].copy_from_slice(&word);
        cpu.inputs[4..8].copy_from_slice(&real);
        cpu.inputs[9] = 1;
        cpu.outputs[0] = 0b0010_0001;
        cpu.scan();
        assert_eq!(
            cpu.outputs[0], 0b1010_0000,
            "bits that are no variable's stay"
        );
        let next = if order == "ABCD" {
            [0x01, 0x03]
        } else {
            [0x03, 0x01]
        };
        assert_eq!(cpu.outputs[2..4], next);
        let half = if order == "ABCD" {
            1.5_f32.to_be_bytes()
        } else {
            1.5_f32.to_le_bytes()
        };
        assert_eq!(cpu.outputs[4..8], half);
    }
}

#[test]
#[cfg_attr(any(windows, no_cc), ignore = "there is no C compiler, cc")]
fn it_states_its_interval_and_counts_its_scans() {
    let folder = folder();
    let path = by_hand(folder.path(), &[]);
    let mut cpu = Cpu::load(&path, &[IEC]);
    assert_eq!(cpu.program.interval(), Nanos::from_millis(20));
    let ticks: Vec<u8> = (0..8)
        .map(|_| {
            cpu.scan();
            cpu.outputs[1]
        })
        .collect();
    assert_eq!(
        ticks,
        [0, 1, 2, 3, 4, 5, 0, 1],
        "greatest_tick_count__ is 6"
    );
    let any = by_hand(folder.path(), &["-DTICK_TIME=0"]);
    assert_eq!(Cpu::load(&any, &[IEC]).program.interval(), plc::INTERVAL);
}

#[test]
#[cfg_attr(any(windows, no_cc), ignore = "there is no C compiler, cc")]
fn whether_data_are_alive_goes_where_the_option_says() {
    let folder = folder();
    let path = by_hand(folder.path(), &[]);
    let mut cpu = Cpu::load(&path, &[IEC, ("alive", "%IX9.0")]);
    for (alive, shown) in [(true, 0x80), (false, 0), (true, 0x80)] {
        cpu.alive = alive;
        cpu.inputs[9] = u8::from(!alive);
        cpu.scan();
        assert_eq!(cpu.outputs[0], shown, "not what lies in the image there");
    }
}

#[test]
#[cfg_attr(any(windows, no_cc), ignore = "there is no C compiler, cc")]
fn many_instances_of_one_file_share_nothing() {
    let folder = folder();
    let path = by_hand(folder.path(), &[]);
    let mut cpus: Vec<Cpu> = (0..3).map(|_| Cpu::load(&path, &[IEC])).collect();
    for (scans, cpu) in cpus.iter_mut().enumerate() {
        cpu.inputs[0] = 1;
        for _ in 0..=scans {
            cpu.scan();
        }
    }
    // Dropping one does not affect the others.
    drop(cpus.remove(0));
    let threads: Vec<_> = cpus
        .into_iter()
        .map(|mut cpu| {
            std::thread::spawn(move || {
                cpu.scan();
                cpu.long()
            })
        })
        .collect();
    let counted: Vec<i64> = threads
        .into_iter()
        .map(|thread| thread.join().expect("it ends"))
        .collect();
    assert_eq!(
        counted,
        [103, 104],
        "scans, counted in each instance's own marker"
    );
}

#[test]
#[cfg_attr(any(windows, no_cc), ignore = "there is no C compiler, cc")]
fn building_anew_changes_nothing_for_a_program_that_runs() {
    let folder = folder();
    let path = by_hand(folder.path(), &[]);
    let mut cpu = Cpu::load(&path, &[IEC]);
    cpu.scan();
    fs::write(&path, vec![0; 100_000]).expect("written over in place");
    fs::remove_file(&path).expect("removed");
    cpu.inputs[0] = 1;
    cpu.scan();
    assert_eq!(cpu.long(), 102);
    let other = by_hand(folder.path(), &["-DTICK_TIME=5000000"]);
    assert_eq!(
        Cpu::load(&other, &[IEC]).program.interval(),
        Nanos::from_millis(5)
    );
    assert_eq!(cpu.program.interval(), Nanos::from_millis(20));
}

#[test]
#[cfg_attr(any(windows, no_cc), ignore = "there is no C compiler, cc")]
fn programs_with_something_wrong_are_refused_with_what_would_be_right() {
    for (mistake, says) in [
        (
            "VERSION",
            "was built with version 7 of the glue, and this tickbus has version 1; build it anew",
        ),
        (
            "SIZE",
            "has a broken table: its size is wrong; build it anew",
        ),
        (
            "ENTRY_SIZE",
            "has a broken table: the size of its entries is wrong; ",
        ),
        ("NO_SCAN", "has a broken table: a function is missing; "),
        (
            "NO_LIST",
            "has a broken table: it has no list of variables; ",
        ),
        ("NO_VALUE", "has a broken table: a variable lies nowhere; "),
        (
            "NO_INDEX",
            "has a broken table: a variable has no address; ",
        ),
        (
            "TYPE",
            "declares %QD0 : TIME, and TIME has no place in a process image; types are BOOL, ",
        ),
        (
            "THREE_NUMBERS",
            "declares %QX0.0.0 : BOOL, and its address has more than two numbers; ",
        ),
        (
            "OVERLAP",
            "has two outputs on the same bits, %QX0.0 and %QB0; keep one of them, ",
        ),
        (
            "MARKERS_ONLY",
            "has no variable in %I or %Q, so that it can do nothing; declare some",
        ),
        (
            "NO_VARIABLES",
            "has no variable in %I or %Q, so that it can do nothing; declare some",
        ),
        (
            "WRONG_SIZE",
            "declares %QX0.0 : BOOL, and its value has 2 bytes; build it anew",
        ),
    ] {
        let folder = folder();
        let path = compile(
            folder.path(),
            &["tests/plc/wrong.c"],
            &[&format!("-DMISTAKE={mistake}")],
        );
        let error = HostedProgram::load(&path, &[])
            .expect_err(mistake)
            .to_string();
        let start = format!("the PLC program \"{}\" {says}", path.display());
        assert!(error.starts_with(&start), "{mistake}: {error}");
    }
    let folder = folder();
    let path = compile(folder.path(), &["tests/plc/wrong.c"], &["-DMISTAKE=GOOD"]);
    HostedProgram::load(&path, &[]).expect("nothing is wrong with the rest of it");
}

#[test]
#[cfg_attr(any(windows, no_cc), ignore = "there is no C compiler, cc")]
fn files_that_cannot_be_loaded_are_refused_with_what_they_lack() {
    let folder = folder();
    let refusal = |path: &Path| {
        HostedProgram::load(path, &[])
            .expect_err("refused")
            .to_string()
    };
    let without = compile(
        folder.path(),
        &["tests/plc/wrong.c"],
        &["-DMISTAKE=UNDEFINED"],
    );
    let error = refusal(&without);
    assert!(
        error.contains("cannot be loaded (it: undefined symbol: nobody_has_this)"),
        "{error}"
    );
    assert!(
        error.contains("; compile in all C files that iec2c wrote, and the glue with"),
        "{error}"
    );

    fs::write(
        folder.path().join("bare.c"),
        "void config_run__(unsigned long t) { (void)t; }",
    )
    .expect("written");
    let bare = folder.path().join("bare.c");
    let bare = compile(folder.path(), &[bare.to_str().expect("text")], &[]);
    assert!(refusal(&bare).ends_with(
        "has no symbol \"tickbus_plc\"; compile plc/glue/tickbus_plc.c into it, beside the files that iec2c wrote"
    ));

    let object = by_hand(folder.path(), &[]);
    let whole = fs::read(&object).expect("read");
    for (at, byte, says) in [
        (4, 1, "is built for another machine (32 bits, "),
        (
            18,
            3,
            "is built for another machine (64 bits, x86); build it for this one (64 bits, ",
        ),
        (
            16,
            1,
            "is an object file that is not linked; link it with cc -shared",
        ),
    ] {
        let mut bytes = whole.clone();
        bytes[at] = byte;
        fs::write(&object, bytes).expect("written");
        let error = refusal(&object);
        assert!(error.contains(says), "{error}");
    }
    for length in [0, 3, 19, 63, 200, 5_000, whole.len() / 2] {
        fs::write(&object, &whole[..length]).expect("written");
        let error = refusal(&object);
        assert!(
            length < 20 || error.contains("is cut off; "),
            "{length}: {error}"
        );
    }
}

const SIGNALS: &str = r#"
[[signal]]
name = "in"
address = "%IX0.0"
[[signal]]
name = "number"
address = "%IW1"
type = "INT"
[[signal]]
name = "half of"
address = "%ID1"
type = "REAL"
order = "DCBA"
[[signal]]
name = "lamp"
address = "%QX0.0"
[[signal]]
name = "alive"
address = "%QX0.7"
[[signal]]
name = "next"
address = "%QW1"
type = "INT"
[[signal]]
name = "half"
address = "%QD1"
type = "REAL"
order = "CDAB"
[[signal]]
name = "long"
address = "%QL1"
"#;

/// A driver.cfg in `folder`.
fn driver_cfg(folder: &Path, driver: &str, fieldbus: &str) -> PathBuf {
    let path = folder.join("driver.cfg");
    let text =
        format!("[driver]\nid = 1\nname = \"cell\"\n{driver}\n[fieldbus]\n{fieldbus}\n{SIGNALS}");
    fs::write(&path, text).expect("written");
    path
}

const STEPPED: &str = "kind = \"loopback\"\nmode = \"stepped\"\nprogram = \"./program.so\"\n\
    program_options = { alive = \"%IX9.0\" }";

fn open(path: &Path) -> Result<(logged::Watch, Driver), String> {
    let logged = logged::Watch::new();
    let config =
        Config::load(path, &tickbus::KINDS).unwrap_or_else(|mistakes| panic!("{mistakes}"));
    let driver = Driver::open(config, Manual::new()).map_err(|error| error.to_string())?;
    Ok((logged, driver))
}

#[test]
#[cfg_attr(any(windows, no_cc), ignore = "there is no C compiler, cc")]
fn a_loopback_hosts_the_program_beside_its_driver_cfg() {
    let folder = folder();
    by_hand(folder.path(), &[]);
    let path = driver_cfg(folder.path(), "addressing = \"iec\"", STEPPED);
    let (_logged, mut driver) = open(&path).expect("opens");
    let mut slots = driver.initial_slots();
    let at = |name: &str| driver.config().table.position(name).expect("a signal");
    let [input, number, half_of, lamp, alive, next, half] =
        ["in", "number", "half of", "lamp", "alive", "next", "half"].map(at);
    slots[input] = Slot::from_real(1.0);
    slots[number] = Slot::from_real(-7.0);
    slots[half_of] = Slot::from_real(6.5);
    let mut lamp_since = None;
    for tick in 0..600 {
        let now = Nanos::from_millis(tick);
        assert_eq!(driver.exchange(now, &mut slots).code, Code::Fresh);
        if slots[lamp].real() > 0.5 {
            lamp_since.get_or_insert(tick);
        }
    }
    assert_eq!(lamp_since, Some(500), "every 20 ms, as compiled");
    let values = [alive, next, half].map(|slot| slots[slot].real());
    assert_eq!(
        values.map(f64::to_bits),
        [1.0, -6.0, 3.25].map(f64::to_bits)
    );
    assert!(
        driver.statistics().contains("plc.scans=30\n"),
        "{}",
        driver.statistics()
    );
}

#[test]
#[cfg_attr(any(windows, no_cc), ignore = "there is no C compiler, cc")]
fn a_program_that_does_not_fit_its_driver_cfg_is_refused() {
    let folder = folder();
    let path = driver_cfg(folder.path(), "addressing = \"iec\"", STEPPED);
    let error = open(&path).map(drop).expect_err("refused");
    let missing = format!(
        "{}: the PLC program \"{}/./program.so\" is not there; check the path; one in a driver.cfg counts from \
         the folder of that file",
        path.display(),
        folder.path().display()
    );
    assert_eq!(error, missing);

    by_hand(folder.path(), &[]);
    open(&path).expect("it fits");
    let other = STEPPED.replace("%IX9.0", "%IX0.0");
    let path = driver_cfg(folder.path(), "addressing = \"iec\"", &other);
    let error = open(&path).map(drop).expect_err("refused");
    assert!(
        error.contains("takes %IX0.0 for the option \"alive\", where the signal \"in\" lies"),
        "{error}"
    );
    let path = driver_cfg(
        folder.path(),
        "addressing = \"iec\"",
        &STEPPED.replace("alive =", "alvie ="),
    );
    let mistakes = Config::load(&path, &tickbus::KINDS)
        .expect_err("refused")
        .to_string();
    assert!(mistakes.contains("has no option \"alvie\""), "{mistakes}");
    // Without the option, the variable needs a place in the image.
    let none = STEPPED.replace("alive = \"%IX9.0\"", "");
    let path = driver_cfg(folder.path(), "addressing = \"iec\"", &none);
    let error = open(&path).map(drop).expect_err("refused");
    assert!(
        error.contains("uses %IX9.0 (to byte 9), but %I has 8 bytes in this driver.cfg"),
        "{error}"
    );
    assert!(
        error.contains("; add the signal, or input_bytes = 10; "),
        "{error}"
    );
}

#[test]
#[cfg_attr(any(windows, no_cc), ignore = "there is no C compiler, cc")]
fn addresses_count_as_the_driver_cfg_says_unless_the_option_does() {
    let folder = folder();
    let path = by_hand(folder.path(), &[]);
    let cfg = |driver| {
        let path = driver_cfg(
            folder.path(),
            driver,
            "kind = \"loopback\"\nlink = \"x\"\ninput_bytes = 10",
        );
        Config::load(&path, &tickbus::KINDS).unwrap_or_else(|mistakes| panic!("{mistakes}"))
    };
    let elements = cfg("addressing = \"iec\"");
    assert_eq!(elements.addressing, Addressing::Elements);
    let mut program = programs::program(path.to_str().expect("text"), &[]).expect("loads");
    program
        .fit(&elements.table, Addressing::Elements)
        .expect("fits");
    let error = program
        .fit(&elements.table, Addressing::Bytes)
        .expect_err("refused");
    assert!(
        error.to_string().contains("say addressing = \"iec\""),
        "{error}"
    );
    let mut program =
        programs::program(path.to_str().expect("text"), &options(&[IEC])).expect("loads");
    program
        .fit(&elements.table, Addressing::Bytes)
        .expect("the option counts");
}

#[test]
#[cfg_attr(any(windows, no_cc), ignore = "there is no C compiler, cc")]
fn the_command_hosts_it_over_a_bus() {
    let folder = folder();
    by_hand(folder.path(), &[]);
    driver_cfg(
        folder.path(),
        "addressing = \"iec\"",
        "kind = \"socket\"\naddress = \"127.0.0.1:1\"\ninput_bytes = 10",
    );
    let run = |program: &str| {
        let output = Command::new(env!("CARGO_BIN_EXE_tickbus"))
            .current_dir(folder.path())
            .args([
                "plc",
                program,
                "--config",
                "driver.cfg",
                "--duration",
                "100ms",
            ])
            .output()
            .expect("tickbus runs");
        let text = |bytes: Vec<u8>| String::from_utf8(bytes).expect("text");
        (
            output.status.code(),
            text(output.stdout),
            text(output.stderr),
        )
    };
    // The program runs; there is no listener at the line's address.
    let (code, out, err) = run("./program.so");
    assert_eq!(code, Some(3), "{out}{err}");
    let last = out.lines().last().expect("a line");
    assert!(
        last.starts_with("plc: failed reason=the line never ran: "),
        "{out}{err}"
    );
    let (code, _, err) = run("./programm.so");
    assert_eq!(code, Some(1));
    assert!(
        err.starts_with("plc: the PLC program \"./programm.so\" is not there; check the path"),
        "{err}"
    );
    let (code, _, err) = run("rgi");
    assert_eq!(code, Some(2), "{err}");
}

#[test]
#[cfg_attr(any(windows, no_cc), ignore = "there is no C compiler, cc")]
fn test_files_name_it_as_seen_from_there() {
    let folder = folder();
    let tests = folder.path().join("tests");
    fs::create_dir(&tests).expect("made");
    by_hand(&tests, &[]);
    driver_cfg(
        folder.path(),
        "addressing = \"iec\"",
        "kind = \"socket\"\naddress = \"127.0.0.1:1\"",
    );
    let file = r#"
config = "../driver.cfg"
program = "./program.so"
program_options = { alive = "%IX9.0" }
[[test]]
name = "the lamp lights after half a second"
steps = [
    { set = { "in" = true, "number" = 41 }, tick = 500, expect = ["not lamp", "next == 42", "alive"] },
    { await = "lamp", within = 20 },
]
"#;
    fs::write(tests.join("lamp.toml"), file).expect("written");
    let output = Command::new(env!("CARGO_BIN_EXE_tickbus"))
        .current_dir(folder.path())
        .args(["test", "tests"])
        .output()
        .expect("tickbus runs");
    assert!(
        output.status.success(),
        "{}{}",
        String::from_utf8_lossy(&output.stdout),
        String::from_utf8_lossy(&output.stderr)
    );
}

#[test]
#[cfg_attr(any(windows, no_cc), ignore = "there is no C compiler, cc")]
fn a_loop_that_never_ends_is_a_fault_of_the_program() {
    let folder = folder();
    by_hand(folder.path(), &["-DLOOP"]);
    driver_cfg(
        folder.path(),
        "addressing = \"iec\"",
        "kind = \"socket\"\naddress = \"127.0.0.1:1\"\ninput_bytes = 10",
    );
    let runs: [(&[&str], &str); 2] = [
        (
            &[],
            "plc: failed reason=the PLC program has been in one scan for ",
        ),
        // Stopped before the hang is detected.
        (
            &["--duration", "500ms"],
            "plc: failed reason=the PLC program's scan did not end within 3s",
        ),
    ];
    for (more, reason) in runs {
        let output = Command::new(env!("CARGO_BIN_EXE_tickbus"))
            .current_dir(folder.path())
            .args(["plc", "./program.so", "--config", "driver.cfg"])
            .args(more)
            .output()
            .expect("tickbus runs");
        let out = String::from_utf8_lossy(&output.stdout).into_owned();
        let last = out.lines().last().expect("a line");
        assert!(last.starts_with(reason), "{out}");
        assert_eq!(output.status.code(), Some(3));
    }
}

#[test]
#[cfg_attr(any(windows, no_cc), ignore = "there is no C compiler, cc")]
fn no_copy_is_left_behind() {
    // A separate folder for temporary files requires a separate process.
    let folder = folder();
    by_hand(folder.path(), &[]);
    driver_cfg(
        folder.path(),
        "addressing = \"iec\"",
        "kind = \"socket\"\naddress = \"127.0.0.1:1\"\ninput_bytes = 10",
    );
    let temporary = folder.path().join("temporary");
    fs::create_dir(&temporary).expect("made");
    let run = |temporary: &Path| {
        Command::new(env!("CARGO_BIN_EXE_tickbus"))
            .current_dir(folder.path())
            .env("TMPDIR", temporary)
            .args([
                "plc",
                "./program.so",
                "--config",
                "driver.cfg",
                "--duration",
                "20ms",
            ])
            .output()
            .expect("tickbus runs")
    };
    // There is no listener at the line's address.
    assert_eq!(run(&temporary).status.code(), Some(3));
    assert_eq!(fs::read_dir(&temporary).expect("a folder").count(), 0);
    let output = run(Path::new("/no/such/folder"));
    let error = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(1));
    assert!(
        error.contains("cannot be copied to /no/such/folder/tickbus-"),
        "{error}"
    );
    assert!(error.contains("set TMPDIR"), "{error}");
}

/// The glue is shipped as source, so it must compile unchanged for every type that iec2c can locate.
#[test]
#[cfg_attr(any(windows, no_cc), ignore = "there is no C compiler, cc")]
fn the_glue_takes_every_type_and_the_loader_names_those_that_have_no_place() {
    let types = [
        ("BOOL", 'X'),
        ("BYTE", 'B'),
        ("SINT", 'B'),
        ("USINT", 'B'),
        ("WORD", 'W'),
        ("INT", 'W'),
        ("UINT", 'W'),
        ("DWORD", 'D'),
        ("DINT", 'D'),
        ("UDINT", 'D'),
        ("REAL", 'D'),
        ("LWORD", 'L'),
        ("LINT", 'L'),
        ("ULINT", 'L'),
        ("LREAL", 'L'),
        ("TIME", 'L'),
        ("DATE", 'L'),
        ("TOD", 'L'),
        ("DT", 'L'),
        ("STRING", 'B'),
    ];
    for (data_type, size) in types {
        let folder = folder();
        let (name, numbers) = if size == 'X' {
            ("__QX0_1", "0,1")
        } else {
            ("__Q0", "0")
        };
        let list = format!("__LOCATED_VAR({data_type},{name},Q,{size},{numbers})\n");
        fs::write(folder.path().join("LOCATED_VARIABLES.h"), list).expect("written");
        let program = "void config_init__(void) {}\nvoid config_run__(unsigned long tick) { (void)tick; }\n\
            unsigned long long common_ticktime__;\nunsigned long greatest_tick_count__;\n";
        let source = folder.path().join("program.c");
        fs::write(&source, program).expect("written");
        let here = format!("-I{}", folder.path().display());
        let sources = [source.to_str().expect("text"), "plc/glue/tickbus_plc.c"];
        let path = compile(folder.path(), &sources, &[&here]);
        match (HostedProgram::load(&path, &[]), data_type) {
            (Err(error), "TIME" | "DATE" | "TOD" | "DT" | "STRING") => {
                assert!(
                    error
                        .to_string()
                        .contains("has no place in a process image"),
                    "{error}"
                );
            }
            (Ok(program), _) => assert!(program.output_bytes() > 0),
            (Err(error), _) => panic!("{error}"),
        }
    }
}

/// The C header and its mirror here must not diverge.
#[test]
fn the_version_of_the_header_is_the_one_that_is_spoken() {
    let header = include_str!("../../../plc/glue/tickbus_plc.h");
    assert!(header.contains("#define TICKBUS_PLC_VERSION 1u\n"));
}
