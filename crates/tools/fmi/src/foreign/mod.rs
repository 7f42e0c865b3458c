//! A foreign FMU, as the machine or as the PLC.

mod archive;
mod arrays;
mod description;
mod events;
mod faults;
mod helper;
mod isolated;
mod join;
mod library;
mod machine;
mod map;
mod model;
mod slave;
mod talk;
mod target;

pub use archive::Unpacked;
pub use helper::serve;
pub use join::{Join, Unjoined};
pub use machine::{Machine, MachineOptions};
pub use map::{Joined, Map};
pub use model::{Causality, ForeignVariable, Model};
pub use slave::{Failure, Stepped};
