//! Ladder and function block diagrams, compiled by `iec2c` as statements.

use super::stepped::{Random, Stepped};
use super::{equal, prepared, text};
use crate::harness::Absent;
use crate::harness::iec2c::Compiler;
use tickbus::prepare::{Source, structured_text};
use tickbus::time::Nanos;

fn as_text(xml: &str) -> String {
    let source = Source {
        name: "diagrams.xml".to_owned(),
        bytes: xml.as_bytes().to_vec(),
    };
    structured_text(&source).unwrap_or_else(|mistakes| panic!("{mistakes}"))
}

/// The four inputs, changed now and then.
fn play(random: &mut Random, plc: &mut Stepped) {
    for bit in 0..4 {
        if random.below(5) == 0 {
            plc.inputs[8] ^= 1 << bit;
        }
    }
}

/// The answers of tests/prepare/diagrams.xml, worked out from its drawings.
#[expect(
    clippy::struct_excessive_bools,
    reason = "each is an output of the program"
)]
#[derive(Default)]
struct Shown {
    motor: bool,
    late: bool,
    since: Option<u32>,
    seen: bool,
    start_before: bool,
    stop_before: bool,
    pulse_before: bool,
    count: i16,
    total: i16,
    kept: i16,
}

impl Shown {
    fn drive(&mut self, inputs: u8, ms: u32) {
        let (start, stop) = (inputs & 1 != 0, inputs & 2 != 0);
        self.motor = (start || self.motor) && !stop;
        self.since = self.motor.then(|| self.since.unwrap_or(ms));
        self.late = self.since.is_some_and(|since| ms - since >= 30);
        self.seen |= start && !self.start_before;
        self.seen &= stop || !self.stop_before;
        (self.start_before, self.stop_before) = (start, stop);
    }

    /// Returns `full` and `count`.
    fn watch(&mut self, inputs: u8) -> (bool, i16) {
        let (pulse, clear) = (inputs & 4 != 0, inputs & 8 != 0);
        if clear {
            self.count = 0;
        } else if pulse && !self.pulse_before && self.count < 3 {
            // The CTU of iec2c stops at PV.
            self.count += 1;
        }
        self.pulse_before = pulse;
        if !clear {
            self.total = self.total.wrapping_add(self.count);
        }
        if pulse {
            self.kept = self.kept.wrapping_add(3);
        }
        (self.count >= 3, if clear { -1 } else { self.count })
    }
}

pub(super) fn diagrams_do_what_they_show() -> Result<(), Absent> {
    let compiler = Compiler::find()?;
    let mut plc = Stepped::load(&compiler, &as_text(&text("tests/prepare/diagrams.xml")));
    let (mut random, mut right) = (Random(11), Shown::default());
    let mut watched = (false, 0);
    let mut most = (0, 0);
    for scan in 0..2000_u32 {
        play(&mut random, &mut plc);
        // iec2c's own clock begins at the first scan.
        let ms = scan * 10;
        plc.scan(Nanos::from_millis(i64::from(ms)));
        right.drive(plc.inputs[8], ms);
        if scan % 2 == 0 {
            watched = right.watch(plc.inputs[8]);
        }
        let bits = u8::from(right.motor) | u8::from(right.late) << 1 | u8::from(right.seen) << 2;
        let word = |at: usize| i16::from_be_bytes([plc.outputs[at], plc.outputs[at + 1]]);
        assert_eq!(plc.outputs[4], bits, "scan {scan}");
        assert_eq!(
            (plc.outputs[5] != 0, word(6), word(8), word(10)),
            (watched.0, watched.1, right.total, right.kept),
            "scan {scan}"
        );
        most = (most.0 + u32::from(right.late), most.1.max(right.count));
    }
    assert!(most.0 > 100 && most.1 >= 3, "{most:?}: too little happened");
    Ok(())
}

pub(super) fn prepared_diagrams_do_what_the_originals_do() -> Result<(), Absent> {
    let original = text("tests/prepare/diagrams.xml");
    let made = as_text(&prepared(&original));
    let outputs = equal(&as_text(&original), &made, play)?;
    assert_ne!(outputs[4..], [0; 8][..], "it did nothing");
    Ok(())
}
