//! The programs "charger" and "lathe": the two PLCs of a line that peels blocks of wood into veneer.
//!
//! Both programs find the axes and signals of `plc/peeler/charger.cfg` and `lathe.cfg` by name: any other layout with
//! the same names works as well. The two are connected by four wires, through the machine.
//!
//! Both start over from the state that the sensors show when the link returns, an axis has recovered from a fault, a
//! step has timed out, or the simulation was restarted.

mod charger;
mod io;
mod lathe;
mod options;
mod report;
mod sequence;

pub(super) use charger::Charger;
pub(super) use lathe::Lathe;
