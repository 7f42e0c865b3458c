//! Serial ports for other programs on this computer, on a system that has none.

use std::io::{self, ErrorKind, Read, Write};
use std::path::Path;

use super::{Pollable, pollable::Source};

/// There is none on this system, where programs use the two ports of a driver for pairs of virtual ports.
#[derive(Debug)]
pub enum LinkedTerminal {}

impl LinkedTerminal {
    /// Fails.
    ///
    /// # Errors
    ///
    /// Always.
    pub fn open(_link: &Path) -> io::Result<Self> {
        let text = "this system has no pseudo-terminals; name a serial port, or one of a pair of virtual ones";
        Err(io::Error::new(ErrorKind::Unsupported, text))
    }
}

impl Read for LinkedTerminal {
    fn read(&mut self, _bytes: &mut [u8]) -> io::Result<usize> {
        match *self {}
    }
}

impl Write for LinkedTerminal {
    fn write(&mut self, _bytes: &[u8]) -> io::Result<usize> {
        match *self {}
    }

    fn flush(&mut self) -> io::Result<()> {
        match *self {}
    }
}

impl Pollable for LinkedTerminal {
    fn source(&self) -> Source<'_> {
        match *self {}
    }
}
