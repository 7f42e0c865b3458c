//! A signal of an open driver, and the events of signals.

use std::sync::Arc;

use pyo3::IntoPyObjectExt as _;
use pyo3::exceptions::{PyAttributeError, PyOverflowError, PyTypeError, PyValueError};
use pyo3::prelude::*;

use tickbus_binding::{Refusal, SignalDescription, SlotKind};
use tickbus_driver::Code;
use tickbus_driver_cfg::Config;
use tickbus_image::signal::{DataType, Slot};

use crate::failure::raised;
use crate::memory::Memory;

/// From this value on, every double is a whole number.
const ALL_WHOLE: f64 = 4_503_599_627_370_496.0;

/// Says how a slot is shown in Python.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Kind {
    /// A double that stands for a bool.
    Bool,
    /// A double that stands for a whole number: an integer of up to 32 bits without scale.
    Whole,
    /// A double.
    Real,
    /// A signed integer.
    Signed,
    /// An unsigned integer.
    Unsigned,
}

impl Kind {
    fn show(self, py: Python<'_>, slot: Slot) -> PyResult<Bound<'_, PyAny>> {
        match self {
            Self::Bool => (slot.real() != 0.0).into_bound_py_any(py),
            Self::Whole if slot.real().fract() == 0.0 && slot.real().abs() < ALL_WHOLE => {
                #[expect(clippy::cast_possible_truncation, reason = "it is whole and fits")]
                let whole = slot.real() as i64;
                whole.into_bound_py_any(py)
            }
            // A value that was set need not be a whole number: it is rounded when it is sent.
            Self::Whole | Self::Real => slot.real().into_bound_py_any(py),
            Self::Signed => slot.signed().into_bound_py_any(py),
            Self::Unsigned => slot.unsigned().into_bound_py_any(py),
        }
    }
}

/// The description of a signal.
pub(crate) struct Description {
    pub(crate) name: String,
    address: String,
    data_type: &'static str,
    unit: String,
    station: String,
    slot: usize,
    edges: Option<usize>,
    pub(crate) is_written: bool,
    kind: Kind,
}

impl Description {
    pub(crate) fn of(signal: &SignalDescription<'_>, config: &Config) -> Self {
        let entry = &config.table.signals[signal.slot];
        let kind = match (signal.kind, entry.data_type) {
            (SlotKind::Signed, _) => Kind::Signed,
            (SlotKind::Unsigned, _) => Kind::Unsigned,
            (SlotKind::Real, DataType::Bool) => Kind::Bool,
            (SlotKind::Real, DataType::Real | DataType::Lreal) => Kind::Real,
            (SlotKind::Real, _) if entry.scale.is_some() => Kind::Real,
            (SlotKind::Real, _) => Kind::Whole,
        };
        Self {
            name: signal.name.to_owned(),
            address: signal.address.clone(),
            data_type: signal.data_type,
            unit: signal.unit.to_owned(),
            station: signal.station.to_owned(),
            slot: signal.slot,
            edges: signal.edges,
            is_written: signal.is_written,
            kind,
        }
    }
}

/// One signal of an open driver.
///
/// Get it once by its name, ``plc["Valve"]``, and keep it. ``value`` is the value received with the last ``receive()``
/// or ``exchange()``, or the value to be sent with the next ``send()`` or ``exchange()``.
#[pyclass(frozen, module = "tickbus")]
pub(crate) struct Signal {
    description: Description,
    memory: Arc<Memory>,
}

impl Signal {
    pub(crate) fn new(description: Description, memory: &Arc<Memory>) -> Self {
        let memory = Arc::clone(memory);
        Self {
            description,
            memory,
        }
    }

    pub(crate) fn show<'py>(&self, py: Python<'py>, slot: Slot) -> PyResult<Bound<'py, PyAny>> {
        self.description.kind.show(py, slot)
    }

    fn must_be_open(&self, py: Python<'_>) -> PyResult<()> {
        if self.memory.is_closed() {
            return Err(raised(py, &Refusal::plain(Code::Closed)));
        }
        Ok(())
    }

    /// Returns the number in any object that has one.
    fn number(&self, value: &Bound<'_, PyAny>) -> PyResult<f64> {
        // A text, which can only be parsed as a number, is refused.
        let number: f64 = value.extract().map_err(|error: PyErr| {
            if error.is_instance_of::<PyOverflowError>(value.py()) {
                let name = &self.description.name;
                return PyValueError::new_err(format!(
                    "signal '{name}' cannot be set to an integer beyond the range of a float"
                ));
            }
            if !error.is_instance_of::<PyTypeError>(value.py()) {
                return error;
            }
            let found = value.get_type();
            let found = found.name().map_or_else(|_| "?".into(), |name| name.to_string());
            let name = &self.description.name;
            PyTypeError::new_err(format!(
                "signal '{name}' cannot be set to a value of type {found}; a number or a bool is needed"
            ))
        })?;
        if !number.is_finite() {
            let name = &self.description.name;
            return Err(PyValueError::new_err(format!(
                "signal '{name}' cannot be set to {number}; a finite number is needed"
            )));
        }
        Ok(number)
    }
}

#[pymethods]
impl Signal {
    /// The value in the signal's unit.
    ///
    /// A bool for a BOOL, an int for an integer without scale, otherwise a float. A value that is set is sent with the
    /// next ``send()`` or ``exchange()``, rounded half away from zero; out of range, the nearest value that fits is
    /// sent.
    #[getter]
    fn value<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.must_be_open(py)?;
        self.show(py, self.memory.get(self.description.slot))
    }

    #[setter]
    fn set_value(&self, value: &Bound<'_, PyAny>) -> PyResult<()> {
        self.must_be_open(value.py())?;
        let Description {
            name,
            address,
            slot,
            is_written,
            kind,
            ..
        } = &self.description;
        if !is_written {
            return Err(PyAttributeError::new_err(format!(
                "signal '{name}' at {address} is written by the other end; only signals that this end writes can be set"
            )));
        }
        let exact = match kind {
            Kind::Signed => value.extract().ok().map(Slot::from_signed),
            Kind::Unsigned => value.extract().ok().map(Slot::from_unsigned),
            _ => None,
        };
        let bits = match (exact, kind) {
            (Some(exact), _) => exact,
            // The casts saturate at the limits of their types.
            #[expect(clippy::cast_possible_truncation, reason = "see above")]
            (None, Kind::Signed) => Slot::from_signed(self.number(value)?.round() as i64),
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "see above"
            )]
            (None, Kind::Unsigned) => Slot::from_unsigned(self.number(value)?.round() as u64),
            (None, Kind::Bool) => Slot::from_real(f64::from(u8::from(self.number(value)? != 0.0))),
            (None, Kind::Whole | Kind::Real) => Slot::from_real(self.number(value)?),
        };
        self.memory.set(*slot, bits);
        Ok(())
    }

    /// The number of edges, of the kind that ``latch`` in driver.cfg names, received with the last ``receive()`` or
    /// ``exchange()``.
    #[getter]
    fn edges<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.must_be_open(py)?;
        let name = &self.description.name;
        match self.description.edges {
            Some(edges) => Kind::Whole.show(py, self.memory.get(edges)),
            None if self.description.is_written => Err(PyAttributeError::new_err(format!(
                "signal '{name}' is written by this end; edges are counted of signals that the other end writes"
            ))),
            None => Err(PyAttributeError::new_err(format!(
                "signal '{name}' counts no edges; add `latch = \"rising\"` to it in driver.cfg"
            ))),
        }
    }

    /// The name, unique in its driver.
    #[getter]
    pub(crate) fn name(&self) -> &str {
        &self.description.name
    }

    /// The address in the process image, in IEC form, such as ``%QX1.0``.
    #[getter]
    fn address(&self) -> &str {
        &self.description.address
    }

    /// The IEC data type, such as ``INT``.
    #[getter]
    fn r#type(&self) -> &str {
        self.description.data_type
    }

    /// The unit; empty for none.
    #[getter]
    fn unit(&self) -> &str {
        &self.description.unit
    }

    /// The station; empty if driver.cfg names no stations.
    #[getter]
    fn station(&self) -> &str {
        &self.description.station
    }

    /// The index of the value in ``Driver.slots``.
    #[getter]
    fn slot(&self) -> usize {
        self.description.slot
    }

    /// The index of the edge count in ``Driver.slots``; None if edges are not counted.
    #[getter]
    fn edges_slot(&self) -> Option<usize> {
        self.description.edges
    }

    /// True if this end writes the signal: a ``%I``, if this end is the machine.
    #[getter]
    fn is_written(&self) -> bool {
        self.description.is_written
    }

    /// True if ``slot`` must be read as an integer, from ``Driver.integer_slots``: a LINT, ULINT or LWORD without
    /// scale.
    #[getter]
    fn is_integer_slot(&self) -> bool {
        matches!(self.description.kind, Kind::Signed | Kind::Unsigned)
    }

    fn __bool__(&self) -> PyResult<bool> {
        let name = &self.description.name;
        Err(PyTypeError::new_err(format!(
            "the signal '{name}' itself is neither true nor false; ask for its .value"
        )))
    }

    fn __repr__(&self) -> String {
        let Description {
            name,
            address,
            data_type,
            ..
        } = &self.description;
        format!("<Signal '{name}' {address} {data_type}>")
    }
}

/// A change of a signal by the PLC; buses with ``events = true`` report every change.
#[pyclass(frozen, module = "tickbus")]
pub(crate) struct Event {
    /// The signal.
    #[pyo3(get)]
    signal: Py<Signal>,
    /// The value written, as ``Signal.value`` shows it.
    #[pyo3(get)]
    value: Py<PyAny>,
    /// The time of the change, in nanoseconds on the driver's clock.
    #[pyo3(get)]
    time_ns: i64,
}

impl Event {
    pub(crate) fn new(
        py: Python<'_>,
        signal: &Py<Signal>,
        event: &tickbus_image::Event,
    ) -> PyResult<Self> {
        Ok(Self {
            value: signal.get().show(py, event.value)?.unbind(),
            signal: signal.clone_ref(py),
            time_ns: event.time.0,
        })
    }
}

#[pymethods]
impl Event {
    fn __repr__(&self, py: Python<'_>) -> PyResult<String> {
        let value = self.value.bind(py).repr()?;
        let name = &self.signal.get().description.name;
        Ok(format!("<Event '{name}' = {value} at {} ns>", self.time_ns))
    }
}
