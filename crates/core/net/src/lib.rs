//! Connections with other programs, for crates with and without a bus: nothing here knows an image, a bus or its `Port`.
//!
//! | part | contents |
//! |---|---|
//! | [`Address`] | hosts and ports, as a driver.cfg and a command line have them |
//! | [`LocalAddress`] | Unix sockets, written there as `unix:PATH` |
//! | [`connect()`], [`reach`], [`Dialler`] | connecting: with a stop, blocking, again and again |
//! | [`listen()`], [`bind`] | listening: with a stop, at once |
//! | [`bind_udp`], [`Datagrams`] | datagrams over UDP |
//! | [`look_up`], [`route`], [`try_connect`], [`sweep`] | finding out which addresses answer, and why others do not |
//! | [`Acceptor`] | accepting clients in a poll set |
//! | [`prepare`], [`close_gracefully`], … | what every connection needs from the system |
//! | [`begins_like_browser`] | distinguishing a web browser from a peer |
//! | [`serial`], [`serial_users`] | serial ports; who may use them, and who does |
//! | [`Message`], [`Inbox`] | the messages of helper processes, over any stream |
//!
//! The sockets themselves, of the system or of a simulation, are those of [`tickbus_base::net`].

mod acceptor;
mod address;
mod browser;
mod connect;
mod dialler;
mod error;
mod listen;
mod local_address;
mod message;
mod reachable;
mod resolve;
pub mod serial;
pub mod serial_users;
mod stream;
mod udp;

pub use acceptor::Acceptor;
pub use address::{Address, Host};
pub use browser::{IS_BROWSER, begins_like_browser, may_become_browser};
pub use connect::{connect, reach, reach_in};
pub use dialler::Dialler;
pub use error::Error;
pub use listen::{bind, listen};
pub use local_address::LocalAddress;
pub use message::{Inbox, Message, WireError};
pub use reachable::{Limits, Swept, Unreachable, look_up, route, sweep, try_connect};
pub use stream::{Stream, close_by_reset, close_gracefully, is_for_later, prepare, watch_peer};
pub use udp::{Datagrams, bind_udp};
