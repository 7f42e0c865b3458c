//! driver.cfg as a whole: one driver's signals, stations and timing, and what its bus needs to know.
//!
//! [`Config`] is a file's content, checked. The bus kinds that it may name are [handed in](Kinds).

mod config;
mod driver_table;
mod kinds;
mod layout;
pub mod loopback;
mod options;
mod overlay;
mod page;
mod timing;

/// Those of this crate's tests.
#[cfg(test)]
static KINDS: Kinds = Kinds::LOOPBACK.with_programs(tickbus_programs::PROGRAMS);

pub use config::{CommandLineEnd, Config};
pub use kinds::{Kind, Kinds};
pub use options::Options;
pub use page::PageOptions;
pub use timing::Timing;
