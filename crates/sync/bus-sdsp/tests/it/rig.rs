//! The rig's PLC program and a machine in lock-step: two runs are equal to the last bit.

use std::fs;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;

use crate::sdsp::{controller, of_two, open};
use crate::server::Server;
use tickbus_base::time::{Manual, Monotonic, Nanos};
use tickbus_conformance::rig::{End, await_that};
use tickbus_driver::{Code, Host};
use tickbus_driver_cfg::{Config, Kind, Kinds};
use tickbus_fieldbus::Role;
use tickbus_image::signal::{Area, Slot};
use tickbus_virtual_time::{Outcome, Settings, StartCondition};

static KINDS: Kinds = Kinds::new(&[Kind::of::<tickbus_bus_sdsp::Options>()]);

/// The step of the machine and the server; the PLC scans every 10 ms.
const STEP: Nanos = Nanos::from_millis(2);

/// Twenty seconds of virtual time.
const STEPS: u64 = 10_000;

/// The repository's driver.cfg, over `sdsp`, with a recording in `file`.
fn config(port: u16, role: Role, file: &Path) -> Config {
    let whole = concat!(env!("CARGO_MANIFEST_DIR"), "/../../../driver.cfg");
    let whole = fs::read_to_string(whole).expect("the rig's driver.cfg");
    let (_, signals) = whole.split_once("[[signal]]").expect("it has signals");
    let text = format!(
        "[driver]\nid = 1\nname = \"Test rig\"\n[fieldbus]\nkind = \"sdsp\"\naddress = \"127.0.0.1:{port}\"\n\
         role = \"{}\"\n[record]\nfile = '{}'\n[[signal]]{signals}",
        role.name(),
        file.display()
    );
    Config::parse("driver.cfg", &text, &KINDS).unwrap_or_else(|why| panic!("{why}"))
}

/// A machine that acts at random, partly depending on its inputs, but always in the same way.
fn act(machine: &mut End, random: &mut u64) {
    for index in 0..machine.slots.len() {
        let signals = &machine.driver.config().table.signals;
        if signals
            .get(index)
            .is_none_or(|signal| signal.area != Area::Input)
        {
            continue;
        }
        // Knuth's generator: the same numbers on every computer.
        *random = random
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        if (*random >> 33).is_multiple_of(64) {
            let echo = machine.slots[index / 2].0 >> 60 & 1;
            let level = (*random >> 40 & 1) ^ echo;
            machine.slots[index] = Slot::from_real(if level == 1 { 1.0 } else { 0.0 });
        }
    }
}

/// One run; both ends are recorded in this folder.
fn run(folder: &Path, name: &str) -> Outcome {
    let mut settings = Settings::new(STEP, StartCondition::Count(2));
    settings.steps = Some(STEPS);
    let server = Server::start(settings);
    let file = |end| folder.join(format!("{name}-{end}.vcd"));
    let program = tickbus_programs::program("rig", &[]).expect("it is built in");
    let interval = Nanos::from_millis(10);
    let at_plc = config(server.port, Role::Controller, &file("plc"));
    let plc = Host::open(&at_plc, program, interval, Monotonic::shared()).expect("opens");
    let mut machine = End::of(
        config(server.port, Role::Device, &file("machine")),
        &Manual::new(),
    );
    let mut random = 1;
    while machine.receive().code == Code::Fresh {
        act(&mut machine, &mut random);
        machine.send();
    }
    let outcome = server.end().expect("it ends as planned");
    await_that("the PLC is done", || plc.is_over());
    assert_eq!(plc.scans(), (STEPS / 5, 0), "scans, and stale ones");
    assert_eq!((plc.fault(), plc.close()), (None, None));
    machine.driver.close();
    outcome
}

#[test]
fn two_runs_of_the_rig_are_equal_to_the_last_bit_however_busy_the_machine_is() {
    let folder = tempfile::tempdir().expect("a folder");
    let quiet = run(folder.path(), "quiet");
    assert_eq!(
        (quiet.steps, quiet.time),
        (STEPS, Nanos::from_millis(19_998))
    );
    // More busy threads than there are processors.
    let stop = Arc::new(AtomicBool::new(false));
    let busy: Vec<_> = (0..4)
        .map(|_| {
            let stop = Arc::clone(&stop);
            thread::spawn(move || {
                while !stop.load(Ordering::Relaxed) {
                    std::hint::spin_loop();
                }
            })
        })
        .collect();
    let again = run(folder.path(), "busy");
    stop.store(true, Ordering::Relaxed);
    for thread in busy {
        thread.join().expect("no panic");
    }
    assert_eq!(again, quiet, "trace hash");
    for end in ["machine", "plc"] {
        let read =
            |run| fs::read(folder.path().join(format!("{run}-{end}.vcd"))).expect("recorded");
        let (one, other) = (read("quiet"), read("busy"));
        assert!(one.len() > 50_000, "{end}: {} bytes", one.len());
        assert!(one == other, "{end}: the recordings differ");
    }
}

#[test]
fn a_client_of_a_run_cannot_be_reset_for_its_time_belongs_to_the_others_too() {
    let server = of_two(3);
    let plc = controller(server.port, "", |_, _| ());
    let mut machine = open(server.port, "device", "");
    assert_eq!(machine.tick().code, Code::Fresh);
    let refused = machine.driver.reset(&mut machine.slots);
    let refused = refused.expect_err("it takes part in a run");
    assert_eq!(refused.code(), Code::Unsupported);
    let text = refused.to_string();
    assert!(text.contains("belongs to the other participants"), "{text}");
    // The run continues as if nothing had been asked.
    assert_eq!(machine.tick().code, Code::Fresh);
    assert_eq!(machine.tick().code, Code::Fresh);
    assert_eq!(machine.tick().code, Code::Stale);
    assert_eq!(server.end().expect("it ends as planned").steps, 3);
    plc.join().expect("no panic");
}
