//! FMI, the Functional Mock-up Interface, versions 2.0 and 3.0, co-simulation, in both directions.
//!
//! [`made`]: a driver.cfg as an FMU. [`made::export`] writes the FMU. [`made::Instance`] runs inside of it; the C
//! functions around it are in the native library.
//!
//! [`foreign`]: a foreign FMU as the machine or as the PLC. [`foreign::Unpacked`] is a checked FMU, [`foreign::Join`]
//! joins its variables with signals, and [`foreign::Machine`] runs it, in this process or in a helper process.

pub mod foreign;
pub mod made;
mod real_time;
mod value;

pub use real_time::RealTime;
pub use value::{Number, Status, Value, ValueType, Version};
