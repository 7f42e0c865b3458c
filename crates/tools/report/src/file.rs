//! Pages as files: the only part of this room that opens any.

use std::fmt::Write as _;
use std::fs::{self, File};
use std::io::{self, BufWriter, Write as _};
use std::path::{Component, Path, PathBuf};

use super::{Contents, DEFAULT_BUDGET, RunStatistics, Sweeps, read, write, write_sweeps};
use tickbus_record::Recording;

/// Writes a page; first to a temporary file, so that an old page stays until the new one is complete. Returns its size.
///
/// # Errors
///
/// The file cannot be written.
pub fn write_file(contents: &Contents<'_>, path: &Path) -> io::Result<u64> {
    replace(path, |out| write(contents, out))
}

/// Writes the page of sweeps, as [`write_file`] does.
///
/// # Errors
///
/// The file cannot be written.
pub fn write_sweeps_file(sweeps: &Sweeps, path: &Path) -> io::Result<u64> {
    replace(path, |out| write_sweeps(sweeps, out))
}

fn replace(
    path: &Path,
    write: impl FnOnce(&mut dyn io::Write) -> io::Result<()>,
) -> io::Result<u64> {
    let mut part = path.as_os_str().to_owned();
    part.push(".part");
    let part = PathBuf::from(part);
    let written = (|| {
        let mut out = BufWriter::new(File::create(&part)?);
        write(&mut out)?;
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
        tables: &[],
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

/// The address of `file` as seen from `page`: a relative one, so that both can be moved together.
pub fn link(page: &Path, file: &Path) -> Option<String> {
    let page = std::path::absolute(page).ok()?;
    let file = std::path::absolute(file).ok()?;
    let folder: Vec<Component<'_>> = page.parent()?.components().collect();
    let parts: Vec<Component<'_>> = file.components().collect();
    let common = folder.iter().zip(&parts).take_while(|(a, b)| a == b);
    let common = common.count();
    if common == 0 {
        return None;
    }
    let up = folder[common..].iter().map(|_| "..".to_owned());
    let down = parts[common..]
        .iter()
        .map(|part| percent_encoded(&part.as_os_str().to_string_lossy()));
    Some(up.chain(down).collect::<Vec<_>>().join("/"))
}

/// A name as part of an address.
fn percent_encoded(name: &str) -> String {
    let mut text = String::with_capacity(name.len());
    for byte in name.bytes() {
        if byte.is_ascii_alphanumeric() || b"-._~".contains(&byte) {
            text.push(char::from(byte));
        } else {
            // Writing to a string cannot fail.
            let _ = write!(text, "%{byte:02X}");
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_link_is_relative_and_every_name_is_an_address() {
        let link = |page: &str, file: &str| link(Path::new(page), Path::new(file));
        for (page, file, expected) in [
            (
                "sweep.html",
                "kept/a - b @ S > 1.html",
                "kept/a%20-%20b%20%40%20S%20%3E%201.html",
            ),
            (
                "out/sweep.html",
                "kept/50%#é.html",
                "../kept/50%25%23%C3%A9.html",
            ),
            ("kept/sweep.html", "kept/a.html", "a.html"),
        ] {
            assert_eq!(link(page, file).as_deref(), Some(expected));
        }
    }
}
