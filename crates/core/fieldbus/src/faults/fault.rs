//! The description of a fault: its effect, its beginning and its end.

use std::fmt;

use super::{AnswerEffect, AnswerTrouble, Condition, Diagnosis, Elements, Request, WrongAnswer};
use tickbus_base::time::Nanos;
use tickbus_base::toml_text::short_number;
use tickbus_image::signal::{DataType, Signal, SignalTable, Slot};

/// The kind of a fault that the simulation's model has, as a driver.cfg names it.
pub(super) const MODEL: &str = "model";

/// The kind of fault that holds back sent values.
pub(super) const LATE_VALUES: &str = "values-late";

/// One fault, as a `[[fault]]` section describes it.
#[derive(Clone, Debug, PartialEq)]
pub struct Fault {
    /// The fault's name, for messages; of a fault of the model, the name by which the model knows it.
    pub name: String,
    /// The fault's effect.
    pub effect: Effect,
    /// When the fault begins.
    pub begin: Begin,
    /// When the fault ends without a request.
    pub lasts: Lasts,
    /// How many times the fault may begin; more than once only with [`Begin::When`]. Positive.
    pub times: u64,
    /// The seed of the fault's random numbers.
    pub seed: u64,
}

/// The effect of a fault.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Effect {
    /// The fault changes the value of the signal with this index in the signal table.
    Signal(usize, SignalEffect),
    /// The fault disturbs the line.
    Line(LineEffect),
    /// The simulation's model has the fault of this name, with this value.
    Model(f64),
}

/// How the value of a signal is changed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SignalEffect {
    /// The signal is stuck at a value; `None` means the value that it has when the fault begins.
    Stuck(Option<Slot>),
    /// The signal goes evenly to a value within a time, and is stuck there. Not for a BOOL.
    Ramp {
        /// The value at which it begins; `None` means the value that it has when the fault begins.
        from: Option<Slot>,
        /// The value at which it ends.
        to: Slot,
        /// The time that it takes.
        within: Nanos,
    },
    /// A BOOL is inverted, or each bit of a bit string.
    Invert,
    /// This number is added, in the signal's unit.
    Offset(f64),
    /// A random number between minus and plus this number is added, a new one at every tick.
    Noise(f64),
    /// A BOOL is inverted with this probability, decided again at every tick.
    Flicker(f64),
}

/// The effect of a fault on the frames of the line.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LineEffect {
    /// Incoming frames are held back for this long.
    Delay(Nanos),
    /// Outgoing frames are held back for this long.
    LateValues(Nanos),
    /// The frames of a cycle are lost with this probability.
    Drop(f64, Direction),
    /// The frames of a cycle are repeated with this probability.
    Duplicate(f64, Direction),
    /// Nothing is sent or received.
    LinkDown,
    /// The station with this index does not respond.
    StationDown(usize),
    /// A station reports a problem to its master.
    Diagnosis(Diagnosis),
    /// A server's answers are wrong.
    Answer(AnswerEffect),
}

impl LineEffect {
    /// The trouble with the answer to a request, and how likely it is; `None` if this effect does not change such answers.
    pub(super) fn on_answer(self, request: Request<'_>) -> Option<(f64, AnswerTrouble)> {
        let Self::Answer(effect) = self else {
            return None;
        };
        let is_meant = effect.station.is_none_or(|meant| meant == request.station)
            && effect
                .function
                .is_none_or(|meant| meant == request.function)
            && (effect.elements == Elements::default() || (request.names)(effect.elements));
        is_meant.then_some((effect.chance, effect.trouble))
    }
}

/// The affected frames, as seen from this end.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Direction {
    /// The frames that this end receives.
    In,
    /// The frames that this end sends.
    Out,
    /// Both.
    #[default]
    Both,
}

impl Direction {
    /// Returns true if received frames are affected.
    pub const fn comes_in(self) -> bool {
        matches!(self, Self::In | Self::Both)
    }

    /// Returns true if sent frames are affected.
    pub const fn goes_out(self) -> bool {
        matches!(self, Self::Out | Self::Both)
    }
}

/// When a fault begins.
#[derive(Clone, Debug, PartialEq)]
pub enum Begin {
    /// At the next tick.
    AtOnce,
    /// This long after the first tick.
    At(Nanos),
    /// At the tick with this number; the first is 1.
    Tick(u64),
    /// When the condition becomes true.
    When(Condition),
    /// When the condition becomes true; the fault ends when the condition becomes false.
    While(Condition),
}

/// How long a fault lasts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Lasts {
    /// Until a request or the condition ends the fault.
    UntilEnded,
    /// For this long.
    For(Nanos),
    /// For this many ticks.
    Ticks(u64),
}

impl Fault {
    /// The fault's kind, as a driver.cfg names it.
    pub const fn kind(&self) -> &'static str {
        match self.effect {
            Effect::Signal(_, SignalEffect::Stuck(_)) => "stuck",
            Effect::Signal(_, SignalEffect::Ramp { .. }) => "ramp",
            Effect::Signal(_, SignalEffect::Invert) => "invert",
            Effect::Signal(_, SignalEffect::Offset(_)) => "offset",
            Effect::Signal(_, SignalEffect::Noise(_) | SignalEffect::Flicker(_)) => "noise",
            Effect::Line(LineEffect::Delay(_)) => "delay",
            Effect::Line(LineEffect::LateValues(_)) => LATE_VALUES,
            Effect::Line(LineEffect::Drop(..)) => "drop",
            Effect::Line(LineEffect::Duplicate(..)) => "duplicate",
            Effect::Line(LineEffect::LinkDown) => "link-down",
            Effect::Line(LineEffect::StationDown(_)) => "station-down",
            Effect::Line(LineEffect::Diagnosis(_)) => "diagnosis",
            Effect::Line(LineEffect::Answer(answer)) => match answer.trouble {
                AnswerTrouble::Late { .. } => "answer-late",
                AnswerTrouble::Error(_) => "answer-error",
                AnswerTrouble::Wrong(_) => "answer-wrong",
            },
            Effect::Model(_) => MODEL,
        }
    }

    /// The fault's effect, as text: `"LA1 bottom" is stuck at 1`.
    pub fn what(&self, table: &SignalTable) -> String {
        match self.effect {
            Effect::Signal(index, change) => {
                let signal = &table.signals[index];
                format!("\"{}\" {}", signal.name, changed(change, signal))
            }
            Effect::Line(trouble) => troubled(trouble, table),
            Effect::Model(value) => {
                format!("\"{}\" of the model is {}", self.name, short_number(value))
            }
        }
    }
}

fn changed(change: SignalEffect, signal: &Signal) -> String {
    let unit = signal.unit.as_deref().unwrap_or_default();
    let measured = |number: f64| {
        format!("{} {unit}", short_number(number))
            .trim_end()
            .to_owned()
    };
    let valued = |slot: Slot| {
        let whole = match signal.data_type {
            DataType::Lint => slot.signed().to_string(),
            _ => slot.unsigned().to_string(),
        };
        if signal.is_integer_slot() {
            format!("{whole} {unit}").trim_end().to_owned()
        } else {
            measured(slot.real())
        }
    };
    match change {
        SignalEffect::Stuck(None) => "is stuck where it is".to_owned(),
        SignalEffect::Stuck(Some(slot)) => format!("is stuck at {}", valued(slot)),
        SignalEffect::Ramp { to, within, .. } => format!("goes to {} within {within}", valued(to)),
        SignalEffect::Invert => "is inverted".to_owned(),
        SignalEffect::Offset(by) => format!("is off by {}", measured(by)),
        SignalEffect::Noise(amplitude) => {
            format!("is off by up to {} at random", measured(amplitude))
        }
        SignalEffect::Flicker(chance) => {
            format!("flickers with a chance of {}", short_number(chance))
        }
    }
}

fn troubled(trouble: LineEffect, table: &SignalTable) -> String {
    let frames = |direction| match direction {
        Direction::In => "received frames",
        Direction::Out => "sent frames",
        Direction::Both => "frames",
    };
    match trouble {
        LineEffect::Delay(by) => format!("what comes in is {by} late"),
        LineEffect::LateValues(by) => format!("what goes out is {by} late"),
        LineEffect::Drop(chance, direction) => {
            let chance = short_number(chance);
            format!("{} are lost with a chance of {chance}", frames(direction))
        }
        LineEffect::Duplicate(chance, direction) => {
            let chance = short_number(chance);
            format!("{} come twice with a chance of {chance}", frames(direction))
        }
        LineEffect::LinkDown => "the link is down".to_owned(),
        LineEffect::StationDown(station) => {
            format!("the station \"{}\" is gone", table.stations[station].name)
        }
        LineEffect::Diagnosis(diagnosis) => match &*table.stations[diagnosis.station].name {
            "" => format!("the station reports {}", diagnosis.finding),
            name => format!("the station \"{name}\" reports {}", diagnosis.finding),
        },
        LineEffect::Answer(answer) => answered(answer, table),
    }
}

fn answered(answer: AnswerEffect, table: &SignalTable) -> String {
    let function = answer.function;
    let function = function.map_or_else(String::new, |code| format!(" to function {code}"));
    let station = answer.station.map_or_else(String::new, |station| {
        format!(" of the station \"{}\"", table.stations[station].name)
    });
    let Elements { signal, quantity } = answer.elements;
    let quantity = quantity.map_or_else(String::new, |number| match number {
        1 => " for one element".to_owned(),
        _ => format!(" for {number} elements"),
    });
    let signal = signal.map_or_else(String::new, |signal| {
        format!(" that concern \"{}\"", table.signals[signal].name)
    });
    let trouble = match answer.trouble {
        AnswerTrouble::Late { by, pause } if pause > Nanos::ZERO => {
            format!("are {by} late, with {pause} between their bytes")
        }
        AnswerTrouble::Late { by, .. } => format!("are {by} late"),
        // Codes of four bytes are written as their standard has them.
        AnswerTrouble::Error(code @ 0x100..) => format!("are the error 0x{code:08X}"),
        AnswerTrouble::Error(code) => format!("are the error {code}"),
        AnswerTrouble::Wrong(WrongAnswer::Truncated) => "lack their last byte".to_owned(),
        AnswerTrouble::Wrong(WrongAnswer::Transaction) => {
            "have the number of another request".to_owned()
        }
        AnswerTrouble::Wrong(WrongAnswer::Unit) => "come from another unit".to_owned(),
        AnswerTrouble::Wrong(WrongAnswer::Short) => "lack their last element".to_owned(),
    };
    let chance = if answer.chance < 1.0 {
        format!(" with a chance of {}", short_number(answer.chance))
    } else {
        String::new()
    };
    format!("answers{function}{quantity}{signal}{station} {trouble}{chance}")
}

/// `at 1200ms for 300ms`.
impl fmt::Display for Begin {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::AtOnce => f.write_str("from the first tick"),
            Self::At(time) => write!(f, "at {time}"),
            Self::Tick(tick) => write!(f, "at tick {tick}"),
            Self::When(condition) => write!(f, "when {condition}"),
            Self::While(condition) => write!(f, "while {condition}"),
        }
    }
}

impl fmt::Display for Lasts {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::UntilEnded => Ok(()),
            Self::For(time) => write!(f, "for {time}"),
            Self::Ticks(ticks) => write!(f, "for {ticks} ticks"),
        }
    }
}
