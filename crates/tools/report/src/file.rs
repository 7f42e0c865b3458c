//! Pages as files: the only part of this room that opens any.

use std::fs::{self, File};
use std::io::{self, BufWriter, Write as _};
use std::path::{Path, PathBuf};

use super::{Contents, DEFAULT_BUDGET, RunStatistics, read, write};
use tickbus_record::Recording;

/// Writes a page; first to a temporary file, so that an old page stays until the new one is complete. Returns its size.
///
/// # Errors
///
/// The file cannot be written.
pub fn write_file(contents: &Contents<'_>, path: &Path) -> io::Result<u64> {
    let mut part = path.as_os_str().to_owned();
    part.push(".part");
    let part = PathBuf::from(part);
    let written = (|| {
        let mut out = BufWriter::new(File::create(&part)?);
        write(contents, &mut out)?;
        out.flush()?;
        let bytes = out.get_ref().metadata()?.len();
        fs::rename(&part, path)?;
        Ok(bytes)
    })();
    if written.is_err() {
        let _ = fs::remove_file(&part);
    }
    written
}

/// Writes the page of a recording to a file with the same name and the extension .html, and returns its path.
/// The texts appear on it under their headings.
///
/// # Errors
///
/// The recording cannot be read at all, or the page cannot be written; the error states the remedy.
pub fn page_beside(
    recording: &Path,
    title: &str,
    statistics: Option<&str>,
    texts: &[(String, String)],
) -> Result<PathBuf, String> {
    let mut read_from = Recording::open(recording, None).map_err(|error| error.to_string())?;
    // The part before a damaged place in the recording is worth a page.
    let (run, _) = read(&mut read_from, DEFAULT_BUDGET);
    let statistics = statistics.map(RunStatistics::read);
    let file = recording.file_name().unwrap_or(recording.as_os_str());
    let contents = Contents {
        title,
        source: &file.to_string_lossy(),
        run: &run,
        steps: None,
        faults: &[],
        statistics: statistics.as_ref(),
        texts,
    };
    let page = recording.with_extension("html");
    match write_file(&contents, &page) {
        Ok(_) => Ok(page),
        Err(error) => Err(format!(
            "{}: the page cannot be written: {error}; check the folder and the disk",
            page.display()
        )),
    }
}
