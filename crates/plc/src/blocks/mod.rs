//! The function blocks of IEC 61131-3 that programs here are made of, and those for the axes of the axis link.
//!
//! A block changes only when it is called, and knows no time but the one that the call hands in.
//! Times are [`Nanos`](tickbus_base::time::Nanos) where the standard says `TIME`.

mod action;
mod axis;
mod bistable;
mod edge;
mod rtc;
mod simulation_time;
mod timer;

pub use action::{ActionControl, Qualifiers};
pub use axis::{AxisCommand, AxisControl, AxisInputs, Execute};
pub use bistable::{Rs, Sr};
pub use edge::{FTrig, RTrig};
pub use rtc::Rtc;
pub use simulation_time::{Simulation, SimulationTime};
pub use timer::{Tof, Ton, Tp};
