//! An engine whose library is loaded, ready to take part in a run.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use tickbus_base::Mistake;
use tickbus_base::time::{Clock, Nanos, Stop};

use crate::mapping::{Engine, Mapping};

/// How an engine takes part.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Options {
    /// The engine's library; `None`: the one that its environment variable names, or an installed one.
    pub library: Option<PathBuf>,
    /// How long the broker or registry and the server may take to appear, and the federation to come to a time.
    pub timeout: Nanos,
}

/// The library of an engine.
pub trait EngineLibrary: Sized {
    /// Loads the library that is named, or the first one that is found.
    ///
    /// # Errors
    ///
    /// The library is missing, or is another version's.
    fn find(named: Option<&Path>) -> Result<Self, Mistake>;

    /// The version of the library.
    fn version(&self) -> String;
}

/// A federation of an engine as a client of a run.
#[derive(Debug)]
pub struct Opened<E: Engine, L> {
    pub(crate) mapping: Mapping<E>,
    pub(crate) options: Options,
    pub(crate) library: L,
    pub(crate) clock: Arc<dyn Clock>,
    pub(crate) stop: Stop,
}

impl<E: Engine, L: EngineLibrary> Opened<E, L> {
    /// Loads the library. When `stop` is stopped, this member leaves federation and run.
    ///
    /// # Errors
    ///
    /// The library is missing, or is another version's.
    pub fn open(
        mapping: Mapping<E>,
        options: Options,
        clock: Arc<dyn Clock>,
        stop: &Stop,
    ) -> Result<Self, Mistake> {
        Ok(Self {
            library: L::find(options.library.as_deref())?,
            mapping,
            options,
            clock,
            stop: stop.clone(),
        })
    }

    /// The version of the library.
    pub fn version(&self) -> String {
        self.library.version()
    }
}
