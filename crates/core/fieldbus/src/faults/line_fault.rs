//! A line fault, on its way from the tick to the bus.

use std::sync::Arc;

use super::LineEffect;
use super::cell::Cell;
use super::random::Random;

/// One line fault on the bus's side.
#[derive(Debug)]
pub struct LineFault {
    pub(super) trouble: LineEffect,
    pub(super) cell: Arc<Cell>,
    pub(super) random: Random,
}

impl LineFault {
    pub(super) fn new(trouble: LineEffect, cell: Arc<Cell>, random: Random) -> Self {
        Self {
            trouble,
            cell,
            random,
        }
    }
}
