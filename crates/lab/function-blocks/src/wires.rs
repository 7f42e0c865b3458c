//! The possible wires of blocks' inputs and the controller's outputs.

/// The number of terminals of each kind of a controller.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Terminals {
    /// `I1` and on.
    pub inputs: usize,
    /// `Q1` and on.
    pub outputs: usize,
    /// `AI1` and on.
    pub analog_inputs: usize,
    /// `AQ1` and on.
    pub analog_outputs: usize,
}

impl Default for Terminals {
    /// A basic LOGO! with an analog module.
    fn default() -> Self {
        Self {
            inputs: 8,
            outputs: 4,
            analog_inputs: 2,
            analog_outputs: 2,
        }
    }
}

/// A kind of terminal.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Terminal {
    Input,
    Output,
    AnalogInput,
    AnalogOutput,
}

impl Terminal {
    pub(crate) const fn letters(self) -> &'static str {
        match self {
            Self::Input => "I",
            Self::Output => "Q",
            Self::AnalogInput => "AI",
            Self::AnalogOutput => "AQ",
        }
    }

    pub(crate) const fn is_analog(self) -> bool {
        matches!(self, Self::AnalogInput | Self::AnalogOutput)
    }

    pub(crate) const fn is_output(self) -> bool {
        matches!(self, Self::Output | Self::AnalogOutput)
    }

    /// Splits a text such as `AI2` into the kind and the number; a number that is too large becomes the largest.
    pub(crate) fn split(text: &str) -> Option<(Self, usize)> {
        let kinds = [
            Self::AnalogInput,
            Self::AnalogOutput,
            Self::Input,
            Self::Output,
        ];
        let with_digits = |kind: &Self| {
            let digits = text.strip_prefix(kind.letters())?;
            // No zeros in front: each terminal has one name.
            let is_number = digits == "0" || !digits.starts_with('0');
            let is_number = is_number && !digits.is_empty();
            let is_number = is_number && digits.bytes().all(|byte| byte.is_ascii_digit());
            is_number.then(|| (*kind, digits.parse().unwrap_or(usize::MAX)))
        };
        kinds.iter().find_map(with_digits)
    }
}

impl Terminals {
    pub(crate) const fn of(self, kind: Terminal) -> usize {
        match kind {
            Terminal::Input => self.inputs,
            Terminal::Output => self.outputs,
            Terminal::AnalogInput => self.analog_inputs,
            Terminal::AnalogOutput => self.analog_outputs,
        }
    }
}

/// The source of a value that is on or off; places count from 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Wire {
    Input(usize),
    Output(usize),
    Block(usize),
}

/// The source of a number.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Quantity {
    Input(usize),
    Output(usize),
    /// The count of a counter.
    Count(usize),
    Constant(f64),
}

/// All current values of a controller; blocks still to come in this scan, and outputs, have the values of the last
/// scan.
#[derive(Clone, Debug)]
pub(crate) struct Signals {
    pub(crate) inputs: Vec<bool>,
    pub(crate) outputs: Vec<bool>,
    pub(crate) analog_inputs: Vec<f64>,
    pub(crate) analog_outputs: Vec<f64>,
    pub(crate) blocks: Vec<bool>,
    pub(crate) counts: Vec<i16>,
}

impl Signals {
    pub(crate) fn new(terminals: Terminals, blocks: usize) -> Self {
        Self {
            inputs: vec![false; terminals.inputs],
            outputs: vec![false; terminals.outputs],
            analog_inputs: vec![0.0; terminals.analog_inputs],
            analog_outputs: vec![0.0; terminals.analog_outputs],
            blocks: vec![false; blocks],
            counts: vec![0; blocks],
        }
    }

    pub(crate) fn is_on(&self, wire: Wire) -> bool {
        match wire {
            Wire::Input(place) => self.inputs[place],
            Wire::Output(place) => self.outputs[place],
            Wire::Block(place) => self.blocks[place],
        }
    }

    pub(crate) fn number(&self, quantity: Quantity) -> f64 {
        match quantity {
            Quantity::Input(place) => self.analog_inputs[place],
            Quantity::Output(place) => self.analog_outputs[place],
            Quantity::Count(block) => f64::from(self.counts[block]),
            Quantity::Constant(number) => number,
        }
    }
}
