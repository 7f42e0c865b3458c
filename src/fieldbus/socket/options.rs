//! What a driver.cfg says to the socket bus.

use crate::config::{Table, Value};
use crate::fieldbus::Role;
use crate::fieldbus::tcp::{Address, AddressError};
use crate::time::Nanos;

use super::Sending;

/// The port where both ends meet, unless a driver.cfg says otherwise.
const PORT: u16 = 20_030;

/// Who waits for the connection, and who makes it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum TcpRole {
    /// Waits for it.
    Listen,
    /// Makes it.
    Connect,
}

/// What a driver.cfg says to the socket bus.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Options {
    /// Where to listen, or what to connect to.
    pub address: Address,
    /// Who makes the connection.
    pub tcp: TcpRole,
    /// When a record goes out.
    pub sending: Sending,
    /// On change: the least time between two records; zero for none.
    pub min_interval: Nanos,
    /// Whether every change that the peer makes is reported as an event, beside the image.
    pub events: bool,
}

impl Options {
    /// Takes another address than the driver.cfg names.
    ///
    /// # Errors
    ///
    /// The text is no address, or none that this end can use.
    pub(in crate::fieldbus) fn set_address(&mut self, address: &str) -> Result<(), String> {
        let address: Address = address
            .parse()
            .map_err(|why: AddressError| why.to_string())?;
        check_port(&address, self.tcp).map_err(|why| why.to_string())?;
        self.address = address;
        Ok(())
    }

    /// Reads `address`, `role_tcp`, `send`, `min_interval` and `events`. `moved` says that
    /// [`set_address`](Self::set_address) follows.
    pub(in crate::fieldbus) fn read(role: Role, moved: bool, mut table: Table<'_>) -> Option<Self> {
        let address = table.take("address");
        let tcp = table.take("role_tcp");
        let send = table.take("send");
        let min_interval = table.take("min_interval");
        let events = table.take("events");
        let whole = table.is_whole();
        table.finish();

        let read = address
            .as_ref()
            .map_or(Some(Address::local(PORT)), Address::read);
        let tcp = tcp.as_ref().map_or(Some(default_tcp(role)), |value| {
            let roles = [("listen", TcpRole::Listen), ("connect", TcpRole::Connect)];
            value.choice("TCP roles", &roles)
        });
        if let (Some(value), Some(address), Some(tcp)) = (&address, &read, tcp)
            && let Err(error) = check_port(address, tcp)
            && !moved
        {
            value.wrong(error.what, error.right);
        }
        let stated = send.as_ref().map(|value| {
            let ways = [
                ("cyclic", Sending::Cyclic),
                ("on-change", Sending::OnChange),
                ("reply", Sending::Reply),
            ];
            value.choice("ways to send", &ways)
        });
        let sending = stated.unwrap_or_else(|| Some(Sending::default()));
        let least = min_interval
            .as_ref()
            .map_or(Some(Nanos::ZERO), Value::duration);
        if let (Some(value), Some(Sending::Cyclic | Sending::Reply)) = (&min_interval, sending)
            && whole
        {
            value.wrong(
                "\"min_interval\" stands without send = \"on-change\"",
                "add that, or remove it; the other ways to send have their own interval",
            );
        }
        let events = events.map_or(Some(false), |value| value.boolean());
        Some(Self {
            address: read?,
            tcp: tcp?,
            sending: sending?,
            min_interval: least?,
            events: events?,
        })
    }
}

/// Checks that an address can be used in this TCP role.
fn check_port(address: &Address, tcp: TcpRole) -> Result<(), AddressError> {
    match tcp {
        TcpRole::Listen => Ok(()),
        TcpRole::Connect => address.check_dialled(),
    }
}

/// A machine waits for its PLC, as a PLC's periphery does.
const fn default_tcp(role: Role) -> TcpRole {
    match role {
        Role::Device => TcpRole::Listen,
        Role::Controller => TcpRole::Connect,
    }
}
