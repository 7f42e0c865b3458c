//! TCP for all buses that use it: addresses, connecting and listening, and a server for many clients.

mod address;
mod connect;
mod listen;
mod resolve;
mod server;
mod stream;

use super::BusError;

pub use address::{Address, AddressError, Host};
pub(crate) use connect::connect;
pub(crate) use listen::{is_of_the_client, listen, not_accepted};
pub(crate) use server::serve;
pub use server::{Limits, Service};
pub(crate) use stream::{bow_out, is_for_later, prepare};

/// The system cannot wait on this thread, or for this socket.
pub(crate) fn no_wait(error: &std::io::Error) -> BusError {
    BusError::Link(format!(
        "the system cannot wait for the socket ({error}); close other programs or raise the limit of \
         open files"
    ))
}
