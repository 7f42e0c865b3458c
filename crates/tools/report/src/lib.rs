//! An HTML page about one run: chart, steps, faults, line states, distributions.
//!
//! [`read`] makes a [`Run`] from a recording, and [`write()`] a page from the run and texts. Only
//! [`write_file`] and [`page_beside`] open files, and no clock is read, so that the same run gives the same
//! bytes. The page is self-contained: style, script and data are inside, and its content security policy
//! forbids loading anything.
//!
//! [`write_sweeps`] writes another page, about the runs of a sweep.
//!
//! Tables are written as HTML by Rust. The chart is a canvas on which `chart.js` draws the changes of the
//! signals; `code` packs them, and the script unpacks them one signal at a time.

mod code;
mod figures;
mod file;
mod from;
mod html;
mod more;
mod page;
mod run;
mod spans;
mod statistics;
mod sweep;
mod tables;
mod time;

pub use file::{link, page_beside, write_file, write_sweeps_file};
pub use from::{LIVE, read};
pub use more::{Cell, MoreTable};
pub use page::{Contents, DRAW, LOOKUP, STYLE, still_head, write};
pub use run::{Change, DEFAULT_BUDGET, Mark, MarkKind, Run, Signal, SignalKind};
pub use statistics::RunStatistics;
pub use sweep::{Sweeps, Swept, SweptRow, SweptRun, write_sweeps};
