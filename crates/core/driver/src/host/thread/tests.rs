//! A scan that takes too long.

use std::sync::mpsc::{Receiver, Sender, channel};

use tickbus_base::time::Manual;
use tickbus_fieldbus::{Cause, Free};
use tickbus_plc::Scan;

use crate::Host;

use super::*;

/// A program whose scan signals its start, and ends when the test allows it.
struct Slow {
    can_hang: bool,
    begun: Sender<()>,
    end: Receiver<()>,
}

impl Program for Slow {
    fn name(&self) -> &'static str {
        "slow"
    }

    fn input_bytes(&self) -> usize {
        0
    }

    fn output_bytes(&self) -> usize {
        0
    }

    fn can_hang(&self) -> bool {
        self.can_hang
    }

    fn scan(&mut self, _scan: &mut Scan<'_>) {
        // The test may have ended.
        let _ = self.begun.send(());
        let _ = self.end.recv();
    }
}

/// Returns the fault reported for a scan that takes 4 s.
fn fault_of(can_hang: bool) -> Option<String> {
    let text = "[driver]\nid = 1\nname = \"x\"\n[fieldbus]\nkind = \"loopback\"\nlink = \"slow\"\n\
                [[signal]]\nname = \"run\"\naddress = \"%QB0\"\n";
    let config = Config::parse("driver.cfg", text, &crate::KINDS).expect("right");
    let clock = Arc::new(Manual::default());
    let (begun, has_begun) = channel();
    let (let_end, end) = channel();
    let program = Box::new(Slow {
        can_hang,
        begun,
        end,
    });
    let wall = Arc::clone(&clock) as Arc<dyn Clock>;
    let host = Host::open(&config, program, Nanos::from_millis(1), wall).expect("opens");
    has_begun.recv().expect("the first scan");
    clock.advance(Nanos::from_secs(4));
    let fault = host.fault();
    drop(let_end);
    assert_eq!(host.close(), None);
    fault
}

#[test]
fn a_scan_of_seconds_is_a_fault_of_a_program_that_can_hang() {
    let fault = fault_of(true).expect("it hangs");
    assert!(fault.contains("has been in one scan for 4s"), "{fault}");
}

#[test]
fn a_program_that_cannot_hang_was_merely_not_let_run() {
    assert_eq!(fault_of(false), None);
}

/// A bus that receives one frame, and then does nothing until the test allows it to end.
struct Stuck(Receiver<()>);

impl Free for Stuck {
    fn run(&mut self, port: &mut Port, _stop: &Stop) -> Result<(), BusError> {
        let now = port.clock().now();
        port.together(|port| port.received(0, now, &[7]));
        port.running("it has answered once");
        let _ = self.0.recv();
        Ok(())
    }
}

#[test]
fn a_bus_that_is_stuck_cannot_hide_it_from_who_asks_for_the_state_of_the_line() {
    let text = "[driver]\nid = 1\nname = \"x\"\n[fieldbus]\nkind = \"loopback\"\nlink = \"stuck\"\n\
                role = \"controller\"\nmax_age = \"300ms\"\n[[signal]]\nname = \"a\"\naddress = \"%IB0\"\n";
    let config = Config::parse("driver.cfg", text, &crate::KINDS).expect("right");
    let clock = Arc::new(Manual::default());
    let ((let_end, end), (begun, _has_begun), (let_scan, scan)) = (channel(), channel(), channel());
    drop(let_scan);
    let hosted = ScanSetup {
        own: None,
        program: Box::new(Slow {
            can_hang: false,
            begun,
            end: scan,
        }),
        interval: Nanos::from_millis(1),
        has_watchdog: true,
        recorder: None,
        swallowed: crate::open::swallowed_of(&config, "x"),
    };
    let (role, wall) = (Role::Controller, Arc::clone(&clock) as Arc<dyn Clock>);
    let bus = Bus::Free(Box::new(Stuck(end)));
    let host = HostThread::start(hosted, (&config, role), (bus, Stop::new()), wall);
    let mut host = host.expect("starts");
    while host.figures.status.state() != LinkState::Running {
        std::thread::yield_now();
    }
    clock.advance(Nanos::from_secs(1));
    host.observe();
    let link = host.figures.status.link();
    assert_eq!((link.state, link.cause), (LinkState::Stale, Cause::Silent));
    drop(let_end);
    assert_eq!(host.end(), None);
}
