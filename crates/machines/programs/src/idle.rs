//! The program "idle": it writes nothing.

use tickbus_plc::{Program, Scan};

/// Leaves its outputs as they are: for an end whose signals are made by its driver.cfg alone.
#[derive(Clone, Copy, Debug, Default)]
pub struct Idle;

impl Program for Idle {
    fn name(&self) -> &'static str {
        "idle"
    }

    fn input_bytes(&self) -> usize {
        0
    }

    fn output_bytes(&self) -> usize {
        0
    }

    fn for_another_station(&self, _: usize) -> Option<Box<dyn Program>> {
        Some(Box::new(*self))
    }

    fn can_hang(&self) -> bool {
        false
    }

    fn scan(&mut self, _: &mut Scan<'_>) {}
}
