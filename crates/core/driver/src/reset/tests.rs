use super::*;
use crate::Code;
use tickbus_base::time::{Clock, Monotonic};
use tickbus_base::toml_text::{Key, Table};
use tickbus_driver_cfg::Config;
use tickbus_fieldbus::faults::Phase;
use tickbus_fieldbus::{Bus, BusKind, BusOptions, BusSetup, NamedFile, OpenError, Role};
use tickbus_image::signal::SignalTable;

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
fn a_watch_knows_how_many_ticks_the_recording_has_from_before_a_reset() {
    let (mut driver, mut slots) = open(MIRROR, "[page]\n");
    let mut watch = driver.watch();
    for episodes in 0..3 {
        episode(&mut driver, &mut slots, 12);
        watch.ask(false);
        driver.exchange(Nanos::from_millis(12), &mut slots);
        assert!(watch.update());
        let place = watch.view(|view| (view.recorded_before, view.tick));
        assert_eq!(place, (episodes * 13, 13));
        driver.reset(&mut slots).expect("its line is its own");
    }
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

/// Records two episodes of three ticks into `file`, with `between` before the reset; returns the recording.
fn recorded(file: &str, between: impl FnOnce(&mut Driver, &mut [Slot])) -> String {
    let folder = folder(file);
    let file = folder.join(file);
    let record = format!("[record]\nfile = {:?}\n", file.display().to_string());
    let (mut driver, mut slots) = open(MIRROR, &record);
    // No tick is before the first episode.
    driver.reset(&mut slots).expect("its line is its own");
    episode(&mut driver, &mut slots, 3);
    between(&mut driver, &mut slots);
    driver.reset(&mut slots).expect("its line is its own");
    episode(&mut driver, &mut slots, 3);
    driver.close();
    let text = std::fs::read_to_string(&file).expect("a recording");
    std::fs::remove_dir_all(&folder).expect("it is there");
    text
}

/// The number and the time of each tick in a recording as CSV.
fn ticks(csv: &str) -> Vec<(&str, &str)> {
    csv.lines()
        .skip(1)
        .filter_map(|line| {
            let (number, rest) = line.split_once(',')?;
            Some((number, rest.split_once(',')?.0))
        })
        .collect()
}

#[test]
fn a_recording_continues_after_a_reset() {
    let text = recorded("continues.csv", |_, _| {});
    let expected = [
        ("1", "0"),
        ("2", "1000000"),
        ("3", "2000000"),
        ("4", "2000001"),
        ("5", "3000001"),
        ("6", "4000001"),
    ];
    assert_eq!(ticks(&text), expected, "{text}");
}

#[test]
fn a_tick_that_was_refused_before_a_reset_takes_no_time_from_the_recording() {
    let text = recorded("refused.csv", |driver, slots| {
        let done = driver.exchange(Nanos::ZERO, slots);
        assert_eq!(done.code, Code::BusFailed);
    });
    let expected = [
        ("1", "0"),
        ("2", "1000000"),
        ("3", "2000000"),
        ("4", "2000000"),
        ("5", "2000001"),
        ("6", "3000001"),
        ("7", "4000001"),
    ];
    assert_eq!(ticks(&text), expected, "{text}");
}

#[test]
fn the_ticks_before_and_after_a_reset_are_two_in_vcd() {
    let text = recorded("two.vcd", |_, _| {});
    let times: Vec<&str> = text.lines().filter(|line| line.starts_with('#')).collect();
    let expected = [
        "#0", "#1000000", "#2000000", "#2000001", "#3000001", "#4000001",
    ];
    assert_eq!(times, expected, "{text}");
}

#[test]
fn random_faults_draw_the_same_in_each_episode() {
    let faults = "[[fault]]\nkind = \"noise\"\nsignal = \"from\"\namplitude = 9\nseed = 4\n\
                  [[fault]]\nkind = \"drop\"\nchance = 0.5\ndirection = \"in\"\nseed = 4\n";
    let (mut driver, mut slots) = open(MIRROR, faults);
    let first = episode(&mut driver, &mut slots, 50);
    for round in 0..3 {
        driver.reset(&mut slots).expect("its line is its own");
        assert_eq!(episode(&mut driver, &mut slots, 50), first, "round {round}");
    }
    let ids: Vec<u32> = driver
        .injected_faults()
        .iter()
        .map(|fault| fault.id)
        .collect();
    assert_eq!(ids, [1, 2, 3, 4, 5, 6, 7, 8]);
}

#[test]
fn a_silence_after_a_reset_does_not_name_a_fault_from_before() {
    let link = "mode = \"stepped\"\nlink = \"reset: injected\"\nmax_age = \"500ms\"\n";
    let (mut driver, mut slots) = open(link, "");
    let mut other = config(link, "");
    other.role = tickbus_fieldbus::Role::Controller;
    let (mut plc, mut theirs) = opened(other, Monotonic::shared());
    driver
        .inject_text("name = \"jitter\"\nkind = \"delay\"\nby = \"1ms\"\n")
        .expect("right");
    let mut silence = |driver: &mut Driver| {
        for time in 0..3 {
            plc.exchange(None, &mut theirs);
            driver.exchange(Nanos::from_millis(time), &mut slots);
        }
        driver.exchange(Nanos::from_secs(9), &mut slots);
        let reason = driver.link().reason;
        driver.reset(&mut slots).expect("its line is its own");
        reason
    };
    let reason = silence(&mut driver);
    assert!(reason.contains("injected fault: \"jitter\""), "{reason}");
    let reason = silence(&mut driver);
    assert!(reason.ends_with("max_age = 500ms"), "{reason}");
}

/// A bus whose time others share; it is never opened.
#[derive(Clone, Debug, PartialEq)]
struct Shared;

impl BusKind for Shared {
    const NAME: &'static str = "shared";
    const KEYS: &'static [&'static [Key]] = &[];

    fn read(_role: Role, _moved: bool, _table: &mut Table<'_>) -> Option<Self> {
        Some(Self)
    }
}

impl BusOptions for Shared {
    fn summary(&self, _role: Role, _table: &SignalTable) -> Vec<String> {
        Vec::new()
    }

    fn files(&self) -> Vec<NamedFile> {
        Vec::new()
    }

    fn open(&self, _setup: &BusSetup<'_>) -> Result<Bus, OpenError> {
        unreachable!("a driver that cannot be reset opens nothing")
    }
}

/// Begins a tick, which the refused reset of `driver` must not end, and ends it.
#[track_caller]
fn refuses(driver: &mut Driver, slots: &mut [Slot]) -> DriverError {
    driver.receive(Nanos::ZERO, slots);
    let before = (driver.statistics(), slots.to_vec());
    let why = driver.reset(slots).expect_err("it cannot be reset");
    assert_eq!((driver.statistics(), slots.to_vec()), before);
    assert_eq!(statistic(driver, "fresh"), "0");
    driver.send(slots);
    assert_eq!(statistic(driver, "fresh"), "1");
    why
}

#[test]
fn a_driver_whose_time_belongs_to_others_as_well_goes_on_after_a_refused_reset() {
    let (mut driver, mut slots) = open(MIRROR, "");
    let bus = tickbus_driver_cfg::Options::of(Shared);
    driver.config = Arc::new(Config {
        bus,
        ..(*driver.config).clone()
    });
    let why = refuses(&mut driver, &mut slots);
    assert!(matches!(why, DriverError::Unsupported(_)), "{why}");
}

#[test]
fn a_driver_whose_line_cannot_be_opened_again_goes_on_after_a_refused_reset() {
    let folder = folder("reset-refused");
    let cfg = folder.join("driver.cfg");
    std::fs::write(folder.join("run.csv"), RUN).expect("written");
    let (mut driver, mut slots) = replaying(cfg.to_str().expect("UTF-8"));
    let mut elsewhere = (*driver.config).clone();
    elsewhere.path = folder.join("elsewhere").join("driver.cfg");
    driver.config = Arc::new(elsewhere);
    let why = refuses(&mut driver, &mut slots);
    assert!(matches!(why, DriverError::Replay(_)), "{why}");
    drop(driver);
    std::fs::remove_dir_all(&folder).expect("it is there");
}

/// A recording of one tick, which shows the value 7.
const RUN: &str = "bus.tick,bus.time_ns,bus.status,bus.dropped,from\n1,0,0,0,7\n";

/// Opens the driver at `path` with the recording `run.csv` beside it.
fn replaying(path: &str) -> (Driver, Vec<Slot>) {
    let text = "[driver]\nid = 1\nname = \"x\"\n[fieldbus]\nkind = \"loopback\"\nreplay = \"run.csv\"\n\
                [[signal]]\nname = \"from\"\naddress = \"%QB0\"\n";
    let config = Config::parse(path, text, &crate::KINDS).unwrap_or_else(|wrong| panic!("{wrong}"));
    opened(config, Monotonic::shared())
}

/// A process has one working folder, so this test runs in a process of its own.
#[test]
fn a_reset_finds_its_files_after_a_change_of_the_working_folder() {
    const NAME: &str = "reset::tests::a_reset_finds_its_files_after_a_change_of_the_working_folder";
    const CHILD: &str = "TICKBUS_TEST_OF_THE_WORKING_FOLDER";
    if std::env::var_os(CHILD).is_some() {
        std::fs::write("run.csv", RUN).expect("written");
        let (mut driver, mut slots) = replaying("driver.cfg");
        std::env::set_current_dir("..").expect("it is there");
        driver.reset(&mut slots).expect("the recording is there");
        driver.exchange(Nanos::ZERO, &mut slots);
        assert_eq!(slots[0], Slot::from_real(7.0));
        return;
    }
    let folder = folder("reset-working-folder");
    let own = std::env::current_exe().expect("a path");
    let child = std::process::Command::new(own)
        .args(["--exact", NAME])
        .env(CHILD, "")
        .current_dir(&folder)
        .output()
        .expect("it starts");
    std::fs::remove_dir_all(&folder).expect("it is there");
    let told = String::from_utf8_lossy(&child.stdout);
    assert!(told.contains("1 passed"), "{told}");
}
