//! The positioner of telegram 111: setpoints by MDI, set-up, jogging and homing, as SINAMICS has them (EPOS).

use super::state::State;
use super::telegram::{WHOLE, Word, Words};
use super::{Edges, Measured};
use crate::ramp::{Place, ramped};

/// Bits of STW1 in the positioning mode.
mod stw1 {
    pub(super) const NOT_REJECT: u16 = 1 << 4;
    pub(super) const NO_STOP: u16 = 1 << 5;
    pub(super) const ACTIVATE: u16 = 1 << 6;
    pub(super) const JOG: [u16; 2] = [1 << 8, 1 << 9];
    pub(super) const HOMING: u16 = 1 << 11;
}

/// Bits of `POS_STW1`.
mod pos_stw1 {
    pub(super) const ABSOLUTE: u16 = 1 << 8;
    pub(super) const POSITIVE: u16 = 1 << 9;
    pub(super) const NEGATIVE: u16 = 1 << 10;
    pub(super) const CONTINUOUS: u16 = 1 << 12;
    pub(super) const SET_UP: u16 = 1 << 14;
    pub(super) const MDI: u16 = 1 << 15;
}

/// Bits of `POS_STW2`.
mod pos_stw2 {
    pub(super) const SET_REFERENCE: u16 = 1 << 1;
    pub(super) const INCREMENTAL_JOG: u16 = 1 << 5;
    pub(super) const SOFTWARE_LIMITS: u16 = 1 << 14;
}

/// Velocities are in 1000 LU per minute.
const VELOCITY: f64 = 1000.0 / 60.0;

/// The factory settings of SINAMICS for homing (p2605) and jogging (p2585, p2586), in 1000 LU per minute, and for an
/// incremental jog (p2587, p2588), in LU.
const HOMING: f64 = 5000.0 * VELOCITY;
const JOG: f64 = 300.0 * VELOCITY;
const JOG_WAY: f64 = 1000.0;

/// The positioning window and the greatest following error (p2544 and p2546 at the factory), in LU.
const WINDOW: f64 = 40.0;
const FOLLOWING_ERROR: f64 = 1000.0;

/// The least override of acceleration and deceleration, which is not 0 either in SINAMICS.
const LEAST_RATE: f64 = 0.0001;

/// The limits of an axis, in LU.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mechanics {
    /// The greatest velocity, in LU/s.
    pub velocity: f64,
    /// The greatest acceleration and deceleration, in LU/s².
    pub rates: [f64; 2],
    /// The software limit switches.
    pub limits: Option<[f64; 2]>,
    /// The LU of a turn of the motor.
    pub units_per_turn: f64,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Aim {
    Position(f64),
    /// 1 forwards, -1 backwards, 0 stops.
    Run(f64),
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Mode {
    None,
    Mdi,
    SetUp,
    Jog,
    Homing,
}

/// A traversing task.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Task {
    aim: Aim,
    velocity: f64,
    rates: [f64; 2],
}

#[derive(Clone, Debug, PartialEq)]
#[allow(
    clippy::struct_excessive_bools,
    reason = "bits of the status words, independent of each other"
)]
pub(super) struct Positioner {
    own: Mechanics,
    place: Place,
    mode: Mode,
    task: Option<Task>,
    /// The words of the PLC when the task was taken over.
    taken: Option<(Task, u16)>,
    is_acknowledged: bool,
    is_there: bool,
    is_referenced: bool,
    limited: bool,
}

impl Positioner {
    /// An axis at 0, with an absolute encoder: the reference point is set.
    pub(super) const fn new(own: Mechanics) -> Self {
        Self {
            own,
            place: Place {
                position: 0.0,
                speed: 0.0,
            },
            mode: Mode::None,
            task: None,
            taken: None,
            is_acknowledged: false,
            is_there: true,
            is_referenced: true,
            limited: false,
        }
    }

    /// The speed in turns per second.
    pub(super) fn turns_per_second(&self) -> f64 {
        self.place.speed / self.own.units_per_turn
    }

    /// Advances by `seconds`. `rates` are those of the quick stop and of coasting, in turns per s². Returns the bits of
    /// ZSW1 that positioning has.
    pub(super) fn step(
        &mut self,
        seconds: f64,
        state: State,
        edges: Edges,
        words: &mut Words,
        rates: [f64; 2],
        measured: &Measured,
    ) -> u16 {
        let before = self.place.speed;
        let pos_stw2 = words.bits(Word::PosStw2);
        if edges.rises(Word::PosStw2, pos_stw2::SET_REFERENCE) && self.place.speed == 0.0 {
            (self.place.position, self.is_referenced) = (0.0, true);
        }
        let [quick_stop, coast] = rates.map(|rate| rate * self.own.units_per_turn);
        let brake = match state {
            State::Operation => {
                self.command(edges, words);
                self.task.map_or(self.own.rates[1], |task| task.rates[1])
            }
            State::RampStop => self.own.rates[1],
            State::QuickStop => quick_stop,
            _ => coast,
        };
        if state != State::Operation {
            self.drop_task();
            self.mode = Mode::None;
        }
        if let Some(position) = measured.position
            && !state.has_power()
        {
            self.place.position = position;
        }
        let stw1 = words.bits(Word::Stw1);
        let runs = stw1 & stw1::NO_STOP != 0;
        let bounds = self.own.limits.filter(|_| {
            pos_stw2 & pos_stw2::SOFTWARE_LIMITS != 0
                && self.is_referenced
                && self.mode != Mode::Homing
        });
        match self.task.filter(|_| runs) {
            Some(task) => self.travel(task, words, bounds, seconds),
            None => self.brake(brake, seconds),
        }
        self.tell(words, before, bounds, measured, stw1)
    }

    /// Takes over what the PLC wants.
    fn command(&mut self, edges: Edges, words: &Words) {
        let (stw1, pos) = (words.bits(Word::Stw1), words.bits(Word::PosStw1));
        let jogs = stw1::JOG.map(|bit| stw1 & bit != 0);
        let mode = match pos & pos_stw1::MDI {
            0 if jogs[0] != jogs[1] => Mode::Jog,
            0 if stw1 & stw1::HOMING != 0 => Mode::Homing,
            0 => Mode::None,
            _ if pos & pos_stw1::SET_UP != 0 => Mode::SetUp,
            _ => Mode::Mdi,
        };
        let changes = std::mem::replace(&mut self.mode, mode) != mode;
        if changes {
            self.drop_task();
        }
        if stw1 & stw1::ACTIVATE == 0 {
            self.is_acknowledged = false;
        }
        if stw1 & stw1::NOT_REJECT == 0 {
            self.drop_task();
            return;
        }
        match mode {
            Mode::Mdi | Mode::SetUp => self.take_over(edges, words, pos),
            Mode::Jog => {
                let sign = if jogs[0] { -1.0 } else { 1.0 };
                let is_incremental = words.bits(Word::PosStw2) & pos_stw2::INCREMENTAL_JOG != 0;
                if changes && is_incremental {
                    let target = self.place.position + sign * JOG_WAY;
                    self.begin(Aim::Position(target), JOG, self.own.rates);
                } else if !is_incremental {
                    self.begin(Aim::Run(sign), JOG, self.own.rates);
                }
            }
            Mode::Homing if changes => {
                self.is_referenced = false;
                self.begin(Aim::Position(0.0), HOMING, self.own.rates);
            }
            Mode::None | Mode::Homing => {}
        }
    }

    /// MDI: with the edge of the command, or at any time in continuous transfer.
    fn take_over(&mut self, edges: Edges, words: &Words, pos: u16) {
        let is_edge = edges.rises(Word::Stw1, stw1::ACTIVATE);
        let is_continuous = pos & pos_stw1::CONTINUOUS != 0;
        let is_absolute = pos & pos_stw1::ABSOLUTE != 0;
        if !is_edge && !is_continuous {
            return;
        }
        let way = words.get(Word::MdiTarpos);
        let forwards = pos & pos_stw1::POSITIVE != 0;
        let backwards = pos & pos_stw1::NEGATIVE != 0;
        let aim = match self.mode {
            Mode::SetUp => Aim::Run(f64::from(i8::from(forwards) - i8::from(backwards))),
            _ => Aim::Position(way),
        };
        let rate = |place: usize, word| {
            self.own.rates[place] * (words.get(word) / WHOLE).clamp(LEAST_RATE, 1.0)
        };
        let task = Task {
            aim,
            velocity: words.get(Word::MdiVelocity) * VELOCITY,
            rates: [rate(0, Word::MdiAcc), rate(1, Word::MdiDec)],
        };
        if !is_edge && self.taken == Some((task, pos)) {
            return;
        }
        self.taken = Some((task, pos));
        self.is_acknowledged |= is_edge;
        let aim = match aim {
            Aim::Position(way) if !is_absolute => Aim::Position(self.place.position + way),
            aim => aim,
        };
        self.begin(aim, task.velocity, task.rates);
    }

    fn begin(&mut self, aim: Aim, velocity: f64, rates: [f64; 2]) {
        self.is_there = false;
        self.task = Some(Task {
            aim,
            velocity,
            rates,
        });
    }

    fn drop_task(&mut self) {
        self.task = None;
        self.taken = None;
    }

    fn travel(&mut self, task: Task, words: &Words, bounds: Option<[f64; 2]>, seconds: f64) {
        // SINAMICS limits the override to 200 %.
        let wanted = task.velocity * (words.get(Word::Override) / WHOLE).clamp(0.0, 2.0);
        let top = wanted.min(self.own.velocity);
        self.limited = wanted > self.own.velocity;
        let aim = match (task.aim, bounds) {
            (Aim::Position(target), Some([low, high])) => Aim::Position(target.clamp(low, high)),
            // Set-up and jogging stop at the software limit switches.
            (Aim::Run(sign), Some([low, high])) if sign != 0.0 => {
                Aim::Position(if sign < 0.0 { low } else { high })
            }
            (aim, _) => aim,
        };
        match aim {
            Aim::Position(target) => {
                let is_there = self.place.chase(target, top, task.rates, seconds);
                if is_there && let Aim::Position(_) = task.aim {
                    self.is_there = true;
                    self.is_referenced |= self.mode == Mode::Homing;
                    self.task = None;
                }
            }
            Aim::Run(sign) => self.ramp(sign * top, task.rates, seconds),
        }
    }

    fn brake(&mut self, rate: f64, seconds: f64) {
        self.limited = false;
        self.ramp(0.0, [0.0, rate], seconds);
    }

    fn ramp(&mut self, wanted: f64, rates: [f64; 2], seconds: f64) {
        let speed = ramped(self.place.speed, wanted, rates, seconds);
        self.place.position += f64::midpoint(self.place.speed, speed) * seconds;
        self.place.speed = speed;
    }

    /// Writes the words of positioning; returns their bits of ZSW1.
    fn tell(
        &self,
        words: &mut Words,
        before: f64,
        bounds: Option<[f64; 2]>,
        measured: &Measured,
        stw1: u16,
    ) -> u16 {
        let bit = |number: u16, on: bool| u16::from(on) << number;
        let Place { position, speed } = self.place;
        let actual = measured.position.unwrap_or(position);
        let away = (actual - position).abs();
        let in_mode = |mode| self.mode == mode;
        let at = |limit: Option<f64>, sign: f64| {
            limit.is_some_and(|limit| (actual - limit) * sign >= 0.0)
        };
        words.set(Word::XistA, actual);
        words.set_bits(
            Word::PosZsw1,
            bit(10, in_mode(Mode::Jog))
                | bit(11, in_mode(Mode::Homing) && self.task.is_some())
                | bit(14, in_mode(Mode::SetUp))
                | bit(15, in_mode(Mode::Mdi) || in_mode(Mode::SetUp)),
        );
        words.set_bits(
            Word::PosZsw2,
            bit(1, self.limited)
                | bit(2, speed == 0.0)
                | bit(4, speed > 0.0)
                | bit(5, speed < 0.0)
                | bit(6, at(bounds.map(|[low, _]| low), -1.0))
                | bit(7, at(bounds.map(|[_, high]| high), 1.0))
                | bit(15, self.task.is_some()),
        );
        bit(8, away <= FOLLOWING_ERROR)
            | bit(10, self.is_there && away <= WINDOW)
            | bit(11, self.is_referenced)
            | bit(12, self.is_acknowledged && stw1 & stw1::ACTIVATE != 0)
            | bit(13, speed == 0.0)
            | bit(14, speed.abs() > before.abs())
            | bit(15, speed.abs() < before.abs())
    }

    /// True while something changes without a word from the PLC.
    pub(super) fn moves(&self) -> bool {
        self.place.speed != 0.0 || self.task.is_some()
    }
}
