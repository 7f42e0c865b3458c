//! The common part of bus cards that are accessed through their vendors' libraries.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use tickbus_base::Mistake;
use tickbus_base::time::{Nanos, Stop};
use tickbus_base::toml_text::{Key, Shape, Table};
use tickbus_image::signal::SignalTable;

use super::{BusError, BusSetup, CYCLE, Cycles, Exchange, Exchanged, Free, OpenError, Port, Role};

/// The longest path of a library, in bytes.
const PATH_LIMIT: usize = 4000;

/// How long loading a library may take.
const LOAD: Nanos = Nanos::from_secs(10);

/// How much longer than its own time-out a call may take.
const CALL: Nanos = Nanos::from_secs(1);

/// The options that a driver.cfg has for any card.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CardOptions {
    /// The library's file as written; `None` for the vendor's.
    pub library: Option<PathBuf>,
    /// The first byte that this end writes in the data that the card sends.
    pub write_offset: u16,
    /// The first byte that this end reads in the data that the card receives.
    pub read_offset: u16,
    /// True if the card watches this end for life signs.
    pub watchdog: bool,
}

impl CardOptions {
    /// The keys that [`read`](Self::read) takes, but for `library`.
    pub const KEYS: &'static [Key] = &[
        Key::new(
            "write_offset",
            Shape::Whole(0, 65_535),
            "The first byte that this end writes in the card's process data",
        )
        .or("0"),
        Key::new(
            "read_offset",
            Shape::Whole(0, 65_535),
            "The first byte that this end reads in the card's process data",
        )
        .or("0"),
        Key::new(
            "card_watchdog",
            Shape::Boolean,
            "true: the card watches this end, which triggers it in each exchange",
        )
        .or("false"),
    ];

    /// Returns the key `library`, which a file needs if the vendor has no library for this system.
    pub const fn library_key(vendor: Option<&str>) -> Key {
        const DOC: &str = "The file of the vendor's library; the system searches for a name alone";
        match vendor {
            Some(_) => Key::new("library", Shape::Label(PATH_LIMIT), DOC),
            None => Key::required("library", Shape::Label(PATH_LIMIT), DOC),
        }
    }

    /// Reads `library`, `write_offset`, `read_offset` and `card_watchdog`. If `vendor` has no library for this system,
    /// `library` is required.
    pub fn read(table: &mut Table<'_>, vendor: Option<&str>) -> Option<Self> {
        const RIGHT: &str = "name the file of the vendor's library";
        let library = match vendor {
            Some(_) => table.take("library"),
            None => table.require("library", RIGHT),
        };
        let [write_offset, read_offset] =
            ["write_offset", "read_offset"].map(|key| table.take(key));
        let watchdog = table.take("card_watchdog");
        let is_missing = library.is_none() && vendor.is_none();
        let library = match library {
            None => Some(None),
            Some(value) => (value.label(PATH_LIMIT, RIGHT)).map(|path| Some(PathBuf::from(path))),
        };
        let [write_offset, read_offset] = [write_offset, read_offset].map(|value| {
            let offset = value.map_or(Some(0), |value| value.whole(0..=65_535))?;
            u16::try_from(offset).ok()
        });
        let watchdog = watchdog.map_or(Some(false), |value| value.boolean());
        Some(Self {
            library: library.filter(|_| !is_missing)?,
            write_offset: write_offset?,
            read_offset: read_offset?,
            watchdog: watchdog?,
        })
    }

    /// Parts of the line's summary: the options that differ from the defaults.
    pub fn summary(&self) -> Vec<String> {
        let library = self.library.iter();
        let mut parts: Vec<String> = library
            .map(|path| format!("library {}", path.display()))
            .collect();
        for (does, offset) in [("writes", self.write_offset), ("reads", self.read_offset)] {
            parts.extend((offset > 0).then(|| format!("{does} from byte {offset} on")));
        }
        parts.extend(self.watchdog.then(|| "card watchdog".to_owned()));
        parts
    }

    /// The library to load: the one that the driver.cfg names, or else `vendor`, which the system searches for.
    ///
    /// # Errors
    ///
    /// The driver.cfg names a file with its folder, and that file does not exist.
    pub fn library(&self, vendor: &str, folder: &Path) -> Result<PathBuf, OpenError> {
        let Some(named) = &self.library else {
            return Ok(PathBuf::from(vendor));
        };
        if named.components().count() == 1 && !folder.join(named).is_file() {
            return Ok(named.clone());
        }
        let joined = folder.join(named);
        // Fails if the current folder was deleted; then the path stays relative.
        let path = std::path::absolute(&joined).unwrap_or(joined);
        if path.is_file() {
            return Ok(path);
        }
        Err(OpenError::Config(Mistake::new(
            format!("there is no library {}", path.display()),
            "check `library`, which begins at the folder of the driver.cfg; a name alone is searched for by the system",
        )))
    }
}

/// Bytes that the end with `role` writes and reads.
fn sizes(role: Role, table: &SignalTable) -> [usize; 2] {
    let (writes, reads) = role.areas();
    [writes, reads].map(|area| {
        table
            .stations
            .iter()
            .map(|station| station.bytes(area))
            .sum()
    })
}

/// The meaning of an error code for the line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// The card works, but not its bus; data were moved anyway.
    NoPeer,
    /// This exchange failed; the next cycle tries again.
    Again,
    /// A repair may help: the line fails, and is reopened.
    Broken,
    /// The driver.cfg, or the card's configuration, must be changed.
    Refused,
}

/// An error code in the words of its vendor's table.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Meaning {
    /// The code.
    pub code: u32,
    /// The code's name in the vendor's header.
    pub name: &'static str,
    /// The consequence for the line.
    pub verdict: Verdict,
    /// The problem and the remedy.
    pub words: &'static str,
}

impl Meaning {
    /// The words for a code that only a mistake in tickbus can cause.
    pub const REPORT: &str =
        "the driver refuses how tickbus calls it; report this with the driver's version";

    /// An entry of a table.
    pub const fn new(code: u32, name: &'static str, verdict: Verdict, words: &'static str) -> Self {
        Self {
            code,
            name,
            verdict,
            words,
        }
    }

    /// The entry of `table` for `code`.
    pub fn of(table: &'static [Self], code: u32) -> Option<&'static Self> {
        table.iter().find(|meaning| meaning.code == code)
    }
}

/// A function of the library that returned an error.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Failing {
    /// The consequence for the line.
    pub verdict: Verdict,
    /// The function, the code, its name and its words.
    pub text: String,
}

impl Failing {
    /// The error that `function` returned, with the code as `shown`, and the code's meaning, if known.
    pub fn new(function: &str, shown: &str, meaning: Option<&Meaning>) -> Self {
        match meaning {
            Some(Meaning {
                name,
                verdict,
                words,
                ..
            }) => Self {
                verdict: *verdict,
                text: format!("{function} returned {name} ({shown}): {words}"),
            },
            None => Self {
                verdict: Verdict::Broken,
                text: format!(
                    "{function} returned {shown}, a code that tickbus does not know; see the vendor's manual"
                ),
            },
        }
    }

    /// The error of a line that this code ends.
    pub fn error(self) -> BusError {
        match self.verdict {
            Verdict::Refused => BusError::Refused(self.text),
            _ => BusError::Link(self.text),
        }
    }
}

/// The result of an exchange with a card.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Moved {
    /// Data were moved in these directions, if the bus communicates.
    Data {
        /// To the card.
        out: bool,
        /// From the card.
        back: bool,
        /// The error code, if any, for which the next cycle tries again.
        again: Option<&'static Meaning>,
    },
    /// The bus does not communicate: the reason, and the remedy.
    NoPeer(&'static str),
}

/// An open card; dropping it closes it.
pub trait Card {
    /// Writes `output` to the card at `now`, and reads `input` from it.
    ///
    /// # Errors
    ///
    /// The card must be reopened.
    fn exchange(&mut self, now: Nanos, output: &[u8], input: &mut [u8]) -> Result<Moved, BusError>;

    /// The state of the card, if it has changed.
    fn news(&mut self) -> Option<String> {
        None
    }
}

/// The calls of a vendor's library.
pub trait Vendor: Send {
    /// The counters of calls that returned too late, of exchanges without a bus, and of exchanges to be tried again.
    const COUNTERS: [&'static str; 3];

    /// A loaded library.
    type Library: Send;

    /// Loads the library at `path`.
    ///
    /// # Errors
    ///
    /// The library does not exist, or a function is missing in it.
    fn load(&self, path: &Path) -> Result<Self::Library, Mistake>;

    /// Opens the card for these numbers of bytes to write and to read, and reports the card's identity to `port`.
    ///
    /// # Errors
    ///
    /// A call failed; everything that was opened is closed again.
    fn open<'l>(
        &self,
        library: &'l Self::Library,
        port: &Port,
        sizes: [usize; 2],
    ) -> Result<Box<dyn Card + 'l>, BusError>;

    /// How long opening and closing may take.
    fn limits(&self) -> [Nanos; 2];

    /// The time-out of an exchange.
    fn timeout(&self) -> Nanos;
}

/// A bus that is a card of one vendor.
pub struct CardBus<V: Vendor> {
    vendor: V,
    path: PathBuf,
    name: String,
    sizes: [usize; 2],
    cycles: Cycles,
    calls: [Arc<str>; 5],
    /// The library stays loaded between attempts: many libraries cannot be loaded twice in a process.
    library: Option<V::Library>,
}

impl<V: Vendor> CardBus<V> {
    /// The bus of the library at `path`, for `line`.
    pub fn new(vendor: V, path: PathBuf, line: &BusSetup<'_>) -> Self {
        let file = path.file_name().unwrap_or(path.as_os_str());
        let file = file.to_string_lossy().into_owned();
        let call = |what: &str| format!("{what} {file}").into();
        Self {
            cycles: Cycles {
                cycle: line.cycle.unwrap_or(CYCLE),
                timeout: vendor.timeout(),
                slow: V::COUNTERS[0],
            },
            vendor,
            calls: [
                "loading",
                "opening by",
                "exchange by",
                "closing by",
                "unloading",
            ]
            .map(call),
            path,
            name: line.name.to_owned(),
            sizes: sizes(line.role, line.table),
            library: None,
        }
    }

    fn run_watched(&mut self, port: &mut Port, stop: &Stop) -> Result<(), BusError> {
        let [load, open, exchange, close, unload] = &self.calls;
        let [open_limit, close_limit] = self.vendor.limits();
        port.tell("library", &self.path.to_string_lossy());
        let library = match &mut self.library {
            Some(library) => library,
            none => {
                let loaded = port.calling(load, LOAD, || self.vendor.load(&self.path));
                none.insert(loaded.map_err(|Mistake { what, right }| {
                    BusError::Link(format!(
                        "the library {}: {what}; {right}",
                        self.path.display()
                    ))
                })?)
            }
        };
        let vendor = &self.vendor;
        let card = port.calling(open, open_limit, || vendor.open(library, port, self.sizes))?;
        let mut line = Line {
            card,
            writes: vec![0; self.sizes[0]].into(),
            reads: vec![0; self.sizes[1]].into(),
            call: exchange,
            limit: self.cycles.timeout + CALL,
            counters: V::COUNTERS,
        };
        let ended = self.cycles.serve(&mut line, port, stop);
        port.calling(close, close_limit, || drop(line));
        if stop.is_stopped() {
            // The library is unloaded here, while calls are watched, because unloading also runs code of the library.
            let library = self.library.take();
            port.calling(unload, close_limit, || drop(library));
        }
        ended
    }
}

impl<V: Vendor> Free for CardBus<V> {
    fn run(&mut self, port: &mut Port, stop: &Stop) -> Result<(), BusError> {
        let name = self.name.clone();
        port.watching_calls(&name, |port| self.run_watched(port, stop))
    }

    fn last_cycles(&self) -> u32 {
        // In its own cycle, the card sends the data of one exchange. The card is closed after the next exchange.
        2
    }

    fn close_timeout(&self) -> Nanos {
        // The call in progress takes its time first; then the card is closed, and the library unloaded.
        let [open, close] = self.vendor.limits();
        (LOAD + open).max(self.cycles.timeout + CALL) + close.times(2) + CALL
    }
}

/// An open card, and the bytes of both directions.
struct Line<'a> {
    card: Box<dyn Card + 'a>,
    writes: Box<[u8]>,
    reads: Box<[u8]>,
    call: &'a Arc<str>,
    limit: Nanos,
    counters: [&'static str; 3],
}

impl Exchange for Line<'_> {
    fn input(&mut self) -> &mut [u8] {
        &mut self.writes
    }

    fn exchange(&mut self, port: &Port, _stop: &Stop) -> Result<Exchanged, BusError> {
        let now = port.clock().now();
        let call = || self.card.exchange(now, &self.writes, &mut self.reads);
        let [_, no_peer, again_counter] = self.counters;
        let moved = port.calling(self.call, self.limit, call);
        if let Some(state) = self.card.news() {
            port.tell("card.state", &state);
        }
        match moved? {
            Moved::Data { out, back, again } => {
                if let Some(again) = again {
                    port.count(again_counter);
                    let level = log::Level::Debug;
                    let Meaning { name, words, .. } = again;
                    port.log(level, "again", format_args!("{name}: {words}"));
                }
                Ok(Exchanged::Data {
                    is_taken: out,
                    is_fresh: back,
                    // A card that takes data but delivers none proves nothing about the PLC.
                    is_alive: back || out && self.reads.is_empty(),
                })
            }
            Moved::NoPeer(why) => {
                port.count(no_peer);
                Ok(Exchanged::NoPeer(why))
            }
        }
    }

    fn output(&self) -> &[u8] {
        &self.reads
    }
}
