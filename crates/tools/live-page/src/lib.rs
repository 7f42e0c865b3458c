//! The live page: a web page, for the web room, with the current state of this process's drivers.
//!
//! Drivers and PLC programs join a [`LivePage`], each as a [`Watch`](tickbus_driver::Watch). While somebody looks, the
//! page's thread requests copies of the ticks, and compares them with the known state: a viewer gets only the changes
//! since the last look. Another thread answers requests about the past, from the history that the driver's recorder
//! feeds. Signals are forced by faults of the kind "stuck". The server of a run on virtual time joins by
//! its [`Controls`](tickbus_virtual_time::Controls), and is only shown; so is a [`Recorded`] file. docs/live-page.md
//! describes the page, for users and for programs.

mod archive;
mod assets;
mod codec;
mod events;
mod exhibit;
mod forcing;
mod keeper;
mod line;
mod lists;
mod metrics;
mod model;
mod on_disk;
mod options;
mod order;
mod page;
mod past;
pub mod picture;
mod recorded;
mod run;
mod sheet;
mod shown;
mod trends;
mod value;

pub use on_disk::{OnDisk, Unwritten};
pub use options::Options;
pub use order::{Order, order};
pub use page::{LivePage, Member};
pub use recorded::Recorded;
pub use value::parse as parse_value;
