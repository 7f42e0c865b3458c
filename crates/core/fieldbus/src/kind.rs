//! A kind of bus, as a list of kinds has it: the options from a driver.cfg, and all questions that other code asks a
//! bus before it runs.

use std::any::Any;
use std::fmt;
use std::path::{Path, PathBuf};

use tickbus_base::Mistake;
use tickbus_base::time::Nanos;
use tickbus_base::toml_text::{Collector, Key, Table};
use tickbus_image::signal::{Signal, SignalTable};

use super::examine::{Complaint, Examination, Search};
use super::faults::AnswerCodes;
use super::{At, Browsing, Bus, BusSetup, Role};

/// The reason why a bus does not open.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum OpenError {
    /// The driver.cfg must be changed.
    Config(Mistake),
    /// This system, or this build, has no support for something that the driver.cfg requires.
    Unsupported(String),
}

/// A file or folder that a driver.cfg names, as written there: relative to its folder.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum NamedFile {
    /// A file that may be copied along with the driver.cfg.
    Plain(PathBuf),
    /// Keys or passwords, which are not copied.
    Secret(PathBuf),
    /// The driver.cfg itself, which has a password under this key.
    InClear(&'static str),
}

/// The derived traits of a type of options (`Clone`, `Debug`, `PartialEq`), for code that does not know the type.
pub trait AnyOptions: Any + fmt::Debug + Send + Sync {
    /// A copy.
    fn boxed(&self) -> Box<dyn BusOptions>;

    /// Returns true if `other` has the same type and is equal.
    fn equals(&self, other: &dyn BusOptions) -> bool;
}

impl<T: BusOptions + Clone + PartialEq + fmt::Debug + Send + Sync + 'static> AnyOptions for T {
    fn boxed(&self) -> Box<dyn BusOptions> {
        Box::new(self.clone())
    }

    fn equals(&self, other: &dyn BusOptions) -> bool {
        other.downcast_ref() == Some(self)
    }
}

impl dyn BusOptions {
    /// These options as those of one kind, for code about this kind; `None` for options of another kind.
    pub fn downcast_ref<K: BusOptions>(&self) -> Option<&K> {
        (self as &dyn Any).downcast_ref()
    }

    /// As `downcast_ref`, to change them.
    pub fn downcast_mut<K: BusOptions>(&mut self) -> Option<&mut K> {
        (self as &mut dyn Any).downcast_mut()
    }
}

/// The options of one bus, with the methods for reading, checking, exporting and opening a driver.cfg.
///
/// Methods with a default body are for the buses that differ in this point. Code that is not about one bus calls these
/// methods, and does not check which bus it has.
pub trait BusOptions: AnyOptions {
    /// A description of the line for `tickbus check`: parts of a sentence, to be joined with commas.
    fn summary(&self, role: Role, table: &SignalTable) -> Vec<String>;

    /// The files that the options name, which a copy of the driver.cfg needs as well. A vendor's driver that the system
    /// finds by its name is not among them.
    fn files(&self) -> Vec<NamedFile>;

    /// Makes the bus, which does not connect yet.
    ///
    /// # Errors
    ///
    /// The driver.cfg requires something that does not exist, or is not in this build.
    fn open(&self, setup: &BusSetup<'_>) -> Result<Bus, OpenError>;

    /// The default bus cycle; `None` for a bus whose peer sets the cycle.
    fn cycle(&self) -> Option<Nanos> {
        None
    }

    /// The addition to [`summary`](Self::summary) if each [write](crate::Events::Writes) of the peer is an event.
    fn summary_of_writes(&self) -> Option<&'static str> {
        None
    }

    /// Returns true if both ends of the bus are in one process.
    fn is_in_process(&self) -> bool {
        false
    }

    /// Returns true if the bus runs in the steps of the simulation, and not in real time.
    fn is_stepped(&self) -> bool {
        false
    }

    /// Returns true if the bus starts the `tickbus` command that it finds on the PATH.
    fn needs_command(&self) -> bool {
        false
    }

    /// Replaces the address from the driver.cfg by one from a command line; `None` if the bus has no address. The error
    /// describes the mistake in the text.
    fn set_address(&mut self, address: &str) -> Option<Result<(), Mistake>> {
        let _ = address;
        None
    }

    /// Reads the keys of the bus in the next of `count` `[[station]]` tables.
    fn read_station(&mut self, count: usize, table: &mut Table<'_>) {
        let _ = (count, table);
    }

    /// Returns true if signals can have device addresses, in `[fieldbus.at]`.
    fn has_addresses(&self) -> bool {
        false
    }

    /// Returns true if stations report their problems to their master; an injected fault can be such a problem.
    fn has_diagnosis(&self) -> bool {
        false
    }

    /// Returns true if the bus answers requests of its peer; injected faults can change these answers.
    fn has_answers(&self) -> bool {
        false
    }

    /// The codes with which the bus can refuse a request, for a bus that [has answers](Self::has_answers).
    fn answer_codes(&self) -> AnswerCodes {
        AnswerCodes::BYTE
    }

    /// Takes the lines of `[fieldbus.at]`, and reports invalid addresses; for buses that [have
    /// them](Self::has_addresses).
    fn place_signals(&mut self, lines: &[At<'_>], table: &SignalTable) {
        let _ = (lines, table);
    }

    /// Reports options that do not fit the driver's stations, signals and structures.
    fn fit(&self, table: &SignalTable, collector: &Collector<'_>) {
        let _ = (table, collector);
    }

    /// Reads the files that the options name, relative to `folder`, and reports mistakes and missing parts in them; for
    /// a driver.cfg that has no other mistakes.
    fn check_files(&self, folder: &Path, table: &SignalTable, collector: &Collector<'_>) {
        let _ = (folder, table, collector);
    }

    /// The facts about the bus from those files, for `tickbus check`: lines, each with its head.
    fn details(&self, folder: &Path, table: &SignalTable) -> Vec<(String, String)> {
        let _ = (folder, table);
        Vec::new()
    }

    /// The place of a signal of `table` in the bus's own notation; empty if the signal's address is the place.
    fn place(&self, signal: &Signal, table: &SignalTable) -> String {
        let _ = (signal, table);
        String::new()
    }

    /// The requests of a polling bus in each cycle, one line per request; empty for other buses.
    fn requests(&self, table: &SignalTable) -> Vec<String> {
        let _ = table;
        Vec::new()
    }

    /// Examines the line step by step, without writing anything into a PLC.
    fn examine(&self, examination: &mut Examination<'_>) {
        examination.unexamined("a line of this kind");
    }

    /// Connects as the options say, and shows the tags of the peer to `browsing` until it has enough; for the buses that
    /// [can](BusKind::BROWSES). Writes nothing. The steps of the examination show how far it came.
    ///
    /// # Errors
    ///
    /// There is no connection, or no longer; with the remedy.
    fn browse(
        &self,
        examination: &mut Examination<'_>,
        browsing: &mut dyn Browsing,
    ) -> Result<(), String> {
        let _ = (examination, browsing);
        Err("a peer on this bus does not list its tags; import the list of its editor".to_owned())
    }

    /// True if this end connects to the peer and writes into a memory of it, which keeps the values.
    fn is_client(&self) -> bool {
        false
    }

    /// True if this end opens the connection, to whatever peer.
    fn connects(&self) -> bool {
        self.is_client()
    }

    /// The host and port where this end connects or listens; `None` for a bus without one.
    fn address(&self) -> Option<String> {
        None
    }

    /// The counters that show what the clients of a server do wrong; `None` for a bus that is no server.
    fn complaints(&self) -> Option<&'static [Complaint]> {
        None
    }

    /// The pairs of a signal that is written and one that is read at the same place, by their positions in the table.
    fn both_ways(&self, table: &SignalTable) -> Vec<(usize, usize)> {
        let _ = table;
        Vec::new()
    }
}

/// A kind of bus that a driver.cfg can name.
pub trait BusKind: BusOptions + Sized {
    /// The kind's name, as in `kind = "modbus-server"`.
    const NAME: &'static str;

    /// True if the bus learns of each write of its peer, so that a driver.cfg can request [writes as
    /// events](crate::Events::Writes).
    const LEARNS_OF_WRITES: bool = false;

    /// True if an end of this bus can be an [observer](Role::Observer): it then places a signal by its [address in the
    /// PLC](Signal::plc_address).
    const CAN_OBSERVE: bool = false;

    /// True if the bus can [browse](BusOptions::browse) the tags of its peer.
    const BROWSES: bool = false;

    /// The keys that [`read`](Self::read) takes, in groups that kinds can share: for the schema of a driver.cfg.
    const KEYS: &'static [&'static [Key]];

    /// Those of the keys of which a file has at least one; empty if it can be without all of them.
    const ONE_OF: &'static [&'static str] = &[];

    /// The keys that [`read_station`](BusOptions::read_station) takes.
    const STATION_KEYS: &'static [Key] = &[];

    /// How the servers of this bus are found, for a kind that connects to them.
    const SEARCH: Option<Search> = None;

    /// Reads the keys of this kind in `[fieldbus]`, for the end with `role`, and reports their mistakes. `moved` means
    /// that [another address](BusOptions::set_address) will follow.
    ///
    /// Keys that no reader has taken are reported afterwards.
    fn read(role: Role, moved: bool, table: &mut Table<'_>) -> Option<Self>;
}
