//! A kind of bus, as a list of kinds knows it: the options that a driver.cfg gives it, and all that others ask of a bus
//! before it runs.

use std::any::Any;
use std::fmt;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use tickbus_axis::Axis;
use tickbus_base::Mistake;
use tickbus_base::time::{Clock, Nanos, Stop};
use tickbus_base::toml_text::{Collector, Table};
use tickbus_image::signal::{Signal, SignalTable};

use super::{At, Bus, Events, Role};

/// What a bus is told about its driver when it opens.
#[derive(Clone, Copy, Debug)]
pub struct BusSetup<'a> {
    /// The driver's name.
    pub name: &'a str,
    /// The driver's id, unique in its folder.
    pub id: i32,
    /// The folder of its driver.cfg, to which paths are relative.
    pub folder: &'a Path,
    /// Which end of the bus it is.
    pub role: Role,
    /// Its stations and signals.
    pub table: &'a SignalTable,
    /// Its axes, whose signals are in the table.
    pub axes: &'a [Axis],
    /// The bus cycle, if stated.
    pub cycle: Option<Nanos>,
    /// Data older than this are stale.
    pub max_age: Nanos,
    /// What is reported as events.
    pub events: Events,
    /// The driver's clock, for what a stepped bus waits for in real time.
    pub clock: &'a Arc<dyn Clock>,
    /// The program that runs at this end by itself; `None` for a simulation, which ticks.
    pub hosted: Option<Hosted<'a>>,
}

/// A PLC program that is hosted at an end of a bus by itself.
#[derive(Clone, Copy, Debug)]
pub struct Hosted<'a> {
    /// The interval of its scans.
    pub interval: Nanos,
    /// Ends it, also while its bus waits.
    pub stop: &'a Stop,
}

/// Why a bus does not open.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum OpenError {
    /// The driver.cfg must be changed.
    Config(Mistake),
    /// This system, or this build, does not have what the driver.cfg asks for.
    Unsupported(String),
}

/// A file or folder that a driver.cfg names, as written there: relative to its folder.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum NamedFile {
    /// One that may go where the driver.cfg goes.
    Plain(PathBuf),
    /// Keys or passwords, which stay where they are.
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
    /// These options as those of one kind, for code that is about this kind; `None` if they are of another.
    pub fn downcast_ref<K: BusOptions>(&self) -> Option<&K> {
        (self as &dyn Any).downcast_ref()
    }

    /// As `downcast_ref`, to change them.
    pub fn downcast_mut<K: BusOptions>(&mut self) -> Option<&mut K> {
        (self as &mut dyn Any).downcast_mut()
    }
}

/// The options of one bus: what is asked of it while a driver.cfg is read, checked, exported and opened.
///
/// Methods with a body are for buses that differ there. Code that is not about one bus calls these methods, and does not ask
/// which bus it has.
pub trait BusOptions: AnyOptions {
    /// What the line is and does, for `tickbus check`: parts of a sentence, to be joined with commas.
    fn summary(&self, role: Role, table: &SignalTable) -> Vec<String>;

    /// The files that the options name, which a driver.cfg needs wherever it goes; of a vendor's driver, which the system finds
    /// by its name, nothing.
    fn files(&self) -> Vec<NamedFile>;

    /// Makes the bus. It connects to nothing yet.
    ///
    /// # Errors
    ///
    /// The driver.cfg asks for something that does not exist, or is not in this build.
    fn open(&self, setup: &BusSetup<'_>) -> Result<Bus, OpenError>;

    /// The default bus cycle; `None` for a bus whose peer sets the cycle.
    fn cycle(&self) -> Option<Nanos> {
        None
    }

    /// The addition to [`summary`](Self::summary) if each [write](Events::Writes) of the peer is an event.
    fn summary_of_writes(&self) -> Option<&'static str> {
        None
    }

    /// Whether both ends of the bus are in one process.
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

    /// Replaces the address from the driver.cfg by one from a command line; `None` if the bus has no address.
    /// An error says what is wrong with the text.
    fn set_address(&mut self, address: &str) -> Option<Result<(), Mistake>> {
        let _ = address;
        None
    }

    /// Reads the keys that the bus has in the next of `count` `[[station]]` tables.
    fn read_station(&mut self, count: usize, table: &mut Table<'_>) {
        let _ = (count, table);
    }

    /// Whether signals can have addresses of the device's own, in `[fieldbus.at]`.
    fn has_addresses(&self) -> bool {
        false
    }

    /// Whether stations report to their master what is wrong with them, which an injected fault can be.
    fn has_diagnosis(&self) -> bool {
        false
    }

    /// Takes the lines of `[fieldbus.at]`, and reports invalid addresses; for buses that [have
    /// them](Self::has_addresses).
    fn place_signals(&mut self, lines: &[At<'_>], table: &SignalTable) {
        let _ = (lines, table);
    }

    /// Reports what does not fit the driver's stations, signals and axes.
    fn fit(&self, table: &SignalTable, axes: &[Axis], collector: &Collector<'_>) {
        let _ = (table, axes, collector);
    }

    /// Reads the files that the options name, relative to `folder`, and reports what is wrong in them and what they lack;
    /// for a driver.cfg that has no other mistakes.
    fn check_files(&self, folder: &Path, table: &SignalTable, collector: &Collector<'_>) {
        let _ = (folder, table, collector);
    }

    /// What those files say of the bus, for `tickbus check`: lines, each with its head.
    fn details(&self, folder: &Path, table: &SignalTable) -> Vec<(String, String)> {
        let _ = (folder, table);
        Vec::new()
    }

    /// The place of a signal of `table` in the bus's own notation; empty where it is its address.
    fn place(&self, signal: &Signal, table: &SignalTable) -> String {
        let _ = (signal, table);
        String::new()
    }

    /// What a polling bus requests in each cycle, one line per request; empty for others.
    fn requests(&self, table: &SignalTable) -> Vec<String> {
        let _ = table;
        Vec::new()
    }

    /// The signals that are written where another one is read, each with that one, by their positions in the table.
    fn both_ways(&self, table: &SignalTable) -> Vec<(usize, usize)> {
        let _ = table;
        Vec::new()
    }
}

/// A kind of bus that a driver.cfg can name.
pub trait BusKind: BusOptions + Sized {
    /// Its name, as in `kind = "modbus-server"`.
    const NAME: &'static str;

    /// Whether it learns of each write of its peer, so that a driver.cfg may ask for [these](Events::Writes).
    const LEARNS_OF_WRITES: bool = false;

    /// Reads its keys in `[fieldbus]`, for the end with `role`, and reports their mistakes. `moved` says that
    /// [another address](BusOptions::set_address) will follow.
    ///
    /// Keys that no reader has taken are reported afterwards.
    fn read(role: Role, moved: bool, table: &mut Table<'_>) -> Option<Self>;
}
