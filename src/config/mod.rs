//! Reading configuration text: spans, collected mistakes, nearest names.

mod mistakes;
mod nearest;

pub use mistakes::{Collector, Mistake, Mistakes, shown};
pub use nearest::{did_you_mean, nearest};
