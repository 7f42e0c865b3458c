//! FMI, the Functional Mock-up Interface, versions 2.0 and 3.0, co-simulation, both ways.
//!
//! [`made`]: a driver.cfg as an FMU. [`made::export`] writes it, and [`made::Instance`] is what runs inside of it, without the
//! functions in C around it, which the native library has.
//!
//! [`foreign`]: an FMU of somebody else as the machine, or as the PLC. [`foreign::Unpacked`] is one that was found right,
//! [`foreign::Join`] says which of its variables are which signals, and [`foreign::Machine`] runs it, in this process or in a
//! helper's.

pub mod foreign;
pub mod made;
mod real_time;
mod value;

pub use real_time::RealTime;
pub use value::{Number, Status, Value, ValueType, Version};
