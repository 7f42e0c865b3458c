//! Modbus buses for tests, and the bytes of telegrams.

use std::io::{Read as _, Write as _};
use std::net::{SocketAddr, TcpStream};
use std::sync::Arc;

use tickbus_base::time::Manual;
use tickbus_bus_modbus::rtu;

use tickbus_conformance::peers::{leave, lying, own_address};
use tickbus_conformance::rig::{Bus, Liar, logged};

/// Modbus TCP, or RTU over TCP, at an address used by one test only.
pub struct Tcp {
    pub address: SocketAddr,
    /// The role of the end that serves.
    server: &'static str,
    framing: &'static str,
    at: &'static str,
}

/// The signals of the suite, scattered over the tables; neighbours are what one request has to carry.
const SCATTERED: &str = "
[fieldbus.at]
run      = \"coil:65536\"
speed    = \"408502\"
echo     = \"408503\"
sensor   = \"100008\"
position = \"408500\"
copy     = \"408501\"
";

impl Tcp {
    /// A machine that is remote I/O, and a PLC that polls it.
    pub fn device_serves() -> Self {
        Self {
            address: own_address(),
            server: "device",
            framing: "tcp",
            at: "",
        }
    }

    /// The same, with a place of its own for each signal.
    pub fn device_serves_places() -> Self {
        Self {
            at: SCATTERED,
            ..Self::device_serves()
        }
    }

    /// The same with RTU over TCP.
    pub fn device_serves_rtu() -> Self {
        Self {
            framing: "rtu",
            ..Self::device_serves()
        }
    }

    /// A PLC that is a server, and a machine that polls it.
    pub fn controller_serves() -> Self {
        Self {
            address: own_address(),
            server: "controller",
            framing: "tcp",
            at: "",
        }
    }
}

impl Bus for Tcp {
    fn kinds(&self) -> &'static tickbus_driver_cfg::Kinds {
        &crate::KINDS
    }

    fn fieldbus(&self, role: &str) -> String {
        let address = format!("\"{}\"\nframing = \"{}\"", self.address, self.framing);
        if role == self.server {
            return format!("kind = \"modbus-server\"\naddress = {address}");
        }
        // A driver of the suite is named after its role. Its clock does not wait for a server that has not
        // been scheduled, hence the long time-out.
        format!(
            "kind = \"modbus-client\"\naddress = {address}\nwrite_to = \"tickbus {}\"\n\
             timeout = \"1h\"",
            self.server
        )
    }

    fn faults(&self) -> &'static str {
        self.at
    }

    /// Half a telegram from a client, or half an answer from a server, and nothing more.
    fn liar(&self, _clock: &Arc<Manual>) -> Liar {
        logged::expect("nothing is written into the PLC \"modbus device at ");
        let serves = self.server == "controller";
        let (half, begun) = match self.framing {
            "rtu" => (
                rtu_request(1, &[3, 0, 0, 0, 1])[..5].to_vec(),
                "left in the middle of a telegram, after 5 bytes of it",
            ),
            _ => (
                request(1, 1, &[3, 0, 0, 0, 1])[..9].to_vec(),
                "left in the middle of a telegram, after 9 bytes of it",
            ),
        };
        Liar {
            peer: lying(self.address, serves, move |stream| {
                if serves {
                    answer_with_too_little(stream);
                } else {
                    ask_half(stream, &half);
                }
            }),
            cause: "protocol",
            words: if serves {
                "its answer has 3 bytes behind the function code"
            } else {
                begun
            },
        }
    }

    fn wrong(&self) -> Vec<(&'static str, &'static str)> {
        vec![
            (
                "kind = \"modbus-server\"\naddress = \"1502\"",
                "has no port",
            ),
            ("kind = \"modbus-server\"\nunit = 256", "\"unit\" is 256"),
            (
                "kind = \"modbus-server\"\ninputs = \"coil:1\"",
                "\"inputs\" of a server is a coil",
            ),
            (
                "kind = \"modbus-server\"\nbaud = 9600",
                "\"baud\" stands without \"device\"",
            ),
            (
                "kind = \"modbus-server\"\naddress = \"0.0.0.0:0\"\ndevice = \"/dev/ttyS0\"",
                "\"address\" stands beside \"device\"",
            ),
            (
                "kind = \"modbus-server\"\nclient = 5",
                "did you mean \"clients\"",
            ),
            (
                "kind = \"modbus-client\"\naddress = \"127.0.0.1:0\"",
                "port 0 cannot be connected to",
            ),
            (
                "kind = \"modbus-client\"\noutputs = \"holding-register:0\"",
                "numbers go from 1 to 65536",
            ),
            (
                "kind = \"modbus-client\"\ninputs = \"input-register:1\"",
                "nobody can write input registers",
            ),
            (
                "kind = \"modbus-client\"\noutput_bytes = 4\noutputs = \"offset:65535\"",
                "end at offset 65536",
            ),
            (
                "kind = \"modbus-client\"\noutput_bytes = 4\noutputs = [{ at = \"coil:1\", bytes = 1 }]",
                "1 bytes, but %Q has 4",
            ),
            (
                "kind = \"modbus-client\"\ndevice = \"/dev/ttyS0\"\nunit = 0",
                "from 1 to 247",
            ),
            (
                "kind = \"modbus-server\"\ndevice = \"/dev/ttyS0\"\nparity = \"mark\"",
                "not one of the parities",
            ),
            (
                "kind = \"modbus-server\"\nevents = \"all\"",
                "no kind of events",
            ),
        ]
    }
}

/// Requests holding registers, but omits the last bytes of the request.
fn ask_half(mut stream: TcpStream, half: &[u8]) {
    let _ = stream.write_all(half);
    leave(stream);
}

/// Answers every request with one register, fewer than were requested.
fn answer_with_too_little(mut stream: TcpStream) {
    let _ = stream.set_nonblocking(false);
    let mut request = [0; 260];
    while let Ok(count @ 8..) = stream.read(&mut request) {
        let mut answer = request[..8].to_vec();
        answer[4..6].copy_from_slice(&[0, 6]);
        answer.extend([2, 0, 0]);
        answer.truncate(count.max(11));
        answer[5] = 5;
        if stream.write_all(&answer).is_err() {
            break;
        }
    }
}

/// The bytes of a telegram over TCP.
pub fn request(transaction: u16, unit: u8, pdu: &[u8]) -> Vec<u8> {
    let mut bytes = transaction.to_be_bytes().to_vec();
    bytes.extend([0, 0]);
    let length = u16::try_from(pdu.len() + 1).expect("it is short");
    bytes.extend(length.to_be_bytes());
    bytes.push(unit);
    bytes.extend(pdu);
    bytes
}

/// The bytes of a telegram with RTU.
pub fn rtu_request(unit: u8, pdu: &[u8]) -> Vec<u8> {
    let mut bytes = Vec::new();
    rtu::append(unit, &mut bytes, |to| to.extend_from_slice(pdu));
    bytes
}
