//! driver.cfg as a whole: one driver's signals, stations and timing, and what its bus needs to know.
//!
//! [`Config`] is what a file says, checked; [`Options`] lists the bus kinds.

mod config;
mod driver_table;
mod kinds;
mod layout;
pub mod loopback;
mod overlay;
mod page;
mod timing;

pub use config::{CommandLineEnd, Config};
pub use kinds::{Exported, Options};
pub use page::PageOptions;
pub use timing::Timing;
