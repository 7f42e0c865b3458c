//! NATS, if its server is installed.

use std::io::{BufRead as _, BufReader, Write as _};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::process::{Child, Command, Stdio};

/// A server that ends with this.
pub(crate) struct Nats(Child, SocketAddr);

impl Nats {
    pub(crate) fn start() -> Option<Self> {
        let listener = TcpListener::bind("127.0.0.1:0").expect("a free port");
        let address = listener.local_addr().expect("it is bound");
        drop(listener);
        // Debian keeps it where only administrators look.
        let child = ["nats-server", "/usr/sbin/nats-server"]
            .iter()
            .find_map(|name| {
                let mut command = Command::new(name);
                command.args(["-a", "127.0.0.1", "-p", &address.port().to_string()]);
                let quiet = command.stdout(Stdio::null()).stderr(Stdio::null());
                quiet.spawn().ok()
            });
        let mut server = Self(child?, address);
        while TcpStream::connect(address).is_err() {
            if server.0.try_wait().is_ok_and(|ended| ended.is_some()) {
                return None;
            }
            std::thread::yield_now();
        }
        Some(server)
    }

    /// A client that introduces itself with `words`.
    pub(crate) fn connect(&self, words: &str) -> TcpStream {
        let mut stream = TcpStream::connect(self.1).expect("it listens");
        stream.set_nodelay(true).expect("a TCP option");
        let hello = format!("CONNECT {{\"verbose\":false}}\r\n{words}PING\r\n");
        stream.write_all(hello.as_bytes()).expect("it reads");
        let mut lines = BufReader::with_capacity(1, &stream).lines();
        while lines.next().expect("a line").expect("text") != "PONG" {}
        stream
    }
}

impl Drop for Nats {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}
