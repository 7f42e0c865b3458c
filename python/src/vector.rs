//! The native half of the class `tickbus.DriverVector`.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use pyo3::buffer::{Element, PyBuffer};
use pyo3::conversion::FromPyObjectOwned;
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyMemoryView;

use tickbus_base::time::Nanos;
use tickbus_binding::Refusal;
use tickbus_driver::Code;

use crate::driver::{Driver, time};
use crate::memory::Words;
use crate::opened::{Half, Handle, tick_each};
use crate::view::Slots;

/// Many drivers that tick in one call; the package's class is derived from it.
#[pyclass(frozen, subclass, module = "tickbus._native")]
pub(crate) struct DriverVector {
    handles: Vec<Handle>,
    codes: Words,
    statuses: Py<Slots>,
    /// Doubles, and integers; `None` if the drivers were opened one by one.
    slots: Option<[Py<Slots>; 2]>,
}

/// The times of a tick.
enum Times {
    /// The same for all drivers.
    Same(Option<Nanos>),
    /// A time for each driver.
    Each(Vec<Nanos>),
}

impl Times {
    fn at(&self, driver: usize) -> Option<Nanos> {
        match self {
            Self::Same(time) => *time,
            Self::Each(times) => Some(times[driver]),
        }
    }
}

impl DriverVector {
    /// Returns the times that were given in seconds or in nanoseconds: a number for all drivers, or one for each.
    fn times(
        &self,
        seconds: Option<&Bound<'_, PyAny>>,
        nanos: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Times> {
        let each: Vec<Nanos> = match (seconds, nanos) {
            (None, None) => return Ok(Times::Same(None)),
            (Some(_), Some(_)) => {
                return Err(PyTypeError::new_err(
                    "the simulation time is given either in seconds or as ns=, not both",
                ));
            }
            (Some(seconds), None) => {
                // NumPy's numbers have no length, but its arrays of one number can pass for a number.
                if seconds.len().is_err() {
                    return time(Some(seconds.extract()?), None).map(Times::Same);
                }
                let each = list::<f64>(seconds)?.into_iter();
                let each = each.map(|seconds| time(Some(seconds), None));
                each.filter_map(Result::transpose)
                    .collect::<PyResult<_>>()?
            }
            (None, Some(nanos)) => {
                if nanos.len().is_err() {
                    return Ok(Times::Same(Some(Nanos(nanos.extract()?))));
                }
                list(nanos)?.into_iter().map(Nanos).collect()
            }
        };
        self.one_for_each(each.len(), "times")?;
        Ok(Times::Each(each))
    }

    /// Checks the number of items in a list.
    fn one_for_each(&self, found: usize, what: &str) -> PyResult<()> {
        let count = self.handles.len();
        if found == count {
            return Ok(());
        }
        Err(PyValueError::new_err(format!(
            "there are {found} {what}; expected one for each of the {count} drivers"
        )))
    }

    fn tick(&self, py: Python<'_>, half: Half, times: &Times) -> usize {
        // Many ticks take longer than releasing the interpreter's lock.
        py.detach(|| {
            let mut failed = 0;
            let done = |at, code| failed += usize::from(self.note(at, code));
            tick_each(&self.handles, half, |at| times.at(at), done);
            failed
        })
    }

    /// Stores the status of a driver; returns true if it has failed.
    fn note(&self, at: usize, code: Code) -> bool {
        let word = i64::from(code.code()).cast_unsigned();
        self.codes[at].store(word, Ordering::Relaxed);
        code.code() < 0
    }

    fn view<'py>(&self, py: Python<'py>, which: usize) -> PyResult<Bound<'py, PyMemoryView>> {
        let Some(slots) = &self.slots else {
            return Err(PyTypeError::new_err(
                "these drivers were opened one by one, and their values are not in one array; open them by \
                 tickbus.open_vector, or use the slots of each driver",
            ));
        };
        PyMemoryView::from(slots[which].bind(py))
    }
}

#[pymethods]
impl DriverVector {
    #[new]
    #[expect(
        clippy::needless_pass_by_value,
        reason = "what is made of Python's objects belongs to the function"
    )]
    fn new(py: Python<'_>, drivers: Vec<Py<Driver>>) -> PyResult<Self> {
        let handles: Vec<Handle> = drivers
            .iter()
            .map(|driver| driver.get().handle.clone())
            .collect();
        let stale = i64::from(Code::Stale.code()).cast_unsigned();
        let codes: Words = handles.iter().map(|_| AtomicU64::new(stale)).collect();
        let statuses = Py::new(py, Slots::numbers(&codes))?;
        let slots = match block_of(&handles) {
            Some(block) => {
                let [reals, integers] = Slots::rows(block, handles.len());
                Some([Py::new(py, reals)?, Py::new(py, integers)?])
            }
            None => None,
        };
        Ok(Self {
            handles,
            codes,
            statuses,
            slots,
        })
    }

    /// One tick of each driver, as ``Driver.exchange()``.
    ///
    /// ``time`` is the simulation's time in seconds, or ``ns`` in nanoseconds: a number for all drivers, or a sequence
    /// with one for each. A driver that fails stops no other one. Returns how many have failed; ``statuses`` has the
    /// status of each.
    #[pyo3(signature = (time = None, *, ns = None))]
    fn exchange(
        &self,
        py: Python<'_>,
        time: Option<&Bound<'_, PyAny>>,
        ns: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<usize> {
        Ok(self.tick(py, Half::Exchange, &self.times(time, ns)?))
    }

    /// Begins a tick of each driver, as ``Driver.receive()``; time and result are as in ``exchange()``.
    #[pyo3(signature = (time = None, *, ns = None))]
    fn receive(
        &self,
        py: Python<'_>,
        time: Option<&Bound<'_, PyAny>>,
        ns: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<usize> {
        Ok(self.tick(py, Half::Receive, &self.times(time, ns)?))
    }

    /// Ends the tick of each driver, as ``Driver.send()``. Returns how many have failed.
    fn send(&self, py: Python<'_>) -> usize {
        self.tick(py, Half::Send, &Times::Same(None))
    }

    /// Begins the next episode of the drivers for which ``mask`` is true, or of all, as ``Driver.reset()``. Returns how
    /// many have refused; ``statuses`` has the status of each, and keeps those of the drivers that are not reset.
    #[pyo3(signature = (mask = None))]
    #[expect(
        clippy::needless_pass_by_value,
        reason = "what is made of Python's objects belongs to the function"
    )]
    fn reset(&self, py: Python<'_>, mask: Option<Vec<bool>>) -> PyResult<usize> {
        if let Some(mask) = &mask {
            self.one_for_each(mask.len(), "places in the mask")?;
        }
        Ok(py.detach(|| {
            let handles = self.handles.iter().enumerate();
            let chosen = handles.filter(|(at, _)| mask.as_ref().is_none_or(|mask| mask[*at]));
            let failed = chosen.filter(|(at, handle)| {
                let done = Refusal::instead_of_panic(|| handle.reset());
                // Until its first tick, a driver shows its initial values.
                self.note(
                    *at,
                    done.map_or_else(|refusal| refusal.code, |()| Code::Stale),
                )
            });
            failed.count()
        }))
    }

    /// The status of each driver in the last call, as a buffer of 64-bit integers: a ``Status`` each.
    #[getter]
    fn statuses<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyMemoryView>> {
        PyMemoryView::from(self.statuses.bind(py))
    }

    /// The values of all drivers as a writable buffer of doubles with a row for each driver: ``Driver.slots`` of each.
    #[getter]
    fn slots<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyMemoryView>> {
        self.view(py, 0)
    }

    /// The same memory as ``slots``, as signed integers.
    #[getter]
    fn integer_slots<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyMemoryView>> {
        self.view(py, 1)
    }
}

/// Returns the numbers in a buffer, such as NumPy's, or in any other sequence.
fn list<'py, T: Element + FromPyObjectOwned<'py>>(numbers: &Bound<'py, PyAny>) -> PyResult<Vec<T>> {
    match PyBuffer::get(numbers) {
        Ok(buffer) => buffer.to_vec(numbers.py()),
        Err(_) => numbers.extract(),
    }
}

/// Returns the block whose rows are the memories of these drivers, in this order.
fn block_of(handles: &[Handle]) -> Option<&Words> {
    let first = &handles.first()?.memory;
    let length = first.range.len();
    let fits = |(row, handle): (usize, &Handle)| {
        let memory = &handle.memory;
        Arc::ptr_eq(&memory.block, &first.block)
            && memory.range == (row * length..(row + 1) * length)
    };
    let all = handles.iter().enumerate().all(fits);
    (all && first.block.len() == handles.len() * length).then_some(&first.block)
}
