//! One HTML page about one run: chart, steps, faults, states of the line, distributions.
//!
//! [`read`] makes a [`Run`] from a recording, [`write()`] a page from that and texts; no file is opened but by
//! [`write_file`] and [`page_beside`], and no clock is read, so that the same run gives the same bytes. The page stands alone: its style, its script and all data are inside, and its
//! content security policy forbids it to load anything.
//!
//! Tables are HTML that Rust writes. The chart is a canvas that `chart.js` draws from the changes of the
//! signals, which `code` packs; the script unpacks them one signal at a time.

mod code;
mod figures;
mod file;
mod from;
mod html;
mod page;
mod run;
mod spans;
mod statistics;
mod tables;

pub use file::{page_beside, write_file};
pub use from::read;
pub use page::{Contents, write};
pub use run::{Change, DEFAULT_BUDGET, Kind, Mark, MarkKind, Run, Signal};
pub use statistics::Statistics;
