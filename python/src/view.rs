//! The slots as a buffer for NumPy and `memoryview`.

#![allow(
    unsafe_code,
    reason = "the buffer protocol of Python is a struct to be filled"
)]

use std::ffi::{CStr, c_int, c_void};
use std::ops::Range;
use std::ptr::null_mut;
use std::sync::Arc;

use pyo3::exceptions::PyBufferError;
use pyo3::ffi;
use pyo3::prelude::*;

use crate::memory::{Memory, Words};

/// The size of an item in bytes.
const ITEM: isize = size_of::<u64>().cast_signed();

/// All slots of a driver, or those of a vector of drivers with a row for each, as a writable buffer of doubles or of
/// signed integers. The buffer keeps the memory, even after the drivers are closed.
#[pyclass(frozen, module = "tickbus._native")]
pub(crate) struct Slots {
    block: Words,
    range: Range<usize>,
    /// The format in the notation of the module `struct`.
    format: &'static CStr,
    /// Shape and strides of rows and slots; exported buffers point to them, those of one driver to the slots alone.
    shape: [isize; 2],
    strides: [isize; 2],
    has_rows: bool,
}

impl Slots {
    /// Creates the buffer of doubles.
    pub(crate) fn reals(memory: &Memory) -> Self {
        Self::row(memory, c"d")
    }

    /// Creates the buffer of signed integers.
    pub(crate) fn integers(memory: &Memory) -> Self {
        Self::row(memory, c"q")
    }

    fn row(memory: &Memory, format: &'static CStr) -> Self {
        Self::new(&memory.block, memory.range.clone(), 1, format)
    }

    /// Creates the buffer of signed integers that are no driver's slots.
    pub(crate) fn numbers(words: &Words) -> Self {
        Self::new(words, 0..words.len(), 1, c"q")
    }

    /// Creates the buffers of this many rows: of doubles, and of signed integers.
    pub(crate) fn rows(block: &Words, rows: usize) -> [Self; 2] {
        [c"d", c"q"].map(|format| Self {
            has_rows: true,
            ..Self::new(block, 0..block.len(), rows, format)
        })
    }

    fn new(block: &Words, range: Range<usize>, rows: usize, format: &'static CStr) -> Self {
        let slots = (range.len() / rows).cast_signed();
        Self {
            block: Arc::clone(block),
            range,
            format,
            shape: [rows.cast_signed(), slots],
            strides: [ITEM * slots, ITEM],
            has_rows: false,
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
        let words = &this.block[this.range.clone()];
        let asked = |what| flags & what == what;
        let dimensions = if this.has_rows { 2 } else { 1 };
        if this.has_rows && asked(ffi::PyBUF_F_CONTIGUOUS) {
            return Err(PyBufferError::new_err(
                "the slots of many drivers are a row for each driver, and cannot be read column by column",
            ));
        }
        let first = usize::from(!this.has_rows);
        let (shape, strides) = (&this.shape[first..], &this.strides[first..]);
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
            // A reader that does not ask for the shape gets the words one after the other.
            (*view).ndim = if asked(ffi::PyBUF_ND) { dimensions } else { 1 };
            (*view).format = if asked(ffi::PyBUF_FORMAT) {
                this.format.as_ptr().cast_mut()
            } else {
                null_mut()
            };
            (*view).shape = or_null(asked(ffi::PyBUF_ND), shape.as_ptr());
            (*view).strides = or_null(asked(ffi::PyBUF_STRIDES), strides.as_ptr());
            (*view).suboffsets = null_mut();
            (*view).internal = null_mut();
            (*view).obj = slf.into_any().into_ptr();
        }
        Ok(())
    }
}
