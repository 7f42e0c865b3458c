//! IEC 61131-3 function blocks, and PLC programs on an injected clock.
//!
//! A [`Program`] is a pure function of its own state, the time and the inputs: its host calls
//! [`Program::scan`] at the scan interval, in wall time or in simulation time, and transfers the images.
//! [`program`] finds a built-in program by its name, or a user's own by its path.

use std::path::Path;
use std::sync::Arc;

use crate::signal::{Addressing, SignalTable};
use crate::time::Nanos;

mod axes;
mod drum;
mod hosted;
mod mirror;
mod reaction;

pub mod blocks;
pub mod peeler;
pub mod rig;

pub use axes::Axes;
pub use drum::Drum;
pub use hosted::Hosted;
pub use mirror::Mirror;
pub use peeler::{Charger, Lathe};
pub use reaction::Reaction;
pub use rig::{La1Code, Rig};

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
    /// Its name for [`program`], or the path of its file.
    fn name(&self) -> &str;

    /// Its default scan interval. Positive.
    fn interval(&self) -> Nanos {
        INTERVAL
    }

    /// Is told, before the first scan, the layout of its image.
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

    /// A further instance for another station of the driver; `None` if the program serves a single station.
    fn for_another_station(&self) -> Option<Box<dyn Program>> {
        None
    }

    /// Runs the program once: inputs to outputs. It allocates nothing and never blocks.
    ///
    /// Images may be longer than the program needs; the rest is not touched. If they are shorter, missing
    /// inputs read as 0 and missing outputs are dropped.
    fn scan(&mut self, scan: &mut Scan<'_>);

    /// The program's report in addition to its outputs, which can be read at any time while it runs.
    fn report(&self) -> Option<Arc<dyn Report>> {
        None
    }
}

/// A program's report in addition to its outputs, shared with its host.
pub trait Report: Send + Sync + std::fmt::Debug {
    /// Appends the report, one `key=value` per line.
    fn write(&self, text: &mut String);

    /// The report for people, shown when the program ends.
    fn summary(&self) -> String;

    /// Whether the program has finished its task.
    fn is_done(&self) -> bool;

    /// What went wrong, if anything, once it [is done](Self::is_done).
    fn failure(&self) -> Option<String>;
}

/// The names of the built-in programs.
pub const PROGRAMS: [&str; 5] = [
    Rig::NAME,
    Mirror::NAME,
    Reaction::NAME,
    Charger::NAME,
    Lathe::NAME,
];

/// Why there is no such program.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ProgramError {
    /// No built-in program has this name.
    #[error("no PLC program is called \"{name}\"; the built-in programs are {}", list(&PROGRAMS, "and"))]
    UnknownName {
        /// The requested name.
        name: String,
    },
    /// The program does not have this option.
    #[error(
        "the PLC program \"{program}\" has no option \"{option}\"; {}",
        if known.is_empty() { "it takes none".to_owned() } else { format!("it takes {}", list(known, "and")) }
    )]
    UnknownOption {
        /// The program.
        program: &'static str,
        /// The given option.
        option: String,
        /// The program's options.
        known: &'static [&'static str],
    },
    /// The option does not accept the value.
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
        /// The given value.
        value: String,
        /// The values that it accepts.
        known: &'static [&'static str],
    },
    /// A user's own program cannot be used.
    #[error("the PLC program \"{program}\" {what}; {right}")]
    Hosted {
        /// The path of its file.
        program: String,
        /// What is wrong with it.
        what: String,
        /// What would be right.
        right: String,
    },
    /// The program does not fit the image of this driver.
    #[error("the PLC program \"{program}\" {what}; {right}")]
    Unfit {
        /// The program.
        program: String,
        /// What is missing.
        what: String,
        /// What would be right.
        right: String,
    },
    /// The value of the option is malformed.
    #[error(
        "the option \"{option}\" of the PLC program \"{program}\" cannot be \"{value}\"; {right}"
    )]
    Malformed {
        /// The program.
        program: &'static str,
        /// The option.
        option: &'static str,
        /// The given value.
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

/// Creates the program called `name`, with its options as (key, value) pairs. If an option is given more than
/// once, the last value applies.
///
/// The name is one of [`PROGRAMS`], or the path of a [`Hosted`] program: a path contains a `/` or ends in
/// `.so`, `.dll` or `.dylib`.
///
/// # Errors
///
/// The name is unknown, the program has no such option, or the option does not accept the value; the text
/// says what would be right.
pub fn program(name: &str, options: &[(String, String)]) -> Result<Box<dyn Program>, ProgramError> {
    program_beside(Path::new(""), name, options)
}

/// As [`program`], with paths relative to `folder`.
///
/// # Errors
///
/// As for [`program`].
pub fn program_beside(
    folder: &Path,
    name: &str,
    options: &[(String, String)],
) -> Result<Box<dyn Program>, ProgramError> {
    match name {
        _ if Hosted::is_path(name) => Ok(Box::new(Hosted::load(&folder.join(name), options)?)),
        Rig::NAME => Ok(Box::new(Rig::from_options(options)?)),
        Mirror::NAME => Ok(Box::new(Mirror::new(options)?)),
        Reaction::NAME => Ok(Box::new(Reaction::from_options(options)?)),
        Charger::NAME => Ok(Box::new(Charger::from_options(options)?)),
        Lathe::NAME => Ok(Box::new(Lathe::from_options(options)?)),
        _ => Err(ProgramError::UnknownName {
            name: name.to_owned(),
        }),
    }
}

/// Checks, without loading anything, whether there can be a program called `name` that takes `options`.
///
/// # Errors
///
/// As for [`program`].
pub fn check(name: &str, options: &[(String, String)]) -> Result<(), ProgramError> {
    if Hosted::is_path(name) {
        Hosted::check_options(name, options)
    } else {
        program(name, options).map(drop)
    }
}

/// The scan interval for `program`: as stated by the user, or the program's default.
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

#[cfg(test)]
mod tests {
    use super::*;

    fn refusal(name: &str, options: &[(&str, &str)]) -> String {
        let options: Vec<_> = options
            .iter()
            .map(|(key, value)| ((*key).to_owned(), (*value).to_owned()))
            .collect();
        program(name, &options).err().expect("refused").to_string()
    }

    #[test]
    fn every_built_in_program_can_be_made_by_its_name() {
        for name in PROGRAMS {
            assert_eq!(program(name, &[]).expect("built in").name(), name);
        }
    }

    #[test]
    fn refusals_name_what_would_be_right() {
        assert_eq!(
            refusal("rigg", &[]),
            "no PLC program is called \"rigg\"; the built-in programs are \"rig\", \"mirror\", \
             \"reaction\", \"charger\" and \"lathe\""
        );
        assert_eq!(
            refusal("mirror", &[("speed", "fast")]),
            "the PLC program \"mirror\" has no option \"speed\"; it takes none"
        );
        assert_eq!(
            refusal("rig", &[("la1", "msb-first")]),
            "the PLC program \"rig\" has no option \"la1\"; it takes \"la1_code\""
        );
        assert_eq!(
            refusal("rig", &[("la1_code", "MSB")]),
            "the option \"la1_code\" of the PLC program \"rig\" cannot be \"MSB\"; write \
             \"msb-first\" or \"lsb-first\""
        );
    }
}
