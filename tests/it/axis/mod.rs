//! The axis link: its bytes, and the driver's work for axes, with a PLC that is a bare TCP client.
#![allow(
    clippy::float_cmp,
    reason = "what went over the wire comes back to the bit"
)]

mod drives;
mod link;
mod machine;
mod messages;

use std::path::Path;

use proptest::prelude::*;
use tickbus::axis::{AxisKind, COMMAND_BYTES, Field};
use tickbus::driver_cfg::Config;
use tickbus::signal::{Area, Plan, Slot};

fn peeler(name: &str) -> Config {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("plc/peeler/{name}.cfg"));
    Config::load(&path, &tickbus::KINDS).unwrap_or_else(|mistakes| panic!("{mistakes}"))
}

fn parse(text: &str) -> Config {
    Config::parse("test.cfg", text, &tickbus::KINDS)
        .unwrap_or_else(|mistakes| panic!("{mistakes}\n{text}"))
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
    // The move documented in the thesis: 63 mm in hundredths, v = 8000, a = b = 15000.
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
    // −15536 is 50000 misread: an INT instead of a UINT.
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

/// An axis made up by a test.
#[derive(Clone, Debug)]
struct Made {
    kind: AxisKind,
    inverted: bool,
    gain: f64,
    flags: [bool; 4],
    gaps: (usize, usize),
}

fn made() -> impl Strategy<Value = Made> {
    let kinds = prop::sample::select(AxisKind::ALL.map(|(_, kind)| kind).to_vec());
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

/// The driver.cfg of these axes, and the places of each: the offsets of its structures and the size of the
/// second.
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
                AxisKind::Torque => (["Execute", "Close", "Open", "SpeedControl", "Enable"], "Torque"),
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
            // When inverted, positions count from the other limit and speeds in the other direction;
            // magnitudes do not change.
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

/// A file of axes is either reported as wrong, or consistent.
fn check_any(text: &str) -> Result<(), TestCaseError> {
    use std::collections::HashSet;

    let Ok(config) = Config::parse("any.cfg", text, &tickbus::KINDS) else {
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
