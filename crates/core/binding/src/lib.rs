//! The common part of the bindings to other languages: everything that Java, C and Python do with an open driver.
//!
//! [`Handles`] is the table of open drivers: checked numbers instead of pointers. A [`Device`] is an open driver with
//! the [`Shared`] buffer of slots that carries the values.

mod description;
mod device;
mod fault;
mod handles;
mod opening;
mod panics;
mod refusal;
mod reload;
mod shared;
mod swallowed;

pub use description::{SignalDescription, SlotKind};
pub use device::{Device, EVENT_WORDS, EVENTS};
pub use fault::{declare_model_faults, faults, inject, read_fault};
pub use handles::{Handles, MAX_DRIVERS, Reservation};
pub use opening::{closing, load, open};
pub use panics::panic_message;
pub use refusal::Refusal;
pub use reload::Reload;
pub use shared::{NO_TIME, SPARE_SLOT, Shared, Word};
pub use swallowed::swallowed;
