//! The built-in PLC programs: those of the demos, and two for commissioning and measuring.
//!
//! None of them is part of the driver: they are at the other end of the line, hosted by a loopback or run by `tickbus
//! plc`. [`PROGRAMS`] is handed in where programs are hosted by their names.

use std::path::Path;

use peeler::{Charger, Lathe};
use tickbus_plc::{Program, ProgramError, Programs};

mod drum;
mod idle;
mod mirror;
mod peeler;
mod reaction;

pub mod rig;

pub use drum::Drum;
pub use idle::Idle;
pub use mirror::Mirror;
pub use reaction::Reaction;
pub use rig::{La1Code, Rig};

/// The list of the built-in programs.
pub const PROGRAMS: Programs = Programs::new(
    &[
        Rig::NAME,
        Mirror::NAME,
        Reaction::NAME,
        Charger::NAME,
        Lathe::NAME,
    ],
    built_in,
);

fn built_in(name: &str, options: &[(String, String)]) -> Result<Box<dyn Program>, ProgramError> {
    Ok(match name {
        Rig::NAME => Box::new(Rig::from_options(options)?),
        Mirror::NAME => Box::new(Mirror::new(options)?),
        Reaction::NAME => Box::new(Reaction::from_options(options)?),
        Charger::NAME => Box::new(Charger::from_options(options)?),
        Lathe::NAME => Box::new(Lathe::from_options(options)?),
        _ => unreachable!("{name} is one of the list"),
    })
}

/// Makes the program called `name`, one of [`PROGRAMS`] or a path relative to the current folder; see [`Programs::make`].
///
/// # Errors
///
/// As there.
pub fn program(name: &str, options: &[(String, String)]) -> Result<Box<dyn Program>, ProgramError> {
    PROGRAMS.make(Path::new(""), name, options)
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
        for name in PROGRAMS.names() {
            assert_eq!(program(name, &[]).expect("built in").name(), *name);
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
