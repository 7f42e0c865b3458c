//! The meeting place of the server and the clients of a run.

use std::fmt;
use std::sync::Arc;

use tickbus_base::time::{Clock, Stop};
use tickbus_base::toml_text::Value;
use tickbus_net::Address;

use crate::client::{Client, Connection};
use crate::{Ended, tcp};

/// The meeting place of the server and the clients of a run.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Meeting {
    /// The server listens at this address.
    Tcp(Address),
    /// Shared memory of this name, for processes of this computer.
    SharedMemory(String),
}

impl Meeting {
    /// Reads a name for shared memory: letters, digits, hyphens and underscores, which are valid in file names on every
    /// system.
    pub fn read_name(value: &Value<'_>) -> Option<String> {
        let right = "write a name of letters, digits, hyphens and underscores, such as \"cell\"";
        let name = value.label(40, right)?;
        let is_plain = |c: char| c.is_ascii_alphanumeric() || "-_".contains(c);
        if !name.chars().all(is_plain) {
            let what = format!("\"{name}\" is no name for shared memory");
            value.wrong(what, right);
            return None;
        }
        Some(name.to_owned())
    }

    /// Joins the server there; over TCP, `clock` provides the times. When `stop` is stopped, the client leaves the run.
    ///
    /// # Errors
    ///
    /// There is no server, or it has no free seat; or this system has no shared memory for clients.
    pub fn connect(
        &self,
        client: Client,
        clock: &Arc<dyn Clock>,
        stop: &Stop,
    ) -> Result<Connection, Ended> {
        match self {
            Self::Tcp(address) => tcp::connect(address, client, clock, stop),
            #[cfg(unix)]
            Self::SharedMemory(name) => crate::shared_memory::connect(name, client, stop),
            #[cfg(not(unix))]
            Self::SharedMemory(_) => {
                let reason = "this system has no shared memory for clients; use TCP";
                Err(Ended::before(crate::Cause::System, reason))
            }
        }
    }
}

/// Formats the place for people.
impl fmt::Display for Meeting {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Tcp(address) => address.fmt(f),
            Self::SharedMemory(name) => write!(f, "the shared memory \"{name}\""),
        }
    }
}
