//! The bus `profibus-device` with profirust, an independent DP master, at the other end of a pseudo-terminal, in real
//! time.
#![cfg(unix)]

use std::fmt::Write as _;
use std::io::{Read as _, Write as _};
use std::os::unix::fs::OpenOptionsExt as _;
use std::time::Duration;

use crate::peer::{Master, Project, SLOT, Seen, Slave};
use crate::pty;
use crate::rig::{
    ADDRESS, IDENT, KINDS, OnPort, RATES, device, device_at, exchange, project, project_at, slave,
    until, until_exchanging,
};
use profirust::dp::PeripheralEvent;
use tickbus_base::time::{Manual, Monotonic, Nanos};
use tickbus_conformance as conformance;
use tickbus_conformance::rig::{End, await_that, config, logged};
use tickbus_driver::Code;
use tickbus_fieldbus::LinkState;

/// The parameters that a PLC's tool sends to `remote_io.gsd` with its first three modules.
const REMOTE_IO_PARAMETERS: [u8; 10] = [0xC0, 0, 0, 0, 0, 0x11, 0xFF, 0xFF, 0xFF, 0xFE];

#[test]
fn it_is_started_up_and_exchanges_both_ways_at_every_rate_of_user_space() {
    for rate in RATES {
        let line = pty::Line::new();
        let mut device = device_at(&line, rate.1);
        let project = Project {
            watchdog: None,
            ..project_at(rate)
        };
        let master = Master::run(line.end(1), project);
        until_exchanging(&mut device, &master);
        let reason = device.link().reason;
        assert_eq!(reason, "master 2 exchanges data");
        for number in 1..=3 {
            exchange(&mut device, &master, number);
        }
        let wrong = [
            PeripheralEvent::ConfigError,
            PeripheralEvent::ParameterError,
        ];
        master.first(|seen| assert!(!wrong.iter().any(|event| seen.has(*event)), "{seen:?}"));
    }
}

#[test]
fn pulses_of_one_tick_and_of_one_exchange_arrive() {
    let line = pty::Line::new();
    let mut device = device(&line);
    let master = Master::run(line.end(1), project());
    until_exchanging(&mut device, &master);
    let before = master.first(|seen| seen.edges);
    for pulse in 1..=15 {
        for level in [1.0, 0.0] {
            device.set("sensor", level);
            device.tick();
        }
        until(&mut device, "the master sees it come and go", |_| {
            master.first(|seen| seen.edges == before + pulse && seen.inputs[0] & 1 == 0)
        });
    }
    let mut edges = 0.0;
    for pulse in 1..=15 {
        for level in [1, 0] {
            let exchanges = master.first(|seen| {
                seen.outputs[0] = level;
                seen.exchanges
            });
            // The machine does not tick during the pulse. One exchange may be under way already.
            await_that("it has gone out", || {
                std::thread::sleep(Duration::from_micros(500));
                master.first(|seen| seen.exchanges > exchanges + 2)
            });
        }
        device.tick();
        edges += device.edges("run");
        until(&mut device, "it is over", |device| {
            edges += device.edges("run");
            device.get("run") == 0.0
        });
        assert_eq!(edges, f64::from(pulse));
    }
}

#[test]
fn the_statistics_have_the_octets_that_the_line_has_carried() {
    let line = pty::Line::new();
    let mut device = device(&line);
    let master = Master::run(line.end(1), project());
    until_exchanging(&mut device, &master);
    exchange(&mut device, &master, 1);
    let exchanges = master.first(|seen| seen.exchanges);
    drop(master);
    until(&mut device, "all octets are counted", |device| {
        let carried = |key: &str, end| device.statistic(key) == line.octets(end).to_string();
        carried("line.octets_out", 0) && carried("line.octets_in", 1)
    });
    // Six octets each way in each exchange; the next one confirms the inputs of the last.
    for key in ["line.data_in", "line.data_out"] {
        let data: usize = device.statistic(key).parse().expect("a count");
        let are_all = data.is_multiple_of(6) && data / 6 + 1 >= exchanges;
        assert!(are_all, "{key}: {data} in {exchanges}");
    }
}

#[test]
fn a_slave_that_is_lost_comes_back_at_every_rate() {
    for rate in RATES {
        let line = pty::Line::new();
        let mut first = device_at(&line, rate.1);
        let master = Master::run(line.end(1), project_at(rate));
        until_exchanging(&mut first, &master);
        for number in [1, 2] {
            exchange(&mut first, &master, number);
            first.driver.close();
            await_that("the master has noticed", || {
                std::thread::sleep(Duration::from_millis(1));
                master.first(|seen| seen.has(PeripheralEvent::Offline))
            });
            master.first(|seen| seen.events.clear());
            first = device_at(&line, rate.1);
            until_exchanging(&mut first, &master);
            exchange(&mut first, &master, number + 10);
        }
    }
}

#[test]
fn without_its_master_the_watchdog_makes_the_station_stale_at_once_and_it_comes_back_at_every_rate()
{
    for rate in RATES {
        let line = pty::Line::new();
        let bus = OnPort(line.end(0).display().to_string());
        // Long enough that only the watchdog can be the reason.
        let text = config(&bus, "device", "").replace("\"300ms\"", "\"60s\"");
        let text = text.replace("baud = 500000", &format!("baud = {}", rate.1));
        let mut device = End::open(&text, &Monotonic::shared(), &KINDS);
        for number in [3, 4] {
            let master = Master::run(line.end(1), project_at(rate));
            until_exchanging(&mut device, &master);
            exchange(&mut device, &master, number);
            drop(master);
            until(&mut device, "the station is stale", |device| {
                device.tick().code == Code::Stale
            });
            assert_eq!(device.get("speed"), -1.0, "the fail-safe value");
            assert!(
                device.tick().age < Nanos::from_secs(60),
                "young, and invalid"
            );
            // The data turn stale first; the reason is logged a moment later.
            let words = "station 8: the master has been silent for longer than 500";
            until(&mut device, "the reason is told", |device| {
                let link = device.link();
                link.state != LinkState::Running && link.reason.contains(words)
            });
        }
    }
}

#[test]
fn the_master_gets_fail_safe_values_while_the_simulation_stands_still() {
    let line = pty::Line::new();
    let bus = OnPort(line.end(0).display().to_string());
    let text = config(&bus, "device", "watchdog = \"50ms\"");
    let mut device = End::open(&text, &Monotonic::shared(), &KINDS);
    let master = Master::run(line.end(1), project());
    until_exchanging(&mut device, &master);
    for number in [5, 6] {
        exchange(&mut device, &master, number);
        await_that("the fail-safe value arrives", || {
            std::thread::sleep(Duration::from_millis(1));
            master.first(|seen| seen.inputs[2..4] == [0, 77])
        });
    }
}

#[test]
fn a_wrong_ident_and_a_wrong_configuration_are_told_in_words_and_mended_at_every_rate() {
    logged::expect("refused: station 8");
    for rate in RATES {
        let line = pty::Line::new();
        let mut device = device_at(&line, rate.1);
        for (wrong, event, words) in [
            (
                Slave {
                    ident: 0x1234,
                    ..slave()
                },
                PeripheralEvent::ParameterError,
                "expected ident 80E0, received 1234",
            ),
            (
                Slave {
                    config: &[0x52, 0x61],
                    ..slave()
                },
                PeripheralEvent::ConfigError,
                "slot 2: expected 62 (6 bytes of outputs), received 61 (4 bytes of outputs)",
            ),
        ] {
            let mistaken = Project {
                slaves: vec![wrong],
                ..project_at(rate)
            };
            let master = Master::run(line.end(1), mistaken);
            until(&mut device, "it is told", |device| {
                let link = device.link();
                link.cause.name() == "refused" && link.reason.contains(words)
            });
            await_that("the master has read it", || {
                std::thread::sleep(Duration::from_millis(1));
                master.first(|seen| seen.has(event))
            });
            master.first(|seen| assert_eq!(seen.exchanges, 0));
            drop(master);
            let master = Master::run(line.end(1), project_at(rate));
            until_exchanging(&mut device, &master);
        }
    }
}

/// Five devices of three kinds, two of them by a GSD file, as one driver on one line.
#[test]
fn many_stations_of_different_devices_share_a_line() {
    let folder = tempfile::tempdir().expect("a folder");
    for (name, text) in [
        (
            "remote_io.gsd",
            include_str!("../../../../../tests/gsd/remote_io.gsd"),
        ),
        (
            "encoder.gsd",
            include_str!("../../../../../tests/gsd/encoder.gsd"),
        ),
    ] {
        std::fs::write(folder.path().join(name), text).expect("a file");
    }
    let line = pty::Line::new();
    let remote_io =
        "gsd = \"remote_io.gsd\"\nmodules = [\"Head\", \"2 words in\", \"2 words out\"]";
    let plain = "ident = 0x80E0";
    let encoder = "gsd = \"encoder.gsd\"";
    let stations = [
        (3, remote_io),
        (5, encoder),
        (9, plain),
        (20, remote_io),
        (125, encoder),
    ];
    let mut text = format!(
        "[driver]\nid = 1\nname = \"cell\"\n[fieldbus]\nkind = \"profibus-device\"\n\
         device = \"{}\"\nbaud = 500000\nmax_tsdr = {}\nmax_age = \"5s\"\n",
        line.end(0).display(),
        SLOT - 1000
    );
    for (address, device) in stations {
        let _ = writeln!(
            text,
            "[[station]]\nname = \"s{address}\"\naddress = {address}\n{device}\n"
        );
    }
    for (address, _) in stations {
        for (area, name) in [("I", "from"), ("Q", "to")] {
            let _ = writeln!(
                text,
                "[[signal]]\nname = \"{name} {address}\"\nstation = \"s{address}\"\n\
                 address = \"%{area}W2\"\ntype = \"INT\"\n"
            );
        }
    }
    // All others use their image addresses.
    let at = "[fieldbus.at]\n\"from 20\" = \"slot 2 %IW0\"\n\"to 20\" = \"slot 3 %QW0\"\n";
    text.push_str(at);
    let low = |address| if address == 20 { 1 } else { 3 };
    let path = folder.path().join("driver.cfg");
    std::fs::write(&path, &text).expect("a file");
    let mut device = open(&path);
    let slaves = stations.map(|(address, _)| {
        let (ident, config, parameters): (_, &[u8], &[u8]) = match address {
            3 | 20 => (0x0B1C, &[0x00, 0x51, 0x61], &REMOTE_IO_PARAMETERS),
            9 => (0x80E0, &[0x71], &[]),
            _ => (0xE4C0, &[0xF1], &[]),
        };
        Slave {
            address,
            ident,
            parameters,
            config,
            inputs: 4,
            outputs: 4,
        }
    });
    let master = Master::run(
        line.end(1),
        Project {
            slaves: slaves.to_vec(),
            ..project()
        },
    );
    for round in [1_u8, 2] {
        for (number, (address, _)) in (1..).zip(stations) {
            device.set(&format!("from {address}"), f64::from(10 * round + number));
            master.all()[usize::from(number) - 1].outputs[low(address)] = 20 * round + number;
        }
        until(&mut device, "each station has its own values", |device| {
            let seen: Vec<Seen> = master.all().clone();
            (1..).zip(stations).all(|(number, (address, _))| {
                let came = &seen[usize::from(number) - 1].inputs;
                came.get(low(address)) == Some(&(10 * round + number))
                    && device.get(&format!("to {address}")) == f64::from(20 * round + number)
            })
        });
    }
    assert_eq!(device.statistic("exchanging"), "3 5 9 20 125");
}

/// One of two stations has a different configuration in the master's project.
#[test]
fn a_station_with_a_mistake_does_not_hinder_the_others() {
    logged::expect("station 9: master 2 sent another configuration");
    let line = pty::Line::new();
    let text = format!(
        "[driver]\nid = 1\nname = \"cell\"\n[fieldbus]\nkind = \"profibus-device\"\n\
         device = \"{}\"\nbaud = 500000\nmax_tsdr = {}\n\
         [[station]]\nname = \"a\"\naddress = 8\nident = {IDENT:#06x}\nconfig = [0x52, 0x62]\n\
         [[station]]\nname = \"b\"\naddress = 9\nident = {IDENT:#06x}\nconfig = [0x52, 0x62]\n\
         [[signal]]\nname = \"speed\"\nstation = \"a\"\naddress = \"%QW2\"\ntype = \"INT\"\n\
         [[signal]]\nname = \"position\"\nstation = \"a\"\naddress = \"%IW2\"\ntype = \"INT\"\n\
         [[signal]]\nname = \"x\"\nstation = \"b\"\naddress = \"%QX0.0\"\n",
        line.end(0).display(),
        SLOT - 1000
    );
    let mut device = End::open(&text, &Monotonic::shared(), &KINDS);
    let mistaken = Slave {
        address: 9,
        config: &[0x52],
        outputs: 0,
        ..slave()
    };
    let both = Project {
        slaves: vec![slave(), mistaken],
        ..project()
    };
    let master = Master::run(line.end(1), both);
    for number in 1..=3 {
        exchange(&mut device, &master, number);
        master.all()[1].events.clear();
        until(&mut device, "the master is told of the other one", |_| {
            master.all()[1].has(PeripheralEvent::ConfigError)
        });
    }
    assert_eq!(device.statistic("exchanging"), "8");
}

#[test]
fn an_answer_that_would_be_late_is_not_sent() {
    let line = pty::Line::new();
    let bus = OnPort(line.end(0).display().to_string());
    let text = config(&bus, "device", "");
    // Between 1.1 ms and 6.3 ms after the request.
    let text = text.replace("baud = 500000", "baud = 9600");
    let text = text.replace(&format!("max_tsdr = {}", SLOT - 1000), "max_tsdr = 60");
    let clock = Manual::new();
    let device = End::open(&text, &clock, &KINDS);
    let mut master = std::fs::OpenOptions::new()
        .read(true)
        .write(true)
        .custom_flags(i32::try_from(rustix::fs::OFlags::NONBLOCK.bits()).expect("a flag"))
        .open(line.end(1))
        .expect("the other end");
    await_that("an answer is late", || {
        let asked = [0x10, ADDRESS, 0x02, 0x49, 0x53, 0x16];
        master.write_all(&asked).expect("a line");
        // Whenever the request arrives, the clock is never in that interval.
        clock.advance(Nanos::from_millis(10));
        let statistics = device.driver.statistics();
        statistics.contains("\nprofibus-device.late=")
    });
    assert!(master.read(&mut [0; 16]).is_err(), "nothing was sent");
}

fn open(path: &std::path::Path) -> End {
    let logged = logged::Watch::new();
    let config =
        tickbus_driver_cfg::Config::load(path, &KINDS).unwrap_or_else(|why| panic!("{why}"));
    let driver = tickbus_driver::Driver::open(config, Monotonic::shared()).expect("opens");
    let slots = driver.initial_slots();
    End {
        driver,
        slots,
        logged,
    }
}

#[test]
fn an_address_that_already_answers_is_refused_with_a_message() {
    logged::expect("answers at address 8");
    let line = pty::Line::new();
    let mut device = device(&line);
    let mut other = std::fs::OpenOptions::new()
        .write(true)
        .open(line.end(1))
        .expect("the other end");
    until(&mut device, "it says so", |device| {
        // Station 8 answers master 2: it is there.
        other
            .write_all(&[0x10, 0x02, 0x08, 0x00, 0x0A, 0x16])
            .expect("a line");
        device.link().reason.contains(
            "answers at address 8; give the station another address, or take that device off the line",
        )
    });
}

#[test]
fn it_closes_while_its_peer_is_silent() {
    let line = pty::Line::new();
    conformance::closes_while_its_peer_is_silent(&OnPort(line.end(0).display().to_string()));
}

#[test]
fn it_refuses_bad_configuration() {
    conformance::refuses_bad_configuration(&OnPort("unused".to_owned()));
}
