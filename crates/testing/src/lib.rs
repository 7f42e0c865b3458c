//! Tests of PLC programs from files, on simulation time.
//!
//! A test file names a driver.cfg and a PLC program, describes as much of the machine as is needed, and has
//! tests: steps that set signals, let time pass, and expect something. [`Suite::load`] reads one,
//! [`Suite::run`] runs one of its tests, and [`junit_xml`] writes what came of them for a CI server. No wall
//! time is involved: the program and the machine take turns on one thread, and the same test gives the
//! same run.

mod condition;
mod junit;
mod machine;
mod playback;
mod run;
mod sections;
mod suite;
mod watch;

pub use condition::{Condition, Demand};
pub use junit::{Case, Group, Verdict, junit_xml};
pub use run::{Failure, Ran};
pub use suite::{Place, Suite, Test};
