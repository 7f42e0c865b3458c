//! A line in trouble: damaged telegrams, noise, a second master, lost tokens. The masters are profirust.
#![cfg(unix)]

use std::fmt::Write as _;
use std::fs::OpenOptions;
use std::io::{Read as _, Write as _};
use std::path::Path;
use std::time::Duration;

use crate::peer::{Master, Project, SLOT, Slave};
use crate::pty;
use crate::rig::{ADDRESS, KINDS, device, exchange, project, slave, until, until_exchanging};
use tickbus_base::time::Monotonic;
use tickbus_conformance::rig::{End, await_that, logged};

#[test]
fn damaged_and_cut_telegrams_and_noise_between_them_are_never_believed() {
    let line = pty::Line::new();
    let mut device = device(&line);
    line.damage_each(9);
    let master = Master::run(line.end(1), project());
    until_exchanging(&mut device, &master);
    let mut last = 0;
    for number in 1..=30 {
        // The same number twice, so that a torn or damaged telegram would show.
        master.first(|seen| seen.outputs[2..6].copy_from_slice(&[0, number, 0, number]));
        until(&mut device, "it arrives", |device| {
            let (speed, echo) = (device.get("speed"), device.get("echo"));
            // The fail-safe value, which only the speed has: the line was silent for too long.
            assert!(speed == echo || speed == -1.0, "{speed} {echo}");
            assert!([f64::from(last), f64::from(number), -1.0].contains(&speed) || last == 0);
            speed == f64::from(number)
        });
        last = number;
    }
    let damaged = device.statistic("profibus-device.damaged");
    assert_ne!(damaged, "0");
}

/// Sends unrequested bytes, in pieces, from a third end of the line.
fn babble(end: &Path, piece: impl Fn(u32) -> Vec<u8>) {
    let mut babbler = OpenOptions::new().write(true).open(end).expect("an end");
    for number in 0..300 {
        babbler.write_all(&piece(number)).expect("a line");
        std::thread::sleep(Duration::from_millis(1));
    }
}

/// An endless request to the station, half a telegram after another one, and the tokens and requests of a master that
/// has gone mad.
#[test]
fn a_babbling_master_does_not_hinder_the_next_exchange() {
    let pieces: [fn(u32) -> Vec<u8>; 3] = [
        |_| vec![0x68, 200, 200, 0x68, ADDRESS, 2, 0x5D],
        |number| {
            number
                .to_be_bytes()
                .iter()
                .map(|byte| byte.wrapping_mul(37))
                .collect()
        },
        |number| {
            if number % 2 == 0 {
                vec![0xDC, 9, 9]
            } else {
                vec![0x10, 0x09, 0x02, 0x49, 0x54, 0x16]
            }
        },
    ];
    for piece in pieces {
        let line = pty::Line::with_ends(3);
        let mut device = device(&line);
        let master = Master::run(line.end(1), project());
        until_exchanging(&mut device, &master);
        exchange(&mut device, &master, 1);
        babble(line.end(2), piece);
        until_exchanging(&mut device, &master);
        for number in 2..=4 {
            exchange(&mut device, &master, number);
        }
    }
}

/// One driver with two stations, each with its own master; the masters pass the token to each other.
#[test]
fn two_masters_take_turns_and_either_goes_on_when_the_other_is_lost() {
    logged::expect("station 9: the master has been silent for longer");
    let line = pty::Line::with_ends(4);
    let mut listener = OpenOptions::new();
    let listener = listener.read(true).open(line.end(3)).expect("an end");
    let heard = std::thread::spawn(move || {
        // Reads until the line ends, which is an error on a pseudo-terminal.
        let mut heard = Vec::new();
        let _ = std::io::BufReader::new(listener).read_to_end(&mut heard);
        heard
    });
    let stations = [(ADDRESS, "a"), (9, "b")];
    let mut text = format!(
        "[driver]\nid = 1\nname = \"cell\"\n[fieldbus]\nkind = \"profibus-device\"\ndevice = \"{}\"\n\
         baud = 500000\nmax_tsdr = {}\nmax_age = \"5s\"\n",
        line.end(0).display(),
        SLOT - 1000
    );
    for (address, name) in stations {
        let _ = writeln!(
            text,
            "[[station]]\nname = \"{name}\"\naddress = {address}\nident = 0x80E0\nconfig = [0x52, 0x62]\n\
             [[signal]]\nname = \"to {name}\"\nstation = \"{name}\"\naddress = \"%QW2\"\ntype = \"INT\"\n\
             [[signal]]\nname = \"from {name}\"\nstation = \"{name}\"\naddress = \"%IW2\"\ntype = \"INT\""
        );
    }
    let mut device = End::open(&text, &Monotonic::shared(), &KINDS);
    let run = |end, address, station| {
        let one = Project {
            address,
            slaves: vec![Slave {
                address: station,
                ..slave()
            }],
            ..project()
        };
        Master::run(line.end(end), one)
    };
    let both_ways = |device: &mut End, master: &Master, name: &str, number: u8| {
        device.set(&format!("from {name}"), f64::from(number));
        master.first(|seen| seen.outputs[2..4].copy_from_slice(&[0, number]));
        until(device, "both numbers arrive", |device| {
            let came = master.first(|seen| seen.inputs.get(2..4) == Some(&[0, number]));
            came && device.get(&format!("to {name}")) == f64::from(number)
        });
    };
    let first = run(1, 2, ADDRESS);
    both_ways(&mut device, &first, "a", 1);
    for round in [10, 20] {
        let second = run(2, 3, 9);
        for number in round..round + 3 {
            both_ways(&mut device, &first, "a", number);
            both_ways(&mut device, &second, "b", number + 100);
        }
        // The second master's token is lost, too.
        drop(second);
        await_that("its station is released", || {
            device.tick();
            std::thread::sleep(Duration::from_millis(1));
            device.statistic("exchanging") == "8"
        });
        both_ways(&mut device, &first, "a", round + 5);
    }
    drop(first);
    device.driver.close();
    drop(line);
    let heard = heard.join().expect("a listener");
    for token in [[0xDC, 3, 2], [0xDC, 2, 3]] {
        let passed = heard.windows(3).any(|bytes| bytes == token);
        assert!(passed, "no token {token:02X?}");
    }
}
