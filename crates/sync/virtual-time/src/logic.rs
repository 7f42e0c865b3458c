//! The server's own logic, called when the run starts, when time moves on, and when data are accessed.

use std::fmt;

use tickbus_base::time::Nanos;

use crate::hash::Trace;
use crate::members::Members;
use crate::shared_data::SharedData;
use crate::{Step, TraceHash, Variable};

/// A reader of every commit. Its error ends the run.
pub type CommitHook<'l> = Box<dyn FnMut(&Commit<'_>) -> Result<(), String> + Send + 'l>;

/// A piece of logic. Its error ends the run.
pub type Hook<'l> = Box<dyn FnMut(&mut Access<'_>) -> Result<(), String> + Send + 'l>;

/// The logic of a server: hooks, and the variables that they write.
///
/// | hook | when it is called | its writes are seen |
/// |---|---|---|
/// | [`on_start`](Self::on_start) | all clients have joined | with the initial values |
/// | [`on_change`](Self::on_change) | at a commit that changes the variable, in the order of the variables | with that commit |
/// | [`on_read`](Self::on_read) | once for each client that reads the variable in a step, in the order of clients and their reads | with the step's commit |
/// | [`on_time`](Self::on_time) | time has moved on, before the clients run; in the order of registration | with the step's commit |
///
/// [`on_commit`](Self::on_commit) is called after each commit, and writes nothing.
/// Writes of the logic call no other hooks. If two hooks write the same variable before one commit, the later one wins.
#[derive(Default)]
pub struct Logic<'l> {
    pub(crate) variables: Vec<Variable>,
    pub(crate) start: Vec<Hook<'l>>,
    pub(crate) time: Vec<Hook<'l>>,
    pub(crate) change: Vec<(String, Hook<'l>)>,
    pub(crate) read: Vec<(String, Hook<'l>)>,
    pub(crate) commit: Vec<CommitHook<'l>>,
}

impl fmt::Debug for Logic<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Logic")
            .field("variables", &self.variables)
            .finish_non_exhaustive()
    }
}

impl<'l> Logic<'l> {
    /// No logic at all.
    pub fn new() -> Self {
        Self::default()
    }

    /// Adds a variable that hooks may write. No client writes it.
    #[must_use]
    pub fn variable(mut self, variable: Variable) -> Self {
        self.variables.push(variable);
        self
    }

    /// Adds a hook for the start of the run.
    #[must_use]
    pub fn on_start(
        mut self,
        hook: impl FnMut(&mut Access<'_>) -> Result<(), String> + Send + 'l,
    ) -> Self {
        self.start.push(Box::new(hook));
        self
    }

    /// Adds a hook for every step of time.
    #[must_use]
    pub fn on_time(
        mut self,
        hook: impl FnMut(&mut Access<'_>) -> Result<(), String> + Send + 'l,
    ) -> Self {
        self.time.push(Box::new(hook));
        self
    }

    /// Adds a hook for changes of the variable `name`.
    #[must_use]
    pub fn on_change(
        mut self,
        name: impl Into<String>,
        hook: impl FnMut(&mut Access<'_>) -> Result<(), String> + Send + 'l,
    ) -> Self {
        self.change.push((name.into(), Box::new(hook)));
        self
    }

    /// Adds a hook for reads of the variable `name`.
    #[must_use]
    pub fn on_read(
        mut self,
        name: impl Into<String>,
        hook: impl FnMut(&mut Access<'_>) -> Result<(), String> + Send + 'l,
    ) -> Self {
        self.read.push((name.into(), Box::new(hook)));
        self
    }

    /// True if nothing but commits is read, and nothing is written.
    pub(crate) fn is_passive(&self) -> bool {
        self.variables.is_empty()
            && self.start.is_empty()
            && self.time.is_empty()
            && self.change.is_empty()
            && self.read.is_empty()
    }

    /// Adds a reader of every commit, the initial values included.
    #[must_use]
    pub fn on_commit(
        mut self,
        hook: impl FnMut(&Commit<'_>) -> Result<(), String> + Send + 'l,
    ) -> Self {
        self.commit.push(Box::new(hook));
        self
    }
}

/// A commit, as everyone sees it from now on.
#[derive(Debug)]
pub struct Commit<'a> {
    pub(crate) step: Step,
    pub(crate) length: Nanos,
    pub(crate) members: &'a Members,
    pub(crate) values: &'a [u64],
    pub(crate) trace: &'a Trace,
}

impl Commit<'_> {
    /// The step that was committed; 0 for the initial values, whose time is one step below 0.
    pub const fn step(&self) -> Step {
        self.step
    }

    /// The virtual time of one step.
    pub const fn length(&self) -> Nanos {
        self.length
    }

    /// The raw values of all variables, in the order of [`members`](Self::members).
    pub const fn values(&self) -> &[u64] {
        self.values
    }

    /// The trace hash of the run up to this commit.
    pub fn hash(&self) -> TraceHash {
        self.trace.hash()
    }

    /// The participants and their variables, the same for every commit of a run.
    pub const fn members(&self) -> &Members {
        self.members
    }
}

/// The view of a hook, and its actions.
#[derive(Debug)]
pub struct Access<'a> {
    pub(crate) data: &'a mut SharedData,
    pub(crate) step: Step,
    pub(crate) reader: Option<&'a str>,
}

impl Access<'_> {
    /// The step; its time is the current virtual time. Before the first step its number is 0, and its time one step
    /// below 0.
    pub const fn step(&self) -> Step {
        self.step
    }

    /// The reading client, in a hook for reads.
    pub const fn reader(&self) -> Option<&str> {
        self.reader
    }

    /// The raw value of the variable `name`: during a commit the new one, otherwise the one committed last.
    ///
    /// # Errors
    ///
    /// There is no such variable.
    pub fn get(&self, name: &str) -> Result<u64, String> {
        Ok(self.data.newest(self.data.find(name)?))
    }

    /// Writes the raw value of the variable `name`.
    ///
    /// # Errors
    ///
    /// The variable does not exist or does not belong to the logic, or its type has no such value.
    pub fn set(&mut self, name: &str, value: u64) -> Result<(), String> {
        let at = self.data.find(name)?;
        self.data.write_by_logic(at, value)
    }

    /// The declaration of the variable `name`, with its type.
    ///
    /// # Errors
    ///
    /// There is no such variable.
    pub fn variable(&self, name: &str) -> Result<&Variable, String> {
        Ok(self.data.variable(self.data.find(name)?))
    }
}
