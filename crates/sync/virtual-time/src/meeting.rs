//! The meeting place of the server and the clients of a run.

use std::fmt;
use std::str::FromStr;
use std::sync::Arc;

use tickbus_base::Mistake;
use tickbus_base::time::{Clock, Stop};
use tickbus_base::toml_text::Value;
use tickbus_net::{Address, LocalAddress};

use crate::client::{Client, Connection};
use crate::{Ended, tcp};

/// The meeting place of the server and the clients of a run.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Meeting {
    /// The server listens at this address.
    Tcp(Address),
    /// The server listens at this Unix socket, for processes of this computer.
    Unix(LocalAddress),
    /// Shared memory of this name, for processes of this computer.
    SharedMemory(String),
}

impl Meeting {
    /// Reads the value of a key with an address, `HOST:PORT` or `unix:PATH`, and reports mistakes in it.
    pub fn read(value: &Value<'_>) -> Option<Self> {
        let right = "write a host and a port in quotes, such as \"127.0.0.1:20060\", or a Unix socket, such as \
                     \"unix:cell\"";
        let parsed = value.text(right)?.parse();
        parsed.map_err(|mistake| value.refuse(mistake)).ok()
    }

    /// Checks that the place is one to connect to.
    ///
    /// # Errors
    ///
    /// Nothing can listen on port 0.
    pub fn check_dialled(&self) -> Result<(), Mistake> {
        match self {
            Self::Tcp(address) => address.check_dialled(),
            Self::Unix(_) | Self::SharedMemory(_) => Ok(()),
        }
    }

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

    /// Joins the server there; over TCP and Unix sockets, `clock` provides the times. When `stop` is stopped, the client leaves the run.
    ///
    /// # Errors
    ///
    /// There is no server, or it has no free seat; or this system has no shared memory or no Unix sockets.
    pub fn connect(
        &self,
        client: Client,
        clock: &Arc<dyn Clock>,
        stop: &Stop,
    ) -> Result<Connection, Ended> {
        match self {
            Self::Tcp(address) => tcp::connect(address, client, clock, stop),
            Self::Unix(address) => tcp::connect_local(address, client, clock, stop),
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

/// Reads `HOST:PORT`, or `unix:PATH`.
impl FromStr for Meeting {
    type Err = Mistake;

    fn from_str(text: &str) -> Result<Self, Mistake> {
        if text.starts_with(LocalAddress::PREFIX) {
            return text.parse().map(Self::Unix);
        }
        text.parse().map(Self::Tcp)
    }
}

/// Formats the place for people.
impl fmt::Display for Meeting {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Tcp(address) => address.fmt(f),
            Self::Unix(address) => address.fmt(f),
            Self::SharedMemory(name) => write!(f, "the shared memory \"{name}\""),
        }
    }
}
