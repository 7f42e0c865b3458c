//! An observer at a third end of the line between profirust, an independent DP master, and our stations.
#![cfg(unix)]

use std::fs::OpenOptions;
use std::io::Write as _;
use std::time::Duration;

use crate::peer::{Master, Project, Slave};
use crate::pty;
use crate::rig::{ADDRESS, KINDS, OnPort, device, exchange, project, slave, until};
use tickbus_base::time::Monotonic;
use tickbus_bus_profibus::telegram::{Control, Frame};
use tickbus_conformance::rig::{End, config, logged};
use tickbus_driver::Code;
use tickbus_fieldbus::{Cause, LinkState};
use tickbus_record::{Recording, Tick};

/// The driver.cfg of an observer at this end of the line, with this device and further sections.
fn text(line: &pty::Line, end: usize, identity: &str, sections: &str) -> String {
    let bus = OnPort(line.end(end).display().to_string());
    let text = config(&bus, "observer", "");
    let own = "ident = 0x80e0\nconfig = [0x52, 0x62]";
    assert!(text.contains(own), "{text}");
    let text = text.replace(own, identity);
    let kept = text.lines().filter(|line| {
        !["fail_safe", "max_tsdr"]
            .iter()
            .any(|key| line.starts_with(key))
    });
    let kept: Vec<&str> = kept.collect();
    format!("{}\n{sections}", kept.join("\n"))
}

fn observer(line: &pty::Line, end: usize, identity: &str) -> End {
    let text = text(line, end, identity, "");
    End::open(&text, &Monotonic::shared(), &KINDS)
}

const OWN: &str = "ident = 0x80E0\nconfig = [0x52, 0x62]";

/// Lets the ends exchange numbers until the observer sees both of them.
#[track_caller]
fn seen(observer: &mut End, device: &mut End, master: &Master, number: u8) {
    exchange(device, master, number);
    until(observer, "both numbers are observed", |observer| {
        let both = ["speed", "position"].map(|name| observer.get(name));
        both == [f64::from(number); 2]
    });
}

#[track_caller]
fn until_told(observer: &mut End, cause: Cause, words: &str) {
    until(observer, words, |observer| {
        let link = observer.link();
        link.cause == cause && link.reason.contains(words)
    });
    assert_ne!(observer.tick().code, Code::Fresh);
}

#[test]
fn what_master_and_station_exchange_is_seen_and_recorded_and_not_one_octet_is_sent() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("line.vcd");
    let line = pty::Line::with_ends(3);
    let record = format!("[record]\nfile = {:?}\n", file.display().to_string());
    let text = text(&line, 2, OWN, &record);
    let mut observer = End::open(&text, &Monotonic::shared(), &KINDS);
    let mut device = device(&line);
    let master = Master::run(line.end(1), project());
    for number in 1..=20 {
        seen(&mut observer, &mut device, &master, number);
    }
    // Values that this end has in its slots go nowhere.
    for name in ["speed", "position"] {
        observer.set(name, 99.0);
    }
    seen(&mut observer, &mut device, &master, 21);
    assert_eq!(observer.link().state, LinkState::Running);
    let reason = observer.link().reason;
    assert_eq!(reason, "observing what master 2 exchanges");
    for (key, value) in [
        ("role", "observer"),
        ("writes", "never"),
        ("exchanging", "8"),
        ("line.octets_out", "0"),
    ] {
        assert_eq!(observer.statistic(key), value, "{key}");
    }
    observer.driver.close();
    assert_eq!(line.octets(2), 0);
    assert!(line.octets(0) > 0 && line.octets(1) > 0);

    let mut recording = Recording::open(&file, None).expect("a recording");
    let columns = recording.columns().clone();
    assert_eq!(columns.role, "observer");
    let places = ["speed", "position"].map(|name| columns.position(name, false).expect(name));
    let addresses = places.map(|at| columns.columns[at].address.expect("it is told").to_string());
    assert_eq!(addresses, ["%QW2", "%IW2"]);
    let mut tick = Tick::new(&columns);
    let mut all = Vec::new();
    while recording.next(&mut tick).expect("a tick") {
        all.push(places.map(|at| tick.values[at].real()));
    }
    for number in 1..=21 {
        assert!(all.contains(&[f64::from(number); 2]), "{number}");
    }
}

#[test]
fn a_station_that_is_lost_is_stale_and_told_and_comes_back() {
    let line = pty::Line::with_ends(3);
    let mut observer = observer(&line, 2, OWN);
    until_told(&mut observer, Cause::Link, "nothing arrives on ");
    let mut first = device(&line);
    let master = Master::run(line.end(1), project());
    seen(&mut observer, &mut first, &master, 1);
    first.driver.close();
    let words = "station 8 no longer answers master 2";
    until_told(&mut observer, Cause::Link, words);
    assert_eq!(observer.statistic("exchanging"), "none");
    let mut second = device(&line);
    seen(&mut observer, &mut second, &master, 2);
    assert_eq!(observer.link().state, LinkState::Running);
    // The watchdog of the station.
    logged::expect("station 8: the master has been silent");
    drop(master);
    until_told(&mut observer, Cause::Link, "nothing arrives on ");
    assert_eq!(line.octets(2), 0);
}

#[test]
fn bytes_that_are_no_telegrams_are_told_with_the_rate() {
    let line = pty::Line::with_ends(2);
    let mut observer = observer(&line, 0, OWN);
    let mut end = OpenOptions::new();
    let mut end = end.write(true).open(line.end(1)).expect("an end");
    // As a line at another rate: among the bytes are short acknowledgements and tokens.
    let words = "is no telegram at 500000 baud; write the rate of the PLC's project in \"baud\"";
    until(&mut observer, words, |observer| {
        end.write_all(&[0xE5, 0x00, 0xDC, 0x02, 0x02, 0x80, 0x68, 0xF8])
            .expect("a line");
        let link = observer.link();
        link.cause == Cause::Protocol && link.reason.contains(words)
    });
    assert_ne!(observer.statistic("profibus-device.damaged"), "0");
}

#[test]
fn another_address_other_modules_and_another_device_are_told_and_no_value_is_made_up() {
    for (from, to, cause, words) in [
        (
            "address = 8",
            "address = 9",
            Cause::Link,
            "no master asks station 9, and the stations that answer are 8; correct \"address\"",
        ),
        (
            "[0x52, 0x62]",
            "[0x52, 0x61]",
            Cause::Refused,
            "master 2 starts up station 8 with other modules: slot 2: expected 61 (4 bytes of outputs), received 62 \
             (6 bytes of outputs)",
        ),
        (
            "0x80E0",
            "0x80E1",
            Cause::Refused,
            "station 8 is a device with the ident 80E0, expected 80E1",
        ),
    ] {
        let line = pty::Line::with_ends(3);
        let text = text(&line, 2, OWN, "").replace(from, to);
        // The signals fit into four bytes, too.
        let text = text.replace("%QW4", "%QB1").replace(
            "\"echo\"\naddress   = \"%QB1\"\ntype      = \"INT\"",
            "\"echo\"\naddress   = \"%QB1\"\ntype      = \"SINT\"",
        );
        let mut observer = End::open(&text, &Monotonic::shared(), &KINDS);
        let mut device = device(&line);
        let master = Master::run(line.end(1), project());
        exchange(&mut device, &master, 5);
        until_told(&mut observer, cause, words);
        exchange(&mut device, &master, 6);
        observer.tick();
        assert_eq!(observer.get("position"), 0.0, "{words}");
        assert_eq!(line.octets(2), 0);
    }
}

#[test]
fn an_observer_that_joins_a_running_line_tells_other_lengths_and_reads_longer_ones_by_the_signals()
{
    let line = pty::Line::with_ends(4);
    let mut device = device(&line);
    let master = Master::run(line.end(1), project());
    exchange(&mut device, &master, 3);
    // Six bytes each way on the line; the module of outputs has eight.
    let mut other = observer(&line, 2, "ident = 0x80E0\nconfig = [0x52, 0x63]");
    let words = "master 2 and station 8 exchange 6 bytes of outputs and 6 bytes of inputs, expected 8 and 6; write \
                 the modules of the PLC's project";
    until_told(&mut other, Cause::Refused, words);
    // Without modules, the signals say how many bytes there are at least.
    let text = text(&line, 3, "ident = 0x80E0", "");
    let text = text.replace(
        "\n[[signal]]\nname      = \"copy\"\naddress   = \"%IW4\"\ntype      = \"INT\"\n",
        "",
    );
    assert!(!text.contains("copy"));
    let mut by_signals = End::open(&text, &Monotonic::shared(), &KINDS);
    seen(&mut by_signals, &mut device, &master, 4);
    assert_eq!(line.octets(2) + line.octets(3), 0);
}

#[test]
fn of_two_stations_the_one_that_is_missing_is_told_and_the_other_one_is_fresh() {
    logged::expect("station 9 does not answer master 2");
    let line = pty::Line::with_ends(3);
    let mut device = device(&line);
    let both = Project {
        slaves: vec![
            slave(),
            Slave {
                address: 9,
                ..slave()
            },
        ],
        ..project()
    };
    let text = format!(
        "[driver]\nid = 1\nname = \"both\"\n[fieldbus]\nkind = \"profibus-device\"\nrole = \"observer\"\n\
         device = \"{}\"\nbaud = 500000\nmax_age = \"2s\"\n\
         [[station]]\nname = \"a\"\naddress = {ADDRESS}\n{OWN}\n[[station]]\nname = \"b\"\naddress = 9\n{OWN}\n\
         [[signal]]\nname = \"speed\"\nstation = \"a\"\naddress = \"%QW2\"\ntype = \"INT\"\n\
         [[signal]]\nname = \"position\"\nstation = \"a\"\naddress = \"%IW2\"\ntype = \"INT\"\n\
         [[signal]]\nname = \"missing\"\nstation = \"b\"\naddress = \"%IW2\"\ntype = \"INT\"\n",
        line.end(2).display()
    );
    let mut observer = End::open(&text, &Monotonic::shared(), &KINDS);
    let master = Master::run(line.end(1), both);
    seen(&mut observer, &mut device, &master, 7);
    until(&mut observer, "the missing one is told", |observer| {
        let reason = observer.link().reason;
        reason.contains("station 9 does not answer master 2")
    });
    seen(&mut observer, &mut device, &master, 8);
    assert_eq!(observer.statistic("exchanging"), "8");
    assert_eq!(observer.get("missing"), 0.0);
}

/// profirust stays in OPERATE: another master is played by hand.
#[test]
fn clear_makes_the_station_stale_at_once_and_operate_ends_it() {
    let line = pty::Line::with_ends(2);
    let text = text(&line, 0, "ident = 0x80E0\nconfig = [0x52, 0x62]", "");
    let text = text.replace("\"300ms\"", "\"60s\"");
    let mut observer = End::open(&text, &Monotonic::shared(), &KINDS);
    let mut end = OpenOptions::new();
    let mut end = end.write(true).open(line.end(1)).expect("an end");
    let frame = |to, from, control, dsap: Option<u8>, data: &[u8]| {
        let mut bytes = Vec::new();
        Frame {
            destination: to,
            source: from,
            control: Control(control),
            dsap,
            ssap: dsap.map(|_| 62),
            data,
        }
        .append(&mut bytes);
        bytes
    };
    let mut say = |command: Option<u8>, value: u8| {
        let control = command.map(|command| frame(127, 2, 0x46, Some(58), &[command, 0]));
        let telegrams = [
            control.unwrap_or_default(),
            frame(ADDRESS, 2, 0x5D, None, &[0, 0, 0, value, 0, 0]),
            frame(2, ADDRESS, 0x08, None, &[0, 0, 0, value, 0, 0]),
        ];
        end.write_all(&telegrams.concat()).expect("a line");
    };
    // The observer may open its port later than the first telegrams come.
    until(&mut observer, "it runs", |observer| {
        say(None, 1);
        observer.get("speed") == 1.0 && observer.get("position") == 1.0
    });
    say(Some(0x02), 0);
    until(&mut observer, "it is in CLEAR", |observer| {
        observer.link().cause == Cause::Stopped && observer.tick().code == Code::Stale
    });
    assert_eq!(observer.statistic("cpu"), "stop");
    say(Some(0x00), 3);
    until(&mut observer, "it runs again", |observer| {
        observer.get("speed") == 3.0 && observer.link().state == LinkState::Running
    });
}

#[test]
fn a_diagnosis_is_told() {
    logged::expect("injected fault");
    let line = pty::Line::with_ends(3);
    let mut observer = observer(&line, 2, OWN);
    let mut device = device(&line);
    let master = Master::run(line.end(1), project());
    seen(&mut observer, &mut device, &master, 1);
    let fault = "kind = \"diagnosis\"\nslot = 1\nchannel = 5\nerror = \"line-break\"";
    let id = device.driver.inject_text(fault).expect("a right fault");
    let diagnosis = |observer: &End| observer.statistic("diagnosis");
    let both = |device: &mut End, observer: &mut End, words: &str| {
        until(device, words, |_| {
            observer.tick();
            std::thread::sleep(Duration::from_millis(1));
            diagnosis(observer) == words
        });
    };
    both(
        &mut device,
        &mut observer,
        "8: Ext_Diag: 08 0C 00 02 80 E0 80 45 A6",
    );
    assert!(device.driver.end_fault(id));
    both(
        &mut device,
        &mut observer,
        "8: nothing wrong: 00 0C 00 02 80 E0",
    );
    seen(&mut observer, &mut device, &master, 2);
}
