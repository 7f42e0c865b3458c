//! The options of the socket bus in a driver.cfg.

use tickbus_base::Mistake;
use tickbus_base::time::Nanos;
use tickbus_base::toml_text::{Collector, Key, Shape, Table, Value, names};
use tickbus_fieldbus::Role;
use tickbus_image::signal::SignalTable;
use tickbus_net::Address;

use super::Sending;

/// The default port.
const PORT: u16 = 20_030;

/// The end that listens or connects.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum TcpRole {
    /// Listens.
    Listen,
    /// Connects.
    Connect,
}

/// The content of a record or message.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Message {
    /// The whole image of one direction.
    #[default]
    Image,
    /// One axis, preceded by its number.
    Axis {
        /// The byte offset of that key in the file.
        at: usize,
    },
}

const TCP_ROLES: [(&str, TcpRole); 2] =
    [("listen", TcpRole::Listen), ("connect", TcpRole::Connect)];

const WAYS: [(&str, Sending); 3] = [
    ("cyclic", Sending::Cyclic),
    ("on-change", Sending::OnChange),
    ("reply", Sending::Reply),
];

/// The keys of the bus, for the schema of a driver.cfg.
pub(crate) const KEYS: &[Key] = &[
    Key::new(
        "address",
        Shape::ADDRESS,
        "Where to listen, or what to connect to; port 0 lets the system choose one",
    )
    .or("\"127.0.0.1:20030\""),
    Key::new(
        "role_tcp",
        Shape::Choice(&names(&TCP_ROLES)),
        "A device listens and a controller connects, if it is left out",
    ),
    Key::new(
        "send",
        Shape::Choice(&names(&WAYS)),
        "When a record is sent: every cycle, when a signal has changed, or for each that comes in",
    )
    .or("\"cyclic\""),
    Key::new(
        "min_interval",
        Shape::Duration,
        "With send = \"on-change\": the least time between two records",
    ),
    Key::new(
        "message",
        Shape::Choice(&["image", "axis"]),
        "\"axis\": each message has one [[axis]], behind its number",
    )
    .or("\"image\""),
];

/// The keys of a station.
pub(crate) const STATION_KEYS: &[Key] = &[Key::new(
    "address",
    Shape::ADDRESS,
    "Where to listen for the station's own peer; in all stations, or in none",
)];

/// The options of the socket bus.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Options {
    /// The address to listen on, or to connect to.
    pub address: Address,
    /// The address to listen on for the peer of each station; empty if one peer has them all.
    pub stations: Vec<Address>,
    /// The number of `[[station]]` tables that were read.
    tables: usize,
    /// The content of a record or message.
    pub message: Message,
    /// The role of this end: to listen or to connect.
    pub tcp: TcpRole,
    /// When a record is sent.
    pub sending: Sending,
    /// On change: the shortest time between two records; zero for no limit.
    pub min_interval: Nanos,
}

impl Options {
    /// Replaces the address of the driver.cfg.
    ///
    /// # Errors
    ///
    /// The text is not an address, or the address is not usable by this end.
    pub fn set_address(&mut self, address: &str) -> Result<(), Mistake> {
        let address: Address = address.parse()?;
        check_port(&address, self.tcp)?;
        if !self.stations.is_empty() {
            return Err(Mistake::new(
                "each station has an address of its own",
                format!("write \"{address}\" into its [[station]]"),
            ));
        }
        self.address = address;
        Ok(())
    }

    /// Reads `address`, `role_tcp`, `send`, `min_interval` and `message`. `moved` says that
    /// [`set_address`](Self::set_address) follows.
    pub fn read(role: Role, moved: bool, table: &mut Table<'_>) -> Option<Self> {
        let address = table.take("address");
        let tcp = table.take("role_tcp");
        let send = table.take("send");
        let min_interval = table.take("min_interval");
        let message = table.take("message");
        let whole = table.is_whole();

        let read = address
            .as_ref()
            .map_or(Some(Address::local(PORT)), Address::read);
        let tcp = tcp.as_ref().map_or(Some(default_tcp(role)), |value| {
            value.choice("TCP roles", &TCP_ROLES)
        });
        if let (Some(value), Some(address), Some(tcp)) = (&address, &read, tcp)
            && let Err(mistake) = check_port(address, tcp)
            && !moved
        {
            value.refuse(mistake);
        }
        let stated = send
            .as_ref()
            .map(|value| value.choice("ways to send", &WAYS));
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

    /// Reports conflicts with the stations and axes of the driver.
    pub fn fit(&self, table: &SignalTable, collector: &Collector<'_>) {
        let Message::Axis { at } = self.message else {
            return;
        };
        if table.structures.is_empty() {
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

/// Checks that an address can be used when listening, or connecting.
fn check_port(address: &Address, tcp: TcpRole) -> Result<(), Mistake> {
    match tcp {
        TcpRole::Listen => Ok(()),
        TcpRole::Connect => address.check_dialled(),
    }
}

/// A machine listens for its PLC, like a PLC's I/O device.
const fn default_tcp(role: Role) -> TcpRole {
    match role {
        Role::Device | Role::Observer => TcpRole::Listen,
        Role::Controller => TcpRole::Connect,
    }
}
