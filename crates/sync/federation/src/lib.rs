//! A federation of another engine as one client of a run on virtual time: each step of the client is one step there.
//!
//! The engine's library is loaded at run time; a file maps variables of the run to publications of the federation.

mod find;
mod helics;
mod mapping;
mod member;
mod opened;
mod silkit;
mod text;
mod value;
mod watch;

pub use helics::{Helics, HelicsMapping, HelicsSettings};
pub use mapping::{Engine, Mapping, Publish, Subscribe};
pub use opened::{EngineLibrary, Opened, Options};
pub use silkit::{Label, SilKit, SilKitMapping, SilKitSettings, Topic};
