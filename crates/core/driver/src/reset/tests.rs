use super::*;
use crate::Code;
use tickbus_base::time::{Clock, Monotonic};
use tickbus_driver_cfg::Config;
use tickbus_fieldbus::faults::Phase;

const SIGNALS: &str = "[[signal]]\nname = \"to\"\naddress = \"%IB0\"\nfail_safe = 3\n\
                       [[signal]]\nname = \"from\"\naddress = \"%QB0\"\nfail_safe = 9\n\
                       [[signal]]\nname = \"pulse in\"\naddress = \"%IX1.0\"\n\
                       [[signal]]\nname = \"pulse out\"\naddress = \"%QX1.0\"\nlatch = \"rising\"\n";

fn config(fieldbus: &str, rest: &str) -> Config {
    let text = format!(
        "[driver]\nid = 1\nname = \"x\"\n[fieldbus]\nkind = \"loopback\"\n{fieldbus}{SIGNALS}{rest}"
    );
    Config::parse("driver.cfg", &text, &crate::KINDS).unwrap_or_else(|wrong| panic!("{wrong}"))
}

fn open(fieldbus: &str, rest: &str) -> (Driver, Vec<Slot>) {
    opened(config(fieldbus, rest), Monotonic::shared())
}

fn opened(config: Config, clock: Arc<dyn Clock>) -> (Driver, Vec<Slot>) {
    let driver = Driver::open(config, clock).unwrap_or_else(|error| panic!("{error}"));
    let slots = driver.initial_slots();
    (driver, slots)
}

const MIRROR: &str = "mode = \"stepped\"\nprogram = \"mirror\"\nscan = \"1ms\"\n";

fn statistic(driver: &Driver, key: &str) -> String {
    let statistics = driver.statistics();
    let mut lines = statistics.lines();
    let found = lines.find_map(|line| line.strip_prefix(key)?.strip_prefix('='));
    found
        .unwrap_or_else(|| panic!("{key} in {statistics}"))
        .to_owned()
}

/// Ticks every millisecond from zero; returns the codes, values and counts that each tick shows.
fn episode(driver: &mut Driver, slots: &mut [Slot], ticks: i64) -> Vec<(Code, Nanos, Vec<Slot>)> {
    let run = (0..ticks).map(|tick| {
        slots[0] = Slot::from_real(20.0 + f64::from(i32::try_from(tick).expect("few")));
        slots[2] = Slot::from_real(f64::from(u8::from(tick % 3 == 1)));
        let done = driver.exchange(Nanos::from_millis(tick), slots);
        (done.code, done.granted, slots.to_vec())
    });
    run.collect()
}

#[test]
fn a_stepped_driver_repeats_its_first_episode_exactly() {
    let fault =
        "[[fault]]\nkind = \"stuck\"\nsignal = \"from\"\nvalue = 77\nat = \"5ms\"\nfor = \"3ms\"\n";
    let (mut driver, mut slots) = open(MIRROR, fault);
    let initial = slots.clone();
    let first = episode(&mut driver, &mut slots, 12);
    assert!(
        first
            .iter()
            .any(|(.., slots)| slots[1] == Slot::from_real(77.0))
    );
    assert!(
        first
            .iter()
            .any(|(.., slots)| slots[4] == Slot::from_real(1.0))
    );
    for round in 0..3 {
        driver.reset(&mut slots).expect("its line is its own");
        assert_eq!(slots, initial, "round {round}");
        assert_eq!(driver.link().state, LinkState::Opening);
        assert_eq!(statistic(&driver, "ticks"), "0");
        assert_eq!(statistic(&driver, "plc.scans"), "0");
        assert_eq!(episode(&mut driver, &mut slots, 12), first, "round {round}");
        assert_eq!(statistic(&driver, "ticks"), "12");
        assert_eq!(statistic(&driver, "state"), "running");
    }
}

#[test]
fn a_fault_that_was_injected_ends_with_its_episode() {
    let (mut driver, mut slots) = open(MIRROR, "");
    let stuck = driver
        .inject_text("kind = \"stuck\"\nsignal = \"from\"\nvalue = 50\n")
        .expect("right");
    episode(&mut driver, &mut slots, 3);
    assert_eq!(slots[1], Slot::from_real(50.0));
    driver.reset(&mut slots).expect("its line is its own");
    let faults = driver.injected_faults();
    let phase = faults.iter().find(|fault| fault.id == stuck);
    assert_eq!(phase.map(|fault| fault.phase), Some(Phase::Over));
    assert_eq!(slots[1], Slot::from_real(9.0));
    episode(&mut driver, &mut slots, 3);
    assert_eq!(slots[1], Slot::from_real(22.0));
}

#[test]
fn a_tick_that_was_begun_ends_with_the_reset() {
    let (mut driver, mut slots) = open(MIRROR, "");
    driver.receive(Nanos::from_millis(5), &mut slots);
    driver.reset(&mut slots).expect("its line is its own");
    let done = driver.receive(Nanos::ZERO, &mut slots);
    assert_eq!(done.code, Code::Fresh);
    // The tick of this episode has not ended, and that of the former one does not count.
    let counted = ["ticks", "fresh", "stale"].map(|key| statistic(&driver, key));
    assert_eq!(counted, ["1", "0", "0"]);
}

#[test]
fn a_program_on_its_own_thread_is_at_its_first_scan() {
    let (mut driver, mut slots) = open("program = \"mirror\"\nscan = \"1ms\"\n", "");
    let shows = |driver: &mut Driver, slots: &mut [Slot], value: f64| {
        slots[0] = Slot::from_real(value);
        eventually(|| {
            driver.exchange(None, slots);
            slots[1] == Slot::from_real(value)
        });
    };
    shows(&mut driver, &mut slots, 40.0);
    let cycles = driver.exchange(None, &mut slots).sequence;
    assert!(cycles > 0);
    driver.reset(&mut slots).expect("its line is its own");
    assert_eq!(slots, driver.initial_slots());
    assert_eq!(statistic(&driver, "ticks"), "0");
    shows(&mut driver, &mut slots, 41.0);
}

/// Calls `done` until it returns true.
fn eventually(mut done: impl FnMut() -> bool) {
    let clock = Monotonic::shared();
    let begin = clock.now();
    while !done() {
        assert!(
            clock.now() - begin < Nanos::from_secs(20),
            "it does not come"
        );
        std::thread::yield_now();
    }
}

#[test]
fn a_line_to_a_peer_stays_and_an_edge_that_no_tick_has_seen_is_forgotten() {
    let link = "mode = \"free\"\nlink = \"reset: stays\"\n";
    let (mut driver, mut slots) = open(link, "");
    let mut other = config(link, "");
    other.role = tickbus_fieldbus::Role::Controller;
    let (mut plc, mut theirs) = opened(other, Monotonic::shared());
    theirs[1] = Slot::from_real(60.0);
    plc.exchange(None, &mut theirs);
    eventually(|| {
        driver.exchange(None, &mut slots);
        slots[1] == Slot::from_real(60.0)
    });
    theirs[3] = Slot::from_real(1.0);
    plc.exchange(None, &mut theirs);
    let before = driver.image.peers.received(0);
    eventually(|| driver.image.peers.received(0) > before + 2);
    let runs = driver.status.runs();
    driver.reset(&mut slots).expect("the line stays");
    assert_eq!(slots, driver.initial_slots());
    assert_eq!(statistic(&driver, "ticks"), "0");
    let done = driver.exchange(None, &mut slots);
    // The level is shown, and its edge belongs to the episode before.
    assert!(done.code.code() <= 1, "{done:?}");
    let [sixty, on] = [60.0, 1.0].map(Slot::from_real);
    assert_eq!([slots[1], slots[3], slots[4]], [sixty, on, Slot::default()]);
    assert_eq!(driver.status.runs(), runs);
    // The next edge counts.
    for level in [0.0, 1.0] {
        theirs[3] = Slot::from_real(level);
        plc.exchange(None, &mut theirs);
        let level = Slot::from_real(level);
        eventually(|| {
            driver.exchange(None, &mut slots);
            slots[3] == level
        });
    }
    assert_eq!(slots[4], on);
}

#[test]
fn an_end_of_a_stepped_link_begins_again_and_meets_the_other_end() {
    let link = "mode = \"stepped\"\nlink = \"reset: stepped\"\n";
    let (mut driver, mut slots) = open(link, "");
    let mut other = config(link, "");
    other.role = tickbus_fieldbus::Role::Controller;
    let (mut plc, mut theirs) = opened(other, Monotonic::shared());
    for time in 0..40 {
        if time % 10 == 0 {
            driver.reset(&mut slots).expect("its line is its own");
            assert_eq!(slots[1], Slot::from_real(9.0));
        }
        let value = Slot::from_real(f64::from(time));
        (slots[0], theirs[1]) = (value, value);
        let done = driver.exchange(Nanos::from_millis(i64::from(time % 10)), &mut slots);
        assert_ne!(done.code, Code::BusFailed, "{}", driver.link().reason);
        plc.exchange(Nanos::from_millis(i64::from(time)), &mut theirs);
        // At first, the other end is not there yet.
        if time > 0 {
            assert_eq!(theirs[0], value, "at {time}");
        }
        if time % 10 > 0 {
            assert_eq!(slots[1], Slot::from_real(f64::from(time - 1)), "at {time}");
        }
    }
}

/// A new folder with this name.
fn folder(name: &str) -> std::path::PathBuf {
    let folder = std::env::temp_dir().join(format!("tickbus-{name}-{}", std::process::id()));
    std::fs::create_dir_all(&folder).expect("a folder");
    folder
}

#[test]
fn a_recording_as_the_other_end_is_replayed_from_its_beginning() {
    let folder = folder("reset-replay");
    let file = folder.join("run.csv").display().to_string();
    let (mut driver, mut slots) = open(MIRROR, &format!("[record]\nfile = {file:?}\n"));
    episode(&mut driver, &mut slots, 6);
    driver.close();
    let (mut driver, mut slots) = open(&format!("replay = {file:?}\n"), "");
    let first = episode(&mut driver, &mut slots, 6);
    assert_eq!(slots[1], Slot::from_real(25.0));
    driver.reset(&mut slots).expect("its line is its own");
    assert_eq!(episode(&mut driver, &mut slots, 6), first);
    assert_eq!(statistic(&driver, "replay.ticks"), "6");
    drop(driver);
    std::fs::remove_dir_all(&folder).expect("it is there");
}

#[test]
fn a_recording_continues_after_a_reset() {
    let folder = folder("reset");
    let file = folder.join("run.csv");
    let record = format!("[record]\nfile = {:?}\n", file.display().to_string());
    let (mut driver, mut slots) = open(MIRROR, &record);
    for _ in 0..2 {
        episode(&mut driver, &mut slots, 3);
        driver.reset(&mut slots).expect("its line is its own");
    }
    driver.close();
    let text = std::fs::read_to_string(&file).expect("a recording");
    std::fs::remove_dir_all(&folder).expect("it is there");
    let ticks: Vec<&str> = text
        .lines()
        .skip(1)
        .filter_map(|line| line.split(',').next())
        .collect();
    assert_eq!(ticks, ["1", "2", "3", "4", "5", "6"], "{text}");
    assert!(!text.contains("backwards"));
}
