//! Compares the recording of a machine with that of its model, by event and curve, and not tick by tick.
//!
//! [`compare`] takes two runs and opens no file. For each BOOL it matches the edges in their order (`edges`). For each number
//! it finds the shift that brings the two curves closest together (`curve`). [`Compared::likeness`] is one figure for all of it;
//! `docs/compare.md` has its formula. [`Limits`] are read from a file, and [`Limits::check`] lists what exceeds them.
//! [`fit()`] looks for the parameters of a model with which the likeness is greatest.
//! Differences in time are positive where the simulated event is later.

mod compared;
mod curve;
mod edges;
mod fit;
mod limits;
mod page;
mod search;
mod side;
mod steps;

pub use compared::{Compared, Options, Outcome, SignalResult, compare};
pub use curve::NumberResult;
pub use edges::{BoolResult, Differences, Edge};
pub use fit::{Budget, Fitted, Model, Parameter, fit};
pub use limits::{Breach, Limits};
pub use page::{both, short, tables};
pub use side::Side;
pub use steps::{StepRow, Steps};
