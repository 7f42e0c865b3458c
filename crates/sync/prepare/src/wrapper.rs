//! The program around a block, while it is written.

use std::fmt::Write as _;

use super::interface::{DWORD, Direction, Elementary, Variable};

/// A signal of a wrapped block.
#[derive(Clone, Debug, PartialEq)]
pub struct Wired {
    /// The name of the variable; of the value that a block leaves in a `VAR_IN_OUT`, with " out" behind it.
    pub name: String,
    /// The address, which counts bytes.
    pub address: String,
    /// The IEC type.
    pub data_type: &'static str,
    /// The unit of a TIME.
    pub unit: Option<&'static str>,
    /// The initial value.
    pub initial: f64,
}

/// The parts of the program around a block, while they are written.
#[derive(Default)]
pub(crate) struct Wrapper {
    pub(crate) located: String,
    pub(crate) own: String,
    pub(crate) before: String,
    pub(crate) after: String,
    pub(crate) signals: Vec<Wired>,
    pub(crate) counters: Vec<Wired>,
    /// The next free byte of each area.
    inputs: usize,
    outputs: usize,
}

impl Wrapper {
    /// Declares what a variable needs; returns its argument in the call.
    pub(crate) fn wire(
        &mut self,
        number: usize,
        variable: &Variable,
        signal: Option<&'static Elementary>,
        is_function: bool,
    ) -> Option<String> {
        let Variable {
            name, data_type, ..
        } = variable;
        let (input, output) = (format!("TickbusI{number}"), format!("TickbusQ{number}"));
        let (held, last) = (format!("TickbusV{number}"), format!("TickbusL{number}"));
        match variable.direction {
            Direction::Input => {
                let signal = signal?;
                let address = self.locate('I', &input, signal);
                let initial = variable.initial;
                self.signals.push(Wired {
                    initial,
                    ..wired(name, address, signal)
                });
                Some(format!("{name} := {}", signal.of_signal(&input)))
            }
            Direction::Output if is_function => {
                let signal = signal?;
                let _ = writeln!(self.own, "  {held} : {data_type};");
                self.show(name, &output, &held, signal);
                Some(format!("{name} => {held}"))
            }
            Direction::Output => {
                self.show(name, &output, &format!("TickbusB.{name}"), signal?);
                None
            }
            Direction::Result => {
                let _ = writeln!(self.own, "  TickbusR : {data_type};");
                self.show(name, &output, "TickbusR", signal?);
                None
            }
            Direction::InOut => {
                let _ = writeln!(self.own, "  {held} : {data_type};");
                if let Some(signal) = signal {
                    let address = self.locate('I', &input, signal);
                    self.signals.push(wired(name, address, signal));
                    // The block's own value stays until the test sets another one.
                    let _ = writeln!(self.own, "  {last} : {};", signal.signal);
                    let value = signal.of_signal(&input);
                    let _ = writeln!(
                        self.before,
                        "IF {input} <> {last} THEN {held} := {value}; {last} := {input}; END_IF;"
                    );
                    self.show(&format!("{name} out"), &output, &held, signal);
                }
                Some(format!("{name} := {held}"))
            }
        }
    }

    /// Declares the counter with this number.
    pub(crate) fn count(&mut self, number: usize) {
        let address = self.locate('Q', &format!("TickbusC{number}"), &DWORD);
        let name = format!("(branches {number})");
        self.counters.push(wired(&name, address, &DWORD));
    }

    /// Makes an output of the value.
    fn show(&mut self, name: &str, output: &str, value: &str, signal: &'static Elementary) {
        let address = self.locate('Q', output, signal);
        self.signals.push(wired(name, address, signal));
        let _ = writeln!(self.after, "{output} := {};", signal.to_signal(value));
    }

    /// Declares a located variable; returns its address.
    fn locate(&mut self, area: char, name: &str, signal: &Elementary) -> String {
        let next = if area == 'I' {
            &mut self.inputs
        } else {
            &mut self.outputs
        };
        let (letter, bytes) = signal.size;
        let at = next.next_multiple_of(bytes);
        *next = at + bytes;
        let bit = if letter == 'X' { ".0" } else { "" };
        let address = format!("%{area}{letter}{at}{bit}");
        let _ = writeln!(self.located, "  {name} AT {address} : {};", signal.signal);
        address
    }
}

fn wired(name: &str, address: String, signal: &Elementary) -> Wired {
    Wired {
        name: name.to_owned(),
        address,
        data_type: signal.signal,
        unit: signal.unit(),
        initial: 0.0,
    }
}
