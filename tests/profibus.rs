//! `tickbus profibus`, as its users call it.
#![cfg(unix)]
#![allow(missing_docs, reason = "tests")]

#[path = "peers/pty.rs"]
mod pty;

use std::fs::{self, OpenOptions};
use std::io::Write as _;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::Duration;

use rustix::process::{Pid, Signal, kill_process};
use tickbus_conformance::rig::await_that;

/// Start-up and one exchange of a station at 8, by the master 2.
const TELEGRAMS: [&[u8]; 7] = [
    &[0xDC, 2, 2],
    &[0x68, 5, 5, 0x68, 0x88, 0x82, 0x6D, 60, 62, 0xF1, 0x16],
    &[
        0x68, 11, 11, 0x68, 0x82, 0x88, 8, 62, 60, 2, 5, 0, 0xFF, 0x47, 0x11, 0xEA, 0x16,
    ],
    &[0x68, 5, 5, 0x68, 8, 2, 0x5D, 0x12, 0x34, 0xAD, 0x16],
    &[0x68, 5, 5, 0x68, 2, 8, 8, 0x56, 0x78, 0xE0, 0x16],
    &[0x10, 0x08, 0x02, 0x49, 0x53, 0x16],
    &[0x10, 0x02, 0x08, 0x00, 0x0A, 0x16],
];

#[test]
fn the_monitor_tells_who_is_there_and_keeps_every_telegram() {
    let folder = tempfile::tempdir().expect("a folder");
    let (log, pcap) = (
        folder.path().join("line.log"),
        folder.path().join("line.pcap"),
    );
    let line = pty::Line::new();
    let monitor = Command::new(env!("CARGO_BIN_EXE_tickbus"))
        .args(["profibus", "monitor", "--baud", "500000", "--telegrams"])
        .arg(line.end(0))
        .arg("--log")
        .arg(&log)
        .arg("--pcap")
        .arg(&pcap)
        .stdout(Stdio::piped())
        .spawn()
        .expect("it runs");
    let mut end = OpenOptions::new()
        .write(true)
        .open(line.end(1))
        .expect("the other end");
    await_that("it has written its log", || {
        for telegram in TELEGRAMS {
            end.write_all(telegram).expect("a line");
        }
        std::thread::sleep(Duration::from_millis(20));
        fs::read_to_string(&log).is_ok_and(|log| log.contains("8 -> 2 ok"))
    });
    let pid = i32::try_from(monitor.id())
        .ok()
        .and_then(Pid::from_raw)
        .expect("a process");
    kill_process(pid, Signal::TERM).expect("it is there");
    let output = monitor.wait_with_output().expect("it ends");
    assert!(output.status.success(), "{output:?}");
    let told = String::from_utf8(output.stdout).expect("UTF-8");
    for words in [
        "2 -> 2 token",
        "2 -> 8 Slave_Diag",
        "8 -> 2 Slave_Diag: data 02 05 00 FF 47 11",
        "2 -> 8 Data_Exchange 12 34",
        "8 -> 2 data 56 78",
        "master   2  requests ",
        "slave    8  exchanges data   master 2  requests ",
        "unanswered 0  repeated 0  late 0  reply median ",
    ] {
        assert!(told.contains(words), "{words}\n{told}");
    }
    packets(&fs::read(&pcap).expect("a file"));
}

/// A machine's own driver.cfg will do: what it would write is left alone.
#[test]
fn observe_records_both_sides_of_an_exchange_by_the_driver_cfg_of_the_machine_and_sends_nothing() {
    let folder = tempfile::tempdir().expect("a folder");
    let line = pty::Line::new();
    let text = format!(
        "[driver]\nid = 1\nname = \"x\"\n[fieldbus]\nkind = \"profibus-device\"\ndevice = \"{}\"\n\
         baud = 500000\nmax_tsdr = 1000\naddress = 8\nident = 0x4711\nconfig = [0x50, 0x60]\n\
         [[signal]]\nname = \"out\"\naddress = \"%QW0\"\ntype = \"WORD\"\nfail_safe = 1\n\
         [[signal]]\nname = \"in\"\naddress = \"%IW0\"\ntype = \"WORD\"\n",
        line.end(0).display()
    );
    fs::write(folder.path().join("x.cfg"), text).expect("a file");
    let observer = Command::new(env!("CARGO_BIN_EXE_tickbus"))
        .args(["observe", "x.cfg", "--record", "run.csv", "--stats"])
        .current_dir(folder.path())
        .stdout(Stdio::piped())
        .spawn()
        .expect("it runs");
    let mut end = OpenOptions::new()
        .write(true)
        .open(line.end(1))
        .expect("the other end");
    let (recording, both) = (folder.path().join("run.csv"), ",4660,22136");
    await_that("both sides are recorded", || {
        for telegram in TELEGRAMS {
            end.write_all(telegram).expect("a line");
        }
        std::thread::sleep(Duration::from_millis(20));
        fs::read_to_string(&recording).is_ok_and(|text| text.contains(both))
    });
    let pid = i32::try_from(observer.id())
        .ok()
        .and_then(Pid::from_raw)
        .expect("a process");
    kill_process(pid, Signal::TERM).expect("it is there");
    let output = observer.wait_with_output().expect("it ends");
    assert!(output.status.success(), "{output:?}");
    let told = String::from_utf8(output.stdout).expect("UTF-8");
    for words in [
        "observe: running: observing what master 2 exchanges\n",
        "\ndiagnosis=8: Station_Not_Ready, Prm_Req: 02 05 00 FF 47 11\n",
        "\nline.octets_out=0\n",
        "\nwrites=never\n",
    ] {
        assert!(told.contains(words), "{words}\n{told}");
    }
    assert_eq!(line.octets(0), 0);
}

/// The head of a pcap file, and the first packets, which are the telegrams.
fn packets(file: &[u8]) {
    let word = |at: usize| u32::from_le_bytes(file[at..at + 4].try_into().expect("4 bytes"));
    assert_eq!((word(0), word(20)), (0xA1B2_3C4D, 147));
    let mut at = 24;
    let mut found = Vec::new();
    while at < file.len() {
        let length = word(at + 8) as usize;
        assert_eq!(word(at + 8), word(at + 12));
        found.push(&file[at + 16..at + 16 + length]);
        at += 16 + length;
    }
    for telegram in TELEGRAMS {
        assert!(found.contains(&telegram), "{telegram:02X?}");
    }
}

#[test]
fn the_monitor_says_what_is_wrong_with_its_port() {
    let output = Command::new(env!("CARGO_BIN_EXE_tickbus"))
        .args(["profibus", "monitor", "/dev/no-such-port"])
        .output()
        .expect("it runs");
    assert_eq!(output.status.code(), Some(3));
    let told = String::from_utf8_lossy(&output.stderr);
    assert!(
        told.contains("cannot open /dev/no-such-port at 19200 baud, 8E1"),
        "{told}"
    );
}

fn advise(file: &Path) -> std::process::Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_tickbus"));
    command
        .args(["profibus", "advise", "--count", "100"])
        .arg(file);
    command.output().expect("it runs")
}

#[test]
fn the_advice_has_a_slot_time_for_each_rate_of_user_space() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("driver.cfg");
    let text = "[driver]\nid = 1\nname = \"x\"\n[fieldbus]\nkind = \"profibus-device\"\ndevice = \"/dev/no-such-port\"\n\
                address = 3\nident = 1\n[[signal]]\nname = \"s\"\naddress = \"%QX0.0\"\n";
    fs::write(&file, text).expect("a file");
    let output = advise(&file);
    let told = String::from_utf8_lossy(&output.stdout);
    assert!(output.status.success(), "{output:?}");
    for words in [
        "100 requests, median ",
        "/dev/no-such-port is not there now",
        "MaxTsdr  slot time\n",
    ] {
        assert!(told.contains(words), "{words}\n{told}");
    }
    for rate in ["     9600  ", "    19200  ", "   187500  ", "   500000  "] {
        assert!(told.contains(rate), "{rate}\n{told}");
    }
    let other = text
        .replace("profibus-device", "socket")
        .replace("device = ", "# ");
    let other = other.replace("address = 3\nident = 1", "address = \"127.0.0.1:0\"");
    fs::write(&file, other).expect("a file");
    let output = advise(&file);
    assert_eq!(output.status.code(), Some(1));
    let told = String::from_utf8_lossy(&output.stderr);
    assert!(
        told.contains("the bus is \"socket\"; name the driver.cfg of a \"profibus-device\""),
        "{told}"
    );
}
