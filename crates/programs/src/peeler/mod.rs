//! The programs "charger" and "lathe": the two PLCs of a line that peels blocks of wood into veneer.
//!
//! They work on the axes and signals of `plc/peeler/charger.cfg` and `lathe.cfg`, which they find by their names: any
//! other layout of the same names does as well. Between the two go four wires, through the machine.
//!
//! Both begin anew, from what the sensors show, whenever the link comes back, an axis has failed and is well again, a
//! step has taken too long, or the simulation was started again.

mod io;
mod options;
mod report;

pub mod charger;
pub mod lathe;

pub use charger::Charger;
pub use lathe::Lathe;
