//! The dispatcher of a virtual laboratory.
//!
//! Virtual controllers and virtual processes are clients of one server. Each client announces its inputs and outputs in
//! a line of text, requests connections, and sends its values; the dispatcher forwards them along the patch.
//! docs/dispatcher.md describes the protocol, for users and for authors of clients.
//!
//! [`Dispatcher`] does no I/O; [`tcp`] puts it on a port. [`client::Client`] is the other end, without I/O as well.

mod board;
mod cable;
mod channel;
pub mod client;
mod device;
mod dispatcher;
mod door;
mod federation;
pub mod grammar;
mod host;
mod key;
mod label;
mod name;
mod number;
mod outbox;
mod patch;
mod patch_file;
mod post;
mod refusal;
mod saver;
pub mod tcp;
mod trickle;
mod volts;

/// The default TCP port of a dispatcher.
pub const PORT: u16 = 20_070;

pub use board::{ChannelState, ClientState, Connection, OnLoss, Snapshot, Traffic};
pub use cable::Cable;
pub use channel::{Channel, Counts, Kind, MOST_CHANNELS};
pub use device::{Device, Role};
pub use dispatcher::{Dispatcher, Order, Reply, Settings};
pub use door::Door;
pub use federation::Identity;
pub use grammar::{LEAST_PROMISE, LONGEST_PROMISE};
pub use host::HostId;
pub use key::{Key, KeyRefused};
pub use label::{LONGEST_LABEL, Label};
pub use name::{LONGEST_NAME, is_name};
pub use number::{LONGEST_NUMBER, Number};
pub use patch::{Patch, Pin};
pub use patch_file::{PatchFile, replace_file};
pub use post::Post;
pub use refusal::{Code, Refusal};
pub use volts::{ON_VOLTS, level};
