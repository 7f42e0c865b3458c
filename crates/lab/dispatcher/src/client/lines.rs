//! The lines of a dispatcher.

use crate::device::Device;
use crate::grammar::{LONGEST_LINE, Values, printable};

use super::ClientError;

/// A line, read as far as its keyword says what it is.
pub(super) enum Heard<'a> {
    Nothing,
    Values(Values<'a>),
    Done(&'a [u8]),
    Refused(u16, String),
    Device(Device),
    ListEnd,
}

/// Reads a line, without its end.
///
/// # Errors
///
/// No dispatcher sends such a line.
pub(super) fn read(line: &[u8]) -> Result<Heard<'_>, ClientError> {
    let (keyword, rest) = match line.iter().position(|byte| *byte == b' ') {
        Some(at) => (&line[..at], &line[at + 1..]),
        None => (line, &line[line.len()..]),
    };
    match keyword {
        b"P" => return Ok(Heard::Values(Values::delivered(rest))),
        b"OK" => return Ok(Heard::Done(rest)),
        b"END" => return Ok(Heard::ListEnd),
        b"ERR" => {
            let mut parts = rest.splitn(2, |byte| *byte == b' ');
            let code = parts.next().and_then(|code| std::str::from_utf8(code).ok());
            if let Some(code) = code.and_then(|code| code.parse().ok()) {
                return Ok(Heard::Refused(
                    code,
                    printable(parts.next().unwrap_or_default()),
                ));
            }
        }
        b"" if rest.is_empty() => return Ok(Heard::Nothing),
        _ => {
            if let Some(device) = Device::parse(line) {
                return Ok(Heard::Device(device));
            }
        }
    }
    Err(nonsense(line, "no dispatcher says that"))
}

/// The error for a line that makes no sense.
pub(super) fn nonsense(line: &[u8], why: &str) -> ClientError {
    ClientError::Protocol(format!(
        "the line \"{}\" came, but {why}; see whether a dispatcher listens there",
        printable(&line[..line.len().min(80)])
    ))
}

/// Splits bytes that arrive in any pieces into lines.
#[derive(Debug, Default)]
pub(super) struct Lines {
    begun: Vec<u8>,
}

impl Lines {
    pub(super) fn new() -> Self {
        Self {
            begun: Vec::with_capacity(LONGEST_LINE),
        }
    }

    pub(super) fn clear(&mut self) {
        self.begun.clear();
    }

    /// Passes each line that `bytes` complete to `take`, without its end.
    ///
    /// # Errors
    ///
    /// A line is too long, or `take` fails.
    pub(super) fn each(
        &mut self,
        mut bytes: &[u8],
        take: &mut dyn FnMut(&[u8]) -> Result<(), ClientError>,
    ) -> Result<(), ClientError> {
        loop {
            let end = bytes.iter().position(|byte| *byte == b'\n');
            let part = end.map_or(bytes, |end| &bytes[..end]);
            if self.begun.len() + part.len() >= LONGEST_LINE {
                let mut line = std::mem::take(&mut self.begun);
                line.extend_from_slice(&part[..part.len().min(80)]);
                let why = format!("a line has at most {LONGEST_LINE} bytes, and it has more");
                return Err(nonsense(&line, &why));
            }
            if end.is_none() || !self.begun.is_empty() {
                self.begun.extend_from_slice(part);
            }
            let Some(end) = end else { return Ok(()) };
            let line = if self.begun.is_empty() {
                part
            } else {
                &self.begun
            };
            take(line.strip_suffix(b"\r").unwrap_or(line))?;
            self.begun.clear();
            bytes = &bytes[end + 1..];
        }
    }
}
