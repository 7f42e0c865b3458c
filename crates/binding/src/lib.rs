//! What the bindings to other languages share: everything that Java, C and Python do with an open
//! driver, without any of them.
//!
//! [`Handles`] is the table of open drivers: checked numbers instead of pointers. A [`Device`] is one of them, with the
//! [`Shared`] buffer of slots through which its values go.

mod description;
mod device;
mod fault;
mod handles;
mod opening;
mod panics;
mod refusal;
mod shared;

pub use description::{SignalDescription, SlotKind};
pub use device::{Device, EVENT_WORDS, EVENTS};
pub use fault::{faults, inject, read_fault};
pub use handles::{Handles, MAX_DRIVERS, Reservation};
pub use opening::{closing, load, open};
pub use panics::panic_message;
pub use refusal::Refusal;
pub use shared::{NO_TIME, SPARE_SLOT, Shared, Word};
