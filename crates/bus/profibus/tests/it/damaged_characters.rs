//! Characters that a serial port reports as damaged: the checksum of a telegram is a sum, and two damaged characters
//! can leave it unchanged.

use tickbus_base::os::Marks;
use tickbus_base::time::Nanos;
use tickbus_bus_profibus::telegram::{Control, DATA_LIMIT, Frame};
use tickbus_bus_profibus::{
    Configuration, Event, Identity, Process, Segment, Station, UserParameters,
};

const STATION: u8 = 8;

/// Six octets of outputs, one of inputs.
const CONFIG: [u8; 2] = [0x10, 0x25];

/// A character on the line; true if it is damaged.
type Character = (u8, bool);

/// The kernel's output by termios(3), with `PARMRK`.
fn marked(line: &[Character]) -> Vec<u8> {
    let codes = line.iter().map(|&(value, is_damaged)| match value {
        _ if is_damaged => vec![0xFF, 0, value],
        0xFF => vec![0xFF, 0xFF],
        _ => vec![value],
    });
    codes.flatten().collect()
}

#[derive(Default)]
struct Machine {
    outputs: Vec<Vec<u8>>,
}

impl Process for Machine {
    fn inputs(&mut self, _: u8, _: Nanos, _: &mut [u8]) -> bool {
        true
    }
    fn delivered(&mut self, _: u8) {}
    fn outputs(&mut self, _: u8, _: Nanos, outputs: &[u8]) {
        self.outputs.push(outputs.to_vec());
    }
    fn alive(&mut self, _: u8, _: Nanos) {}
    fn tell(&mut self, _: u8, _: Nanos, _: Event) {}
}

fn telegram(control: u8, sap: Option<u8>, data: &[u8]) -> Vec<u8> {
    let mut bytes = Vec::new();
    Frame {
        destination: STATION,
        source: 2,
        control: Control(control),
        dsap: sap,
        ssap: sap.map(|_| 62),
        data,
    }
    .append(&mut bytes);
    bytes
}

/// A line with one station that exchanges data, and its master.
struct Rig {
    segment: Segment,
    marks: Marks,
    machine: Machine,
    now: Nanos,
    control: u8,
}

impl Rig {
    fn new() -> Self {
        let identity = Identity {
            ident: 0x80E0,
            configuration: Configuration::of_bytes(&CONFIG).expect("whole"),
            user: UserParameters::default(),
            sync: false,
            freeze: false,
            fail_safe: false,
            dpv1: false,
            max_diagnosis: DATA_LIMIT,
            acyclic: tickbus_bus_profibus::Acyclic::default(),
        };
        let mut rig = Self {
            segment: Segment::new(500_000, vec![Station::new(STATION, identity)]),
            marks: Marks::default(),
            machine: Machine::default(),
            now: Nanos(0),
            control: 0x5D,
        };
        // The first request finds the address free.
        for (control, sap, data) in [
            (0x49, None, &[][..]),
            (0x6D, Some(60), &[]),
            (0x5D, Some(61), &[0x80, 0, 0, 11, 0x80, 0xE0, 0]),
            (0x7D, Some(62), &CONFIG),
        ] {
            rig.hear(&marked(&sound(&telegram(control, sap, data))));
        }
        assert!(rig.exchange([0; 6], |_| {}));
        rig
    }

    /// True if the station answers.
    fn hear(&mut self, bytes: &[u8]) -> bool {
        self.now += Nanos::from_millis(1);
        let mut reply = Vec::new();
        let characters = self.marks.read(bytes);
        let heard = self
            .segment
            .hear(self.now, characters, &mut self.machine, &mut reply);
        heard.expect("the address is free").answer.is_some()
    }

    /// Sends these outputs over a line that does `harm`; returns whether they were answered.
    fn exchange(&mut self, outputs: [u8; 6], harm: impl FnOnce(&mut [Character])) -> bool {
        let mut line = sound(&telegram(self.control, None, &outputs));
        harm(&mut line);
        let is_answered = self.hear(&marked(&line));
        if is_answered {
            self.control ^= 0x20;
        }
        is_answered
    }
}

fn sound(bytes: &[u8]) -> Vec<Character> {
    bytes.iter().map(|byte| (*byte, false)).collect()
}

/// The start of the outputs in a telegram.
const DATA: usize = 7;

#[test]
fn two_damaged_characters_that_leave_the_sum_as_it_was_are_no_outputs() {
    let mut rig = Rig::new();
    let before = rig.machine.outputs.len();
    for (first, second, of_it) in [
        // The characters that a port without marks delivers.
        (0x80, 0x80, [0, 0]),
        (0xFF, 0x01, [0, 0]),
        // One bit each, one up and one down.
        (0x10, 0x01, [0x11, 0x00]),
        (0x7F, 0x80, [0xFF, 0x00]),
    ] {
        let is_answered = rig.exchange([first, second, 0, 0, 0, 2], |line| {
            line[DATA] = (of_it[0], true);
            line[DATA + 1] = (of_it[1], true);
        });
        assert!(!is_answered, "{first:02X} {second:02X}");
    }
    assert_eq!(rig.machine.outputs.len(), before);
    // Only the marks reveal the damage: the checksum is right.
    assert!(rig.exchange([0x80, 0x80, 0, 0, 0, 2], |line| {
        line[DATA].0 = 0;
        line[DATA + 1].0 = 0;
    }));
    assert_eq!(rig.machine.outputs.last(), Some(&vec![0, 0, 0, 0, 0, 2]));
}

#[test]
fn no_outputs_are_believed_that_the_master_has_not_sent() {
    let mut rig = Rig::new();
    let mut state = 1_u64;
    let mut random = |below: u64| {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) % below
    };
    let (mut answered, mut harmed) = (0, 0);
    for _ in 0..20_000 {
        // Common data, with many pairs that add up to 256.
        let outputs = [0; 6].map(|_: u8| {
            let common = [0x00, 0x01, 0x40, 0x80, 0xC0, 0xFF];
            common[usize::try_from(random(6)).expect("below six")]
        });
        let before = rig.machine.outputs.len();
        let mut is_harmed = false;
        let is_answered = rig.exchange(outputs, |line| {
            for character in line {
                if random(20) == 0 {
                    // Wrong parity, no stop bit, or a break.
                    let value = [character.0 ^ 1 << random(8), 0, 0xFF];
                    *character = (
                        value[usize::try_from(random(3)).expect("below three")],
                        true,
                    );
                    is_harmed = true;
                }
            }
        });
        assert_eq!(is_answered, !is_harmed, "{outputs:02X?}");
        let got = &rig.machine.outputs[before..];
        if is_harmed {
            assert_eq!(got, [[0; 6]; 0]);
        } else {
            assert_eq!(got, [outputs]);
        }
        answered += u32::from(is_answered);
        harmed += u32::from(is_harmed);
    }
    assert!(answered > 5_000 && harmed > 5_000, "{answered} {harmed}");
}
