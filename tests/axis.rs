//! The axis link: its bytes, and what the driver does for axes, with a PLC that is a bare TCP client.
#![allow(
    clippy::float_cmp,
    reason = "what went over the wire comes back to the bit"
)]

use std::io::{Read, Write};
use std::net::TcpStream;
use std::path::Path;
use std::time::{Duration, Instant};

use proptest::prelude::*;
use tickbus::axis::{COMMAND_BYTES, Field, Kind};
use tickbus::driver::{Config, Driver};
use tickbus::signal::{Area, Plan, Slot};
use tickbus::time::{Monotonic, Nanos};

fn peeler(name: &str) -> Config {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("plc/peeler/{name}.cfg"));
    Config::load(&path).unwrap_or_else(|mistakes| panic!("{mistakes}"))
}

fn parse(text: &str) -> Config {
    Config::parse("test.cfg", text).unwrap_or_else(|mistakes| panic!("{mistakes}\n{text}"))
}

/// The bytes of an area when these signals have these values, and all others are 0.
fn bytes(config: &Config, area: Area, values: &[(&str, f64)]) -> Vec<u8> {
    let mut slots = vec![Slot::default(); config.table.signals.len()];
    for (name, value) in values {
        let place = config.table.position(name);
        slots[place.unwrap_or_else(|| panic!("{name}"))] = Slot::from_real(*value);
    }
    let mut frame = vec![0; config.table.stations[0].bytes(area)];
    Plan::new(&config.table, 0, area).encode(&slots, &mut frame);
    frame
}

#[test]
fn both_records_have_the_sizes_that_were_captured_in_2018() {
    for (name, axes, output, input) in [("charger", 12, 360, 134), ("lathe", 13, 390, 130)] {
        let config = peeler(name);
        let station = &config.table.stations[0];
        assert_eq!(config.axes.len(), axes);
        assert_eq!((station.output_bytes, station.input_bytes), (output, input));
    }
}

#[test]
fn a_position_command_has_the_bytes_that_the_structure_says() {
    // The move that the thesis shows: 63 mm in hundredths, v = 8000, a = b = 15000.
    let frame = bytes(
        &peeler("charger"),
        Area::Output,
        &[
            ("linear feeder.Execute", 1.0),
            ("linear feeder.Enable", 1.0),
            ("linear feeder.TargetPosition", 63.0),
            ("linear feeder.Speed", 80.0),
            ("linear feeder.Acceleration", 150.0),
            ("linear feeder.Deceleration", 150.0),
            ("linear feeder.Torque", 100.0),
        ],
    );
    let command = [
        0x11, 0x00, // Execute and Enable
        0x45, 0xC4, 0xE0, 0x00, // 6300
        0x45, 0xFA, 0x00, 0x00, // 8000
        0x46, 0x6A, 0x60, 0x00, // 15000
        0x46, 0x6A, 0x60, 0x00, // 15000
        0x42, 0xC8, 0x00, 0x00, // 100
        0, 0, 0, 0, 0, 0, 0, 0, // reserved
    ];
    assert_eq!(frame[30..60], command);
    assert!(
        frame[..30]
            .iter()
            .chain(&frame[60..])
            .all(|byte| *byte == 0)
    );
}

#[test]
fn each_bit_lies_where_the_structure_says() {
    let lathe = peeler("lathe");
    for (signal, bits) in [
        ("knife carriage.Execute", 0x01),
        ("knife carriage.Tracking", 0x02),
        ("knife carriage.TorqueControl", 0x04),
        ("knife carriage.SpeedControl", 0x08),
        ("knife carriage.Enable", 0x10),
    ] {
        let frame = bytes(&lathe, Area::Output, &[(signal, 1.0)]);
        assert_eq!((frame[90], frame[91]), (bits, 0), "{signal}");
    }
    for (signal, bits) in [("spindle left.Close", 0x02), ("spindle left.Open", 0x04)] {
        assert_eq!(
            bytes(&lathe, Area::Output, &[(signal, 1.0)])[0],
            bits,
            "{signal}"
        );
    }
    for (signal, bits) in [
        ("knife carriage.Healthy", 0x01),
        ("knife carriage.InPosition", 0x02),
        ("knife carriage.Acknowledge", 0x04),
    ] {
        let frame = bytes(&lathe, Area::Input, &[(signal, 1.0)]);
        assert_eq!((frame[30], frame[31]), (bits, 0), "{signal}");
    }
    // −15536 is what becomes of 50000 where somebody takes an INT for a UINT.
    let frame = bytes(
        &lathe,
        Area::Input,
        &[("knife carriage.ActualPosition", 500.0)],
    );
    assert_eq!(frame[32..36], 50_000.0_f32.to_be_bytes());
}

#[test]
fn the_charger_s_fourteen_bytes_lie_behind_its_axes() {
    let charger = peeler("charger");
    for step in 1..=16_usize {
        let name = format!("block at feeder step {step}");
        let frame = bytes(&charger, Area::Input, &[(&name, 1.0)]);
        let mut expected = vec![0; 134];
        expected[120 + (step - 1) / 8] = 1 << ((step - 1) % 8);
        assert_eq!(frame, expected);
    }
    for (name, at) in [
        ("pre-centring distance 1", 122),
        ("pre-centring distance 2", 126),
        ("simulation time", 130),
    ] {
        let frame = bytes(&charger, Area::Input, &[(name, 1.5)]);
        assert_eq!(frame[at..at + 4], 1.5_f32.to_be_bytes(), "{name}");
    }
}

/// An axis as a test makes it up.
#[derive(Clone, Debug)]
struct Made {
    kind: Kind,
    inverted: bool,
    gain: f64,
    flags: [bool; 4],
    gaps: (usize, usize),
}

fn made() -> impl Strategy<Value = Made> {
    let kinds = prop::sample::select(Kind::ALL.map(|(_, kind)| kind).to_vec());
    let gains = prop::sample::select(vec![1.0, 10.0, 50.0, 100.0]);
    let gaps = (0_usize..5, 0_usize..5);
    (kinds, any::<bool>(), gains, any::<[bool; 4]>(), gaps).prop_map(
        |(kind, inverted, gain, flags, gaps)| Made {
            kind,
            inverted,
            gain,
            flags,
            gaps,
        },
    )
}

/// The driver.cfg of these axes, and where it puts each: the offsets of its structures and the size of the second.
fn made_up(axes: &[Made]) -> (String, Vec<(usize, usize, usize)>) {
    use std::fmt::Write as _;

    let mut text =
        "[driver]\nid = 1\nname = \"made up\"\n[fieldbus]\nkind = \"socket\"\n".to_owned();
    let (mut command, mut feedback, mut places) = (0, 0, Vec::new());
    for (number, axis) in axes.iter().enumerate() {
        command += axis.gaps.0;
        feedback += axis.gaps.1;
        let [acknowledge, diagnostics, jerk, numbered] = axis.flags;
        write!(
            text,
            "[[axis]]\nname = \"axis {number}\"\nkind = \"{}\"\nlimits = [-20.0, 320.0]\ninverted = {}\n\
             scale = {{ raw = [0, {}], value = [0, 1] }}\nacknowledge = {acknowledge}\n\
             diagnostics = {diagnostics}\njerk = {jerk}\n",
            axis.kind.name(),
            axis.inverted,
            axis.gain,
        )
        .expect("a string takes all");
        if axis.gaps.0 > 0 {
            writeln!(text, "command_offset = {command}").expect("a string takes all");
        }
        if axis.gaps.1 > 0 {
            writeln!(text, "feedback_offset = {feedback}").expect("a string takes all");
        }
        if numbered {
            text += "command = [{ number = 9 }]\n";
        }
        let size = if diagnostics || numbered { 16 } else { 10 };
        places.push((command, feedback, size));
        command += COMMAND_BYTES;
        feedback += size;
    }
    (text, places)
}

proptest! {
    #[test]
    fn any_number_of_axes_lies_as_an_independent_reckoning_says(axes in prop::collection::vec(made(), 1..30)) {
        let (text, places) = made_up(&axes);
        let config = parse(&text);
        let station = &config.table.stations[0];
        let (command, feedback, size) = *places.last().expect("one at least");
        prop_assert_eq!(station.output_bytes, command + 30);
        prop_assert_eq!(station.input_bytes, feedback + size);
        for (number, (axis, (command, feedback, _))) in axes.iter().zip(&places).enumerate() {
            let (bits, torque) = match axis.kind {
                Kind::Torque => (["Execute", "Close", "Open", "SpeedControl", "Enable"], "Torque"),
                _ => (["Execute", "Tracking", "TorqueControl", "SpeedControl", "Enable"], "Torque"),
            };
            let name = |field: &str| format!("axis {number}.{field}");
            for (bit, field) in bits.into_iter().enumerate() {
                let frame = bytes(&config, Area::Output, &[(&name(field), 1.0)]);
                prop_assert_eq!(frame[*command], 1 << bit);
            }
            let real = |area, at: usize, field: &str, value: f64| {
                let frame = bytes(&config, area, &[(&name(field), value)]);
                let raw: [u8; 4] = frame[at..at + 4].try_into().expect("four bytes");
                f64::from(f32::from_be_bytes(raw))
            };
            // Inverted, a position counts from the other limit, and a speed the other way; sizes stay.
            let position = if axis.inverted { 300.0 - 75.0 } else { 75.0 };
            let sign = if axis.inverted { -1.0 } else { 1.0 };
            prop_assert_eq!(real(Area::Output, command + 2, "TargetPosition", 75.0), position * axis.gain);
            prop_assert_eq!(real(Area::Input, feedback + 2, "ActualPosition", 75.0), position * axis.gain);
            prop_assert_eq!(real(Area::Input, feedback + 6, "ActualSpeed", 75.0), sign * 75.0 * axis.gain);
            prop_assert_eq!(real(Area::Output, command + 6, "Speed", 75.0), 75.0 * axis.gain);
            prop_assert_eq!(real(Area::Output, command + 10, "Acceleration", 75.0), 75.0 * axis.gain);
            prop_assert_eq!(real(Area::Output, command + 14, "Deceleration", 75.0), 75.0 * axis.gain);
            prop_assert_eq!(real(Area::Output, command + 18, torque, 75.0), 75.0);
            let there = [("Acknowledge", 0), ("Status", 1), ("Error", 1), ("Jerk", 2), ("CommandNumber", 3), ("CommandDone", 3)];
            for (field, flag) in there {
                prop_assert_eq!(config.table.position(&name(field)).is_some(), axis.flags[flag], "{}", field);
            }
            if axis.flags[2] {
                prop_assert_eq!(real(Area::Output, command + 26, "Jerk", 75.0), 75.0 * axis.gain);
            }
            if axis.flags[3] {
                let frame = bytes(&config, Area::Output, &[(&name("CommandNumber"), 258.0)]);
                prop_assert_eq!(&frame[command + 22..command + 24], &[1, 2]);
                let frame = bytes(&config, Area::Input, &[(&name("CommandDone"), 258.0)]);
                prop_assert_eq!(&frame[feedback + 14..feedback + 16], &[1, 2]);
            }
            if axis.flags[1] {
                let frame = bytes(&config, Area::Input, &[(&name("Status"), 258.0), (&name("Error"), 772.0)]);
                prop_assert_eq!(&frame[feedback + 10..feedback + 14], &[1, 2, 3, 4]);
            }
        }
    }
}

/// Whatever is wrong with a file of axes is told, and what is right is consistent.
fn check_any(text: &str) -> Result<(), TestCaseError> {
    use std::collections::HashSet;

    let Ok(config) = Config::parse("any.cfg", text) else {
        return Ok(());
    };
    let mut names = HashSet::new();
    let mut bits = HashSet::new();
    for signal in &config.table.signals {
        prop_assert!(names.insert(signal.name.clone()), "{} twice", signal.name);
        let size = config.table.stations[signal.station].bytes(signal.area);
        for bit in signal.address().bits() {
            prop_assert!(bit < size * 8);
            prop_assert!(bits.insert((signal.station, signal.area, bit)));
        }
        prop_assert!(
            signal
                .scale
                .is_none_or(|scale| scale.offset.is_finite() && scale.gain != 0.0)
        );
        prop_assert!(signal.fail_safe.real().is_finite());
    }
    for axis in &config.axes {
        for field in [Field::Execute, Field::Enable, Field::ActualPosition] {
            prop_assert!(axis.slot(field).is_some());
        }
    }
    Ok(())
}

proptest! {
    #[test]
    fn lines_that_are_lost_doubled_or_changed_do_no_harm(
        changes in prop::collection::vec((0_usize..60, 0_usize..8), 1..6)
    ) {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/right/axes.cfg");
        let text = std::fs::read_to_string(path).expect("the file");
        let mut lines: Vec<String> = text.lines().map(str::to_owned).collect();
        for (line, change) in changes {
            let line = line % lines.len();
            match change {
                0 => drop(lines.remove(line)),
                1 => lines.insert(line, lines[line].clone()),
                2 => lines[line] = lines[line].replace("65", "1e308"),
                3 => lines[line] = lines[line].replace("0.0", "-1e308"),
                4 => lines[line] = lines[line].replace("lift", "drum"),
                5 => lines[line] = lines[line].replace('0', "7"),
                6 => lines[line] = lines[line].replace("true", "false"),
                _ => lines[line] = lines[line].replace('"', ""),
            }
        }
        check_any(&lines.join("\n"))?;
    }
}

/// A machine whose driver listens, and a PLC that is a bare TCP client.
struct Pair {
    machine: Machine,
    plc: TcpStream,
    outputs: Vec<u8>,
    inputs: Vec<u8>,
}

/// An open driver, ticked by the test.
struct Machine {
    driver: Driver,
    slots: Vec<Slot>,
    ticks: i64,
}

impl Machine {
    fn new(text: &str) -> Self {
        let driver =
            Driver::open(parse(text), Monotonic::shared().expect("a clock")).expect("opens");
        Self {
            slots: driver.initial_slots(),
            driver,
            ticks: 0,
        }
    }

    fn statistic(&self, key: &str) -> Option<String> {
        let statistics = self.driver.statistics();
        let mut lines = statistics.lines();
        lines.find_map(|line| Some(line.strip_prefix(key)?.strip_prefix('=')?.to_owned()))
    }

    /// Connects with each address that it listens on.
    fn clients(&self, count: usize) -> Vec<TcpStream> {
        let begun = Instant::now();
        let addresses = loop {
            let told = self.statistic("address").unwrap_or_default();
            let addresses: Vec<String> = told.split_whitespace().map(str::to_owned).collect();
            if addresses.len() == count {
                break addresses;
            }
            assert!(begun.elapsed() < Duration::from_secs(10), "{told}");
            std::thread::yield_now();
        };
        addresses.iter().map(client).collect()
    }

    fn place(&self, name: &str) -> usize {
        let place = self.driver.config().table.position(name);
        place.unwrap_or_else(|| panic!("{name}"))
    }

    fn get(&self, name: &str) -> f64 {
        self.slots[self.place(name)].real()
    }

    fn set(&mut self, name: &str, value: f64) {
        let place = self.place(name);
        self.slots[place] = Slot::from_real(value);
    }

    fn tick(&mut self) {
        self.ticks += 1;
        self.driver
            .exchange(Nanos::from_millis(self.ticks), &mut self.slots);
    }

    #[track_caller]
    fn until(&mut self, what: &str, is: impl Fn(&Self) -> bool) {
        let begun = Instant::now();
        while !is(self) {
            assert!(begun.elapsed() < Duration::from_secs(20), "{what}");
            self.tick();
            std::thread::yield_now();
        }
    }
}

fn client(address: &String) -> TcpStream {
    let plc = TcpStream::connect(address).expect("it listens");
    plc.set_nodelay(true).expect("a socket");
    plc.set_read_timeout(Some(Duration::from_secs(10)))
        .expect("a socket");
    plc
}

impl Pair {
    fn new(axes: &str) -> Self {
        let machine = Machine::new(&format!(
            "[driver]\nid = 1\nname = \"axes\"\n[fieldbus]\nkind = \"socket\"\naddress = \"127.0.0.1:0\"\n\
             cycle = \"2ms\"\n{axes}"
        ));
        let station = &machine.driver.config().table.stations[0];
        Self {
            outputs: vec![0; station.output_bytes],
            inputs: vec![0; station.input_bytes],
            plc: machine.clients(1).remove(0),
            machine,
        }
    }

    fn get(&self, name: &str) -> f64 {
        self.machine.get(name)
    }

    fn set(&mut self, name: &str, value: f64) {
        self.machine.set(name, value);
    }

    /// The PLC sends its outputs and takes a record; the machine ticks.
    fn turn(&mut self) {
        self.plc
            .write_all(&self.outputs)
            .expect("the machine reads");
        self.plc
            .read_exact(&mut self.inputs)
            .expect("the machine sends");
        self.machine.tick();
    }

    #[track_caller]
    fn until(&mut self, what: &str, is: impl Fn(&Self) -> bool) {
        let begun = Instant::now();
        while !is(self) {
            assert!(
                begun.elapsed() < Duration::from_secs(20),
                "{what}: {:?}",
                self.inputs
            );
            self.turn();
        }
    }
}

#[test]
fn the_machine_acknowledges_so_that_the_edge_may_fall_at_once() {
    let mut pair = Pair::new("[[axis]]\nname = \"A\"\nacknowledge = true\n");
    for _ in 0..20 {
        pair.outputs[0] = 0x11;
        pair.until("an acknowledge", |pair| pair.inputs[0] & 4 != 0);
        // Whoever sees it knows that a tick has had the command.
        pair.outputs[0] = 0x10;
        pair.until("its fall", |pair| pair.inputs[0] & 4 == 0);
    }
    pair.until("a tick without", |pair| pair.get("A.Execute") == 0.0);
}

#[test]
fn a_command_number_stands_for_what_the_table_of_the_machine_says() {
    let mut pair = Pair::new(
        "[[axis]]\nname = \"A\"\nkind = \"tracking\"\ndiagnostics = true\nlimits = [0.0, 400.0]\n\
         [[axis.command]]\nnumber = 258\nmode = \"position\"\nposition = 300.0\nspeed = 80.0\nacceleration = 150.0\n\
         [[axis.command]]\nnumber = 2\ntorque = 1.5\n",
    );
    assert_eq!((pair.outputs.len(), pair.inputs.len()), (30, 16));
    // What the table does not state comes from the PLC: here the deceleration.
    pair.outputs[0] = 0x11;
    pair.outputs[2..6].copy_from_slice(&7.0_f32.to_be_bytes());
    pair.outputs[14..18].copy_from_slice(&99.0_f32.to_be_bytes());
    pair.outputs[22..24].copy_from_slice(&[1, 2]);
    pair.set("A.InPosition", 0.0);
    pair.until("the command", |pair| pair.get("A.Execute") == 1.0);
    let told = ["TargetPosition", "Speed", "Acceleration", "Deceleration"];
    let told = told.map(|field| pair.get(&format!("A.{field}")));
    assert_eq!(told, [300.0, 80.0, 150.0, 99.0]);
    assert_eq!(pair.inputs[14..16], [0, 0], "not done yet");
    pair.set("A.InPosition", 1.0);
    pair.until("done", |pair| pair.inputs[14..16] == [1, 2]);

    pair.outputs[0] = 0x10;
    pair.outputs[22..24].copy_from_slice(&[0, 2]);
    pair.until("the next", |pair| pair.get("A.Torque") == 1.5);
    assert_eq!(pair.get("A.Tracking"), 1.0, "the mode of the table");
    assert_eq!(
        pair.get("A.TargetPosition"),
        7.0,
        "and the offset of the PLC"
    );

    pair.outputs[0] = 0x11;
    pair.outputs[22..24].copy_from_slice(&[0, 3]);
    pair.until("an error", |pair| pair.inputs[12..14] == [0, 3]);
    for _ in 0..5 {
        assert_eq!(pair.get("A.Execute"), 0.0, "no command for the simulation");
        pair.turn();
    }
    pair.outputs[22..24].copy_from_slice(&[0, 0]);
    assert_eq!(
        pair.get("A.Error"),
        0.0,
        "the simulation's own is as it was"
    );
    pair.until("no error", |pair| pair.inputs[12..14] == [0, 0]);
    pair.until("a command of the PLC's own", |pair| {
        pair.get("A.TargetPosition") == 7.0 && pair.get("A.Execute") == 1.0
    });
}

#[test]
fn end_switches_trip_at_their_positions_and_let_go_behind_their_hysteresis() {
    let mut pair = Pair::new(
        "[[axis]]\nname = \"A\"\nlimits = [0.0, 400.0]\n\
         [[axis.switch]]\nname = \"up\"\nabove = 395.0\nhysteresis = 2.0\naddress = \"%IX10.3\"\n\
         [[axis.switch]]\nname = \"down\"\nbelow = 0.5\naddress = \"%IX10.4\"\n",
    );
    assert_eq!(pair.inputs.len(), 11);
    for (position, switches) in [
        (200.0, 0),
        (394.9, 0),
        (395.0, 8),
        (393.1, 8),
        (392.9, 0),
        (394.0, 0),
        (400.0, 8),
        (0.6, 0),
        (0.5, 16),
        (0.0, 16),
        (0.51, 0),
    ] {
        pair.set("A.ActualPosition", position);
        let raw = f32::to_be_bytes(
            #[expect(clippy::cast_possible_truncation, reason = "as the codec does")]
            {
                position as f32
            },
        );
        pair.until("the position", |pair| pair.inputs[2..6] == raw);
        assert_eq!(pair.inputs[10], switches, "{position}");
    }
}

#[test]
fn fields_are_found_by_their_axis() {
    let charger = peeler("charger");
    let axis = &charger.axes[9];
    assert_eq!(axis.signal(Field::Tracking), "transfer clamp left.Close");
    let slot = axis.slot(Field::Tracking).expect("it has one");
    assert_eq!(
        charger.table.signals[slot].name,
        "transfer clamp left.Close"
    );
    assert_eq!(axis.slot(Field::Jerk), None);
}

/// Three axes, one signal beside them, and one message for each.
const ONE_BY_ONE: &str = "[driver]\nid = 1\nname = \"one by one\"\n[fieldbus]\nkind = \"socket\"\n\
    address = \"127.0.0.1:0\"\nmessage = \"axis\"\ncycle = \"2ms\"\n\
    [[axis]]\nname = \"A\"\n[[axis]]\nname = \"B\"\n[[axis]]\nname = \"C\"\ndiagnostics = true\n\
    [[signal]]\nname = \"time\"\naddress = \"%ID36\"\ntype = \"REAL\"\n";

#[test]
fn an_axis_per_message_reaches_that_axis_and_leaves_the_others() {
    let mut machine = Machine::new(ONE_BY_ONE);
    let mut plc = machine.clients(1).remove(0);
    let message = |axis: u8, bits: u8, position: f32| {
        let mut bytes = vec![0, axis, bits, 0];
        bytes.extend(position.to_be_bytes());
        bytes.resize(32, 0);
        bytes
    };
    plc.write_all(&message(2, 0x11, 20.0)).expect("it reads");
    machine.until("a command for B", |machine| machine.get("B.Execute") == 1.0);
    plc.write_all(&message(3, 0x10, 30.0)).expect("it reads");
    machine.until("the position of C", |machine| {
        machine.get("C.TargetPosition") == 30.0
    });
    assert_eq!(machine.get("B.TargetPosition"), 20.0);
    assert_eq!(machine.get("A.Enable"), 0.0);
    let pulses = machine.place("B.Execute");
    assert_eq!(machine.slots[pulses].real(), 1.0, "B goes on as it was");
    // An edge between two ticks is seen, too.
    plc.write_all(&message(2, 0x10, 20.0)).expect("it reads");
    machine.until("its end", |machine| machine.get("B.Execute") == 0.0);
    let both = [message(2, 0x11, 21.0), message(2, 0x10, 21.0)].concat();
    plc.write_all(&both).expect("it reads");
    machine.until("a short pulse", |machine| machine.get("B.Execute") == 1.0);
    machine.until("its end", |machine| machine.get("B.Execute") == 0.0);
}

#[test]
fn feedback_comes_axis_by_axis_what_has_changed_first() {
    let mut machine = Machine::new(ONE_BY_ONE);
    machine.set("A.ActualPosition", 1.0);
    machine.set("B.ActualPosition", 2.0);
    machine.set("C.Status", 772.0);
    machine.set("time", 4.0);
    machine.tick();
    let mut plc = machine.clients(1).remove(0);
    // The longest structure has 16 bytes, so each message has 18.
    let mut record = [0; 18];
    let mut seen = [[0; 16]; 4];
    for _ in 0..4 {
        plc.read_exact(&mut record).expect("a message");
        assert_eq!(record[0], 0);
        seen[usize::from(record[1])].copy_from_slice(&record[2..]);
    }
    assert_eq!(seen[1][2..6], 1.0_f32.to_be_bytes());
    assert_eq!(seen[2][2..6], 2.0_f32.to_be_bytes());
    assert_eq!(seen[3][10..12], [3, 4]);
    assert_eq!(
        seen[0][..4],
        4.0_f32.to_be_bytes(),
        "what belongs to no axis is part 0"
    );
    machine.set("B.ActualPosition", 5.0);
    machine.tick();
    // At most what was under way, and then B before its turn.
    let mut turns = 0;
    while record[1] != 2 || record[4..8] != 5.0_f32.to_be_bytes() {
        plc.read_exact(&mut record).expect("a message");
        turns += 1;
        assert!(turns < 200, "B has its turn");
    }
}

#[test]
fn a_message_for_an_axis_that_there_is_not_ends_the_connection_with_its_reason() {
    let mut machine = Machine::new(ONE_BY_ONE);
    let mut plc = machine.clients(1).remove(0);
    let mut message = [0; 32];
    message[1] = 4;
    plc.write_all(&message).expect("it reads");
    machine.until("the reason", |machine| {
        let reason = machine.statistic("reason").unwrap_or_default();
        reason.contains("axis 4, but there are 3") && reason.contains("listening")
    });
    assert_eq!(machine.statistic("cause").as_deref(), Some("protocol"));
}

#[test]
fn both_plcs_are_two_stations_of_one_driver_each_at_a_port_of_its_own() {
    let mut machine = Machine::new(
        "[driver]\nid = 1\nname = \"line\"\n[fieldbus]\nkind = \"socket\"\ncycle = \"2ms\"\n\
         max_age = \"250ms\"\n\
         [[station]]\nname = \"charger\"\naddress = \"127.0.0.1:0\"\n\
         [[station]]\nname = \"lathe\"\naddress = \"127.0.0.1:0\"\n\
         [[axis]]\nname = \"feeder\"\nstation = \"charger\"\n\
         [[axis]]\nname = \"arm\"\nstation = \"charger\"\n\
         [[axis]]\nname = \"knife\"\nstation = \"lathe\"\n",
    );
    let mut clients = machine.clients(2);
    let (mut lathe, mut charger) = (clients.remove(1), clients.remove(0));
    let mut outputs = [vec![0; 60], vec![0; 30]];
    outputs[0][30] = 0x10;
    outputs[1][0] = 0x10;
    machine.set("arm.ActualPosition", 1.0);
    machine.set("knife.ActualPosition", 2.0);
    let talk = |machine: &mut Machine, plc: &mut TcpStream, station: usize| {
        let mut input = vec![0; [20, 10][station]];
        plc.write_all(&outputs[station]).expect("it reads");
        plc.read_exact(&mut input).expect("a record");
        machine.tick();
        input
    };
    let begun = Instant::now();
    loop {
        let input = talk(&mut machine, &mut charger, 0);
        let other = talk(&mut machine, &mut lathe, 1);
        if machine.get("arm.Enable") + machine.get("knife.Enable") == 2.0
            && input[12..16] == 1.0_f32.to_be_bytes()
            && other[2..6] == 2.0_f32.to_be_bytes()
        {
            break;
        }
        assert!(begun.elapsed() < Duration::from_secs(10));
    }
    let running = |machine: &Machine| machine.statistic("state").as_deref() == Some("running");
    assert!(running(&machine), "{:?}", machine.statistic("reason"));

    // One goes, and the other does not notice.
    drop(lathe);
    while machine.get("knife.Enable") == 1.0 {
        talk(&mut machine, &mut charger, 0);
        assert!(begun.elapsed() < Duration::from_secs(20));
    }
    assert_eq!(machine.get("arm.Enable"), 1.0);
    assert!(!running(&machine));
    let reason = machine.statistic("reason").expect("a reason");
    assert!(
        reason.contains("\"charger\": connected with") && reason.contains("\"lathe\": listening"),
        "{reason}"
    );

    // And it comes back.
    let mut lathe = machine.clients(2).remove(1);
    while !running(&machine) || machine.get("knife.Enable") == 0.0 {
        talk(&mut machine, &mut charger, 0);
        talk(&mut machine, &mut lathe, 1);
        assert!(
            begun.elapsed() < Duration::from_secs(30),
            "{:?}",
            machine.statistic("reason")
        );
    }
}

/// Drives in the machine's place, and a test in the PLC's.
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

    /// Sends these values until the signal is on; gives the milliseconds that it took.
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
    // From the middle, 10000, it is the move of 6300 that the thesis shows: 1.32083 s.
    let mut drives = Drives::new(axis);
    drives.until(&rest, "A.Healthy");
    let trapezoid = drives.until(&go, "A.CommandDone");
    assert!((1_320..=1_323).contains(&trapezoid), "{trapezoid} ms");
    drives.until(&go, "there");

    let mut drives = Drives::new(axis);
    drives.until(&rest, "A.Healthy");
    let mut smooth = go.to_vec();
    smooth.push(("A.Jerk", 150_000.0));
    // Either ramp takes a / j = 0.1 s longer, and its mean speed is half of the highest.
    let s_curve = drives.until(&smooth, "A.CommandDone");
    assert!((1_419..=1_424).contains(&s_curve), "{s_curve} ms");
}

/// Two processes over TCP: the charger's program brings all axes home. Whole images, and one axis at a time.
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
        std::fs::write(&file, text.replace("\"10ms\"", cycle)).expect("a file");
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
        let last: Vec<&str> = rows.last().expect("a row").split(',').collect();
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
