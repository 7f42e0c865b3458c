//! Diagnoses that the simulation raises, read by profirust. (The integration tests have pyprofibus read some.)
#![cfg(unix)]

use crate::peer::{Master, Seen};
use crate::pty;
use crate::rig::{KINDS, OnPort, device, exchange, project, until, until_exchanging};
use profirust::dp::PeripheralEvent;
use tickbus_base::time::Monotonic;
use tickbus_conformance::rig::{End, config, logged};

const WATCHDOG_ON: u16 = 0x0800;
const EXT_DIAG: u16 = 0x0008;
const STAT_DIAG: u16 = 0x0200;

#[test]
fn a_fault_raises_a_diagnosis_which_the_master_reads_once_and_takes_it_back() {
    logged::expect("injected fault");
    let line = pty::Line::new();
    let mut device = device(&line);
    let master = Master::run(line.end(1), project());
    until_exchanging(&mut device, &master);
    for (fault, block) in [
        // Four bytes of inputs in words, and the same of outputs.
        (
            "slot = 1\nchannel = 5\nerror = \"line-break\"",
            &[0x80, 0x45, 0xA6][..],
        ),
        ("slot = 2\nchannel = 0", &[0x81, 0x80, 0xA9]),
        ("slot = 2", &[0x42, 0b10]),
        ("octets = [0x11, 0x22]", &[0x03, 0x11, 0x22]),
    ] {
        // On a busy machine the master can lose the station. It reads the diagnosis when it finds the station again, too, and
        // does not report that, so such a round does not count.
        let is_read_once = (0..5).any(|_| {
            let others = |seen: &Seen| {
                let events = seen.events.iter();
                events
                    .filter(|event| **event != PeripheralEvent::Diagnostics)
                    .count()
            };
            let before = master.first(|seen| (seen.diagnoses, others(seen)));
            let text = format!("kind = \"diagnosis\"\n{fault}");
            let id = device.driver.inject_text(&text).expect("a right fault");
            until(&mut device, "the master has read it", |_| {
                master.first(|seen| seen.diagnosis == (WATCHDOG_ON | EXT_DIAG, block.to_vec()))
            });
            // The data exchange continues, and nobody reads the diagnosis again.
            exchange(&mut device, &master, 7);
            exchange(&mut device, &master, 8);
            let after = master.first(|seen| (seen.diagnoses, others(seen)));
            assert!(device.driver.end_fault(id));
            until(&mut device, "the master has read that it is over", |_| {
                master.first(|seen| seen.diagnosis == (WATCHDOG_ON, Vec::new()))
            });
            if after.1 == before.1 {
                assert_eq!(after.0, before.0 + 1, "{fault}");
            }
            after.1 == before.1
        });
        assert!(is_read_once, "the master loses the station all the time");
    }
}

#[test]
fn the_master_goes_on_reading_a_static_diagnosis() {
    logged::expect("injected fault");
    let line = pty::Line::new();
    let mut device = device(&line);
    let master = Master::run(line.end(1), project());
    until_exchanging(&mut device, &master);
    let text = "kind = \"diagnosis\"\nslot = 1\nstatic = true";
    let id = device.driver.inject_text(text).expect("a right fault");
    until(&mut device, "it is read again and again", |_| {
        master.first(|seen| seen.diagnosis.0 & STAT_DIAG != 0 && seen.diagnoses > 10)
    });
    assert!(device.driver.end_fault(id));
    until(&mut device, "it is over", |_| {
        master.first(|seen| seen.diagnosis == (WATCHDOG_ON, Vec::new()))
    });
    exchange(&mut device, &master, 3);
}

#[test]
fn a_fault_of_the_driver_cfg_begins_with_what_the_plc_does() {
    logged::expect("injected fault");
    let line = pty::Line::new();
    let bus = OnPort(line.end(0).display().to_string());
    let fault = "[[fault]]\nkind = \"diagnosis\"\nslot = 1\nchannel = 0\nerror = \"overload\"\n\
                 while = \"speed > 100\"\n";
    let text = format!("{}\n{fault}", config(&bus, "device", ""));
    let mut device = End::open(&text, &Monotonic::shared(), &KINDS);
    let master = Master::run(line.end(1), project());
    until_exchanging(&mut device, &master);
    for (number, extended) in [(101, &[0x80, 0x40, 0xA4][..]), (99, &[])] {
        exchange(&mut device, &master, number);
        until(&mut device, "the master is told", |_| {
            master.first(|seen| seen.diagnosis.1 == extended)
        });
    }
}
