//! IEC 61131-3 function blocks, and PLC programs on a clock that is handed in.
//!
//! A [`Program`] is a pure function of its own state, the time and the inputs: whoever hosts it
//! calls [`Program::scan`] at the scan interval, on wall time or on simulation time, and carries
//! the images. [`Hosted`] loads a program of the user's own.

use std::sync::Arc;

use tickbus_base::time::Nanos;
use tickbus_image::signal::{Addressing, SignalTable};

mod axes;
mod hosted;

pub mod blocks;

pub use axes::Axes;
pub use hosted::Hosted;

/// What a program sees and makes in one scan.
#[derive(Debug)]
pub struct Scan<'a> {
    /// The time of this scan; timers measure with nothing else.
    pub now: Nanos,
    /// The peer's data are fresh or unchanged, not stale.
    pub alive: bool,
    /// Whole bus cycles that have arrived so far.
    pub cycle: u64,
    /// The inputs, `%I`, from byte 0.
    pub inputs: &'a [u8],
    /// The outputs, `%Q`, from byte 0; they keep their content between scans.
    pub outputs: &'a mut [u8],
}

/// The scan interval of a program that asks for none.
pub const INTERVAL: Nanos = Nanos::from_millis(10);

/// A PLC program.
pub trait Program: Send {
    /// What it is asked for by: its name, or the path of its file.
    fn name(&self) -> &str;

    /// The scan interval that it asks for. Positive.
    fn interval(&self) -> Nanos {
        INTERVAL
    }

    /// Hears, before the first scan, how the image is laid out that it will work on.
    ///
    /// # Errors
    ///
    /// The program cannot work on that image.
    fn fit(&mut self, table: &SignalTable, addressing: Addressing) -> Result<(), ProgramError> {
        let _ = (table, addressing);
        Ok(())
    }

    /// How many bytes of `%I` the program reads; 0 if it takes what there is.
    fn input_bytes(&self) -> usize;

    /// How many bytes of `%Q` the program writes; 0 if it takes what there is.
    fn output_bytes(&self) -> usize;

    /// Another one of the same kind, for a further station of the driver; `None` for a program that serves one.
    fn for_another_station(&self) -> Option<Box<dyn Program>> {
        None
    }

    /// Runs the program once: inputs to outputs. It allocates nothing and never waits.
    ///
    /// Images may be longer than the program asks for, and the rest is left alone. Of shorter
    /// ones, the missing inputs read as 0 and the missing outputs are dropped.
    fn scan(&mut self, scan: &mut Scan<'_>);

    /// What the program has to tell beside its outputs, to be asked for at any time while it runs.
    fn report(&self) -> Option<Arc<dyn Report>> {
        None
    }
}

/// What a program has to tell beside its outputs, shared with whoever hosts it.
pub trait Report: Send + Sync + std::fmt::Debug {
    /// Appends it, one `key=value` a line.
    fn write(&self, text: &mut String);

    /// The same for people, as the program's last word.
    fn summary(&self) -> String;

    /// Whether the program has done all that it was asked to.
    fn is_done(&self) -> bool;

    /// What went wrong, once it [is done](Self::is_done).
    fn failure(&self) -> Option<String>;
}

/// Why there is no such program.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ProgramError {
    /// No built-in program has that name.
    #[error(
        "no PLC program is called \"{name}\"; the built-in programs are {}",
        list(known, "and")
    )]
    UnknownName {
        /// The name that was asked for.
        name: String,
        /// The programs that are built in.
        known: &'static [&'static str],
    },
    /// The program has no such option.
    #[error(
        "the PLC program \"{program}\" has no option \"{option}\"; {}",
        if known.is_empty() { "it takes none".to_owned() } else { format!("it takes {}", list(known, "and")) }
    )]
    UnknownOption {
        /// The program.
        program: &'static str,
        /// The option that was given.
        option: String,
        /// The options that it takes.
        known: &'static [&'static str],
    },
    /// The option cannot have that value.
    #[error(
        "the option \"{option}\" of the PLC program \"{program}\" cannot be \"{value}\"; \
         write {}",
        list(known, "or")
    )]
    BadValue {
        /// The program.
        program: &'static str,
        /// The option.
        option: &'static str,
        /// The value that was given.
        value: String,
        /// The values that it can have.
        known: &'static [&'static str],
    },
    /// A program of the user's own cannot be used.
    #[error("the PLC program \"{program}\" {what}; {right}")]
    Hosted {
        /// The path of its file.
        program: String,
        /// What is wrong with it.
        what: String,
        /// What would be right.
        right: String,
    },
    /// The program cannot work on the image of this driver.
    #[error("the PLC program \"{program}\" {what}; {right}")]
    Unfit {
        /// The program.
        program: String,
        /// What it misses.
        what: String,
        /// What would be right.
        right: String,
    },
    /// The option is no value of its kind.
    #[error(
        "the option \"{option}\" of the PLC program \"{program}\" cannot be \"{value}\"; {right}"
    )]
    Malformed {
        /// The program.
        program: &'static str,
        /// The option.
        option: &'static str,
        /// The value that was given.
        value: String,
        /// What would be right.
        right: String,
    },
}

/// Writes `"a", "b" or "c"`, with `last` before the last one.
fn list(names: &[&str], last: &str) -> String {
    let mut text = String::new();
    for (index, name) in names.iter().enumerate() {
        if index > 0 && index + 1 == names.len() {
            text.push(' ');
            text.push_str(last);
            text.push(' ');
        } else if index > 0 {
            text.push_str(", ");
        }
        text.push('"');
        text.push_str(name);
        text.push('"');
    }
    text
}

/// The scan interval for `program`: the one that a user has stated, else its own.
pub fn interval(program: &dyn Program, stated: Option<Nanos>) -> Nanos {
    let own = program.interval();
    let interval = stated.unwrap_or(own);
    if interval != own && Hosted::is_path(program.name()) {
        log::warn!(
            "the PLC program \"{}\" was compiled for a scan every {own} and gets one every {interval}: its \
             timers are right all the same, but its tasks run at other intervals than they state",
            program.name()
        );
    }
    interval
}
