//! The outputs that a controller leaves at a foreign device: when it closes, when it is ended, when it stops, and while
//! it receives no data.
#![cfg(unix)]
#![allow(
    missing_docs,
    unreachable_pub,
    clippy::float_cmp,
    reason = "tests; the values are small whole numbers"
)]

#[allow(dead_code, reason = "each test uses a part of it")]
#[path = "../../crates/bus/modbus/tests/modbus/plc.rs"]
mod modbus_plc;

use std::io::Read as _;
use std::net::TcpListener;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, mpsc};

use crate::commands::Running;
use modbus_plc::{Habit, Plc};
use rustix::process::Signal;
use tickbus::driver::Host;
use tickbus::driver_cfg::Config;
use tickbus::plc::{Program, Scan};
use tickbus::time::{Clock, Monotonic, Nanos};
use tickbus_conformance as conformance;

use conformance::peers::Alone;
use conformance::rig::{End, eventually, logged, statistic};

/// A controller that switches a motor, register 10 of `plc`, depending on register 0.
fn controller(plc: &Plc, further: &str) -> String {
    let address = plc.address;
    format!(
        "[driver]\nid = 1\nname = \"cell\"\n[fieldbus]\nkind = \"modbus-client\"\naddress = \"{address}\"\n\
         role = \"controller\"\nwrite_to = \"modbus device at {address}, unit 1\"\ncycle = \"1ms\"\n\
         reconnect = [\"10ms\"]\n{further}\n\
         [fieldbus.at]\n\"run\" = \"input-register offset:0\"\n\"motor\" = \"holding-register offset:10\"\n\
         [[signal]]\nname = \"run\"\naddress = \"%IW0\"\ntype = \"INT\"\n\
         [[signal]]\nname = \"motor\"\naddress = \"%QW0\"\ntype = \"INT\"\nfail_safe = 7\n"
    )
}

fn motor(plc: &Plc) -> u16 {
    plc.with(|memory| memory.registers[1][10])
}

/// Starts the motor in real time.
fn started<C: Clock + 'static>(plc: &Plc, text: &str, clock: &Arc<C>) -> End {
    let mut end = End::open(text, clock, &tickbus::KINDS);
    end.set("motor", 1.0);
    eventually("the motor runs", || {
        end.tick();
        (motor(plc) == 1).then_some(())
    });
    end
}

#[test]
fn closing_leaves_the_motor_at_its_fail_safe_value_or_on_if_that_is_asked_for() {
    for (further, left) in [("", 7), ("at_close = \"hold\"", 1)] {
        let plc = Plc::start(|_, _| Habit::Answers);
        let text = controller(&plc, &format!("max_age = \"20s\"\n{further}"));
        started(&plc, &text, &Monotonic::shared()).driver.close();
        assert_eq!(motor(&plc), left, "{further}");
    }
}

#[test]
fn closing_writes_even_to_a_device_that_refuses_to_be_read() {
    static REFUSES: AtomicBool = AtomicBool::new(false);
    let plc = Plc::start(|_, function| match function {
        4 if REFUSES.load(Ordering::Relaxed) => Habit::Refuses(4),
        _ => Habit::Answers,
    });
    let text = controller(&plc, "max_age = \"1s\"\nwhile_stale = \"hold\"");
    let end = started(&plc, &text, &Monotonic::shared());
    REFUSES.store(true, Ordering::Relaxed);
    eventually("the controller knows", || {
        statistic(&end.driver, "modbus-client.refused").map(drop)
    });
    logged::expect("has not confirmed the fail-safe values within 1s");
    end.driver.close();
    assert_eq!(motor(&plc), 7);
}

#[test]
fn a_process_that_is_terminated_leaves_the_motor_at_its_fail_safe_value() {
    for signal in [Signal::TERM, Signal::INT] {
        let plc = Plc::start(|_, _| Habit::Answers);
        plc.with(|memory| memory.registers[0][0] = 1);
        let file = tempfile::Builder::new().suffix(".cfg").tempfile();
        let file = file.expect("a temporary file");
        let text = controller(&plc, "max_age = \"20s\"");
        std::fs::write(file.path(), text).expect("it can be written");
        let path = file.path().to_str().expect("text");
        let process = Running::of("plc", &["mirror", "--config", path]);
        eventually("the motor runs", || (motor(&plc) == 1).then_some(()));
        let (last, code) = process.signal(signal);
        assert_eq!(code, Some(0), "{last}");
        assert_eq!(motor(&plc), 7, "{signal:?}: {last}");
    }
}

#[test]
fn a_controller_that_sees_nothing_stops_the_motor_unless_it_shall_hold_it() {
    static REFUSES: AtomicBool = AtomicBool::new(false);
    for (further, left) in [("", 7), ("while_stale = \"hold\"", 1)] {
        REFUSES.store(false, Ordering::Relaxed);
        let plc = Plc::start(|_, function| match function {
            4 if REFUSES.load(Ordering::Relaxed) => Habit::Refuses(4),
            _ => Habit::Answers,
        });
        let text = controller(&plc, &format!("max_age = \"300ms\"\n{further}"));
        let mut cell = Alone::open(&text, &tickbus::KINDS);
        cell.end.set("motor", 1.0);
        cell.until("the motor runs", |_| motor(&plc) == 1);
        REFUSES.store(true, Ordering::Relaxed);
        let asked = || plc.with(|memory| memory.asked.iter().filter(|asked| asked.1 == 4).count());
        let before = asked();
        // The device is asked again every second, and each time the controller writes first.
        cell.until("it was asked thrice", |_| asked() > before + 3);
        assert_eq!(motor(&plc), left, "{further}");
        REFUSES.store(false, Ordering::Relaxed);
        cell.until("the motor runs again", |_| motor(&plc) == 1);
        cell.end.driver.close();
    }
}

#[test]
fn a_controller_that_stops_has_a_watchdog_unless_it_is_switched_off() {
    for (further, left) in [("", 7), ("watchdog = \"off\"", 1)] {
        let plc = Plc::start(|_, _| Habit::Answers);
        let text = controller(&plc, &format!("max_age = \"300ms\"\n{further}"));
        let mut cell = Alone::open(&text, &tickbus::KINDS);
        cell.end.set("motor", 1.0);
        cell.until("the motor runs", |_| motor(&plc) == 1);
        let stopped = cell.now();
        eventually("the watchdog would have bitten", || {
            conformance::rig::pass(&cell.clock, 1);
            (cell.now() - stopped > Nanos::from_millis(400)).then_some(())
        });
        let asked = || plc.with(|memory| memory.asked.len());
        let before = asked();
        eventually("it is written once more", || {
            conformance::rig::pass(&cell.clock, 1);
            (asked() > before + 4).then_some(())
        });
        assert_eq!(motor(&plc), left, "{further}");
        cell.end.driver.close();
    }
}

/// A program that starts the motor, and hangs in its second scan until released.
#[derive(Debug)]
struct Hangs(mpsc::Receiver<()>);

impl Program for Hangs {
    fn name(&self) -> &'static str {
        "hangs"
    }

    fn input_bytes(&self) -> usize {
        2
    }

    fn output_bytes(&self) -> usize {
        2
    }

    fn scan(&mut self, scan: &mut Scan<'_>) {
        if scan.outputs[1] == 1 {
            // The test has ended, or releases it.
            let _ = self.0.recv();
        }
        scan.outputs.copy_from_slice(&[0, 1]);
    }
}

#[test]
fn a_program_that_hangs_has_the_watchdog_of_its_file() {
    for (further, left) in [
        ("", 7),
        ("watchdog = \"off\"", 1),
        ("watchdog = \"20s\"", 1),
    ] {
        let plc = Plc::start(|_, _| Habit::Answers);
        let text = controller(&plc, &format!("max_age = \"300ms\"\n{further}"));
        let config = Config::parse("driver.cfg", &text, &tickbus::KINDS).expect("a right file");
        let (release, released) = mpsc::channel();
        let (clock, program) = (Monotonic::shared(), Box::new(Hangs(released)));
        let host = Host::open(
            &config,
            program,
            Nanos::from_millis(1),
            Arc::clone(&clock) as _,
        );
        let host = host.expect("it opens");
        eventually("the motor runs", || (motor(&plc) == 1).then_some(()));
        let limit = clock.now() + Nanos::from_millis(900);
        let bitten = eventually("the watchdog bites, or has time to", || {
            let value = motor(&plc);
            (value == 7 || clock.now() > limit).then_some(value)
        });
        assert_eq!(bitten, left, "{further}");
        drop(release);
        host.close();
    }
}

#[test]
fn the_last_record_of_a_socket_has_the_fail_safe_values() {
    for (further, left) in [("", 7), ("at_close = \"hold\"", 1)] {
        let listener = TcpListener::bind("127.0.0.1:0").expect("a free port");
        let address = listener.local_addr().expect("it is bound");
        let text = format!(
            "[driver]\nid = 1\nname = \"cell\"\n[fieldbus]\nkind = \"socket\"\nrole = \"controller\"\n\
             address = \"{address}\"\ncycle = \"1ms\"\nmax_age = \"20s\"\n{further}\n\
             [[signal]]\nname = \"motor\"\naddress = \"%QB0\"\nfail_safe = 7\n"
        );
        let mut end = End::open(&text, &Monotonic::shared(), &tickbus::KINDS);
        end.set("motor", 1.0);
        end.tick();
        let (mut peer, _) = listener.accept().expect("it connects");
        let mut record = [0];
        while record != [1] {
            end.tick();
            peer.read_exact(&mut record).expect("a record");
        }
        end.driver.close();
        let mut rest = Vec::new();
        peer.read_to_end(&mut rest).expect("it closes properly");
        assert_eq!(rest.last().copied().unwrap_or(1), left, "{further}");
    }
}
