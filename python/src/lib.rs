//! The extension module `tickbus._native` of the Python package `tickbus`.
//!
//! This module contains the parts that a tick needs and that only the driver knows; the rest of the package is written
//! in Python. An open driver is a number in a table of [`Handles`](tickbus_binding::Handles), as in the other bindings.
//! Its values pass through `memory::Memory`, of which the driver has a copy: whatever Python does to that memory, on
//! any thread, can produce wrong values and nothing worse.

mod block;
mod driver;
mod failure;
mod memory;
mod opened;
mod signal;
mod sweep;
mod vector;
mod view;

use pyo3::prelude::*;

/// The native half of tickbus; use the package `tickbus`.
#[pymodule]
mod _native {
    use std::ffi::OsString;
    use std::path::PathBuf;

    use pyo3::prelude::*;

    use tickbus_binding::Refusal;
    use tickbus_driver::Code;
    use tickbus_report::page_beside;

    use crate::failure::raised;

    #[pymodule_export]
    use crate::block::Block;
    #[pymodule_export]
    use crate::driver::Driver;
    #[pymodule_export]
    use crate::signal::{Event, Signal};
    #[pymodule_export]
    use crate::sweep::Sweep;
    #[pymodule_export]
    use crate::vector::DriverVector;
    #[pymodule_export]
    use crate::view::Slots;

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        module.add("__version__", env!("CARGO_PKG_VERSION"))?;
        let table = Code::ALL.map(|code| (code.code(), code.name(), code.text(), code.remedy()));
        module.add("STATUS_TABLE", table)?;
        module.add("MAX_DRIVERS", tickbus_binding::MAX_DRIVERS)
    }

    /// Must be called in a child process right after a fork: the parent's drivers do not belong to the child.
    #[pyfunction]
    fn forked() {
        crate::opened::forked();
    }

    /// Runs the tickbus command in this process, and returns its exit code. The first argument is the name of the program.
    #[pyfunction]
    fn command(py: Python<'_>, arguments: Vec<OsString>) -> u8 {
        py.detach(|| tickbus::cli::command(&tickbus_kinds::KINDS, arguments))
    }

    /// Makes an HTML page from a recording, and returns its path.
    #[pyfunction]
    #[expect(
        clippy::needless_pass_by_value,
        reason = "what is made of Python's objects belongs to the function"
    )]
    fn report(
        py: Python<'_>,
        recording: PathBuf,
        title: String,
        statistics: String,
        texts: Vec<(String, String)>,
    ) -> PyResult<PathBuf> {
        let made = py.detach(|| {
            Refusal::instead_of_panic(|| {
                page_beside(&recording, &title, Some(&statistics), &texts)
                    .map_err(|error| Refusal::new(Code::BadArgument, error))
            })
        });
        made.map_err(|refusal| raised(py, &refusal))
    }
}
