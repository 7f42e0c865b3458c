//! Ends of the S7 buses: pairs of ours, and a hand-written client.
#![allow(dead_code, reason = "each test uses a part of it")]

use std::io::{ErrorKind, Read, Write};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::sync::{Arc, Mutex};
use std::time::Duration;

use tickbus_base::time::Manual;

use tickbus_conformance::peers::{leave, lying, own_address};
use tickbus_conformance::rig::{Bus, Liar, logged};

/// A server and a client of ours, at an address used by one test only.
pub struct Pair {
    pub address: SocketAddr,
    /// The role of the end that serves.
    pub serves: &'static str,
    /// Further lines of the client.
    pub client: &'static str,
    pub blocks: bool,
}

impl Pair {
    pub fn new(serves: &'static str, client: &'static str) -> Self {
        Self {
            address: own_address(),
            serves,
            client,
            blocks: false,
        }
    }

    /// The images are in data blocks, but not at their beginnings.
    pub fn with_blocks(self) -> Self {
        Self {
            blocks: true,
            ..self
        }
    }
}

impl Bus for Pair {
    fn kinds(&self) -> &'static tickbus_driver_cfg::Kinds {
        &crate::KINDS
    }

    fn fieldbus(&self, role: &str) -> String {
        // A slow or absent server is not asked for its state again.
        logged::expect("does not say whether it is in RUN");
        let Self {
            address,
            serves,
            client,
            ..
        } = self;
        if role == *serves {
            let blocks = if self.blocks {
                "db = [{ number = 10, area = \"%I\" }, { number = 65535, area = \"%Q\" }]\n"
            } else {
                ""
            };
            return format!("kind = \"s7-server\"\naddress = \"{address}\"\n{blocks}");
        }
        let places = if self.blocks {
            "input = \"DB10\"\noutput = \"%DB65535.DBX0.0\"\n"
        } else {
            ""
        };
        format!(
            "kind = \"s7-client\"\naddress = \"{address}\"\nwrite_to = \"tickbus {serves}\"\n{places}{client}"
        )
    }

    /// A client, or a server, that starts properly and then sends something that is not S7.
    fn liar(&self, _clock: &Arc<Manual>) -> Liar {
        let listens = self.serves != "device";
        Liar {
            peer: lying(self.address, listens, move |stream| lie(stream, listens)),
            cause: "protocol",
            words: "a message of it begins with 0x11, where S7 has 0x32",
        }
    }

    fn wrong(&self) -> Vec<(&'static str, &'static str)> {
        vec![
            (
                "kind = \"s7-server\"\naddress = \"127.0.0.1\"",
                "has no port",
            ),
            (
                "kind = \"s7-server\"\ndb = [{ number = 0, area = \"%Q\" }]",
                "from 1 to 65535",
            ),
            (
                "kind = \"s7-server\"\ndb = [{ number = 1, area = \"%M\" }]",
                "is not one of the areas",
            ),
            (
                "kind = \"s7-server\"\ndb = [{ number = 1, area = \"%Q\", offset = 1 }]",
                "goes up to byte 2 of an area that has 1",
            ),
            (
                "kind = \"s7-server\"\ndb = [{ number = 1, area = \"%I\" }]",
                "goes up to byte 1 of an area that has 0",
            ),
            (
                "kind = \"s7-server\"\ndb = [{ number = 1, area = \"%Q\" }, { number = 1, area = \"%Q\" }]",
                "is there twice",
            ),
            (
                "kind = \"s7-server\"\ndb = [{ number = 1, area = \"%Q\", station = \"a\" }]",
                "there is no station \"a\"",
            ),
            ("kind = \"s7-server\"\npdu = 100", "from 240 to 960"),
            ("kind = \"s7-client\"", "has no \"address\""),
            (
                "kind = \"s7-client\"\naddress = \"10.0.0.1:0\"",
                "port 0 cannot be connected to",
            ),
            (
                "kind = \"s7-client\"\naddress = \"10.0.0.1\"\noutput = \"%QW0\"",
                "is no place in a CPU",
            ),
            (
                "kind = \"s7-client\"\naddress = \"10.0.0.1\"\nremote_tsap = \"3.1\"",
                "is no TSAP",
            ),
            (
                "kind = \"s7-client\"\naddress = \"10.0.0.1\"\nremote_tsap = \"03.01\"\nslot = 1",
                "stands beside",
            ),
            (
                "kind = \"s7-client\"\naddress = \"10.0.0.1\"\nslot = 32",
                "from 0 to 31",
            ),
        ]
    }
}

/// Connects, or accepts a connection, and then violates the protocol.
fn lie(mut stream: TcpStream, serves: bool) {
    // The other end may have closed first.
    let _ = stream.set_nonblocking(false);
    let _ = stream.set_read_timeout(Some(Duration::from_secs(20)));
    if serves {
        let _ = stream.read(&mut [0; 64]);
        let _ = stream.write_all(&CONFIRM);
    } else {
        let _ = stream.write_all(&CONNECT);
    }
    // All ones would be a valid speed, if accepted.
    let _ = stream.write_all(&packet(&[0x11; 20]));
    leave(stream);
}

/// A connect request to rack 0, slot 1.
pub const CONNECT: [u8; 22] = [
    3, 0, 0, 22, 17, 0xE0, 0, 0, 0, 1, 0, 0xC1, 2, 1, 0, 0xC2, 2, 1, 1, 0xC0, 1, 10,
];

pub const CONFIRM: [u8; 22] = [
    3, 0, 0, 22, 17, 0xD0, 0, 1, 0, 1, 0, 0xC0, 1, 10, 0xC1, 2, 1, 0, 0xC2, 2, 1, 1,
];

/// A packet with a message.
pub fn packet(message: &[u8]) -> Vec<u8> {
    let [high, low] = u16::try_from(7 + message.len())
        .expect("short")
        .to_be_bytes();
    [&[3, 0, high, low, 2, 0xF0, 0x80][..], message].concat()
}

/// A packet with a job of these parameters and data.
pub fn job(parameters: &[u8], data: &[u8]) -> Vec<u8> {
    let length = |bytes: &[u8]| u16::try_from(bytes.len()).expect("short").to_be_bytes();
    let ([p0, p1], [d0, d1]) = (length(parameters), length(data));
    let header = [0x32, 1, 0, 0, 0, 7, p0, p1, d0, d1];
    packet(&[&header[..], parameters, data].concat())
}

/// The address of `count` bytes in an area: 0x81 inputs, 0x82 outputs, 0x83 flags, 0x84 a data block.
pub fn address(area: u8, block: u16, byte: usize, count: usize) -> Vec<u8> {
    let [b0, b1] = block.to_be_bytes();
    let [c0, c1] = u16::try_from(count).expect("short").to_be_bytes();
    let [_, a0, a1, a2] = u32::try_from(byte * 8).expect("short").to_be_bytes();
    vec![0x12, 10, 0x10, 2, c0, c1, b0, b1, area, a0, a1, a2]
}

/// A packet with a request to read these bytes.
pub fn request(area: u8, byte: usize, count: usize) -> Vec<u8> {
    job(&[&[4, 1][..], &address(area, 0, byte, count)].concat(), &[])
}

/// A packet with a request to write these bytes.
pub fn command(area: u8, byte: usize, bytes: &[u8]) -> Vec<u8> {
    let [high, low] = u16::try_from(bytes.len() * 8).expect("short").to_be_bytes();
    let data = [&[0, 4, high, low][..], bytes].concat();
    let address = address(area, 0, byte, bytes.len());
    job(&[&[5, 1][..], &address].concat(), &data)
}

/// A hand-written client.
pub struct Client(pub TcpStream);

impl Client {
    /// A client that has connected and negotiated a PDU length of 480 bytes.
    pub fn new(address: SocketAddr) -> Self {
        Self::in_slot(address, 1)
    }

    /// Like [`new`](Self::new), for the CPU in this slot.
    pub fn in_slot(address: SocketAddr, slot: u8) -> Self {
        let mut client = Self::silent(address);
        let mut connect = CONNECT;
        connect[18] = slot;
        assert_eq!(client.ask(&connect).len(), 22);
        let agreed = client.ask(&job(&[0xF0, 0, 0, 1, 0, 1, 1, 0xE0], &[]));
        assert_eq!(agreed[agreed.len() - 2..], [1, 0xE0]);
        client
    }

    /// A client that has not sent anything yet.
    pub fn silent(address: SocketAddr) -> Self {
        let stream = TcpStream::connect(address).expect("somebody listens");
        stream.set_nodelay(true).expect("a TCP option");
        let limit = Some(Duration::from_secs(20));
        stream.set_read_timeout(limit).expect("a TCP option");
        Self(stream)
    }

    pub fn send(&mut self, bytes: &[u8]) {
        self.0.write_all(bytes).expect("the server reads");
    }

    /// The next packet; `None` when the server closes the connection.
    pub fn receive(&mut self) -> Option<Vec<u8>> {
        let mut packet = vec![0; 4];
        match self.0.read_exact(&mut packet) {
            Ok(()) => {}
            Err(error)
                if matches!(
                    error.kind(),
                    ErrorKind::UnexpectedEof | ErrorKind::ConnectionReset
                ) =>
            {
                return None;
            }
            Err(error) => panic!("no answer: {error}"),
        }
        let length = usize::from(u16::from_be_bytes([packet[2], packet[3]]));
        packet.resize(length, 0);
        self.0.read_exact(&mut packet[4..]).expect("a whole packet");
        Some(packet)
    }

    /// Sends, and receives one packet.
    pub fn ask(&mut self, bytes: &[u8]) -> Vec<u8> {
        self.send(bytes);
        self.receive().expect("an answer")
    }

    /// Reads bytes.
    pub fn read(&mut self, area: u8, byte: usize, count: usize) -> Vec<u8> {
        let answer = self.ask(&request(area, byte, count));
        // After packet header, PDU header and parameters: the item's return code.
        assert_eq!(answer[7 + 12 + 2], 0xFF, "{answer:02x?}");
        answer[7 + 12 + 2 + 4..].to_vec()
    }

    /// Writes bytes.
    pub fn write(&mut self, area: u8, byte: usize, bytes: &[u8]) {
        let answer = self.ask(&command(area, byte, bytes));
        assert_eq!(answer[7 + 12..], [5, 1, 0xFF]);
    }
}

/// A hand-written CPU: its blocks, its state, and the requests it has received.
#[derive(Default)]
pub struct Cpu {
    /// The data blocks; each of their bytes is the block's number.
    pub blocks: Vec<u8>,
    /// The state in its list 0x0424; `None` to refuse the list.
    pub state: Option<u8>,
    /// How many times this list was requested.
    pub asked: u32,
    /// How many more requests for this list it refuses.
    pub refuses: u32,
    /// True if the CPU closes the connection when any list is requested.
    pub hangs_up: bool,
}

impl Cpu {
    /// Serves one client after another, as long as there are any.
    pub fn serve(listener: TcpListener, cpu: Arc<Mutex<Self>>) {
        std::thread::spawn(move || {
            while let Ok((stream, _)) = listener.accept() {
                let mut client = Client(stream);
                while let Some(packet) = client.receive() {
                    let answer = cpu.lock().expect("no panic").answer(&packet);
                    let Some(answer) = answer else {
                        break;
                    };
                    client.send(&answer);
                }
            }
        });
    }

    /// The answer to a packet; `None` to close the connection.
    fn answer(&mut self, request: &[u8]) -> Option<Vec<u8>> {
        if request[5] == 0xE0 {
            return Some(CONFIRM.to_vec());
        }
        if request[8] == 7 && self.hangs_up {
            return None;
        }
        let reference = [request[11], request[12]];
        let unit = |kind: u8, parameters: &[u8], data: &[u8]| {
            let length = |bytes: &[u8]| u16::try_from(bytes.len()).expect("short").to_be_bytes();
            let mut unit = vec![0x32, kind, 0, 0];
            for word in [reference, length(parameters), length(data)] {
                unit.extend_from_slice(&word);
            }
            if kind == 3 {
                unit.extend_from_slice(&[0, 0]);
            }
            packet(&[&unit, parameters, data].concat())
        };
        let parameters = &request[17..];
        Some(match (request[8], parameters[0]) {
            (1, 0xF0) => unit(3, &[0xF0, 0, 0, 1, 0, 1, 1, 0xE0], &[]),
            (1, 4) => {
                let count = parameters[1];
                let mut data: Vec<u8> = Vec::new();
                for item in parameters[2..].chunks(12) {
                    if data.len() % 2 == 1 {
                        data.push(0);
                    }
                    let (length, block) = (item[5], item[7]);
                    if self.blocks.contains(&block) {
                        data.extend([0xFF, 4, 0, length * 8]);
                        data.extend(vec![block; length.into()]);
                    } else {
                        data.extend([0x0A, 0, 0, 0]);
                    }
                }
                unit(3, &[4, count], &data)
            }
            (7, _) => {
                let is_state = request[request.len() - 4..][..2] == [0x04, 0x24];
                self.asked += u32::from(is_state);
                let is_refused = is_state && self.refuses > 0;
                self.refuses -= u32::from(is_refused);
                let Some(state) = self.state.filter(|_| is_state && !is_refused) else {
                    let refuses = [0, 1, 0x12, 8, 0x12, 0x84, 1, 0, 0, 0, 0xD4, 1];
                    return Some(unit(7, &refuses, &[0x0A, 0, 0, 0]));
                };
                let mut data = vec![
                    0xFF, 9, 0, 28, 4, 0x24, 0, 0, 0, 20, 0, 1, 0x51, 0x44, 0xFF, state,
                ];
                data.resize(32, 0);
                unit(7, &[0, 1, 0x12, 8, 0x12, 0x84, 1, 0, 0, 0, 0, 0], &data)
            }
            other => panic!("{other:?} was not expected"),
        })
    }
}
