//! A user's program in lock-step: the same scans as on the ticks of a stepped loopback, a step later.

use std::path::Path;
use std::thread;

use tickbus::driver::{Driver, Host};
use tickbus::driver_cfg::Config;
use tickbus::net::Address;
use tickbus::plc::HostedProgram;
use tickbus::signal::{Area, Slot};
use tickbus::time::{Monotonic, Nanos};
use tickbus::virtual_time::{
    Controls, Hosting, Logic, Outcome, Save, SavedRun, Settings, StartCondition, tcp,
};

use super::fixture::{by_hand, folder, options};
use super::{STEPPED, driver_cfg, open};

const STEP: Nanos = Nanos::from_millis(20);
const STEPS: u32 = 60;

/// The machine's view of the program in each step, while it changes its own values.
fn seen(driver: &mut Driver) -> Vec<Vec<u64>> {
    let mut slots = driver.initial_slots();
    let signals = driver.config().table.signals.clone();
    let mut seen = Vec::new();
    for step in 0..STEPS {
        driver.receive(STEP.times(step.into()), &mut slots);
        let outputs = signals.iter().zip(&slots);
        let outputs = outputs.filter(|(signal, _)| signal.area == Area::Output);
        seen.push(outputs.map(|(_, slot)| slot.0).collect());
        for (index, signal) in signals.iter().enumerate() {
            match signal.name.as_str() {
                "in" => slots[index] = Slot::from_real(f64::from(step >= 5 && step % 40 < 35)),
                "number" | "half of" => slots[index] = Slot::from_real(f64::from(step * 3)),
                _ => {}
            }
        }
        driver.send(&mut slots);
    }
    seen
}

/// Runs the program and its machine in lock-step, in a run of [`STEPS`] steps at most: what the machine sees, and the
/// outcome.
fn in_lock_step(
    folder: &Path,
    program: &Path,
    change: impl FnOnce(&mut Settings),
) -> (Vec<Vec<u64>>, Outcome) {
    let listener = tcp::Listener::bind(&Address::local(0)).expect("a free port");
    let address = listener.address();
    let mut settings = Settings::new(STEP, StartCondition::Count(2));
    settings.steps = Some(STEPS.into());
    change(&mut settings);
    let server = thread::spawn(move || {
        let hosting = Hosting {
            clock: &*Monotonic::shared(),
            controls: &Controls::default(),
            news: &mut |_| {},
        };
        listener.run(settings, Logic::new(), hosting)
    });
    let fieldbus =
        |role: &str| format!("kind = \"sdsp\"\naddress = \"{address}\"\nrole = \"{role}\"");
    let path = driver_cfg(folder, "addressing = \"iec\"", &fieldbus("controller"));
    let config =
        Config::load(&path, &tickbus::KINDS).unwrap_or_else(|mistakes| panic!("{mistakes}"));
    let program = HostedProgram::load(program, &options(&[("alive", "%IX9.0"), super::IEC]));
    let program = program.unwrap_or_else(|error| panic!("{error}"));
    let plc = Host::open(&config, Box::new(program), STEP, Monotonic::shared()).expect("opens");
    let path = driver_cfg(folder, "addressing = \"iec\"", &fieldbus("device"));
    let (_logged, mut driver) = open(&path).expect("opens");
    let stepped = seen(&mut driver);
    driver.close();
    let outcome = server.join().expect("no panic").expect("as planned");
    assert_eq!((plc.fault(), plc.close()), (None, None));
    (stepped, outcome)
}

#[test]
#[cfg_attr(any(windows, no_cc), ignore = "there is no C compiler, cc")]
fn in_lock_step_a_program_scans_as_on_the_ticks_of_a_loopback() {
    let folder = folder();
    let program = by_hand(folder.path(), &[]);
    let path = driver_cfg(folder.path(), "addressing = \"iec\"", STEPPED);
    let (_logged, mut driver) = open(&path).expect("opens");
    let ticked = seen(&mut driver);

    let (stepped, outcome) = in_lock_step(folder.path(), &program, |_| {});
    assert_eq!(outcome.steps, u64::from(STEPS));

    // In lock-step the machine's initial values are present in the first scan; on the loopback that scan precedes the
    // machine.
    assert_eq!(stepped[2..], ticked[1..ticked.len() - 1]);
    let changes = ticked.windows(2).filter(|pair| pair[0] != pair[1]).count();
    assert!(changes > 20, "{changes} changes: the program has worked");
}

/// A compiled program has its state in memory of its own, which nothing can read; it computes it again.
#[test]
#[cfg_attr(any(windows, no_cc), ignore = "there is no C compiler, cc")]
fn a_program_continues_in_a_run_that_was_saved_and_restored() {
    let folder = folder();
    let program = by_hand(folder.path(), &[]);
    let file = folder.path().join("cell.saved");
    let (stepped, outcome) = in_lock_step(folder.path(), &program, |settings| {
        settings.save = Some(Save {
            file: file.clone(),
            at: Some(u64::from(STEPS / 2)),
        });
    });
    let (again, restored) = in_lock_step(folder.path(), &program, |settings| {
        settings.restore = Some(SavedRun::load(&file).expect("it was saved"));
    });
    assert_eq!((again, restored), (stepped, outcome));
}
