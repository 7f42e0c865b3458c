//! The built-in PLC programs: those of the demos, and two for commissioning and measuring.
//!
//! None of them is part of the driver: they are at the other end of the line, hosted by a loopback or run by `tickbus
//! plc`. [`program`] finds a built-in program by its name, or a user's own program by its path.

use std::path::Path;

use peeler::{Charger, Lathe};
use tickbus_plc::{HostedProgram, Program, ProgramError};

mod drum;
mod mirror;
mod peeler;
mod reaction;

pub mod rig;

pub use drum::Drum;
pub use mirror::Mirror;
pub use reaction::Reaction;
pub use rig::{La1Code, Rig};

/// The built-in names for [`program`].
pub const PROGRAMS: [&str; 5] = [
    Rig::NAME,
    Mirror::NAME,
    Reaction::NAME,
    Charger::NAME,
    Lathe::NAME,
];

/// Makes the program called `name`, with its options as (key, value) pairs. If an option is given twice, the last one
/// counts.
///
/// The name is one of [`PROGRAMS`], or the path of a [`HostedProgram`]: a path contains `/` or ends in `.so`, `.dll` or
/// `.dylib`.
///
/// # Errors
///
/// The name is unknown, the program has no such option, or the option does not accept the value; the text says what
/// would be right.
pub fn program(name: &str, options: &[(String, String)]) -> Result<Box<dyn Program>, ProgramError> {
    program_beside(Path::new(""), name, options)
}

/// The same, with paths relative to `folder`.
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
        _ if HostedProgram::is_path(name) => {
            Ok(Box::new(HostedProgram::load(&folder.join(name), options)?))
        }
        Rig::NAME => Ok(Box::new(Rig::from_options(options)?)),
        Mirror::NAME => Ok(Box::new(Mirror::new(options)?)),
        Reaction::NAME => Ok(Box::new(Reaction::from_options(options)?)),
        Charger::NAME => Ok(Box::new(Charger::from_options(options)?)),
        Lathe::NAME => Ok(Box::new(Lathe::from_options(options)?)),
        _ => Err(ProgramError::UnknownName {
            name: name.to_owned(),
            known: &PROGRAMS,
        }),
    }
}

/// Checks without loading anything that there can be a program called `name` that takes `options`.
///
/// # Errors
///
/// As for [`program`].
pub fn check(name: &str, options: &[(String, String)]) -> Result<(), ProgramError> {
    if HostedProgram::is_path(name) {
        HostedProgram::check_options(name, options)
    } else {
        program(name, options).map(drop)
    }
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
