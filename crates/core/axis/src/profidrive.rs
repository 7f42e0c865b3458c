//! A drive on a telegram of PROFIdrive: the words from the PLC go in, those to the PLC come out.
//!
//! The bits of STW1 and ZSW1 and the states are those of the profile (IEC 61800-7-203, "PROFIdrive" 4.1) and of the
//! manuals of its makers (SINAMICS G115D and S120, operating instructions; ABB FPBA-01, tables 4 and 5). Telegram 111 and
//! its units are those of the basic positioner of SINAMICS S120 (EPOS).

mod encoder;
mod positioner;
mod state;
mod telegram;

use encoder::Encoder;
pub use positioner::Mechanics;
use positioner::Positioner;
use state::NO_QUICK_STOP;
pub use state::State;
pub use telegram::{Telegram, Word, Words};

use crate::ramp::ramped;

/// Bits of STW1, beside those of the states.
mod stw1 {
    pub(super) const RAMP: u16 = 1 << 4;
    pub(super) const NO_FREEZE: u16 = 1 << 5;
    pub(super) const SETPOINT: u16 = 1 << 6;
    pub(super) const ACKNOWLEDGE: u16 = 1 << 7;
    pub(super) const CONTROL: u16 = 1 << 10;
    pub(super) const REVERSE: u16 = 1 << 11;
}

/// The fault of a drive that no longer gets setpoints while it is on (F01910 of SINAMICS).
pub const NO_SETPOINTS: u16 = 1910;

/// The actual speed counts as the setpoint, and as standstill, within this part of the reference speed.
const TOLERANCE: f64 = 0.01;

/// The greatest speed of a word, as a part of the reference speed, and the greatest position, in LU (a DINT).
const MOST_SPEED: f64 = 2.0;
const MOST_POSITION: f64 = 2_147_483_647.0;

/// The properties of a drive.
#[derive(Clone, Debug, PartialEq)]
pub struct Setup {
    /// The telegram.
    pub telegram: Telegram,
    /// 100 % of a speed, in turns per minute (p2000).
    pub reference_speed: f64,
    /// From standstill to the reference speed, in seconds (p1120).
    pub ramp_up: f64,
    /// From the reference speed to standstill: after OFF1 and of the ramp generator (p1121).
    pub ramp_down: f64,
    /// After OFF3 (p1135).
    pub quick_stop: f64,
    /// After OFF2, or a fault.
    pub coast: f64,
    /// The increments of a turn in `G1_XIST1`.
    pub increments: f64,
    /// The codes of the fault and the warning that conditions raise.
    pub codes: [u16; 2],
    /// The axis that telegram 111 positions.
    pub mechanics: Mechanics,
}

/// The state of the machine in a step, as far as it concerns the drive.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Measured {
    /// The actual speed, if a simulation has it.
    pub speed: Option<f64>,
    /// The actual position in LU, if a simulation has it.
    pub position: Option<f64>,
    /// The cause of a fault is there.
    pub fault: bool,
    /// A warning is there.
    pub warning: bool,
}

impl Measured {
    /// Returns the values that are possible: no simulation moves a motor by a NaN, or beyond what the words can have.
    fn sound(self, reference_speed: f64) -> Self {
        let within = |value: Option<f64>, most: f64| {
            let number = value.filter(|value| !value.is_nan());
            number.map(|value| value.clamp(-most, most))
        };
        Self {
            speed: within(self.speed, MOST_SPEED * reference_speed),
            position: within(self.position, MOST_POSITION),
            ..self
        }
    }
}

/// The words of bits in which edges count, now and in the step before.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Edges {
    now: [u16; 2],
    before: [u16; 2],
}

impl Edges {
    fn step(&mut self, words: &Words) {
        self.before = self.now;
        self.now = [words.bits(Word::Stw1), words.bits(Word::PosStw2)];
    }

    /// True if a bit of STW1 or `POS_STW2` has risen.
    fn rises(self, word: Word, bit: u16) -> bool {
        let place = usize::from(word != Word::Stw1);
        self.now[place] & !self.before[place] & bit != 0
    }
}

/// A drive, with its motor.
#[derive(Clone, Debug, PartialEq)]
pub struct Profidrive {
    setup: Setup,
    state: State,
    /// The last words that came with "control by PLC".
    words: Words,
    edges: Edges,
    /// The PLC has stopped sending setpoints.
    is_lost: bool,
    /// The code of a fault that is not acknowledged.
    fault: Option<u16>,
    /// The output of the ramp generator, and the speed of the motor as far as no simulation has it.
    speed: f64,
    encoder: Encoder,
    positioner: Positioner,
    /// The life sign of the drive, 1 to 15; 0 while the PLC sends none.
    life_sign: u16,
    /// The last step began in another state, or at another speed, or the motor turned in it.
    has_changed: bool,
}

impl Profidrive {
    /// A drive at standstill, in S1.
    pub fn new(setup: Setup) -> Self {
        Self {
            state: State::default(),
            words: Words::default(),
            edges: Edges::default(),
            is_lost: false,
            fault: None,
            speed: 0.0,
            encoder: Encoder::new(setup.increments),
            positioner: Positioner::new(setup.mechanics),
            life_sign: 0,
            has_changed: false,
            setup,
        }
    }

    /// The state.
    pub const fn state(&self) -> State {
        self.state
    }

    /// True while the words to the PLC change although those of the PLC do not.
    pub fn moves(&self) -> bool {
        self.has_changed
            || matches!(self.state, State::RampStop | State::QuickStop)
            || self.speed != 0.0
            || self.positioner.moves()
            || self.life_sign != 0
    }

    /// Advances by `seconds`, with the words from the PLC; returns those to the PLC.
    pub fn step(&mut self, seconds: f64, words: &Words, measured: &Measured) -> Words {
        let measured = &measured.sound(self.setup.reference_speed);
        let was = self.state;
        self.receive(words);
        self.edges.step(&self.words);
        let stands = self.stands(measured);
        let stw1 = self.words.bits(Word::Stw1);
        if measured.fault {
            self.fail(self.setup.codes[0], State::Inhibited);
        } else if self.edges.rises(Word::Stw1, stw1::ACKNOWLEDGE) && !self.is_lost {
            self.fault = None;
        }
        let next = self.state.next(stw1, stands);
        // A fault keeps the drive in S1.
        if self.fault.is_none() || next != State::Ready || self.state != State::Inhibited {
            self.state = next;
        }
        self.has_changed = self.state != was;
        self.life_sign = match (words.bits(Word::Stw2) >> 12, self.life_sign) {
            (0, _) => 0,
            (_, 15) => 1,
            (_, own) => own + 1,
        };

        let mut told = self.words.clone();
        let before = self.speed;
        let of_mode = if self.setup.telegram == Telegram::Positioner {
            self.position(seconds, &mut told, measured)
        } else {
            self.turn(seconds, stw1);
            0
        };
        self.has_changed |= self.speed.total_cmp(&before).is_ne();
        let actual = measured.speed.unwrap_or(self.speed);
        // The encoder counts on while a simulation turns a motor that the drive does not.
        self.has_changed |= actual != 0.0;
        self.encoder
            .turn(f64::midpoint(measured.speed.unwrap_or(before), actual) / 60.0 * seconds);
        self.tell(&mut told, stw1, of_mode, actual, measured);
        told
    }

    /// Takes over the words of the PLC, if they count. A PLC that has stopped, or is gone, sends zeros.
    fn receive(&mut self, words: &Words) {
        let stw1 = words.bits(Word::Stw1);
        if stw1 & stw1::CONTROL != 0 {
            self.words = words.clone();
            self.is_lost = false;
        } else if stw1 == 0 && self.state.has_power() && !self.is_lost {
            self.is_lost = true;
            let last = self.words.bits(Word::Stw1);
            self.words.set_bits(Word::Stw1, last & !NO_QUICK_STOP);
            self.fail(NO_SETPOINTS, State::QuickStop);
        } else if stw1 == 0 && !self.state.has_power() {
            self.words.set_bits(Word::Stw1, 0);
        }
    }

    /// Raises a fault, which leads to a state; the first one stays until it is acknowledged.
    fn fail(&mut self, code: u16, state: State) {
        self.fault.get_or_insert(code);
        self.state = state;
    }

    fn stands(&self, measured: &Measured) -> bool {
        let limit = TOLERANCE * self.setup.reference_speed;
        self.speed == 0.0 && measured.speed.unwrap_or(0.0).abs() <= limit
    }

    /// The setpoint of the speed, before the ramp generator.
    fn setpoint(&self, stw1: u16) -> f64 {
        let setpoint = self.words.get(if self.setup.telegram == Telegram::Speed {
            Word::NsollA
        } else {
            Word::NsollB
        });
        match (stw1 & stw1::SETPOINT != 0, stw1 & stw1::REVERSE != 0) {
            (false, _) => 0.0,
            (true, false) => setpoint,
            (true, true) => -setpoint,
        }
    }

    /// Drives the motor at a speed.
    fn turn(&mut self, seconds: f64, stw1: u16) {
        let reference = self.setup.reference_speed;
        let Setup {
            ramp_up,
            ramp_down,
            quick_stop,
            coast,
            ..
        } = self.setup;
        let correction = 60.0 * self.encoder.correction(&self.words);
        let (wanted, times) = match self.state {
            State::Operation if self.words.get(Word::Kpc) > 0.0 => {
                // The position controller replaces the ramp generator.
                self.speed = self.setpoint(stw1) + correction;
                return;
            }
            State::Operation if stw1 & stw1::RAMP == 0 => (0.0, [quick_stop; 2]),
            State::Operation if stw1 & stw1::NO_FREEZE == 0 => (self.speed, [0.0; 2]),
            State::Operation => (self.setpoint(stw1), [ramp_up, ramp_down]),
            State::RampStop => (0.0, [ramp_down; 2]),
            State::QuickStop => (0.0, [quick_stop; 2]),
            _ => (0.0, [coast; 2]),
        };
        let rates = times.map(|time| reference / time);
        self.speed = ramped(self.speed, wanted, rates, seconds);
    }

    /// Drives the motor to a position; returns the bits of ZSW1 that positioning has.
    fn position(&mut self, seconds: f64, words: &mut Words, measured: &Measured) -> u16 {
        let per_second = self.setup.reference_speed / 60.0;
        let rates = [self.setup.quick_stop, self.setup.coast].map(|time| per_second / time);
        let bits = (self.positioner).step(seconds, self.state, self.edges, words, rates, measured);
        self.speed = 60.0 * self.positioner.turns_per_second();
        bits
    }

    fn tell(&self, words: &mut Words, stw1: u16, of_mode: u16, actual: f64, measured: &Measured) {
        let bit = |number: u16, on: bool| u16::from(on) << number;
        let reference = self.setup.reference_speed;
        let is_on = self.state.has_power();
        let setpoint = if self.state == State::Operation {
            self.setpoint(stw1)
        } else {
            0.0
        };
        let near = |one: f64, other: f64| (one - other).abs() <= TOLERANCE * reference;
        let own = if self.setup.telegram == Telegram::Positioner {
            of_mode
        } else {
            // Bits 11 to 15 are the maker's: no limit, brake open, no overtemperature, forwards, no overload.
            bit(8, near(actual, setpoint))
                | bit(10, actual.abs() >= reference)
                | bit(12, is_on)
                | bit(13, true)
                | bit(14, actual >= 0.0)
                | bit(15, true)
        };
        words.set_bits(
            Word::Zsw1,
            self.state.bits()
                | bit(3, self.fault.is_some())
                // STW1 has the two stops at the same distance.
                | (stw1 & 0b110) << 3
                | bit(7, measured.warning)
                | bit(9, true)
                | own,
        );
        words.set(Word::NistA, actual);
        words.set(Word::NistB, actual);
        // Pulses enabled, and the life sign.
        words.set_bits(Word::Zsw2, bit(10, is_on) | self.life_sign << 12);
        self.encoder.tell(words.bits(Word::G1Stw), words);
        words.set(Word::FaultCode, self.fault.unwrap_or(0).into());
        let warning = if measured.warning {
            self.setup.codes[1]
        } else {
            0
        };
        words.set(Word::WarnCode, warning.into());
        words.set_bits(
            Word::Meldw,
            // Ramp complete, torque low, standstill, below the comparison speed; no overtemperature, no overload.
            bit(0, near(actual, self.speed))
                | bit(1, true)
                | bit(2, near(actual, 0.0))
                | bit(3, actual.abs() <= reference)
                | bit(6, true)
                | bit(7, true)
                | bit(8, near(actual, self.speed))
                | bit(11, is_on)
                | bit(12, self.fault.is_none())
                | bit(13, is_on),
        );
    }
}

#[cfg(test)]
mod tests;
