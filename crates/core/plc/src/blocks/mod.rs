//! The function blocks of IEC 61131-3 that the programs here use, and blocks for the axes of the axis link.
//!
//! A block only changes when it is called, and uses only the time passed to the call. Times are
//! [`Nanos`](tickbus_base::time::Nanos) where the standard has `TIME`.

mod action;
mod axis;
mod bistable;
mod counter;
mod edge;
mod rtc;
mod simulation_time;
mod timer;

pub use action::{ActionControl, Qualifiers};
pub use axis::{AxisCommand, AxisControl, AxisInputs, Execute};
pub use bistable::{Rs, Sr};
pub use counter::Ctu;
pub use edge::{FTrig, RTrig};
pub use rtc::Rtc;
pub use simulation_time::{Simulation, SimulationTime};
pub use timer::{Tof, Ton, Tp};
