//! TCP for all buses that use it: connecting and listening with a port, a connection with one peer, and a server for many
//! clients. The parts that know no port are in [`tickbus_net`].

mod connect;
mod dial;
mod listen;
mod server;
mod writers;

use super::BusError;

pub use connect::connect;
pub use dial::{Call, Caller, dial};
pub use listen::{listen, not_accepted};
pub use server::serve;
pub use server::{Limits, Service};
pub use writers::{Writer, Writers, report_second};

/// The error when the system cannot wait on this thread, or for this socket.
pub fn no_wait(error: &std::io::Error) -> BusError {
    BusError::Link(format!(
        "the system cannot wait for the socket ({error}); close other programs or raise the limit of \
         open files"
    ))
}
