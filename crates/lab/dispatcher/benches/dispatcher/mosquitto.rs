//! Mosquitto, if it is installed: a value line is a message at `QoS` 0.

use std::io::{Read as _, Write as _};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::process::{Child, Command, Stdio};

use tempfile::NamedTempFile;

/// A broker that ends with this.
pub(crate) struct Mosquitto {
    child: Child,
    address: SocketAddr,
    _settings: NamedTempFile,
}

impl Mosquitto {
    pub(crate) fn start() -> Option<Self> {
        let listener = TcpListener::bind("127.0.0.1:0").expect("a free port");
        let address = listener.local_addr().expect("it is bound");
        drop(listener);
        let mut settings = NamedTempFile::new().expect("a file");
        // Without these limits the broker would lose messages, and be faster for it.
        write!(
            settings,
            "listener {} 127.0.0.1\nallow_anonymous true\nset_tcp_nodelay true\nlog_type none\n\
             max_queued_messages 0\nmax_inflight_messages 0\n",
            address.port()
        )
        .expect("room in the file");
        // Debian keeps it where only administrators look.
        let child = ["mosquitto", "/usr/sbin/mosquitto"]
            .iter()
            .find_map(|name| {
                let mut command = Command::new(name);
                command.arg("-c").arg(settings.path());
                let quiet = command.stdout(Stdio::null()).stderr(Stdio::null());
                quiet.spawn().ok()
            });
        let mut broker = Self {
            child: child?,
            address,
            _settings: settings,
        };
        while TcpStream::connect(address).is_err() {
            if broker.child.try_wait().is_ok_and(|ended| ended.is_some()) {
                return None;
            }
            std::thread::yield_now();
        }
        Some(broker)
    }

    /// A client of this name, subscribed to `topic`.
    pub(crate) fn connect(&self, name: &str, topic: Option<&str>) -> TcpStream {
        let mut stream = TcpStream::connect(self.address).expect("it listens");
        stream.set_nodelay(true).expect("a TCP option");
        // Version 3.1.1, a clean session, no keep-alive.
        let hello = format!("\0\u{4}MQTT\u{4}\u{2}\0\0{}", text(name));
        let mut packets = packet('\u{10}', &hello).into_bytes();
        let mut answers = 4;
        if let Some(topic) = topic {
            packets.push(0x82);
            // The packet's number, and QoS 0.
            packets.extend(&packet('\0', &format!("\0\u{1}{}\0", text(topic))).as_bytes()[1..]);
            answers += 5;
        }
        stream.write_all(&packets).expect("it reads");
        let mut answer = vec![0; answers];
        stream.read_exact(&mut answer).expect("it answers");
        assert_eq!(answer[3], 0, "the connection is accepted");
        assert!(topic.is_none() || answer[8] == 0, "so is the subscription");
        stream
    }
}

/// Publishes a text under a topic.
pub(crate) fn publish(topic: &str, value: &str) -> String {
    packet('0', &format!("{}{value}", text(topic)))
}

/// A packet of less than 128 bytes: its kind, its length, and the rest.
fn packet(kind: char, rest: &str) -> String {
    format!("{kind}{}{rest}", length(rest))
}

/// A text of less than 128 bytes, as it stands in a packet.
fn text(text: &str) -> String {
    format!("\0{}{text}", length(text))
}

fn length(text: &str) -> char {
    assert!(text.len() < 128, "one byte has the length");
    char::from(u8::try_from(text.len()).expect("it is small"))
}

impl Drop for Mosquitto {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
