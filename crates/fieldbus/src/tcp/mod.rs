//! TCP for all buses that use it: addresses, connecting and listening, a connection with one peer, and a server
//! for many clients.

mod address;
mod browser;
mod connect;
mod dial;
mod dialler;
mod listen;
mod resolve;
mod server;
mod stream;
mod writers;

use super::BusError;

pub use address::{Address, Host};
pub use browser::{IS_BROWSER, begins_like_browser, may_become_browser};
pub use connect::{connect, reach, reach_in};
pub use dial::{Call, Caller, Stream, dial};
pub use dialler::Dialler;
pub use listen::{bind, is_of_the_client, listen, not_accepted};
pub use server::serve;
pub use server::{Limits, Service};
pub use stream::{close_by_reset, close_gracefully, is_for_later, prepare, watch_peer};
pub use writers::{Writer, Writers, report_second};

/// The error when the system cannot wait on this thread, or for this socket.
pub fn no_wait(error: &std::io::Error) -> BusError {
    BusError::Link(format!(
        "the system cannot wait for the socket ({error}); close other programs or raise the limit of \
         open files"
    ))
}
