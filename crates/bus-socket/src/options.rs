//! What a driver.cfg says to the socket bus.

use tickbus_axis::Axis;
use tickbus_base::time::Nanos;
use tickbus_base::toml_text::{Collector, Table, Value};
use tickbus_fieldbus::Role;
use tickbus_fieldbus::tcp::{Address, AddressError};
use tickbus_image::signal::SignalTable;

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

/// What one record or message has.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Message {
    /// The whole image of one direction.
    #[default]
    Image,
    /// One axis, behind its number.
    Axis {
        /// Where the file says so, as a byte offset.
        at: usize,
    },
}

/// What a driver.cfg says to the socket bus.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Options {
    /// Where to listen, or what to connect to.
    pub address: Address,
    /// Where to listen for the peer of each station; empty where one peer has them all.
    pub stations: Vec<Address>,
    /// How many `[[station]]` tables were read.
    tables: usize,
    /// What one record or message has.
    pub message: Message,
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
    pub fn set_address(&mut self, address: &str) -> Result<(), String> {
        let address: Address = address
            .parse()
            .map_err(|why: AddressError| why.to_string())?;
        check_port(&address, self.tcp).map_err(|why| why.to_string())?;
        if !self.stations.is_empty() {
            return Err(format!(
                "each station has an address of its own; write \"{address}\" into its [[station]]"
            ));
        }
        self.address = address;
        Ok(())
    }

    /// Reads `address`, `role_tcp`, `send`, `min_interval`, `events` and `message`. `moved` says that
    /// [`set_address`](Self::set_address) follows.
    pub fn read(role: Role, moved: bool, mut table: Table<'_>) -> Option<Self> {
        let address = table.take("address");
        let tcp = table.take("role_tcp");
        let send = table.take("send");
        let min_interval = table.take("min_interval");
        let events = table.take("events");
        let message = table.take("message");
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
        let message = message.map_or(Some(Message::Image), |value| {
            let axis = Message::Axis { at: value.at() };
            value.choice("messages", &[("image", Message::Image), ("axis", axis)])
        });
        Some(Self {
            address: read?,
            stations: Vec::new(),
            tables: 0,
            message: message?,
            tcp: tcp?,
            sending: sending?,
            min_interval: least?,
            events: events?,
        })
    }
}

impl Options {
    /// Reads `address` in the next `[[station]]` table.
    pub fn read_station(&mut self, table: &mut Table<'_>) {
        const ALL: &str = "give each station an address, or none of them";
        self.tables += 1;
        let Some(value) = table.take("address") else {
            if !self.stations.is_empty() {
                table.wrong("this [[station]] has no \"address\", and others have", ALL);
            }
            return;
        };
        if self.stations.is_empty() && self.tables > 1 {
            value.wrong("this station has an \"address\", and others have none", ALL);
        } else if self.tcp == TcpRole::Connect {
            value.wrong(
                "a station has an \"address\", but this end connects",
                "only an end that listens serves several peers; write a driver.cfg for each PLC",
            );
        }
        self.stations.extend(Address::read(&value));
    }

    /// Reports what does not go together with the stations and axes of the driver.
    pub fn fit(&self, table: &SignalTable, axes: &[Axis], collector: &Collector<'_>) {
        let Message::Axis { at } = self.message else {
            return;
        };
        if axes.is_empty() {
            collector.report(
                at,
                "message = \"axis\", but there is no axis",
                "write [[axis]] tables, or remove it",
            );
        } else if table.stations.len() > 1 {
            collector.report(
                at,
                format!(
                    "message = \"axis\", but there are {} stations",
                    table.stations.len()
                ),
                "write a driver.cfg for each of them",
            );
        }
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
