//! The bus `profibus-device` with pyprofibus, a DP master in Python, at the other end. (The tests in the bus's own
//! crate use profirust.)
#![allow(missing_docs, clippy::float_cmp, reason = "a test")]

#[path = "foreign/harness/mod.rs"]
mod foreign;
#[cfg(unix)]
#[path = "peers/pty.rs"]
mod pty;

use std::fmt::Write as _;
use std::process::ExitCode;
#[cfg(unix)]
use std::sync::{Mutex, MutexGuard, PoisonError};

use foreign::Absent;
#[cfg(unix)]
use foreign::machine::Machine;
use tickbus::fieldbus::profibus::Gsd;
#[cfg(unix)]
use tickbus_conformance::rig::{logged, statistic};

/// Each master polls without a pause, in real time where that is allowed: one at a time, or they starve each other.
#[cfg(unix)]
fn alone() -> MutexGuard<'static, ()> {
    static MASTER: Mutex<()> = Mutex::new(());
    MASTER.lock().unwrap_or_else(PoisonError::into_inner)
}

fn main() -> ExitCode {
    foreign::main(&[(
        "pyprofibus",
        &[
            ("pyprofibus_reads_gsd_files_as_we_do", reads),
            #[cfg(unix)]
            (
                "pyprofibus_takes_our_gsd_files_exchanges_and_reads_diagnoses_at_every_rate_of_user_space",
                exchanges,
            ),
            #[cfg(unix)]
            (
                "pyprofibus_carries_requests_for_records_while_it_exchanges_data",
                records,
            ),
            #[cfg(unix)]
            ("pyprofibus_reads_alarms_and_acknowledges_them", alarms),
            #[cfg(unix)]
            (
                "pyprofibus_runs_a_drive_up_and_down_and_acknowledges_its_fault",
                drives,
            ),
            #[cfg(unix)]
            (
                "pyprofibus_reads_the_weighing_terminal_of_examples_devices",
                weighs,
            ),
        ],
    )])
}

#[cfg(unix)]
fn exchanges() -> Result<(), Absent> {
    const SCRIPT: &str = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/tests/peers/profibus_master.py"
    );
    let _alone = alone();
    let folder = tempfile::tempdir().expect("a folder");
    let encoder = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/gsd/encoder.gsd");
    let by_gsd = format!("gsd = \"{encoder}\"");
    let own = folder.path().join("own.gsd");
    let own = own.to_str().expect("UTF-8");
    for (baud, device, gsd, module) in [
        ("9600", &*by_gsd, encoder, "4 bytes in and out"),
        ("19200", &*by_gsd, encoder, "4 bytes in and out"),
        ("187500", &*by_gsd, encoder, "4 bytes in and out"),
        ("500000", &*by_gsd, encoder, "4 bytes in and out"),
        // With the file that "tickbus gsd" writes.
        (
            "500000",
            "ident = 0x80E1\nconfig = [0xF1]",
            own,
            "2 words in and out, consistent",
        ),
    ] {
        let mut master = foreign::python_with("main", &["pyprofibus", "serial"])?;
        // A new port each time: a port that was opened with parity cannot be opened again with the same settings.
        let line = pty::Line::new();
        let port = line.end(0).display();
        let text = format!(
            "[driver]\nid = 1\nname = \"encoder\"\n[fieldbus]\nkind = \"profibus-device\"\ndevice = \"{port}\"\n\
             baud = {baud}\nmax_tsdr = 16000\nmax_age = \"5s\"\naddress = 8\n{device}\n\
             [[signal]]\nname = \"out\"\naddress = \"%QD0\"\ntype = \"UDINT\"\n\
             [[signal]]\nname = \"in\"\naddress = \"%ID0\"\ntype = \"UDINT\"\n\
             [[fault]]\nkind = \"diagnosis\"\nslot = 1\nchannel = 3\nerror = \"line-break\"\n\
             while = \"out > {}\"\n",
            100 << 24
        );
        if gsd == own {
            write_gsd(folder.path(), &text, own);
        }
        let mut machine = Machine::open(&text);
        machine.until("it listens", |machine| {
            statistic(&machine.driver, "device").is_some()
        });
        master.arg(SCRIPT).arg(line.end(1));
        master.args([baud, "8", gsd, module]);
        let told = machine.until_the_end_of(master, |machine| {
            machine.tick();
            let value = machine.get("out");
            machine.set("in", value);
        });
        assert!(told.contains("profibus_master: ok exchanges="), "{told}");
        // Ext_Diag, the watchdog, the master; and finally a block about a channel.
        let diagnoses = told.rsplit("diagnoses=").next();
        let diagnoses = diagnoses.and_then(|rest| rest.split_whitespace().next());
        let diagnoses = diagnoses.unwrap_or_default();
        let (first, last) = diagnoses
            .split_once(',')
            .unwrap_or_else(|| panic!("{told}"));
        assert!(first.starts_with("000c0002") && first.len() == 12, "{told}");
        assert!(last.starts_with("080c0002") && last.len() == 18, "{told}");
        assert_eq!(last[12..14], *"80", "{told}");
        println!("{baud} baud, {module}: {}", told.trim());
    }
    Ok(())
}

/// The IND570 of examples/devices: its weight, its indicator and its acknowledgement, as a PLC's program reads them.
#[cfg(unix)]
fn weighs() -> Result<(), Absent> {
    let _alone = alone();
    let mut master = foreign::python_with("main", &["pyprofibus", "serial"])?;
    let line = pty::Line::new();
    let example = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/examples/devices/ind570/driver.cfg"
    );
    let text = std::fs::read_to_string(example).expect("an example");
    let port = line.end(0).display().to_string();
    // The master waits longer here than on a line.
    let text = text.replace("/dev/ttyUSB0", &port).replace(
        "baud    = 19200",
        "baud    = 19200\nmax_tsdr = 16000\nmax_age = \"5s\"",
    );
    let folder = tempfile::tempdir().expect("a folder");
    let gsd = folder.path().join("ind570.gsd");
    let gsd = gsd.to_str().expect("UTF-8");
    write_gsd(folder.path(), &text, gsd);
    let mut machine = Machine::open(&text);
    machine.until("it listens", |machine| {
        statistic(&machine.driver, "device").is_some()
    });
    master.arg(concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/tests/peers/ind570.py"
    ));
    master.arg(line.end(1));
    master.args(["19200", "3", gsd, "4 words in and out"]);
    let told = machine.until_the_end_of(master, |machine| {
        machine.set("Weight", 51.67);
        machine.tick();
    });
    assert!(told.contains("ind570: ok weight=51.67"), "{told}");
    Ok(())
}

/// Signals and fixed octets in records, of a machine whose GSD file is ours.
#[cfg(unix)]
fn records() -> Result<(), Absent> {
    const SCRIPT: &str = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/tests/peers/profibus_records.py"
    );
    let _alone = alone();
    let folder = tempfile::tempdir().expect("a folder");
    let own = folder.path().join("own.gsd");
    let own = own.to_str().expect("UTF-8");
    let mut master = foreign::python_with("main", &["pyprofibus", "serial"])?;
    let line = pty::Line::new();
    let port = line.end(0).display();
    let text = format!(
        "[driver]\nid = 1\nname = \"Drive 4\"\n[fieldbus]\nkind = \"profibus-device\"\ndevice = \"{port}\"\n\
         baud = 500000\nmax_tsdr = 16000\nmax_age = \"5s\"\naddress = 8\n\
         ident = 0x80E1\nconfig = [0xF1]\nrecords = [\"slot 0 record 10 = 01 02\"]\n\
         identity = {{ manufacturer = 42, serial = \"T-C1\" }}\n\
         parameters = [\"945 Unsigned16 = 1355 0 0 0 0 0 0 0\"]\n\
         [[signal]]\nname = \"out\"\naddress = \"%QD0\"\ntype = \"UDINT\"\n\
         [[signal]]\nname = \"in\"\naddress = \"%ID0\"\ntype = \"UDINT\"\n\
         [[signal]]\nname = \"ramp\"\naddress = \"%QW4\"\ntype = \"INT\"\n\
         [[signal]]\nname = \"warmth\"\naddress = \"%IW4\"\ntype = \"INT\"\n\
         [[signal]]\nname = \"warm\"\naddress = \"%IX6.0\"\n\
         [[signal]]\nname = \"time\"\naddress = \"%QD8\"\ntype = \"REAL\"\n\
         [fieldbus.at]\ntime = \"parameter 1121\"\nramp = \"slot 1 record 10 %QW0\"\nwarmth = \"slot 1 record 11 %IW0\"\n\
         warm = \"slot 1 record 11 %IX2.7\"\n"
    );
    write_gsd(folder.path(), &text, own);
    let mut machine = Machine::open(&text);
    machine.until("it listens", |machine| {
        statistic(&machine.driver, "device").is_some()
    });
    master.arg(SCRIPT).arg(line.end(1));
    master.args(["500000", "8", own, "2 words in and out, consistent"]);
    for refused in [
        "cannot read record 12 of slot 1",
        "cannot read record 10 of slot 5",
        "cannot write record 10 of slot 1",
    ] {
        logged::expect(refused);
    }
    let ramps = std::cell::RefCell::new(Vec::new());
    let told = machine.until_the_end_of(master, |machine| {
        machine.tick();
        let value = machine.get("out");
        machine.set("in", value);
        machine.set("warmth", 300.0);
        machine.set("warm", 1.0);
        let ramp = machine.get("ramp");
        let mut ramps = ramps.borrow_mut();
        if ramps.last() != Some(&ramp) {
            ramps.push(ramp);
        }
    });
    let initiate = "5700000000640100000000000002000200000000";
    let expected = [
        "5e010af0 5e010a020000".to_owned(),
        "5f010a021234 5f010a02".to_owned(),
        "5e010af0 5e010a021234".to_owned(),
        "5e010bf0 5e010b03012c80".to_owned(),
        "5e010cf0 de80b000".to_owned(),
        "5e050af0 de80b200".to_owned(),
        "5f010a0112 df80b100".to_owned(),
        "5f000a020102 5f000a02".to_owned(),
        "5f00ff040800fde8 5f00ff04".to_owned(),
        // I&M0: 42, "ident 80E1", "T-C1".
        "5e00ff44 5e00ff440800fde800000000000000000000002a6964656e74203830453120202020202020202020542d433120202020202020\
         20202020200001560100000000f60000000101000e"
            .to_owned(),
        // The examples of a maker's manuals: eight faults are read, and a time is changed to 12.15.
        "5f012f0a25010201100803b10000 5f012f0a".to_owned(),
        "5e012ff0 5e012f16250102010608054b0000000000000000000000000000".to_owned(),
        "5f012f1080020101100104610000080141426666 5f012f10".to_owned(),
        "5e012ff0 5e012f0480020101".to_owned(),
        format!("{initiate} 563000c8"),
        "57f00100000000000002000200000000".to_owned(),
        format!("{initiate} 562f00c8"),
        "57f00100000000000002000200000000".to_owned(),
        format!("{initiate} rr"),
        "5e010af0 5e010a021234".to_owned(),
        "5f010a025678 5f010a02".to_owned(),
        "48 48".to_owned(),
        "5101010101 d180a900".to_owned(),
        "580020 rs".to_owned(),
        "5e010af0 rs".to_owned(),
        "profibus_records: ok".to_owned(),
    ];
    let expected = expected.join("\n");
    assert!(told.contains(&expected), "expected {expected}\ntold {told}");
    assert!((machine.get("time") - 12.15).abs() < 1e-6);
    assert_eq!(
        ramps.into_inner(),
        [0.0, f64::from(0x1234), f64::from(0x5678)]
    );
    Ok(())
}

/// Alarms of a driver.cfg, raised by a signal, one of each type at a time.
#[cfg(unix)]
fn alarms() -> Result<(), Absent> {
    let _alone = alone();
    let folder = tempfile::tempdir().expect("a folder");
    let own = folder.path().join("own.gsd");
    let own = own.to_str().expect("UTF-8");
    let mut master = foreign::python_with("main", &["pyprofibus", "serial"])?;
    let line = pty::Line::new();
    let port = line.end(0).display();
    let alarm = |rest: &str, above: u32| {
        format!(
            "[[fault]]\nkind = \"diagnosis\"\n{rest}\nwhile = \"out > {}\"\n",
            above << 24
        )
    };
    let faults = [
        alarm("alarm = \"process\"\nslot = 1\noctets = [0x11, 0x22]", 100),
        alarm("alarm = \"process\"\nslot = 2", 100),
        alarm("alarm = \"diagnosis\"\nslot = 3", 200),
    ];
    let text = format!(
        "[driver]\nid = 1\nname = \"Cell\"\n[fieldbus]\nkind = \"profibus-device\"\ndevice = \"{port}\"\n\
         baud = 500000\nmax_tsdr = 16000\nmax_age = \"5s\"\naddress = 8\nident = 0x80E1\nconfig = [0xF1]\n\
         records = [\"slot 0 record 1 = 00\"]\n\
         [[signal]]\nname = \"out\"\naddress = \"%QD0\"\ntype = \"UDINT\"\n\
         [[signal]]\nname = \"in\"\naddress = \"%ID0\"\ntype = \"UDINT\"\n{}",
        faults.concat()
    );
    write_gsd(folder.path(), &text, own);
    let mut machine = Machine::open(&text);
    machine.until("it listens", |machine| {
        statistic(&machine.driver, "device").is_some()
    });
    master.arg(concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/tests/peers/profibus_alarms.py"
    ));
    master.arg(line.end(1));
    master.args(["500000", "8", own, "2 words in and out, consistent"]);
    let told = machine.until_the_end_of(master, |machine| {
        machine.tick();
        let value = machine.get("out");
        machine.set("in", value);
    });
    let expected = [
        "00 060201001122",
        "5c010208 dc80b500",
        "5c010200 5c010200",
        "00 04020200",
        "08 04010301",
        "5c020200 5c020200",
        "5c030101 5c030101",
        "00 04010302",
        "5c030102 5c030102",
        "5c030102 dc80b500",
        "profibus_alarms: ok",
    ];
    let expected = expected.join("\n");
    assert!(told.contains(&expected), "expected {expected}\ntold {told}");
    Ok(())
}

/// A `[[drive]]` on telegram 1, whose motor is too hot while a quarter of its speed is wanted.
#[cfg(unix)]
fn drives() -> Result<(), Absent> {
    let _alone = alone();
    let folder = tempfile::tempdir().expect("a folder");
    let own = folder.path().join("own.gsd");
    let own = own.to_str().expect("UTF-8");
    let mut master = foreign::python_with("main", &["pyprofibus", "serial"])?;
    let line = pty::Line::new();
    let port = line.end(0).display();
    let text = format!(
        "[driver]\nid = 1\nname = \"Drive\"\n[fieldbus]\nkind = \"profibus-device\"\ndevice = \"{port}\"\n\
         baud = 500000\nmax_tsdr = 16000\nmax_age = \"5s\"\naddress = 8\nident = 0x80E1\nconfig = [0xF1]\n\
         parameters = [\"2000 FloatingPoint = 1500\", \"1120 FloatingPoint = 1\", \"2050 Unsigned16 = %QW0 %QW2\",\n\
         \"2053 Unsigned16 = %IW0 %IW2\"]\n\
         [[signal]]\nname = \"hot\"\naddress = \"%IX4.0\"\n\
         [fieldbus.at]\nhot = \"slot 0 record 100 %IX0.0\"\n\
         [[drive]]\nname = \"Spindle\"\ntelegram = 1\nreference_speed = 1500\nfault = \"hot\"\nwarning = \"hot\"\n\
         ramp_up = \"1s\"\nramp_down = \"3s\"\nquick_stop = \"200ms\"\ncoast = \"300ms\"\n"
    );
    write_gsd(folder.path(), &text, own);
    let mut machine = Machine::open(&text);
    machine.until("it listens", |machine| {
        statistic(&machine.driver, "device").is_some()
    });
    master.arg(concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/tests/peers/profibus_drive.py"
    ));
    master.arg(line.end(1));
    master.args(["500000", "8", own, "2 words in and out, consistent"]);
    let fastest = std::cell::Cell::new(0.0_f64);
    let told = machine.until_the_end_of(master, |machine| {
        machine.tick();
        let wanted = machine.get("Spindle.NSOLL_A");
        machine.set("hot", f64::from(u8::from((wanted - 375.0).abs() < 1.0)));
        fastest.set(fastest.get().max(machine.get("Spindle.NIST_A")));
    });
    // p2000 and p1120; r2050 and r2053, as after OFF3 and ON, which is no way out of S1.
    let parameters = "5e002ff0 5e002f1c01010104080144bb800008013f8000000602047f40000602e3700000";
    assert!(told.contains(parameters), "{told}");
    assert!(told.contains("profibus_drive: ok"), "{told}");
    assert_eq!(fastest.get(), 1500.0, "{told}");
    Ok(())
}

/// Runs `tickbus gsd` on this driver.cfg.
#[cfg(unix)]
fn write_gsd(folder: &std::path::Path, text: &str, to: &str) {
    let file = folder.join("driver.cfg");
    std::fs::write(&file, text).expect("a file");
    let mut command = std::process::Command::new(env!("CARGO_BIN_EXE_tickbus"));
    let output = command.arg("gsd").arg(&file).output().expect("it runs");
    assert!(output.status.success(), "{output:?}");
    std::fs::write(to, output.stdout).expect("a file");
}

/// pyprofibus and our reader agree about a file and its modules.
fn reads() -> Result<(), Absent> {
    for (file, modules) in [
        (
            "own_machine.gsd",
            &[
                "1 word in",
                "1 word out",
                "1 word in",
                "4 bytes in, consistent",
                "module 4: 2 in, 8 out",
            ][..],
        ),
        (
            "own_machine.gsd",
            &["16 bytes in", "4 bytes in", "1 byte out"],
        ),
        ("valves.gsd", &[]),
        ("encoder.gsd", &[]),
        ("drive.gsd", &["Empty", "Position, 4 bytes"]),
    ] {
        let path = format!("{}/tests/gsd/{file}", env!("CARGO_MANIFEST_DIR"));
        let mut peer = foreign::python_with("main", &["pyprofibus"])?;
        peer.arg(concat!(
            env!("CARGO_MANIFEST_DIR"),
            "/tests/peers/profibus_gsd.py"
        ));
        let output = peer.arg(&path).args(modules).output().expect("it runs");
        let gsd = Gsd::read(&std::fs::read(&path).expect("the file")).expect("a right file");
        let mut theirs = String::from_utf8(output.stdout).expect("UTF-8");
        let modules: Vec<String> = modules.iter().map(|name| (*name).to_owned()).collect();
        // pyprofibus does not know slots.
        let identity = Gsd {
            slots: Vec::new(),
            ..gsd.clone()
        }
        .identity(&modules);
        let identity = identity.expect("its modules");
        let hex = |octets: &[u8]| {
            octets.iter().fold(String::new(), |mut text, octet| {
                write!(text, "{octet:02x}").expect("a String takes all");
                text
            })
        };
        let mut ours = format!(
            "ident {:04x}\nconfig {}\n",
            identity.ident,
            hex(identity.configuration.bytes())
        );
        for (rate, wait) in gsd.rates.iter().filter(|(rate, _)| **rate <= 500_000) {
            // If the file does not state the wait, pyprofibus does not guess.
            if theirs.contains(&format!("tsdr {rate} ")) {
                writeln!(ours, "tsdr {rate} {wait}").expect("a String takes all");
            }
        }
        if file == "drive.gsd" {
            // pyprofibus fills in only the constants.
            theirs.truncate(theirs.find("parameters").expect("the last line"));
        } else {
            writeln!(ours, "parameters {}", hex(identity.user.defaults()))
                .expect("a String takes all");
        }
        assert_eq!(
            ours,
            theirs,
            "{file}: {}",
            String::from_utf8_lossy(&output.stderr)
        );
    }
    Ok(())
}
