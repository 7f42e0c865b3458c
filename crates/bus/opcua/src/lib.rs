//! OPC UA: a client of a PLC that is a server, and a server for PLCs that are clients.
//!
//! Every build reads their options in a driver.cfg. The buses themselves use the crate `async-opcua` and are
//! only built with the cargo feature `opcua`.

mod at;
mod codes;
mod hello;
mod identity;
mod keys;
mod kind;
mod member;
mod namespaces;
mod node;
mod options;
mod search;
mod security;
mod url;

#[cfg(feature = "opcua")]
mod application;
#[cfg(feature = "opcua")]
mod client;
#[cfg(feature = "opcua")]
mod looks;
#[cfg(feature = "opcua")]
mod pki;
#[cfg(feature = "opcua")]
mod reactor;
#[cfg(feature = "opcua")]
mod rejects;
#[cfg(feature = "opcua")]
mod server;
#[cfg(feature = "opcua")]
mod values;

#[cfg(feature = "opcua")]
pub use client::Client;
pub use identity::Identity;
#[cfg(feature = "opcua")]
use member::Step;
pub use node::{Identifier, Namespace, NodeName, Pattern};
pub use options::{ClientOptions, Node, ServerOptions};
pub use security::{Credentials, Login, Mode, Policy, Secret, Trust};
#[cfg(feature = "opcua")]
pub use server::Server;
#[cfg(feature = "opcua")]
use server::check_nodesets;
pub use url::Url;
