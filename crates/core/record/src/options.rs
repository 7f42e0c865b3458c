//! The `[record]` table of a driver.cfg.

use std::path::{Component, Path, PathBuf};

use tickbus_base::Mistake;
use tickbus_base::toml_text::{Key, Shape, Table, Value, names};

/// The default capacity of the ring in ticks, unless that takes too much memory.
const TICKS: usize = 4096;

/// The memory that the ring may take by default, in bytes.
const RING_BYTES: usize = 16 << 20;

/// The memory that the ring may take if its capacity is stated, in bytes.
const MOST_RING_BYTES: usize = 1 << 30;

/// The largest capacity that can be stated, in ticks.
const MOST_TICKS: usize = 1 << 24;

/// How a recording is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Format {
    /// Value change dump, as waveform viewers read it.
    Vcd,
    /// Comma-separated values, one line per tick.
    Csv,
}

impl Format {
    /// The format that the extension of a file name implies.
    ///
    /// # Errors
    ///
    /// The extension is neither.
    pub fn of(file: &Path) -> Result<Self, Mistake> {
        let ending = file.extension().map(std::ffi::OsStr::to_ascii_lowercase);
        match ending.as_ref().and_then(|ending| ending.to_str()) {
            Some("vcd") => Ok(Self::Vcd),
            Some("csv") => Ok(Self::Csv),
            _ => Err(Mistake::new(
                format!("\"{}\" ends neither in .vcd nor in .csv", file.display()),
                "name it run.vcd for waveform viewers, or run.csv for tables",
            )),
        }
    }
}

/// The longest file name, in characters.
const FILE_LIMIT: usize = 1000;

/// When to record.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum When {
    /// From the first tick to the last.
    #[default]
    Always,
    /// Not at all.
    Never,
}

/// The values of the key `when`.
const TIMES: [(&str, When); 2] = [("always", When::Always), ("never", When::Never)];

/// The shape of the name of a recording's file.
pub const FILE_SHAPE: Shape = Shape::Pattern("\\S.*\\.([vV][cC][dD]|[cC][sS][vV])");

/// The options for recording in a driver.cfg.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Options {
    /// The file as written there: relative to the folder of the driver.cfg.
    pub file: PathBuf,
    /// The format.
    pub format: Format,
    /// Capacity of the ring in ticks; `None` chooses it by the size of a tick. Positive.
    pub ring: Option<usize>,
    /// When to record.
    pub when: When,
}

impl Options {
    /// Recording to `file`, everything else at its default.
    ///
    /// # Errors
    ///
    /// The file name implies no format.
    pub fn to(file: &Path) -> Result<Self, Mistake> {
        Ok(Self {
            file: file.to_owned(),
            format: Format::of(file)?,
            ring: None,
            when: When::Always,
        })
    }

    /// The keys of the table `[record]`.
    pub const KEYS: &'static [Key] = &[
        Key::required(
            "file",
            FILE_SHAPE,
            "The recording: a name that ends in .vcd or .csv, relative to the folder of this file",
        ),
        Key::new(
            "ring",
            Shape::Whole(1, MOST_TICKS as i128),
            "Ticks that may wait to be written; 4096 by default, at most 16 MiB",
        ),
        Key::new(
            "when",
            Shape::Choice(&names(&TIMES)),
            "\"never\" switches recording off",
        )
        .or("\"always\""),
    ];

    /// Reads the `[record]` table. `replayed` is the recording that the bus replays, if any: it must not be
    /// overwritten.
    pub fn read(mut table: Table<'_>, replayed: Option<&Path>) -> Option<Self> {
        let file = table.require("file", "name the recording, such as file = \"run.vcd\"");
        let ring = table.take("ring");
        let when = table.take("when");
        table.finish();
        let ring = ring.map(|value| ring_of(&value));
        let when = when.map_or(Some(When::Always), |value| value.choice("times", &TIMES));
        let value = file?;
        let (file, format) = file_of(&value)?;
        if replayed.is_some_and(|replayed| plain(replayed) == plain(&file)) {
            value.wrong(
                "the recording that is replayed would be overwritten",
                "record to another file",
            );
            return None;
        }
        Some(Self {
            file,
            format,
            ring: match ring {
                Some(ring) => Some(ring?),
                None => None,
            },
            when: when?,
        })
    }

    /// Capacity of the ring for ticks of `words` words each: a power of two within the limits.
    pub fn ticks(&self, words: usize) -> usize {
        let bytes = words.max(1) * size_of::<u64>();
        match self.ring {
            Some(ticks) => within(ticks.next_power_of_two(), MOST_RING_BYTES / bytes),
            None => usual_ticks(words),
        }
    }
}

/// The usual capacity of the ring for ticks of `words` words each.
pub(super) fn usual_ticks(words: usize) -> usize {
    within(TICKS, RING_BYTES / (words.max(1) * size_of::<u64>())).max(16)
}

/// A power of two, halved until it is at most `most`, or 1.
fn within(power: usize, most: usize) -> usize {
    power.min(1 << most.max(1).ilog2())
}

/// The file name of a recording, and its format.
pub fn file_of(value: &Value<'_>) -> Option<(PathBuf, Format)> {
    let right = "write the name of a file in quotes, such as \"run.vcd\"";
    let file = PathBuf::from(value.label(FILE_LIMIT, right)?);
    match Format::of(&file) {
        Ok(format) => Some((file, format)),
        Err(mistake) => {
            value.refuse(mistake);
            None
        }
    }
}

fn ring_of(value: &Value<'_>) -> Option<usize> {
    let most = i128::try_from(MOST_TICKS).expect("a small number");
    value
        .whole(1..=most)
        .and_then(|ticks| usize::try_from(ticks).ok())
}

/// A path without its `.` components.
fn plain(path: &Path) -> PathBuf {
    path.components()
        .filter(|part| *part != Component::CurDir)
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_ending_names_the_format() {
        for (file, format) in [
            ("run.vcd", Some(Format::Vcd)),
            ("a/b.c/RUN.VCD", Some(Format::Vcd)),
            ("run.csv", Some(Format::Csv)),
            ("run.vcd.gz", None),
            ("vcd", None),
            ("", None),
        ] {
            assert_eq!(Format::of(Path::new(file)).ok(), format, "{file}");
        }
    }

    #[test]
    fn a_ring_for_large_ticks_is_shorter_but_never_tiny() {
        let mut options = Options::to(Path::new("run.csv")).expect("a format");
        assert_eq!(options.ticks(40), 4096);
        assert_eq!(options.ticks(1 << 13), 256);
        assert_eq!(options.ticks(1 << 30), 16);
        options.ring = Some(1 << 20);
        assert_eq!(options.ticks(40), 1 << 20);
        assert_eq!(options.ticks(1 << 13), 1 << 14);
        options.ring = Some(MOST_TICKS);
        for words in [1, 40, 2047, 100_003, 1 << 28] {
            let ticks = options.ticks(words);
            assert!(ticks.is_power_of_two(), "{words} {ticks}");
            assert!(
                ticks == 1 || ticks * words * 8 <= MOST_RING_BYTES,
                "{words} {ticks}"
            );
        }
    }
}
