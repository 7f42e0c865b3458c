//! Signals: named, typed, scaled values in the process image, and the codec plan made from them.

mod address;
mod notes;
mod order;
mod plan;
mod raw;
mod scale;
pub mod section;
mod slot;
mod table;
mod types;

pub use address::{AREA_LIMIT, Address, Addressing, Area, Width};
pub use notes::{NOTE_LIMIT, Notes};
pub use order::ByteOrder;
pub use plan::{Conversions, Plan, fail_safe_frame};
pub use raw::RawValues;
pub use scale::Scale;
pub use slot::Slot;
pub use table::{Latch, Signal, SignalTable, Station, Structure};
pub use types::{DataType, UnknownType};
