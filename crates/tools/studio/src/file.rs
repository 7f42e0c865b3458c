//! A text that has no place on the disk yet.

use std::io::{self, Write as _};
use std::path::PathBuf;

/// Writes a text to a new file in the system's temporary folder.
pub(crate) fn keep(text: &str) -> io::Result<PathBuf> {
    let mut kept = tempfile::Builder::new();
    let mut kept = kept.prefix("driver-").suffix(".cfg").tempfile()?;
    kept.write_all(text.as_bytes())?;
    let (_, path) = kept.keep().map_err(|error| error.error)?;
    Ok(path)
}
