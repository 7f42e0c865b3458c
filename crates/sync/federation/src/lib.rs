//! A federation of another engine as one client of a run on virtual time: each step of the client is a time request there.
//!
//! The engine's library is loaded at run time; a file maps variables of the run to publications of the federation.

mod helics;
mod mapping;
mod value;
mod watch;

pub use helics::{Helics, HelicsOptions};
pub use mapping::{Mapping, Publish, Subscribe};
