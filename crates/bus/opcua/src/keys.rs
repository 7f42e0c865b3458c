//! The keys of `opcua-client` and `opcua-server` in a driver.cfg, for its schema.

use tickbus_base::toml_text::{Key, Shape};

use crate::identity::IDENTITY_KEYS;
use crate::namespaces::{NAMESPACES, NODESET};
use crate::options::IDENTITY_LIMIT;
use crate::security::POLICIES;

/// The client's own.
pub(crate) const CLIENT: &[Key] = &[
    Key::required(
        "url",
        Shape::Text,
        "Where the server is: \"opc.tcp://HOST:PORT/PATH\"; port and path can be left out",
    ),
    Key::new("security", POLICIES, "The protection of messages").or("\"Basic256Sha256\""),
    Key::new(
        "publishing_interval",
        Shape::Duration,
        "How often the server reports, at least 1ms; the cycle by default",
    ),
    Key::new(
        "sampling_interval",
        Shape::Duration,
        "How often the server samples, at least 1ms; as often as it publishes by default",
    ),
    Key::new(
        "nodes",
        Shape::Map(&Shape::Text),
        "The nodes of single signals, as [fieldbus.at] has them",
    ),
    Key::new(
        "node_pattern",
        Shape::Text,
        "The nodes of all other signals, with {name} and {station}",
    )
    .or("\"ns=2;s={name}\""),
    Key::new(
        "write_to",
        Shape::Label(IDENTITY_LIMIT),
        "The identity of the server that may be written to; without it nothing is written",
    ),
];

/// The server's own.
pub(crate) const SERVER: &[Key] = &[
    Key::new(
        "address",
        Shape::ADDRESS,
        "Where to listen; port 0 lets the system choose one",
    )
    .or("\"127.0.0.1:4840\""),
    Key::new(
        "host",
        Shape::Text,
        "The host in the URLs that clients get; where it listens by default",
    ),
    Key::new(
        "security",
        Shape::Any(&[POLICIES, Shape::List(&POLICIES, 1, 4)]),
        "A policy, or a list of them; the three that protect by default",
    ),
    Key::new("anonymous", Shape::Boolean, "true: everybody can log in"),
    Key::new(
        "namespaces",
        NAMESPACES,
        "The URIs of the device's namespaces, from number 2 on, for [fieldbus.at]",
    ),
    Key::new(
        "nodeset",
        NODESET,
        "The NodeSet2 file with the device's address space, or a list, each after those that it requires",
    ),
    Key::new(
        "identity",
        Shape::Table(IDENTITY_KEYS),
        "How the server names itself; \"tickbus\" and the driver's name by default",
    ),
];
