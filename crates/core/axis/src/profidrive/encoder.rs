//! The encoder of telegrams 3 and 5: its words in the form of the profile.

use super::telegram::{Word, Words};

/// Of `G1_STW` and of `G1_ZSW`: the absolute value is requested and sent in `G1_XIST2`.
const ABSOLUTE: u16 = 1 << 13;
/// The encoder is parked: it sends no position and no error.
const PARKING: u16 = 1 << 14;
/// Of `G1_STW`: acknowledges an error of the encoder; bit 11 of `G1_ZSW` confirms that.
const ACKNOWLEDGE: u16 = 1 << 15;
const ACKNOWLEDGES: u16 = 1 << 11;

/// The positions of an encoder wrap at 32 bits.
const WRAP: f64 = 4_294_967_296.0;

/// The encoder on the shaft of the motor: an absolute one, at 0 when the drive is switched on.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Encoder {
    /// The increments of a turn in `G1_XIST1` and `G1_XIST2`.
    increments: f64,
    /// The position in turns.
    turns: f64,
    /// The last `XERR`, and the position in turns when it came.
    error: (f64, f64),
}

impl Encoder {
    pub(super) const fn new(increments: f64) -> Self {
        Self {
            increments,
            turns: 0.0,
            error: (0.0, 0.0),
        }
    }

    /// Turns on by a number of turns.
    pub(super) fn turn(&mut self, turns: f64) {
        self.turns += turns;
    }

    /// Writes the words of the encoder.
    pub(super) fn tell(&self, stw: u16, words: &mut Words) {
        let position = (self.turns * self.increments).floor().rem_euclid(WRAP);
        let mut zsw = stw & (ABSOLUTE | PARKING);
        if stw & ACKNOWLEDGE != 0 {
            zsw |= ACKNOWLEDGES;
        }
        if stw & PARKING != 0 {
            zsw &= !ABSOLUTE;
        } else {
            words.set(Word::G1Xist1, position);
        }
        if zsw & ABSOLUTE != 0 {
            words.set(Word::G1Xist2, position);
        }
        words.set_bits(Word::G1Zsw, zsw);
    }

    /// The speed in turns per second that the position controller in the drive (DSC) adds: `XERR` is the position's
    /// setpoint minus its actual value, in increments, and `KPC` the gain in 0.001/s. While no new `XERR` comes, the drive
    /// takes off the way that it has made since.
    pub(super) fn correction(&mut self, words: &Words) -> f64 {
        let error = words.get(Word::Xerr);
        if error.total_cmp(&self.error.0).is_ne() {
            self.error = (error, self.turns);
        }
        let way = error / self.increments - (self.turns - self.error.1);
        words.get(Word::Kpc) / 1000.0 * way
    }
}
