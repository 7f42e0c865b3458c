//! Memory for the values of many drivers.

use std::sync::atomic::AtomicU64;
use std::sync::{Arc, OnceLock};

use pyo3::prelude::*;

use tickbus_binding::Refusal;
use tickbus_driver::Code;
use tickbus_image::signal::Slot;

use crate::memory::{Memory, Words};

/// The memory of the drivers of a vector, with a row for each. The driver that is opened first says how long a row is.
#[pyclass(frozen, module = "tickbus._native")]
pub(crate) struct Block {
    count: usize,
    words: OnceLock<Words>,
}

#[pymethods]
impl Block {
    #[new]
    fn new(rows: usize) -> Self {
        Self {
            count: rows,
            words: OnceLock::new(),
        }
    }
}

impl Block {
    /// Returns the memory of a row with these values.
    pub(crate) fn row(&self, row: usize, slots: &[Slot]) -> Result<Memory, Refusal> {
        let length = slots.len();
        let words = || {
            let rows = (0..self.count * length).map(|at| AtomicU64::new(slots[at % length].0));
            rows.collect()
        };
        let block = self.words.get_or_init(words);
        if row >= self.count || block.len() != self.count * length {
            let text = format!(
                "driver {row} of a vector of {} has {length} values; expected {} as the others; open it alone",
                self.count,
                block.len() / self.count.max(1)
            );
            return Err(Refusal::new(Code::BadArgument, text));
        }
        Ok(Memory::within(
            Arc::clone(block),
            row * length..(row + 1) * length,
        ))
    }
}
