//! Converts a refusal to an exception of the package.

use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::PyType;

use tickbus_binding::Refusal;
use tickbus_driver::Code;

/// The module that defines the exceptions.
const ERRORS: &str = "tickbus._errors";

/// Creates `FieldbusError(code, message)`.
pub(crate) fn raised(py: Python<'_>, refusal: &Refusal) -> PyErr {
    static CLASS: PyOnceLock<Py<PyType>> = PyOnceLock::new();
    let arguments = (refusal.code.code(), refusal.to_string());
    make(py, &CLASS, "FieldbusError", arguments)
}

/// Creates `UnknownSignalError(code, message)`.
pub(crate) fn unknown_signal(py: Python<'_>, what: String) -> PyErr {
    static CLASS: PyOnceLock<Py<PyType>> = PyOnceLock::new();
    let arguments = (Code::BadArgument.code(), what);
    make(py, &CLASS, "UnknownSignalError", arguments)
}

fn make(
    py: Python<'_>,
    class: &PyOnceLock<Py<PyType>>,
    name: &str,
    arguments: (i32, String),
) -> PyErr {
    let class = class.import(py, ERRORS, name);
    match class.and_then(|class| class.call1(arguments)) {
        Ok(error) => PyErr::from_value(error),
        Err(error) => error,
    }
}
