//! Tests of PLC programs from files, in simulation time.
//!
//! A test file names a driver.cfg and a PLC program, describes as much of the machine as necessary, and contains tests:
//! steps that set signals, let time pass, and expect something. [`Suite::load`] reads a file, [`Suite::run`] runs one
//! of its tests, and [`junit_xml`] writes the results for a CI server. Wall time has no influence: the program and the
//! machine take turns on one thread, and the same test always gives the same run.

mod condition;
mod junit;
mod machine;
mod plant;
mod playback;
mod run;
mod sections;
mod suite;
mod test;
mod watch;

pub use condition::{Condition, Demand};
pub use junit::{Case, Group, Verdict, junit_xml};
pub use run::{Failure, Ran};
pub use suite::Suite;
pub use test::{Test, TextPosition};
