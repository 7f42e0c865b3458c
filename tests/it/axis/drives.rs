//! Ideal drives in place of the machine.

use std::path::Path;

use tickbus::driver_cfg::Config;
use tickbus::signal::{Area, Plan, Slot};
use tickbus::time::Nanos;

use crate::axis::{bytes, parse};

/// Drives in place of the machine, and a test in place of the PLC.
struct Drives {
    program: tickbus::plc::Axes,
    config: Config,
    outputs: Vec<u8>,
    inputs: Vec<u8>,
    slots: Vec<Slot>,
    now: Nanos,
}

impl Drives {
    fn new(axes: &str) -> Self {
        use tickbus::plc::Program as _;

        let config = parse(&format!(
            "[driver]\nid = 1\nname = \"axes\"\n[fieldbus]\nkind = \"socket\"\n{axes}"
        ));
        let mut program = tickbus::plc::Axes::new(&config.axes);
        program.fit(&config.table, config.addressing).expect("axes");
        let station = &config.table.stations[0];
        Self {
            program,
            outputs: vec![0; station.output_bytes],
            inputs: vec![0; station.input_bytes],
            slots: vec![Slot::default(); config.table.signals.len()],
            config,
            now: Nanos::ZERO,
        }
    }

    /// Sends these values until the signal is on; returns how many milliseconds that took.
    #[track_caller]
    fn until(&mut self, values: &[(&str, f64)], signal: &str) -> i64 {
        use tickbus::plc::{Program as _, Scan};

        self.outputs = bytes(&self.config, Area::Output, values);
        let place = self.config.table.position(signal).expect("a signal");
        for millis in 0..60_000 {
            self.now += Nanos::from_millis(1);
            self.program.scan(&mut Scan {
                now: self.now,
                alive: true,
                cycle: 0,
                inputs: &self.outputs,
                outputs: &mut self.inputs,
            });
            Plan::new(&self.config.table, 0, Area::Input).decode(&self.inputs, &mut self.slots);
            if self.slots[place].real() != 0.0 {
                return millis;
            }
        }
        panic!("{signal} never: {:?}", self.inputs);
    }
}

#[test]
fn ideal_drives_take_the_time_of_their_profile_with_and_without_a_limit_of_jerk() {
    let axis = "[[axis]]\nname = \"A\"\njerk = true\nlimits = [0, 20000]\n\
                [[axis.command]]\nnumber = 3\nposition = 16300\nspeed = 8000\nacceleration = 15000\n\
                deceleration = 15000\n\
                [[axis.switch]]\nname = \"there\"\nabove = 16299\naddress = \"%IX16.0\"\n";
    let rest = [("A.Enable", 1.0)];
    let go = [
        ("A.Enable", 1.0),
        ("A.Execute", 1.0),
        ("A.CommandNumber", 3.0),
    ];
    // From the middle, 10000, this is the move of 6300 documented in the thesis: 1.32083 s.
    let mut drives = Drives::new(axis);
    drives.until(&rest, "A.Healthy");
    let trapezoid = drives.until(&go, "A.CommandDone");
    assert!((1_320..=1_323).contains(&trapezoid), "{trapezoid} ms");
    drives.until(&go, "there");

    let mut drives = Drives::new(axis);
    drives.until(&rest, "A.Healthy");
    let mut smooth = go.to_vec();
    smooth.push(("A.Jerk", 150_000.0));
    // Each ramp takes a / j = 0.1 s longer, and its mean speed is half of the highest.
    let s_curve = drives.until(&smooth, "A.CommandDone");
    assert!((1_419..=1_424).contains(&s_curve), "{s_curve} ms");
}

/// Two processes over TCP: the charger's program homes all axes. With whole images, and with one axis at a
/// time.
#[test]
fn the_charger_moves_its_axes_over_a_real_socket() {
    use std::io::BufRead as _;
    use std::process::{Command, Stdio};

    let folder = tempfile::tempdir().expect("a folder");
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("plc/peeler/charger.cfg");
    let text = std::fs::read_to_string(file).expect("the file");
    for (number, cycle) in ["\"10ms\"", "\"2ms\"\nmessage = \"axis\""]
        .iter()
        .enumerate()
    {
        let file = folder.path().join(format!("{number}.cfg"));
        // On a busy machine an end may be silent for longer than the usual `max_age`.
        let timing = format!("{cycle}\nmax_age = \"5s\"");
        std::fs::write(&file, text.replace("\"10ms\"", &timing)).expect("a file");
        let tickbus = || Command::new(env!("CARGO_BIN_EXE_tickbus"));
        let mut machine = tickbus()
            .arg("axes")
            .arg(&file)
            .args(["--address", "127.0.0.1:0", "--duration", "60s"])
            .stdout(Stdio::piped())
            .spawn()
            .expect("it runs");
        let told = std::io::BufReader::new(machine.stdout.as_mut().expect("its output"));
        let address = told.lines().find_map(|line| {
            let line = line.expect("text");
            Some(
                line.strip_prefix("axes: opening: listening on ")?
                    .to_owned(),
            )
        });
        let record = folder.path().join(format!("{number}.csv"));
        let plc = tickbus()
            .args(["plc", "charger", "--stats", "--duration", "6s", "--config"])
            .arg(&file)
            .args(["--address", &address.expect("it listens"), "--record"])
            .arg(&record)
            .output()
            .expect("it runs");
        machine.kill().expect("it is there");
        machine.wait().expect("it ends");
        let told = String::from_utf8_lossy(&plc.stdout).into_owned();
        assert!(plc.status.success(), "{told}");
        assert!(told.contains("peeler.faults=0\n"), "{told}");
        for axis in ["step feeder", "transfer arm", "charger gate"] {
            assert!(
                told.contains(&format!("peeler.commands.{axis}=1\n")),
                "{told}"
            );
        }
        let recorded = std::fs::read_to_string(&record).expect("a recording");
        let mut rows = recorded.lines().filter(|line| !line.starts_with('#'));
        let columns: Vec<&str> = rows.next().expect("a heading").split(',').collect();
        let last: Vec<&str> = rows.next_back().expect("a row").split(',').collect();
        for (signal, home) in [
            ("linear feeder.ActualPosition", 650.0),
            ("centring spindle left.ActualPosition", 700.0),
            ("step feeder.ActualPosition", 0.0),
            ("transfer clamp right.ActualPosition", 800.0),
        ] {
            let column = columns.iter().position(|column| column.contains(signal));
            let at: f64 = last[column.unwrap_or_else(|| panic!("{signal} in {columns:?}"))]
                .parse()
                .expect("a number");
            assert!((at - home).abs() < 0.01, "{signal} is at {at}");
        }
    }
}
