//! The native half of the class `tickbus.Driver`.

use std::collections::HashMap;
use std::path::PathBuf;

use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::{PyIterator, PyMemoryView, PyTuple};

use tickbus_base::time::Nanos;
use tickbus_base::toml_text::nearest;
use tickbus_binding::{Refusal, faults, read_fault};
use tickbus_driver::Code;

use crate::block::Block;
use crate::failure::{raised, unknown_signal};
use crate::opened::{Facts, Half, Handle};
use crate::signal::{Event, Signal};
use crate::view::Slots;

const NANOS_PER_SECOND: f64 = 1e9;
/// Beyond this, a double of seconds does not fit a time of 64 bits in nanoseconds.
const MOST_SECONDS: f64 = 9.2e9;

/// Members of the package's enumeration of statuses, created once: those that ticks return.
static DONE: PyOnceLock<[Py<PyAny>; 3]> = PyOnceLock::new();

/// An open driver; the package's class is derived from it.
#[pyclass(frozen, subclass, module = "tickbus._native")]
pub(crate) struct Driver {
    pub(crate) handle: Handle,
    id: i32,
    name: String,
    signals: Vec<Py<Signal>>,
    by_name: HashMap<String, usize>,
    slots: Py<Slots>,
    integer_slots: Py<Slots>,
}

impl Driver {
    fn status(py: Python<'_>, code: Code) -> PyResult<Py<PyAny>> {
        let done = DONE.get_or_try_init(py, || {
            let status = py.import("tickbus._status")?.getattr("Status")?;
            let member = |code: Code| status.call1((code.code(),)).map(Bound::unbind);
            PyResult::Ok([
                member(Code::Fresh)?,
                member(Code::Unchanged)?,
                member(Code::Stale)?,
            ])
        })?;
        let at = usize::try_from(code.code()).unwrap_or_default();
        Ok(done[at].clone_ref(py))
    }

    fn tick(&self, py: Python<'_>, half: Half, time: Option<Nanos>) -> PyResult<Py<PyAny>> {
        // Only a stepped bus waits. On other buses a tick takes less time than releasing the interpreter's lock.
        let code = if self.handle.is_stepped {
            py.detach(|| self.handle.tick(half, time))
        } else {
            self.handle.tick(half, time)
        };
        if code.code() < 0 {
            return Err(raised(py, &self.handle.reason(code)));
        }
        Self::status(py, code)
    }

    fn find(&self, py: Python<'_>, name: &str) -> PyResult<&Py<Signal>> {
        if let Some(&at) = self.by_name.get(name) {
            return Ok(&self.signals[at]);
        }
        let known = self.signals.iter().map(|signal| signal.get().name());
        let near = match nearest(name, known) {
            Some(near) => format!("; did you mean '{near}'?"),
            None => String::new(),
        };
        let what = format!("driver '{}' has no signal '{name}'{near}", self.name);
        Err(unknown_signal(py, what))
    }

    fn done<R>(py: Python<'_>, result: Result<R, Refusal>) -> PyResult<R> {
        result.map_err(|refusal| raised(py, &refusal))
    }
}

/// Returns the time of a tick, given in seconds or in nanoseconds.
pub(crate) fn time(seconds: Option<f64>, nanos: Option<i64>) -> PyResult<Option<Nanos>> {
    match (seconds, nanos) {
        (None, None) => Ok(None),
        (None, Some(nanos)) => Ok(Some(Nanos(nanos))),
        (Some(seconds), None) if seconds.abs() <= MOST_SECONDS => {
            #[expect(clippy::cast_possible_truncation, reason = "the range is checked")]
            let nanos = (seconds * NANOS_PER_SECOND).round() as i64;
            Ok(Some(Nanos(nanos)))
        }
        (Some(seconds), None) => Err(PyValueError::new_err(format!(
            "{seconds} is no simulation time; seconds since the simulation began are needed"
        ))),
        (Some(_), Some(_)) => Err(PyTypeError::new_err(
            "the simulation time is given either in seconds or as ns=, not both",
        )),
    }
}

/// Converts to seconds, for people and simulators.
#[expect(clippy::cast_precision_loss, reason = "to the nearest double")]
fn seconds(nanos: Nanos) -> f64 {
    if nanos == Nanos::MAX {
        f64::INFINITY
    } else {
        nanos.0 as f64 / NANOS_PER_SECOND
    }
}

#[pymethods]
impl Driver {
    #[new]
    #[expect(
        clippy::needless_pass_by_value,
        reason = "what is made of Python's objects belongs to the function"
    )]
    #[pyo3(signature = (path, overlay = String::new(), block = None, row = 0))]
    fn new(
        py: Python<'_>,
        path: PathBuf,
        overlay: String,
        block: Option<Py<Block>>,
        row: usize,
    ) -> PyResult<Self> {
        let place = block.as_ref().map(|block| (block.get(), row));
        let Facts {
            handle,
            id,
            name,
            signals,
        } = Self::done(py, py.detach(|| Handle::open(&path, &overlay, place)))?;
        let names = signals.iter().map(|signal| signal.name.clone());
        let by_name = names.enumerate().map(|(at, name)| (name, at)).collect();
        let memory = &handle.memory;
        let objects: PyResult<Vec<_>> = signals
            .into_iter()
            .map(|signal| Py::new(py, Signal::new(signal, memory)))
            .collect();
        let views = (
            Py::new(py, Slots::reals(memory)),
            Py::new(py, Slots::integers(memory)),
        );
        match (objects, views) {
            (Ok(signals), (Ok(slots), Ok(integer_slots))) => Ok(Self {
                handle,
                id,
                name,
                signals,
                by_name,
                slots,
                integer_slots,
            }),
            (Err(error), _) | (_, (Err(error), _) | (_, Err(error))) => {
                // There is no memory left; a driver that cannot be used must not stay open.
                let _ = handle.close();
                Err(error)
            }
        }
    }

    /// One tick: sends the signals that this end writes, then receives those that it reads.
    ///
    /// ``time`` is the simulation's time in seconds since it began, or ``ns`` in nanoseconds; stepped buses run the PLC
    /// by it, and recordings use it. Without a time the last given one is kept; if none was ever given, the computer's
    /// time since the first tick is used. Returns ``Status.FRESH``, ``UNCHANGED`` or ``STALE``; raises
    /// ``FieldbusError``.
    #[pyo3(signature = (time = None, *, ns = None))]
    fn exchange(&self, py: Python<'_>, time: Option<f64>, ns: Option<i64>) -> PyResult<Py<PyAny>> {
        self.tick(py, Half::Exchange, self::time(time, ns)?)
    }

    /// Begins a tick: receives the signals that this end reads. The model then computes, and ``send()`` ends the tick.
    ///
    /// Time and result are as in ``exchange()``.
    #[pyo3(signature = (time = None, *, ns = None))]
    fn receive(&self, py: Python<'_>, time: Option<f64>, ns: Option<i64>) -> PyResult<Py<PyAny>> {
        self.tick(py, Half::Receive, self::time(time, ns)?)
    }

    /// Ends the tick that ``receive()`` began: sends the signals that this end writes.
    fn send(&self, py: Python<'_>) -> PyResult<()> {
        self.tick(py, Half::Send, None).map(drop)
    }

    /// Begins the next episode of the simulation without opening again: values, counts of edges, faults and the counters
    /// of ticks are as after opening, and simulation time begins at 0.
    ///
    /// A PLC program or a recording in this process begins again, too: the program is at its first scan. A connection to
    /// a PLC stays, and the PLC gets the initial values with the next tick. A recording continues in the same file.
    /// Raises ``FieldbusError`` with ``Status.UNSUPPORTED`` if the time of a stepped bus belongs to others as well.
    fn reset(&self, py: Python<'_>) -> PyResult<()> {
        Self::done(py, py.detach(|| self.handle.reset()))
    }

    /// Reads the driver.cfg again, and gives the line its settings while the simulation ticks: the present bus ends as by
    /// ``close()``, and the new one opens; until its PLC sends something, data are stale. Returns False if the line has
    /// these settings already. Any thread may call this.
    ///
    /// Raises ``FieldbusError`` with ``Status.BAD_CONFIG`` if the file has mistakes, and with ``Status.UNSUPPORTED`` if
    /// more than the line differs; the line is then as before.
    fn reload(&self, py: Python<'_>) -> PyResult<bool> {
        Self::done(py, py.detach(|| self.handle.reload()))
    }

    /// Returns a signal by its name, always the same object; ``plc["Valve"]`` is the same.
    ///
    /// Raises ``UnknownSignalError``, a ``KeyError``, whose message contains the nearest name.
    fn signal(&self, py: Python<'_>, name: &str) -> PyResult<Py<Signal>> {
        Ok(self.find(py, name)?.clone_ref(py))
    }

    fn __getitem__(&self, py: Python<'_>, name: &str) -> PyResult<Py<Signal>> {
        self.signal(py, name)
    }

    /// The names of the signals, in the order of driver.cfg.
    fn __iter__<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyIterator>> {
        let names = self.signals.iter().map(|signal| signal.get().name());
        PyTuple::new(py, names.collect::<Vec<_>>())?.try_iter()
    }

    fn __len__(&self) -> usize {
        self.signals.len()
    }

    /// A driver is true, even without signals.
    #[expect(clippy::unused_self, reason = "Python asks an object")]
    fn __bool__(&self) -> bool {
        true
    }

    fn __contains__(&self, name: &Bound<'_, PyAny>) -> bool {
        name.extract::<String>()
            .is_ok_and(|name| self.by_name.contains_key(&name))
    }

    /// All signals, in the order of driver.cfg.
    #[getter]
    fn signals<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyTuple>> {
        PyTuple::new(py, &self.signals)
    }

    /// The values of all signals as a writable buffer of doubles, in the order of ``signals``, followed by the edge
    /// counts.
    ///
    /// ``numpy.asarray(plc.slots)`` copies nothing: create the array once. The next tick sends the values written to
    /// it, and overwrites the values that the other end writes.
    #[getter]
    fn slots<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyMemoryView>> {
        PyMemoryView::from(self.slots.bind(py))
    }

    /// The same memory as ``slots``, as signed integers: for 64-bit integers without scale, for which doubles are not
    /// precise enough (``Signal.is_integer_slot``).
    #[getter]
    fn integer_slots<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyMemoryView>> {
        PyMemoryView::from(self.integer_slots.bind(py))
    }

    /// The events since the last call, at most 4096 at once.
    fn events(&self, py: Python<'_>) -> PyResult<Vec<Event>> {
        let events = Self::done(py, py.detach(|| self.handle.events()))?;
        let with_signal = events.iter().filter_map(|event| {
            let signal = self.signals.get(usize::try_from(event.signal).ok()?)?;
            Some((signal, event))
        });
        with_signal
            .map(|(signal, event)| Event::new(py, signal, event))
            .collect()
    }

    /// Age in seconds of the data that the last tick read; infinite if no data have arrived yet.
    #[getter]
    fn age(&self) -> f64 {
        seconds(self.handle.memory.age())
    }

    /// The number of bus cycles that had arrived by the last tick.
    #[getter]
    fn sequence(&self) -> u64 {
        self.handle.memory.sequence()
    }

    /// The number of ticks so far.
    #[getter]
    fn ticks(&self) -> u64 {
        self.handle.memory.ticks()
    }

    /// The time in seconds up to which the simulation can run before it must exchange again, on a stepped bus; on other
    /// buses the time that was given.
    #[getter]
    fn granted(&self) -> f64 {
        seconds(self.handle.memory.granted())
    }

    /// The same time in nanoseconds.
    #[getter]
    fn granted_ns(&self) -> i64 {
        self.handle.memory.granted().0
    }

    /// True if the bus has ended on its own, for example because a run on virtual time is over: further ticks bring
    /// nothing.
    #[getter]
    fn is_over(&self, py: Python<'_>) -> PyResult<bool> {
        Self::done(py, self.handle.is_over())
    }

    /// True if the bus is stepped: the PLC runs on the simulation's time, and a tick waits for it.
    #[getter]
    fn is_stepped(&self) -> bool {
        self.handle.is_stepped
    }

    /// The id in driver.cfg.
    #[getter]
    fn id(&self) -> i32 {
        self.id
    }

    /// The name in driver.cfg.
    #[getter]
    fn name(&self) -> &str {
        &self.name
    }

    /// True if the driver can no longer be used: it is closed, or belongs to the parent of this forked process.
    #[getter]
    fn closed(&self) -> bool {
        self.handle.memory.is_closed() || self.handle.is_forked()
    }

    /// Closes the driver; a second call does nothing. Values set since the last ``send()`` or ``exchange()`` are not
    /// sent; a recording contains them if ``receive()`` had begun a tick.
    ///
    /// In a forked child of the process that opened the driver, the call does nothing either. Arrays of ``slots`` stay
    /// valid memory.
    fn close(&self, py: Python<'_>) -> PyResult<()> {
        Self::done(py, py.detach(|| self.handle.close()))
    }

    /// The address of the live page on which the driver is shown, for a browser; ``None`` if driver.cfg has no ``[page]``.
    /// It contains the page's token: everyone who has it can force signals.
    fn page(&self, py: Python<'_>) -> PyResult<Option<String>> {
        Self::done(py, py.detach(|| self.handle.page()))
    }

    fn _statistics(&self, py: Python<'_>) -> PyResult<String> {
        let snapshot = Self::done(py, py.detach(|| self.handle.snapshot()))?;
        Ok(snapshot.to_string())
    }

    fn _swallowed(&self, py: Python<'_>) -> PyResult<String> {
        Self::done(py, self.handle.swallowed())
    }

    fn _inject(&self, py: Python<'_>, fault: &str) -> PyResult<u32> {
        let read = || {
            let config = self.handle.config()?;
            let fault = read_fault(fault, &config)?;
            self.handle.inject(&fault)
        };
        Self::done(py, py.detach(|| Refusal::instead_of_panic(read)))
    }

    fn _declare_faults(&self, py: Python<'_>, names: Vec<String>) -> PyResult<()> {
        Self::done(py, py.detach(|| self.handle.declare_model_faults(names)))
    }

    fn _model_faults(&self, py: Python<'_>) -> PyResult<Vec<(usize, f64)>> {
        Self::done(py, self.handle.model_changes())
    }

    fn _end_fault(&self, py: Python<'_>, id: u32) -> PyResult<bool> {
        Self::done(py, py.detach(|| self.handle.end_fault(id)))
    }

    fn _faults(&self, py: Python<'_>) -> PyResult<String> {
        let board = Self::done(py, py.detach(|| self.handle.board()))?;
        Ok(faults(&board))
    }

    fn __repr__(&self) -> String {
        let state = if self.closed() { " closed" } else { "" };
        format!("<Driver '{}' ({}){state}>", self.name, self.id)
    }
}

/// Closes a driver that nobody refers to any more.
impl Drop for Driver {
    fn drop(&mut self) {
        // Nobody is left to receive an error.
        let _ = self.handle.close();
    }
}
