//! Tests of PLC programs from files, in simulation time.
//!
//! A test file names a driver.cfg and a PLC program, describes as much of the machine as necessary, and contains tests:
//! steps that set signals, let time pass, and expect something. [`Suite::load`] reads a file, [`Suite::run`] runs one
//! of its tests, and [`junit_xml`] writes the results for a CI server. Wall time has no influence: the program and the
//! machine take turns on one thread, and the same test always gives the same run. A [`Sweep`] repeats a scenario with
//! each fault of a list at each moment of a list, and judges what the program makes of it; a [`Session`] does so where
//! machine and scenario are code in another language.

mod block;
mod edges;
mod failure;
mod fit_file;
mod junit;
mod machine;
mod model;
mod model_faults;
mod observer;
mod plant;
mod playback;
mod run;
mod sections;
mod session;
mod suite;
mod sweep;
mod sweeping;
mod table;
mod test;
mod unswallowed;
mod watch;

pub use block::{Branch, Coverage, build_program};
pub use failure::Failure;
pub use fit_file::{FitFile, Twin};
pub use junit::{Case, Group, Verdict, junit_xml};
pub use model::{Commands, Model};
pub use run::Ran;
pub use session::{Session, SessionRun};
pub use suite::{Suite, Wanted};
pub use sweep::{
    Accepted, Cell, CellMark, Judgement, Plan, Sweep, Tally, matrix, swept, swept_run, verdict_hash,
};
pub use sweeping::{Judged, Refused};
pub use test::{Test, TextPosition};
pub use tickbus_reply::{Condition, Demand};
