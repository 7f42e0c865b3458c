//! Replies of a machine, on drivers and hosted machines as users have them.

use std::fs;
use std::path::Path;
use std::process::Command;

use tickbus::driver::{Code, Driver};
use tickbus::driver_cfg::Config;
use tickbus::signal::Slot;
use tickbus::time::{Manual, Nanos};
use tickbus_test_log as logged;

/// The PLC's program mirrors: what the simulation writes as "Button" comes back as "Pump on", and so on.
const HEAD: &str = "[driver]\nid = 1\nname = \"Pump\"\n[fieldbus]\nkind = \"loopback\"\nprogram = \"mirror\"\n\
                    scan = \"10ms\"\nmode = \"stepped\"\n\
                    [[signal]]\nname = \"Button\"\naddress = \"%IX0.0\"\n\
                    [[signal]]\nname = \"Running\"\naddress = \"%IX0.1\"\n\
                    [[signal]]\nname = \"Oil\"\naddress = \"%IW2\"\ntype = \"INT\"\n\
                    [[signal]]\nname = \"Pump on\"\naddress = \"%QX0.0\"\n\
                    [[signal]]\nname = \"Running as the PLC sees it\"\naddress = \"%QX0.1\"\n\
                    [[signal]]\nname = \"Oil as the PLC sees it\"\naddress = \"%QW2\"\ntype = \"INT\"\n\
                    [[reply]]\nkind = \"follows\"\nsignal = \"Running\"\nwhen = \"Pump on\"\non_after = \"30ms\"\n\
                    [[reply]]\nkind = \"constant\"\nsignal = \"Oil\"\nvalue = 40\n";

struct Line {
    driver: Driver,
    slots: Vec<Slot>,
    millis: i64,
}

impl Line {
    fn new(more: &str) -> Self {
        let text = format!("{HEAD}{more}");
        let config = Config::parse("driver.cfg", &text, &tickbus::KINDS);
        let config = config.unwrap_or_else(|mistakes| panic!("{mistakes}"));
        let driver = Driver::open(config, Manual::new()).expect("opens");
        Self {
            slots: driver.initial_slots(),
            driver,
            millis: 0,
        }
    }

    fn tick(&mut self) {
        self.millis += 10;
        let time = Nanos::from_millis(self.millis);
        self.driver.exchange(time, &mut self.slots);
    }

    /// The signal with this index after each of so many ticks.
    fn seen(&mut self, signal: usize, ticks: usize) -> Vec<f64> {
        let ticks = 0..ticks;
        let seen = ticks.map(|_| {
            self.tick();
            self.slots[signal].real()
        });
        seen.collect()
    }
}

const BUTTON: usize = 0;
const RUNNING_AT_PLC: usize = 4;
const OIL: usize = 2;
const OIL_AT_PLC: usize = 5;

#[test]
fn a_driver_makes_replies_from_the_commands_of_the_plc_and_the_plc_gets_them() {
    let mut line = Line::new("");
    line.slots[BUTTON] = Slot::from_real(1.0);
    let seen = line.seen(RUNNING_AT_PLC, 10);
    let first = seen.iter().position(|on| *on > 0.5).expect("it runs");
    assert!((3..=6).contains(&first), "{seen:?}");
    assert!((line.slots[OIL_AT_PLC].real() - 40.0).abs() < 1e-9);
    // A second run after a reset is the same.
    line.driver.reset(&mut line.slots).expect("its own line");
    line.millis = 0;
    line.slots[BUTTON] = Slot::from_real(1.0);
    assert_eq!(line.seen(RUNNING_AT_PLC, 10), seen);
}

#[test]
fn a_fault_changes_the_signal_of_a_reply_and_gives_it_back() {
    let fault = "[[fault]]\nkind = \"stuck\"\nsignal = \"Oil\"\nvalue = 90\nat = \"50ms\"\nfor = \"30ms\"\n";
    logged::expect("fault \"stuck Oil\"");
    let mut line = Line::new(fault);
    let seen = line.seen(OIL_AT_PLC, 15);
    assert!(seen.contains(&90.0), "{seen:?}");
    assert!((seen[14] - 40.0).abs() < 1e-9, "{seen:?}");
    assert!(
        (line.slots[OIL].real() - 40.0).abs() < 1e-9,
        "the fault is not the simulation"
    );
}

#[test]
fn a_simulation_that_writes_the_signal_wins_and_log_and_statistics_say_so_once() {
    logged::expect("the simulation writes \"Oil\" itself");
    let mut line = Line::new("");
    line.tick();
    line.slots[OIL] = Slot::from_real(55.0);
    let seen = line.seen(OIL_AT_PLC, 5);
    assert!((seen[4] - 55.0).abs() < 1e-9, "{seen:?}");
    let statistics = line.driver.statistics();
    assert!(
        statistics.contains("replies=2\nreplies.overruled=Oil\n"),
        "{statistics}"
    );
}

/// A driver with this text behind its `[driver]` table, and its slots.
fn open(text: &str) -> (Driver, Vec<Slot>) {
    let text = format!("[driver]\nid = 1\nname = \"x\"\n{text}");
    let config = Config::parse("driver.cfg", &text, &tickbus::KINDS);
    let config = config.unwrap_or_else(|mistakes| panic!("{mistakes}"));
    let driver = Driver::open(config, Manual::new()).expect("opens");
    let slots = driver.initial_slots();
    (driver, slots)
}

#[test]
fn a_reply_reads_the_command_of_another_station() {
    let (mut driver, mut slots) = open(
        "[fieldbus]\nkind = \"loopback\"\nprogram = \"mirror\"\nscan = \"10ms\"\nmode = \"stepped\"\n\
         [[station]]\nname = \"one\"\n[[station]]\nname = \"two\"\n\
         [[signal]]\nname = \"Button\"\nstation = \"one\"\naddress = \"%IX0.0\"\n\
         [[signal]]\nname = \"Pump on\"\nstation = \"one\"\naddress = \"%QX0.0\"\n\
         [[signal]]\nname = \"Running\"\nstation = \"two\"\naddress = \"%IX0.0\"\n\
         [[signal]]\nname = \"Seen\"\nstation = \"two\"\naddress = \"%QX0.0\"\n\
         [[reply]]\nkind = \"follows\"\nsignal = \"Running\"\nwhen = \"Pump on\"\n",
    );
    slots[0] = Slot::from_real(1.0);
    for tick in 1..=6 {
        driver.exchange(Nanos::from_millis(10 * tick), &mut slots);
    }
    let values: Vec<f64> = slots[..4].iter().map(|slot| slot.real()).collect();
    assert_eq!(values, [1.0; 4]);
}

#[test]
fn a_command_that_is_stale_is_its_fail_safe_value_for_a_reply_too() {
    let (mut driver, mut slots) = open(
        "[fieldbus]\nkind = \"loopback\"\nlink = \"replies-stale\"\nmode = \"stepped\"\n\
         [[signal]]\nname = \"Stop\"\naddress = \"%QX0.0\"\nfail_safe = true\n\
         [[signal]]\nname = \"Stopped\"\naddress = \"%IX0.0\"\n\
         [[reply]]\nkind = \"follows\"\nsignal = \"Stopped\"\nwhen = \"Stop\"\n",
    );
    let codes = (1..=200).map(|tick| {
        let time = Nanos::from_millis(10 * tick);
        driver.exchange(time, &mut slots).code
    });
    assert_eq!(codes.last(), Some(Code::Stale));
    assert!(slots[1].real() > 0.5);
}

#[test]
fn a_second_send_in_a_tick_moves_nothing() {
    let (mut driver, mut slots) = open(
        "[fieldbus]\nkind = \"loopback\"\nprogram = \"mirror\"\n\
         [[signal]]\nname = \"Out\"\naddress = \"%IX0.0\"\n\
         [[signal]]\nname = \"Position\"\naddress = \"%ID4\"\ntype = \"REAL\"\n\
         [[reply]]\nkind = \"cylinder\"\nextend = \"Out\"\nposition = \"Position\"\nextend_time = \"100ms\"\n",
    );
    let mut seen = Vec::new();
    for tick in 1..=3 {
        driver.receive(Nanos::from_millis(10 * tick), &mut slots);
        slots[0] = Slot::from_real(1.0);
        for _ in 0..2 {
            driver.send(&mut slots);
            seen.push(slots[1].real());
        }
    }
    assert_eq!(seen, [0.0, 0.0, 10.0, 10.0, 20.0, 20.0]);
}

#[test]
fn a_test_file_adds_replies_and_forces_one_for_a_while() {
    let folder = tempfile::tempdir().expect("a folder");
    let (head, _) = HEAD.split_once("[[reply]]").expect("replies");
    fs::write(folder.path().join("pump.cfg"), head).expect("the driver.cfg");
    let test = "config = \"pump.cfg\"\nstep = \"10ms\"\n\
                [[machine.reply]]\nkind = \"follows\"\nsignal = \"Running\"\nwhen = \"Pump on\"\non_after = \"30ms\"\n\
                [[machine.reply]]\nkind = \"constant\"\nsignal = \"Oil\"\nvalue = 40\n\
                [[test]]\nname = \"runs\"\nsteps = [\n\
                { set = { Button = true }, await = \"Running as the PLC sees it\", within = \"100ms\" },\n\
                { force = { Oil = 90 }, await = { \"Oil as the PLC sees it\" = 90 }, within = \"50ms\" },\n\
                { release = \"Oil\", await = { \"Oil as the PLC sees it\" = 40 }, within = \"50ms\" },\n\
                { set = { Oil = 0 }, await = { \"Oil as the PLC sees it\" = 0 }, within = \"50ms\" },\n]\n";
    fs::write(folder.path().join("a.toml"), test).expect("the test file");
    let output = tickbus(folder.path(), &["test", "a.toml"]);
    assert!(output.0, "{}", output.1);
}

#[test]
fn a_mirror_with_replies_needs_some_in_its_file() {
    let folder = tempfile::tempdir().expect("a folder");
    let text = "[driver]\nid = 1\nname = \"x\"\n[fieldbus]\nkind = \"socket\"\n[[signal]]\nname = \"a\"\naddress = \"%IX0.0\"\n";
    fs::write(folder.path().join("x.cfg"), text).expect("the driver.cfg");
    let (is_ok, told) = tickbus(folder.path(), &["mirror", "x.cfg", "--replies"]);
    assert!(!is_ok);
    assert!(told.contains("x.cfg has no [[reply]]"), "{told}");
}

#[test]
fn a_mirror_with_replies_makes_them_on_its_bus_and_faults_change_them() {
    let folder = tempfile::tempdir().expect("a folder");
    let text = "[driver]\nid = 1\nname = \"x\"\n[fieldbus]\nkind = \"socket\"\naddress = \"127.0.0.1:0\"\n\
                [[signal]]\nname = \"Run\"\naddress = \"%QX0.0\"\n\
                [[signal]]\nname = \"Idle\"\naddress = \"%IX0.0\"\n\
                [[signal]]\nname = \"Oil\"\naddress = \"%IW2\"\n\
                [[reply]]\nkind = \"follows\"\nsignal = \"Idle\"\nwhen = \"not Run\"\non_after = \"20ms\"\n\
                [[reply]]\nkind = \"constant\"\nsignal = \"Oil\"\nvalue = 40\n";
    fs::write(folder.path().join("x.cfg"), text).expect("the driver.cfg");
    let fault = "[[fault]]\nkind = \"stuck\"\nsignal = \"Oil\"\nvalue = 90\nat = \"50ms\"\n";
    fs::write(folder.path().join("f.toml"), fault).expect("the faults");
    let arguments = "mirror x.cfg --replies --tick 10ms --duration 200ms --faults f.toml --stats";
    let (_, told) = tickbus(folder.path(), &arguments.split(' ').collect::<Vec<_>>());
    assert!(told.contains("\nreplies=2\nreplies.overruled=\n"), "{told}");
    assert!(told.contains("\nplc.rises.Idle=1\n"), "{told}");
    assert!(told.contains("\nfault.active=stuck Oil\n"), "{told}");
}

#[test]
fn check_lists_inputs_that_nobody_writes_and_what_it_proposes_makes_them() {
    let folder = tempfile::tempdir().expect("a folder");
    let signal = |name: &str, address: &str| {
        format!("[[signal]]\nname = \"{name}\"\naddress = \"{address}\"\n")
    };
    let text = [
        "[driver]\nid = 7\nname = \"x\"\n[fieldbus]\nkind = \"socket\"\n".to_owned(),
        signal("Pump 1 on", "%QX0.0"),
        signal("Pump 1 running", "%IX0.0"),
        signal("Door closed", "%IX0.1"),
        signal("Beam", "%IX0.2"),
        signal("Start button", "%IX0.3"),
    ]
    .concat();
    fs::write(folder.path().join("x.cfg"), &text).expect("the driver.cfg");
    let table = "# source | variable | transfer | destination\nmachine:beam | | | 7:Beam\nmachine:door | | | 8:Door closed\n";
    fs::write(folder.path().join("x.table"), table).expect("the table");
    let (is_ok, told) = tickbus(
        folder.path(),
        &["check", "x.cfg", "--unwritten", "--table", "x.table"],
    );
    assert!(is_ok, "{told}");
    let (list, proposed) = told.split_once("\n\n").expect("proposals");
    assert_eq!(
        list,
        "unwritten %IX0.0    Pump 1 running\nunwritten %IX0.1    Door closed\nunwritten %IX0.3    Start button"
    );
    let (proposed, last) = proposed.rsplit_once("\nunwritten: ").expect("a last line");
    assert_eq!(last, "3 of 4 inputs, replies proposed for 2\n");
    fs::write(folder.path().join("y.cfg"), text + proposed).expect("the driver.cfg");
    let (is_ok, told) = tickbus(folder.path(), &["check", "y.cfg"]);
    assert!(is_ok, "{told}");
    assert!(
        told.contains(
            "reply     \"motor Pump 1 running\" (motor): \"Pump 1 running\" from \"Pump 1 on\"\n"
        ),
        "{told}"
    );
}

#[test]
fn import_makes_a_first_set_of_replies() {
    let folder = tempfile::tempdir().expect("a folder");
    let list = "Name;Address;Type;Comment\nM1;%Q0.0;Bool;Pumpe 1 ein\nM1_FB;%I0.0;Bool;Pumpe 1 läuft\nS1;%I0.1;Bool;Not-Aus\n";
    fs::write(folder.path().join("tags.csv"), list).expect("the list");
    let arguments = ["import", "tags.csv", "--replies", "--out", "x.cfg"];
    let (is_ok, told) = tickbus(folder.path(), &arguments);
    assert!(is_ok, "{told}");
    assert!(
        told.contains("import: ok signals=3 assigned=0 skipped=0 replies=2"),
        "{told}"
    );
    let (is_ok, told) = tickbus(folder.path(), &["check", "x.cfg"]);
    assert!(is_ok, "{told}");
    assert!(told.contains("\"M1_FB\" from \"M1\""), "{told}");
    assert!(told.contains("(constant): \"S1\""), "{told}");
}

/// Runs the command; returns whether it went well, and all that it printed.
fn tickbus(folder: &Path, arguments: &[&str]) -> (bool, String) {
    let output = Command::new(env!("CARGO_BIN_EXE_tickbus"))
        .args(arguments)
        .current_dir(folder)
        .output()
        .expect("the tickbus program runs");
    let texts =
        [output.stdout, output.stderr].map(|text| String::from_utf8_lossy(&text).into_owned());
    (output.status.success(), texts.concat())
}

/// A drive whose words the mirror takes from the signals "Control" and "Wanted".
const DRIVE: &str = "[[signal]]\nname = \"Control\"\naddress = \"%IW10\"\n\
                     [[signal]]\nname = \"Wanted\"\naddress = \"%IW12\"\ntype = \"INT\"\n\
                     [[signal]]\nname = \"Hot\"\naddress = \"%IX4.0\"\n\
                     [[drive]]\nname = \"Fan\"\ntelegram = 1\nreference_speed = 16384\ncommand_offset = 10\n\
                     feedback_offset = 20\nramp_up = \"100ms\"\nramp_down = \"200ms\"\nfault = \"Hot\"\n";

const CONTROL: usize = 6;
const WANTED: usize = 7;
const HOT: usize = 8;
const ZSW1: usize = 11;
const NIST_A: usize = 12;

impl Line {
    /// The PLC writes STW1; the drive's bits 0 to 3 and 6 of ZSW1, without repetitions, for so many ticks.
    fn drives(&mut self, stw1: u16, ticks: usize) -> Vec<u16> {
        self.slots[CONTROL] = Slot::from_real(stw1.into());
        let seen = self.seen(ZSW1, ticks).into_iter();
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a word"
        )]
        let mut states: Vec<u16> = seen.map(|word| word as u16 & 0x4F).collect();
        states.dedup();
        states
    }

    #[track_caller]
    fn turns_at(&self, speed: f64) {
        let actual = self.slots[NIST_A].real();
        assert!((actual - speed).abs() < 0.5, "{actual}, expected {speed}");
    }
}

#[test]
fn a_drive_runs_up_and_down_while_nothing_but_its_plc_moves_it() {
    let mut line = Line::new(DRIVE);
    line.slots[WANTED] = Slot::from_real(8192.0);
    assert_eq!(line.drives(0x047E, 8), [0x40, 1]);
    assert_eq!(line.drives(0x047F, 20), [1, 3, 7]);
    line.turns_at(8192.0);
    assert_eq!(line.drives(0x047E, 30), [7, 3, 1]);
    line.turns_at(0.0);
    line.drives(0x047F, 20);
    line.slots[HOT] = Slot::from_real(1.0);
    assert_eq!(line.drives(0x047F, 4), [0x48]);
    line.slots[HOT] = Slot::from_real(0.0);
    assert_eq!(line.drives(0x047E, 4), [0x48]);
    assert_eq!(line.drives(0x04FE, 8), [0x48, 1]);
}

#[test]
fn the_speed_that_a_simulation_writes_is_that_of_the_drive() {
    logged::expect("Fan.NIST_A");
    let mut line = Line::new(DRIVE);
    line.drives(0x047E, 8);
    line.drives(0x047F, 8);
    line.slots[NIST_A] = Slot::from_real(1000.0);
    line.drives(0x047F, 4);
    assert_eq!(line.drives(0x047E, 40), [7, 3], "no standstill yet");
    line.slots[NIST_A] = Slot::from_real(0.0);
    assert_eq!(line.drives(0x047E, 4), [1]);
}

/// The outputs of a PLC are forced.
#[test]
fn a_drive_may_fail_by_its_own_speed_and_warn_by_a_reply_that_reads_it() {
    let (mut driver, mut slots) = open(
        "[fieldbus]\nkind = \"loopback\"\nprogram = \"mirror\"\n\
         [[signal]]\nname = \"Fast\"\naddress = \"%IX9.0\"\n\
         [[drive]]\nname = \"D\"\ntelegram = 1\nramp_up = \"1s\"\nfault = \"D.NIST_A > 1000\"\nwarning = \"Fast\"\n\
         [[reply]]\nkind = \"follows\"\nsignal = \"Fast\"\nwhen = \"D.NIST_A > 500\"\n",
    );
    let names = ["D.STW1", "D.NSOLL_A", "D.ZSW1", "D.NIST_A"];
    let names = names.map(|name| driver.config().table.position(name).expect("a signal"));
    let [stw1, setpoint, zsw1, speed] = names;
    let mut watch = driver.watch();
    for (signal, value) in [(setpoint, 3000.0), (stw1, f64::from(0x047E))] {
        let id = watch.force(signal, Slot::from_real(value));
        id.expect("there is room");
    }
    let mut seen = Vec::new();
    for tick in 0..600 {
        if tick == 10 {
            let id = watch.force(stw1, Slot::from_real(f64::from(0x047F)));
            id.expect("there is room");
        }
        driver.exchange(Nanos::from_millis(tick), &mut slots);
        seen.push((slots[zsw1].real(), slots[speed].real()));
    }
    let has = |value: f64, bit: u32| (value / f64::from(bit)).floor() % 2.0 > 0.5;
    let first = |bit| {
        seen.iter()
            .find(|(zsw1, _)| has(*zsw1, bit))
            .expect("it comes")
            .1
    };
    let (warned, failed) = (first(0x80), first(0x08));
    assert!((500.0..520.0).contains(&warned), "{warned}");
    assert!((980.0..1020.0).contains(&failed), "{failed}");
}

/// A client of a Modbus server: %QW0 is holding register 0, %IW0 input register 0.
#[cfg(unix)]
struct Plc(std::net::TcpStream);

#[cfg(unix)]
impl Plc {
    fn connect(address: &str) -> Self {
        Self(std::net::TcpStream::connect(address).expect("it listens"))
    }

    /// Sends STW1, if there is one, and returns ZSW1.
    fn words(&mut self, stw1: Option<u16>) -> u16 {
        use std::io::{Read as _, Write as _};
        let mut ask = |pdu: &[u8]| {
            let length = u8::try_from(pdu.len()).expect("a short one") + 1;
            let request = [&[0, 1, 0, 0, 0, length, 1], pdu].concat();
            self.0.write_all(&request).expect("it is sent");
            let mut head = [0; 7];
            self.0.read_exact(&mut head).expect("an answer");
            let mut answer = vec![0; usize::from(head[5]) - 1];
            self.0.read_exact(&mut answer).expect("an answer");
            answer
        };
        if let Some(stw1) = stw1 {
            let [high, low] = stw1.to_be_bytes();
            // With a setpoint of 100 %.
            ask(&[16, 0, 0, 0, 2, 4, high, low, 0x40, 0]);
        }
        let answer = ask(&[4, 0, 0, 0, 1]);
        u16::from_be_bytes([answer[2], answer[3]])
    }

    fn until(&mut self, stw1: u16, state: u16) {
        while self.words(Some(stw1)) & 0x4F != state {
            std::thread::yield_now();
        }
    }
}

/// A hosted machine keeps the other words of a PLC that is gone.
#[cfg(unix)]
#[test]
fn a_drive_without_its_plc_makes_a_quick_stop_in_a_hosted_machine_as_well() {
    use super::commands::Running;

    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("driver.cfg");
    let text = "[driver]\nid = 1\nname = \"x\"\n[fieldbus]\nkind = \"modbus-server\"\n\
                [[drive]]\nname = \"D\"\ntelegram = 1\nramp_up = \"10ms\"\nquick_stop = \"10ms\"\n";
    fs::write(&file, text).expect("the driver.cfg");
    let file = file.to_str().expect("a path");
    let arguments = [file, "--replies", "--address", "127.0.0.1:0"];
    let mut machine = Running::of("mirror", &arguments);
    let address = machine.after("mirror: opening: listening on ");
    let mut plc = Plc::connect(&address);
    plc.until(0x047E, 0x01);
    plc.until(0x047F, 0x07);
    // A fault, S1; the drive may miss a PLC that is back at once.
    let stopped = (0..20).any(|_| {
        plc.0
            .shutdown(std::net::Shutdown::Both)
            .expect("it is open");
        machine.after("mirror: opening: the peer left");
        plc = Plc::connect(&address);
        (0..100).any(|_| plc.words(None) & 0x4F == 0x48)
    });
    assert!(stopped, "it runs on without a PLC");
    plc.until(0x047E, 0x48);
    plc.until(0x04FE, 0x01);
    machine.kill();
}
