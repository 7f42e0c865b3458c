//! A program that runs.

use tickbus_base::time::Nanos;

use crate::block::Block;
use crate::program::Program;
use crate::week::WallTime;
use crate::wires::{Signals, Terminals};

/// A controller with its program: inputs and time in, outputs out. Allocates only during construction.
///
/// All inputs are off, or 0, until they are set.
#[derive(Clone, Debug)]
pub struct Controller {
    program: Program,
    blocks: Vec<Block>,
    signals: Signals,
    /// The outputs of the current scan: outputs that read outputs read those of the last scan.
    next_outputs: Vec<bool>,
    next_analog_outputs: Vec<f64>,
}

impl Controller {
    /// A controller at power-up: counters at 0, relays off.
    pub fn new(program: Program) -> Self {
        let signals = Signals::new(program.terminals, program.blocks.len());
        Self {
            blocks: program.blocks.clone(),
            next_outputs: signals.outputs.clone(),
            next_analog_outputs: signals.analog_outputs.clone(),
            signals,
            program,
        }
    }

    /// The terminals.
    pub fn terminals(&self) -> Terminals {
        self.program.terminals
    }

    /// Switches the input `I<number>`; numbers count from 1.
    ///
    /// # Panics
    ///
    /// When there is no such input.
    pub fn set_input(&mut self, number: usize, is_on: bool) {
        self.signals.inputs[number - 1] = is_on;
    }

    /// Sets the input `AI<number>`; numbers count from 1.
    ///
    /// # Panics
    ///
    /// When there is no such input.
    pub fn set_analog_input(&mut self, number: usize, value: f64) {
        self.signals.analog_inputs[number - 1] = value;
    }

    /// Runs the program once. Returns the time at which the next scan is due for a timer, even if no input changes;
    /// [`Nanos::MAX`] if no timer runs.
    ///
    /// Blocks are evaluated in the order of the program. Later blocks, and outputs, have the values of the last scan.
    pub fn scan(&mut self, now: Nanos, wall: WallTime) -> Nanos {
        let mut due = Nanos::MAX;
        for (place, block) in self.blocks.iter_mut().enumerate() {
            due = due.min(block.evaluate(place, &mut self.signals, now, wall));
        }
        let signals = &mut self.signals;
        for (next, wire) in self.next_outputs.iter_mut().zip(&self.program.outputs) {
            *next = wire.is_some_and(|wire| signals.is_on(wire));
        }
        let quantities = &self.program.analog_outputs;
        for (next, quantity) in self.next_analog_outputs.iter_mut().zip(quantities) {
            *next = quantity.map_or(0.0, |quantity| signals.number(quantity));
        }
        std::mem::swap(&mut signals.outputs, &mut self.next_outputs);
        std::mem::swap(&mut signals.analog_outputs, &mut self.next_analog_outputs);
        due
    }

    /// The outputs, `Q1` first.
    pub fn outputs(&self) -> &[bool] {
        &self.signals.outputs
    }

    /// The analog outputs, `AQ1` first.
    pub fn analog_outputs(&self) -> &[f64] {
        &self.signals.analog_outputs
    }
}
