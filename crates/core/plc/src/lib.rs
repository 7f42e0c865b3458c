//! IEC 61131-3 function blocks, and PLC programs on an injected clock.
//!
//! A [`Program`] is a pure function of its own state, the time and the inputs: its host calls
//! [`Program::scan`] at the scan interval, in wall time or in simulation time, and transfers the images.
//! [`HostedProgram`] is a user's own program.

use std::fmt;
use std::sync::Arc;

use tickbus_base::Mistake;
use tickbus_base::statistics::Statistics;
use tickbus_base::time::Nanos;
use tickbus_image::signal::{Addressing, SignalTable};

mod axes;
mod hosted;
mod programs;

pub mod blocks;

pub use axes::Axes;
pub use hosted::HostedProgram;
pub use programs::Programs;

/// The inputs and outputs of one scan.
#[derive(Debug)]
pub struct Scan<'a> {
    /// The time of this scan, the only time that timers use.
    pub now: Nanos,
    /// The peer's data are fresh or unchanged, not stale.
    pub alive: bool,
    /// The number of whole bus cycles received so far.
    pub cycle: u64,
    /// The inputs, `%I`, starting at byte 0.
    pub inputs: &'a [u8],
    /// The outputs, `%Q`, starting at byte 0; they keep their values between scans.
    pub outputs: &'a mut [u8],
}

/// The default scan interval of a program.
pub const INTERVAL: Nanos = Nanos::from_millis(10);

/// A PLC program.
pub trait Program: Send {
    /// The name for requesting the program, or the path of its file.
    fn name(&self) -> &str;

    /// The default scan interval. Positive.
    fn interval(&self) -> Nanos {
        INTERVAL
    }

    /// Gets the layout of its image, before the first scan.
    ///
    /// # Errors
    ///
    /// The program cannot work on that image.
    fn fit(&mut self, table: &SignalTable, addressing: Addressing) -> Result<(), ProgramError> {
        let _ = (table, addressing);
        Ok(())
    }

    /// How many bytes of `%I` the program reads; 0 if it uses the whole area.
    fn input_bytes(&self) -> usize;

    /// How many bytes of `%Q` the program writes; 0 if it uses the whole area.
    fn output_bytes(&self) -> usize;

    /// A further instance for the station of the driver with this index, from 1; `None` if the program serves a single
    /// station.
    fn for_another_station(&self, station: usize) -> Option<Box<dyn Program>> {
        let _ = station;
        None
    }

    /// Runs the program once: inputs to outputs. Allocates nothing and never blocks.
    ///
    /// Images may be longer than the program needs; the rest is not touched. If they are shorter, missing
    /// inputs read as 0 and missing outputs are dropped.
    fn scan(&mut self, scan: &mut Scan<'_>);

    /// True if a scan that takes seconds is a fault of the program. If every scan ends at once, a slow one was merely
    /// delayed by a busy computer, and continues when it gets its turn.
    fn can_hang(&self) -> bool {
        true
    }

    /// The program's report in addition to its outputs, which can be read at any time while it runs.
    fn report(&self) -> Option<Arc<dyn Report>> {
        None
    }
}

/// A program's report in addition to its outputs, shared with its host.
pub trait Report: Send + Sync + std::fmt::Debug {
    /// Adds the report.
    fn write(&self, statistics: &mut Statistics);

    /// The report for people, shown when the program ends.
    fn summary(&self) -> String;

    /// True if the program has finished its task.
    fn is_done(&self) -> bool;

    /// The failure, if any, once the program [is done](Self::is_done).
    fn failure(&self) -> Option<String>;
}

/// Why a program is not available.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum ProgramError {
    /// No built-in program has that name.
    UnknownName {
        /// The requested name.
        name: String,
        /// The programs that are built in.
        known: &'static [&'static str],
    },
    /// The program does not have this option.
    UnknownOption {
        /// The program.
        program: &'static str,
        /// The given option.
        option: String,
        /// The program's options.
        known: &'static [&'static str],
    },
    /// The option does not accept the value.
    BadValue {
        /// The program.
        program: &'static str,
        /// The option.
        option: &'static str,
        /// The given value.
        value: String,
        /// The accepted values.
        right: String,
    },
    /// A user's own program cannot be used, or the program does not fit the image of this driver.
    Unfit {
        /// The program.
        program: String,
        /// The mistake, to be printed after the program's name.
        mistake: Mistake,
    },
}

impl ProgramError {
    /// The option does not accept the value, but `known` ones.
    pub fn none_of(
        program: &'static str,
        option: &'static str,
        value: &str,
        known: &[&str],
    ) -> Self {
        Self::BadValue {
            program,
            option,
            value: value.to_owned(),
            right: format!("write {}", list(known, "or")),
        }
    }

    /// The mistake and its remedy.
    pub fn mistake(&self) -> Mistake {
        match self {
            Self::UnknownName { name, known } => Mistake::new(
                format!("no PLC program is called \"{name}\""),
                format!("the built-in programs are {}", list(known, "and")),
            ),
            Self::UnknownOption {
                program,
                option,
                known,
            } => Mistake::new(
                format!("the PLC program \"{program}\" has no option \"{option}\""),
                match known {
                    [] => "it takes none".to_owned(),
                    known => format!("it takes {}", list(known, "and")),
                },
            ),
            Self::BadValue {
                program,
                option,
                value,
                right,
            } => Mistake::new(
                format!(
                    "the option \"{option}\" of the PLC program \"{program}\" cannot be \"{value}\""
                ),
                right,
            ),
            Self::Unfit { program, mistake } => Mistake::new(
                format!("the PLC program \"{program}\" {}", mistake.what),
                &mistake.right,
            ),
        }
    }
}

impl fmt::Display for ProgramError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.mistake().fmt(f)
    }
}

impl std::error::Error for ProgramError {}

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
    if interval != own && HostedProgram::is_path(program.name()) {
        log::warn!(
            "the PLC program \"{}\" was compiled for a scan every {own} and gets one every {interval}: its \
             timers are still right, but its tasks run at other intervals than they state",
            program.name()
        );
    }
    interval
}
