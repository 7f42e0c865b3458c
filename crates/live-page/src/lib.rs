//! The live page: what the drivers of this process do at this moment, as a web page for the web room.
//!
//! A [`LivePage`] is joined by drivers and PLC programs, each as a [`Watch`](tickbus_driver::Watch). Its thread asks their
//! ticks for copies while somebody looks, and compares them with what it knew: a viewer gets what has changed since it
//! looked last. Signals are forced by faults of the kind "stuck". The server of a run on virtual time joins by its
//! [`Controls`](tickbus_virtual_time::Controls), and only shows. docs/live-page.md has it, for users and for programs.

mod assets;
mod exhibit;
mod keeper;
mod line;
mod metrics;
mod model;
mod options;
mod order;
mod page;
pub mod picture;
mod run;
mod sheet;
mod shown;
mod trend;
mod value;

pub use options::Options;
pub use order::{Order, order};
pub use page::{LivePage, Member};
pub use value::parse as parse_value;
