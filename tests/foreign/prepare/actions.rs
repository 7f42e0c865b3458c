//! The block of actions, with its qualifiers.

use super::stepped::Random;
use super::{ACTION, CONFLICT, RAN, TOF, TON, TP, ask, bench};
use crate::harness::Absent;
use tickbus::plc::blocks::{ActionControl, Qualifiers};
use tickbus::time::Nanos;

// Bits of the word with the qualifiers.
const N: u16 = 1;
const R: u16 = 2;
const S: u16 = 4;
const L: u16 = 8;
pub const D: u16 = 16;
const P: u16 = 32;
const P0: u16 = 64;
const P1: u16 = 128;
const SD: u16 = 256;
const DS: u16 = 512;
const SL: u16 = 1024;

/// A step is active in scans 2 to 7, the step with `R` from scan 14.
#[rustfmt::skip]
const ACTIONS: [(u16, u16, &str); 14] = [
    (N,  0,  "..111111.........."),
    (S,  0,  "..111111111111...."),
    (L,  30, "..111............."),
    (L,  90, "..111111.........."),
    (D,  30, ".....111.........."),
    (SD, 30, ".....111111111...."),
    (SD, 90, "...........111...."),
    (DS, 30, ".....111111111...."),
    (DS, 90, ".................."),
    (SL, 30, "..111............."),
    (SL, 90, "..111111111......."),
    (P,  0,  "..1..............."),
    (P0, 0,  "........1........."),
    (P1, 0,  "..1..............."),
];

pub fn actions_follow_the_golden_rows() -> Result<(), Absent> {
    let mut bench = bench()?;
    for final_scan in [false, true] {
        for (qualifier, t, row) in ACTIONS {
            bench.restart();
            let is_quiet = qualifier == P0 || qualifier == P1;
            let right = if final_scan && !is_quiet {
                row.replacen("1.", "11", 1)
            } else {
                row.to_owned()
            };
            let (mut ran, mut q) = (String::new(), String::new());
            for scan in 0..18 {
                let is_active = (2..=7).contains(&scan);
                let on = if is_active { qualifier } else { 0 } | if scan >= 14 { R } else { 0 };
                let preset = if is_active { t } else { 0 };
                let answer = ask(&mut bench, 10 * scan, false, final_scan, preset, on);
                let mark = |bit| if answer.bits & bit == 0 { '.' } else { '1' };
                ran.push(mark(RAN));
                q.push(mark(ACTION));
            }
            assert_eq!(ran, right, "{qualifier} {t} {final_scan}");
            let right = if is_quiet {
                ".".repeat(18)
            } else {
                row.to_owned()
            };
            assert_eq!(q, right, "{qualifier} {t} {final_scan}");
        }
    }
    Ok(())
}

pub fn actions_are_those_of_the_built_in_programs() -> Result<(), Absent> {
    let mut bench = bench()?;
    for final_scan in [false, true] {
        bench.restart();
        let mut block = ActionControl::new(final_scan);
        let mut random = Random(7);
        let (mut on, mut preset) = (0_u16, 0_u16);
        for scan in 0..800 {
            if random.below(3) == 0 {
                on ^= 1 << random.below(11);
            }
            // Otherwise R and latches hide the rest.
            if random.below(6) == 0 {
                on = 0;
            }
            if random.below(4) == 0 {
                preset = [0, 10, 30, 45][random.below(4)];
            }
            let is = |bit: u16| on & bit != 0;
            let asked = Qualifiers {
                n: is(N),
                r: is(R),
                s: is(S),
                l: is(L),
                d: is(D),
                p: is(P),
                p0: is(P0),
                p1: is(P1),
                sd: is(SD),
                ds: is(DS),
                sl: is(SL),
                t: Nanos::from_millis(i64::from(preset)),
            };
            let ran = block.call(Nanos::from_millis(10 * i64::from(scan)), &asked);
            let right = [(ACTION, block.q), (RAN, ran), (CONFLICT, block.conflict)];
            let right = right
                .into_iter()
                .filter(|(_, is_on)| *is_on)
                .fold(0, |bits, (bit, _)| bits | bit);
            let answer = ask(&mut bench, 10 * scan, false, final_scan, preset, on);
            assert_eq!(
                answer.bits & !(TOF | TON | TP),
                right,
                "scan {scan}: {asked:?}"
            );
        }
    }
    Ok(())
}
