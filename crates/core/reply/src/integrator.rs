//! A number that flows fill and empty, such as a level or a position.

use tickbus_base::time::Nanos;

use super::io::Io;
use super::levels::Levels;
use super::signal::{Input, Output};

/// `kind = "integrator"`: the sum of its flows over time, within limits.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Integrator {
    pub(crate) signal: Output,
    pub(crate) flows: Box<[Flow]>,
    pub(crate) reset: Option<Levels>,
    pub(crate) limits: [f64; 2],
    pub(crate) start: f64,
    /// The state.
    pub(crate) at: f64,
}

/// One flow.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Flow {
    /// Without it, it always flows.
    pub(crate) when: Option<Levels>,
    /// Units per second, or the factor of `input`.
    pub(crate) factor: f64,
    pub(crate) input: Option<Input>,
}

impl Integrator {
    pub(crate) fn step(&mut self, io: &mut Io<'_>) -> Nanos {
        let mut rate = 0.0;
        for flow in &self.flows {
            if flow.when.as_ref().is_none_or(|when| when.hold(io.slots)) {
                let input = flow.input.map_or(1.0, |input| input.value(io.slots));
                rate += flow.factor * input;
            }
        }
        let next = self.at + rate * io.seconds;
        // An input that is no number leaves the value where it is.
        if !next.is_nan() {
            self.at = next.clamp(self.limits[0], self.limits[1]);
        }
        let reset = self.reset.as_ref();
        if reset.is_some_and(|reset| reset.hold(io.slots)) {
            self.at = self.start;
        }
        io.put(self.signal, self.at);
        // What it reads may have changed behind it in this tick.
        io.now
    }
}
