//! The slots as a buffer for NumPy and `memoryview`.

#![allow(
    unsafe_code,
    reason = "the buffer protocol of Python is a struct to be filled"
)]

use std::ffi::{CStr, c_int, c_void};
use std::ptr::null_mut;
use std::sync::Arc;

use pyo3::exceptions::PyBufferError;
use pyo3::ffi;
use pyo3::prelude::*;

use crate::memory::Memory;

/// The size of an item in bytes.
const ITEM: isize = size_of::<u64>().cast_signed();

/// All slots of a driver as a writable buffer of doubles or of signed integers. The buffer keeps the memory, even after
/// the driver is closed.
#[pyclass(frozen, module = "tickbus._native")]
pub(crate) struct Slots {
    memory: Arc<Memory>,
    /// The format in the notation of the module `struct`.
    format: &'static CStr,
    /// Shape and strides; exported buffers point to them.
    shape: [isize; 1],
    strides: [isize; 1],
}

impl Slots {
    /// Creates the buffer of doubles.
    pub(crate) fn reals(memory: &Arc<Memory>) -> Self {
        Self::new(memory, c"d")
    }

    /// Creates the buffer of signed integers.
    pub(crate) fn integers(memory: &Arc<Memory>) -> Self {
        Self::new(memory, c"q")
    }

    fn new(memory: &Arc<Memory>, format: &'static CStr) -> Self {
        Self {
            shape: [memory.words().len().cast_signed()],
            strides: [ITEM],
            memory: Arc::clone(memory),
            format,
        }
    }
}

#[pymethods]
impl Slots {
    /// # Safety
    ///
    /// Only Python calls this, with a `view` to fill.
    unsafe fn __getbuffer__(
        slf: Bound<'_, Self>,
        view: *mut ffi::Py_buffer,
        flags: c_int,
    ) -> PyResult<()> {
        if view.is_null() {
            return Err(PyBufferError::new_err("there is no buffer to be filled"));
        }
        let this = slf.get();
        let words = this.memory.words();
        let asked = |what| flags & what == what;
        let or_null = |is_asked, pointer: *const isize| {
            if is_asked {
                pointer.cast_mut()
            } else {
                null_mut()
            }
        };
        // SAFETY: Python passes `view` to be filled. The words are atomic, so writing through a pointer to them is
        // allowed. The words, the format, the shape and the strides live as long as `slf`: `obj` is a reference to it,
        // which Python releases with the buffer. An object does not move, and a frozen one does not change.
        unsafe {
            (*view).buf = words.as_ptr().cast_mut().cast::<c_void>();
            (*view).len = ITEM * words.len().cast_signed();
            (*view).itemsize = ITEM;
            (*view).readonly = 0;
            (*view).ndim = 1;
            (*view).format = if asked(ffi::PyBUF_FORMAT) {
                this.format.as_ptr().cast_mut()
            } else {
                null_mut()
            };
            (*view).shape = or_null(asked(ffi::PyBUF_ND), this.shape.as_ptr());
            (*view).strides = or_null(asked(ffi::PyBUF_STRIDES), this.strides.as_ptr());
            (*view).suboffsets = null_mut();
            (*view).internal = null_mut();
            (*view).obj = slf.into_any().into_ptr();
        }
        Ok(())
    }
}
