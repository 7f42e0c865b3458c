//! A sweep of faults whose machine and scenario are in Python.

use std::collections::HashMap;
use std::path::PathBuf;
use std::sync::{Mutex, PoisonError};

use pyo3::prelude::*;

use tickbus_base::time::Nanos;
use tickbus_binding::Refusal;
use tickbus_driver::Code;
use tickbus_testing::Session;

use crate::driver::Driver;
use crate::failure::raised;

/// How all verdicts are accepted under pytest.
const ACCEPT: &str = "pytest --tickbus-accept";

/// The runs of a sweep, for the plug-in of pytest.
#[pyclass(frozen, module = "tickbus._native")]
pub(crate) struct Sweep {
    session: Mutex<Session>,
}

impl Sweep {
    /// Calls `work` without the interpreter's lock.
    fn with<R: Send>(
        &self,
        py: Python<'_>,
        work: impl FnOnce(&mut Session) -> Result<R, Refusal> + Send,
    ) -> PyResult<R> {
        let work = || {
            let mut session = self.session.lock().unwrap_or_else(PoisonError::into_inner);
            Refusal::instead_of_panic(|| work(&mut session))
        };
        py.detach(work).map_err(|refusal| raised(py, &refusal))
    }
}

fn refused(why: impl std::fmt::Display) -> Refusal {
    Refusal::new(Code::BadArgument, why)
}

#[pymethods]
impl Sweep {
    /// Reads the keys of a sweep but for ``scenario``.
    #[new]
    #[expect(
        clippy::needless_pass_by_value,
        reason = "what is made of Python's objects belongs to the function"
    )]
    fn new(
        py: Python<'_>,
        driver: &Bound<'_, Driver>,
        name: String,
        folder: PathBuf,
        keys: String,
        step_ns: i64,
    ) -> PyResult<Self> {
        let read = || {
            let keys = (name.as_str(), keys.as_str());
            let handle = &driver.get().handle;
            let read = handle
                .with_driver(|driver| Session::read(keys, ACCEPT, &folder, driver, Nanos(step_ns)));
            read?.map_err(|mistakes| refused(format!("the sweep cannot be read:\n{mistakes}")))
        };
        let session = Refusal::instead_of_panic(read).map_err(|refusal| raised(py, &refusal))?;
        Ok(Self {
            session: Mutex::new(session),
        })
    }

    /// Begins a run on a driver that has just been opened; without a cell, that without a fault.
    #[pyo3(signature = (driver, cell = None))]
    fn begin(
        &self,
        py: Python<'_>,
        driver: &Bound<'_, Driver>,
        cell: Option<usize>,
    ) -> PyResult<()> {
        let handle = &driver.get().handle;
        self.with(py, |session| {
            handle.with_slots(|slots| session.begin(cell, slots).map_err(refused))?
        })
    }

    /// One exchange of the run; returns true if the run is over.
    fn exchange(&self, py: Python<'_>, driver: &Bound<'_, Driver>, ns: i64) -> PyResult<bool> {
        let handle = &driver.get().handle;
        self.with(py, |session| handle.swept(session, Nanos(ns)))
    }

    /// Ends the scenario; returns true if the run is over.
    fn idle(&self, py: Python<'_>, driver: &Bound<'_, Driver>) -> PyResult<bool> {
        let handle = &driver.get().handle;
        self.with(py, |session| handle.with_slots(|slots| session.idle(slots)))
    }

    /// The names of the runs with a fault, after the run without one.
    fn plan(&self, py: Python<'_>, rewriting: bool) -> PyResult<Vec<String>> {
        self.with(py, |session| {
            let plan = session.plan(rewriting).map_err(refused)?;
            Ok(plan.cells.iter().map(|cell| cell.name.clone()).collect())
        })
    }

    /// The verdict of a run: ``True`` if it passes, and a sentence; ``None`` if the run is not over.
    fn result(&self, py: Python<'_>, cell: usize) -> PyResult<Option<(bool, String)>> {
        self.with(py, |session| {
            Ok(session.result(cell).map(|run| (run.passes, run.what)))
        })
    }

    /// The matrix of the runs so far, with counts and hash.
    fn summary(&self, py: Python<'_>) -> PyResult<String> {
        self.with(py, |session| Ok(session.summary()))
    }

    /// Writes the verdicts of all runs as accepted, and returns the file.
    fn accept(&self, py: Python<'_>) -> PyResult<PathBuf> {
        self.with(py, |session| session.accept().map_err(refused))
    }

    /// Writes the page of the runs so far; ``again`` is the command that repeats a run, with ``{}`` in the place of its
    /// name, and ``reports`` has the reports about the recordings of runs.
    #[expect(
        clippy::needless_pass_by_value,
        reason = "what is made of Python's objects belongs to the function"
    )]
    fn page(
        &self,
        py: Python<'_>,
        file: PathBuf,
        again: String,
        reports: HashMap<usize, PathBuf>,
    ) -> PyResult<()> {
        self.with(py, |session| {
            let report = |run: usize| reports.get(&run).cloned();
            session.page(&file, &again, report).map_err(refused)
        })
    }
}
