//! The list of runs, from the run without a fault.

use std::path::Path;
use std::sync::Arc;

use super::Sweep;
use super::progress::Change;
use super::survey::Moment;

/// The runs of a sweep, and the run without a fault that they are compared with.
#[derive(Clone, Debug)]
pub struct Plan {
    pub(crate) sweep: Arc<Sweep>,
    pub(super) moments: Vec<Moment>,
    /// The runs: row by row, and in a row in the order of the moments.
    pub cells: Vec<Cell>,
    pub(super) changes: Vec<Change>,
    /// The ticks of the run without a fault.
    pub ticks: u64,
}

/// One run: a fault at a moment.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Cell {
    /// `Level stuck-on @ Step 3`.
    pub name: String,
    /// The place of the run in the list.
    pub index: usize,
    pub(super) row: usize,
    pub(super) moment: usize,
}

impl Plan {
    /// The name of the fault of a cell, without the moment.
    pub fn row_name(&self, cell: &Cell) -> String {
        self.sweep.rows[cell.row].name()
    }

    /// The names of the fault and of the moment of a cell.
    pub fn names(&self, cell: &Cell) -> (String, &str) {
        (self.row_name(cell), &self.moments[cell.moment].name)
    }

    /// The file with the accepted verdicts.
    pub fn accepted_file(&self) -> &Path {
        &self.sweep.accepted
    }

    /// The moments' names, in the order of the matrix' columns.
    pub fn moment_names(&self) -> impl Iterator<Item = &str> {
        self.moments.iter().map(|moment| moment.name.as_str())
    }

    /// The runs of a sweep with these moments, row by row.
    pub(crate) fn new(
        sweep: &Arc<Sweep>,
        moments: Vec<Moment>,
        changes: Vec<Change>,
        ticks: u64,
    ) -> Self {
        let mut cells = Vec::with_capacity(sweep.rows.len() * moments.len());
        for (row, fault) in sweep.rows.iter().enumerate() {
            for (column, moment) in moments.iter().enumerate() {
                cells.push(Cell {
                    name: format!("{} @ {}", fault.name(), moment.name),
                    index: cells.len(),
                    row,
                    moment: column,
                });
            }
        }
        Self {
            sweep: Arc::clone(sweep),
            moments,
            cells,
            changes,
            ticks,
        }
    }
}
