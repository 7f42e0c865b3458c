//! The programs that can be named where a program is hosted. Those that are built in are handed in.

use std::fmt;
use std::path::Path;

use crate::{HostedProgram, Program, ProgramError};

/// Makes the built-in program of a name, with its options as (key, value) pairs.
type Make = fn(&str, &[(String, String)]) -> Result<Box<dyn Program>, ProgramError>;

/// The programs that are built in, by their names. A user's own program is named by its path, and always there.
#[derive(Clone, Copy)]
pub struct Programs {
    names: &'static [&'static str],
    make: Make,
}

impl Programs {
    /// No program is built in.
    pub const NONE: Self = Self::new(&[], |name, _| Err(unknown(name, &[])));

    /// Those with these names, made by `make`.
    pub const fn new(names: &'static [&'static str], make: Make) -> Self {
        Self { names, make }
    }

    /// The names of those that are built in.
    pub const fn names(&self) -> &'static [&'static str] {
        self.names
    }

    /// Makes the program called `name`, with its options as (key, value) pairs. Where an option is given
    /// twice, the last one counts.
    ///
    /// The name is a built-in one, or the path of a [`HostedProgram`], which counts from `folder`: then it has a `/` in it or
    /// ends in `.so`, `.dll` or `.dylib`.
    ///
    /// # Errors
    ///
    /// The name is unknown, the program has no such option, or the option cannot have that value; the
    /// text says which would be right.
    pub fn make(
        &self,
        folder: &Path,
        name: &str,
        options: &[(String, String)],
    ) -> Result<Box<dyn Program>, ProgramError> {
        if HostedProgram::is_path(name) {
            return Ok(Box::new(HostedProgram::load(&folder.join(name), options)?));
        }
        if !self.names.contains(&name) {
            return Err(unknown(name, self.names));
        }
        (self.make)(name, options)
    }

    /// Checks, without loading anything, that there can be a program called `name` that takes `options`.
    ///
    /// # Errors
    ///
    /// As for [`make`](Self::make).
    pub fn check(&self, name: &str, options: &[(String, String)]) -> Result<(), ProgramError> {
        if HostedProgram::is_path(name) {
            HostedProgram::check_options(name, options)
        } else {
            self.make(Path::new(""), name, options).map(drop)
        }
    }
}

fn unknown(name: &str, known: &'static [&'static str]) -> ProgramError {
    ProgramError::UnknownName {
        name: name.to_owned(),
        known,
    }
}

impl fmt::Debug for Programs {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("Programs").field(&self.names).finish()
    }
}
