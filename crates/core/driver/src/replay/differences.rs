//! The list of differences found by a replay: a file next to the recording.

use std::fs::File;
use std::io::{self, BufWriter, Write as _};
use std::path::{Path, PathBuf};

use tickbus_image::signal::Slot;
use tickbus_record::{FileClaim, Tick, ValueKind};

/// The most differences listed; further ones are only counted.
const MOST_LISTED: u64 = 100_000;

/// The most differences that are logged as well.
const MOST_LOGGED: u64 = 10;

/// Up to this number, each difference is written to the file at once, so that the file can be watched.
const FLUSHED: u64 = 1_000;

/// The list of differences.
pub(super) struct Differences {
    recording: PathBuf,
    path: PathBuf,
    has_begun: bool,
    file: Option<BufWriter<File>>,
    /// Must be dropped after the file.
    place: Option<FileClaim>,
    listed: u64,
}

impl Differences {
    /// Creates the list for the recording at `path`, in `<path>.diff`.
    pub(super) fn new(recording: &Path) -> Self {
        let mut path = recording.to_owned().into_os_string();
        path.push(".diff");
        Self {
            recording: recording.to_owned(),
            path: PathBuf::from(path),
            has_begun: false,
            file: None,
            place: None,
            listed: 0,
        }
    }

    /// Notes that a tick is compared. The first one begins the list and overwrites that of an earlier replay.
    pub(super) fn compared(&mut self) {
        if self.has_begun {
            return;
        }
        self.has_begun = true;
        let begun = FileClaim::to_write(&self.path).and_then(|opened| {
            let (file, place) = opened.map_err(io::Error::other)?;
            if let Some(place) = &place {
                place.truncate()?;
            }
            self.place = place;
            let mut file = BufWriter::new(file);
            writeln!(file, "tick,time_ns,signal,expected,seen")?;
            file.flush()?;
            Ok(file)
        });
        self.file = begun
            .inspect_err(|error| {
                log::warn!(
                    "{}: differences cannot be listed here: {error}; the first {MOST_LOGGED} go to the log",
                    self.path.display()
                );
            })
            .ok();
    }

    /// Lists one difference.
    pub(super) fn add(
        &mut self,
        tick: &Tick,
        name: &str,
        kind: ValueKind,
        expected: Slot,
        seen: Slot,
    ) {
        self.listed += 1;
        if self.listed > MOST_LISTED {
            return;
        }
        let (number, time) = (tick.number, tick.time);
        let (expected, seen) = (shown(kind, expected), shown(kind, seen));
        if self.listed <= MOST_LOGGED {
            log::warn!(
                "{}: tick {number} at {time}: \"{name}\" was {expected}, and is {seen}",
                self.recording.display()
            );
        }
        let name = if name.contains([',', '"']) {
            &format!("\"{}\"", name.replace('"', "\"\""))
        } else {
            name
        };
        self.write(&format!("{number},{},{name},{expected},{seen}\n", time.0));
        if self.listed == MOST_LISTED {
            self.write("# no more are listed\n");
        }
    }

    fn write(&mut self, text: &str) {
        if let Some(file) = &mut self.file
            && let Err(error) = file.write_all(text.as_bytes())
        {
            log::error!(
                "{}: the list of differences ends here: {error}",
                self.path.display()
            );
            self.file = None;
        }
    }

    /// Flushes the list to the file, while the list is short.
    pub(super) fn flush(&mut self) {
        if let Some(file) = &mut self.file
            && self.listed <= FLUSHED
        {
            // An error here recurs at the next write, which reports it.
            let _ = file.flush();
        }
    }

    /// Ends the list with the totals.
    pub(super) fn end(&mut self, compared: u64, differences: u64) {
        self.write(&format!("# ticks={compared} differences={differences}\n"));
        if let Some(file) = &mut self.file {
            let _ = file.flush();
        }
        let recording = self.recording.display();
        if differences == 0 {
            log::info!("{recording}: replayed, {compared} ticks compared, no difference");
        } else {
            let listed = self.listed_where();
            log::warn!(
                "{recording}: replayed, {compared} ticks compared, {differences} differences, {listed}"
            );
        }
    }

    fn listed_where(&self) -> String {
        match &self.file {
            Some(_) => format!("listed in {}", self.path.display()),
            None => format!("the first {MOST_LOGGED} are in the log"),
        }
    }
}

fn shown(kind: ValueKind, slot: Slot) -> String {
    match kind {
        ValueKind::Signed => slot.signed().to_string(),
        ValueKind::Unsigned => slot.unsigned().to_string(),
        ValueKind::Bit | ValueKind::Real | ValueKind::Count => slot.real().to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_list_that_cannot_be_written_is_not_said_to_be_there() {
        let folder = tempfile::tempdir().expect("a folder");
        let listed_where = |name: &str| {
            let mut differences = Differences::new(&folder.path().join(name));
            differences.compared();
            differences.listed_where()
        };
        let place = folder.path().join("run.csv.diff");
        assert_eq!(
            listed_where("run.csv"),
            format!("listed in {}", place.display())
        );
        // Nobody can write to this path, whatever the user's permissions.
        std::fs::create_dir(folder.path().join("other.csv.diff")).expect("a folder");
        assert_eq!(listed_where("other.csv"), "the first 10 are in the log");
    }
}
