//! Foreign ends of a socket bus: TCP from the standard library, hand-written records.

use std::io::Write;
use std::net::{Ipv4Addr, SocketAddr, TcpStream};
use std::sync::Arc;
use tickbus_base::time::Manual;

use tickbus_conformance::peers::{Alone, leave, lying, own_address};
use tickbus_conformance::rig::{Bus, Liar, config};
use tickbus_driver_cfg::{Kind, Kinds};

/// The kind of this crate.
pub static KINDS: Kinds = Kinds::new(&[Kind::of::<tickbus_bus_socket::Options>()]);

/// The size of a record of the conformance suite's signals, in both directions.
pub const RECORD: usize = 6;

/// A socket bus at an address used by one test only.
pub struct Tcp {
    pub address: SocketAddr,
    /// Further lines in the `[fieldbus]` tables of the two ends.
    pub device: &'static str,
    pub controller: &'static str,
}

impl Tcp {
    pub fn new(device: &'static str, controller: &'static str) -> Self {
        let address = own_address();
        Self {
            address,
            device,
            controller,
        }
    }
}

impl Bus for Tcp {
    fn kinds(&self) -> &'static Kinds {
        &KINDS
    }

    fn fieldbus(&self, role: &str) -> String {
        let further = match role {
            "device" => self.device,
            _ => self.controller,
        };
        format!(
            "kind = \"socket\"\naddress = \"{}\"\n{further}",
            self.address
        )
    }

    /// A client, or a server, that sends half a record and leaves.
    fn liar(&self, _clock: &Arc<Manual>) -> Liar {
        Liar {
            peer: lying(self.address, self.device.contains("connect"), lie),
            cause: "protocol",
            words: "left in the middle of a record: 3 of 6 bytes had come",
        }
    }

    fn wrong(&self) -> Vec<(&'static str, &'static str)> {
        vec![
            ("kind = \"socket\"\naddress = \"127.0.0.1\"", "has no port"),
            (
                "kind = \"socket\"\nrole = \"controller\"\naddress = \"127.0.0.1:0\"",
                "port 0 cannot be connected to",
            ),
            (
                "kind = \"socket\"\nrole_tcp = \"server\"",
                "TCP roles are listen, connect",
            ),
            (
                "kind = \"socket\"\nsend = \"on_change\"",
                "did you mean \"on-change\"",
            ),
            (
                "kind = \"socket\"\nmin_interval = \"5ms\"",
                "without send = \"on-change\"",
            ),
            ("kind = \"socket\"\nadress = \"127.0.0.1:1\"", "address"),
        ]
    }
}

/// Sends half a record, and closes properly.
fn lie(mut stream: TcpStream) {
    // All zeros would be a valid speed, if accepted. The other end may have closed first.
    let _ = stream.set_nonblocking(false);
    let _ = stream.write_all(&[0; RECORD / 2]);
    leave(stream);
}

/// A Device that listens on a port chosen by the system, without a peer.
pub fn device(further: &str) -> (Alone, SocketAddr) {
    let bus = Tcp {
        address: (Ipv4Addr::LOCALHOST, 0).into(),
        device: "",
        controller: "",
    };
    let alone = Alone::open(&config(&bus, "device", further), &KINDS);
    let address = alone.address();
    (alone, address)
}

/// A record from a PLC: `run`, `speed`, `echo`.
pub fn record(speed: i16) -> [u8; RECORD] {
    let [high, low] = speed.to_be_bytes();
    [0, 0, high, low, high, low]
}
