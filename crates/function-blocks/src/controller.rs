//! A program that runs.

use tickbus_base::time::Nanos;

use crate::block::Block;
use crate::program::Program;
use crate::week::WallTime;
use crate::wires::{Signals, Terminals};

/// A controller with its program: inputs and time in, outputs out. It allocates only when it is made.
///
/// All inputs are off, or 0, until they are set.
#[derive(Clone, Debug)]
pub struct Controller {
    program: Program,
    blocks: Vec<Block>,
    signals: Signals,
}

impl Controller {
    /// A controller at power-up: counters at 0, relays off.
    pub fn new(program: Program) -> Self {
        Self {
            blocks: program.blocks.clone(),
            signals: Signals::new(program.terminals, program.blocks.len()),
            program,
        }
    }

    /// Its terminals.
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

    /// Runs the program once. Returns the time at which the next scan is due for a timer, although no input changes;
    /// [`Nanos::MAX`] if no timer runs.
    ///
    /// Blocks are evaluated in the order of the program. What comes later in it, or is an output, has its value of the
    /// last scan.
    pub fn scan(&mut self, now: Nanos, wall: WallTime) -> Nanos {
        let mut due = Nanos::MAX;
        for (place, block) in self.blocks.iter_mut().enumerate() {
            due = due.min(block.evaluate(place, &mut self.signals, now, wall));
        }
        for place in 0..self.signals.outputs.len() {
            if let Some(wire) = self.program.outputs[place] {
                self.signals.outputs[place] = self.signals.is_on(wire);
            }
        }
        for place in 0..self.signals.analog_outputs.len() {
            if let Some(quantity) = self.program.analog_outputs[place] {
                self.signals.analog_outputs[place] = self.signals.number(quantity);
            }
        }
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
