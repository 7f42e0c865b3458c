//! One reply: its signals, and what it does.

use std::fmt::Write as _;

use tickbus_base::time::Nanos;
use tickbus_base::toml_text::shown;
use tickbus_image::signal::{SignalTable, Slot};

use super::delay::Follows;
use super::drive::Driven;
use super::integrator::Integrator;
use super::io::Io;
use super::lag::Lag;
use super::motor::Motor;
use super::numbers::{Counter, Encoder, Switch};
use super::pulses::{Blink, LifeSign};
use super::rule::Ruled;
use super::signal::Output;
use super::track::Track;
use super::travel::Travel;

/// The kind whose replies are rules.
pub(crate) const RULE: &str = "rule";

/// The beginning of the kinds of drives, before the telegram.
pub(crate) const DRIVE: &str = "drive";

/// True for kinds whose replies may read what they make, because they read the values of the tick before: states that change
/// with time.
pub(crate) fn reads_tick_before(kind: &str) -> bool {
    matches!(kind, RULE | "integrator" | "track") || kind.starts_with(DRIVE)
}

/// One `[[reply]]` or `[[drive]]` of a driver.cfg, or `[[machine.reply]]` of a test file, at its beginning.
#[derive(Clone, Debug, PartialEq)]
pub struct Reply {
    /// The name, for messages.
    pub name: String,
    /// The kind, one of [`REPLY_KINDS`](super::REPLY_KINDS), or `drive`.
    pub kind: &'static str,
    /// The signals that it reads, by index.
    pub inputs: Vec<usize>,
    /// The signals that it makes, by index.
    pub outputs: Vec<usize>,
    /// The shortest time that it states.
    pub(crate) shortest: Option<Nanos>,
    pub(crate) behaviour: Behaviour,
}

/// The behaviour of a reply, with its state.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Behaviour {
    Constant(Output, Slot),
    Follows(Follows),
    Motor(Box<Motor>),
    Travel(Box<Travel>),
    Lag(Box<Lag>),
    Switch(Switch),
    Counter(Box<Counter>),
    Encoder(Box<Encoder>),
    Blink(Blink),
    LifeSign(LifeSign),
    Integrator(Box<Integrator>),
    Track(Box<Track>),
    Rule(Box<Ruled>),
    Drive(Box<Driven>),
}

impl Behaviour {
    /// Makes the signals of a tick. Returns when they can change next although no signal that the reply reads changes: the
    /// time of this tick for the next one, [`Nanos::MAX`] for never. Until then, no tick has to call this.
    pub(crate) fn step(&mut self, io: &mut Io<'_>) -> Nanos {
        match self {
            Self::Constant(output, value) => {
                io.put_slot(output.signal(), *value);
                Nanos::MAX
            }
            Self::Follows(it) => it.step(io),
            Self::Motor(it) => it.step(io),
            Self::Travel(it) => it.step(io),
            Self::Lag(it) => it.step(io),
            Self::Switch(it) => it.step(io),
            Self::Counter(it) => it.step(io),
            Self::Encoder(it) => it.step(io),
            Self::Blink(it) => it.step(io),
            Self::LifeSign(it) => it.step(io),
            Self::Integrator(it) => it.step(io),
            Self::Track(it) => it.step(io),
            Self::Rule(it) => it.step(io),
            Self::Drive(it) => it.step(io),
        }
    }
}

impl Reply {
    /// Describes the reply in one line: `"Pump 1" (motor): "Pump 1 running" from "Pump 1 on"`.
    pub fn what(&self, table: &SignalTable) -> String {
        let names = |signals: &[usize]| {
            let mut text = String::new();
            for (place, signal) in signals.iter().enumerate() {
                let comma = if place == 0 { "" } else { ", " };
                let name = shown(&table.signals[*signal].name);
                // Writing to a string cannot fail.
                let _ = write!(text, "{comma}\"{name}\"");
            }
            text
        };
        let made = format!(
            "\"{}\" ({}): {}",
            self.name,
            self.kind,
            names(&self.outputs)
        );
        if self.inputs.is_empty() {
            made
        } else {
            format!("{made} from {}", names(&self.inputs))
        }
    }
}
