//! SDSP: a server hands out virtual time, and its clients run in lock-step.
//!
//! Each client declares the variables that it writes and reads, and runs once per step of its own. All clients of a step
//! see one snapshot; their writes are committed together, when the last client has written. So the result depends neither on the order of answers nor on the speed of the computer, and two runs are
//! equal to the last bit: [`TraceHash`] shows it.
//!
//! A client implements [`Participant`]; it then takes part in this process, over TCP, a Unix socket or shared memory.

mod barrier;
mod bytes;
mod declaration;
mod hosting;
mod local;
mod meeting;
mod member_list;
mod members;
mod memory;
mod mesh;
mod outcome;
mod participant;
mod parting;
mod recording;
mod run_file;
mod saved_run;
mod settings;
mod shared_data;
mod step;
mod view;

pub mod client;
pub mod hash;

pub mod in_process;
pub mod logic;
#[cfg(feature = "script")]
pub mod script;
pub mod server;
#[cfg(unix)]
pub mod shared_memory;
pub mod tcp;
pub mod wire;

pub use barrier::State;
pub use client::Connection;
pub use declaration::{Declaration, Variable, is_raw, slot_of};
pub use hash::TraceHash;
pub use hosting::{Controls, Hosting, hear};
pub use logic::{Commit, Logic};
pub use meeting::Meeting;
pub use member_list::MemberList;
pub use members::{Client, Members};
pub use mesh::{Mesh, Next};
pub use outcome::{Cause, Ended, Outcome};
pub use participant::Participant;
pub use parting::{Compared, Difference, Parting, compare};
pub use recording::RecordedRun;
pub use run_file::RunFile;
pub use saved_run::SavedRun;
pub use settings::{Exchange, Pacing, Save, Settings, StartCondition};
pub use step::Step;
pub use view::RunView;
