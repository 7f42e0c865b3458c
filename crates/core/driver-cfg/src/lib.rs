//! A complete driver.cfg: the signals, stations and timing of one driver, and the settings of its bus.
//!
//! [`Config`] is the checked content of a file. The caller passes in the [bus kinds](Kinds) that the file can name.

mod again;
mod config;
mod contradictions;
mod driver_table;
pub mod keys;
mod kind_keys;
mod kinds;
mod layout;
pub mod loopback;
mod observer;
mod options;
mod origin;
mod overlay;
mod page;
mod real_time;
mod restart;
mod setup;
mod timing;

/// The kinds that this crate's tests use.
#[cfg(test)]
static KINDS: Kinds = Kinds::LOOPBACK.with_programs(tickbus_programs::PROGRAMS);

pub use config::Config;
pub use kinds::{Kind, Kinds};
pub use options::Options;
pub use origin::{CommandLineEnd, Origin};
pub use page::PageOptions;
pub use timing::Timing;
