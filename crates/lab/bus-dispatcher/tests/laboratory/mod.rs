//! A dispatcher on a port, for a machine and its PLC.

use std::io::Write as _;
use std::net::{SocketAddr, TcpListener};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::{self, JoinHandle};

use tickbus_base::time::{Manual, Monotonic, Stop};
use tickbus_conformance::rig::{self, Bus, Liar, eventually};
use tickbus_dispatcher::tcp::{Hosting, Listener};
use tickbus_dispatcher::{Dispatcher, Patch, Pin, Settings};
use tickbus_driver_cfg::{Kind, Kinds};
use tickbus_net::Address;

pub static KINDS: Kinds = Kinds::new(&[Kind::of::<tickbus_bus_dispatcher::Options>()]);

/// A dispatcher that can be stopped, and restarted on the same port.
pub struct Laboratory {
    port: u16,
    patch: Patch,
    state: Mutex<State>,
}

enum State {
    /// Something holds the port, but no dispatcher serves it.
    Reserved(TcpListener),
    Lied,
    Serving(Stop, JoinHandle<Patch>),
}

impl Laboratory {
    /// A laboratory without connections.
    pub fn empty() -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").expect("a free port");
        Self {
            port: listener.local_addr().expect("bound").port(),
            patch: Patch::new(),
            state: Mutex::new(State::Reserved(listener)),
        }
    }

    /// A laboratory in which the machine `device` and its PLC `device-PLC`, and `controller-PLC` of the suite, are
    /// connected.
    pub fn patched() -> Self {
        let mut laboratory = Self::empty();
        let pin = |client: &str, channel: &str| {
            Pin::parse(&format!("{client}:{channel}")).expect("a pin")
        };
        for (output, input) in [("Q1", "I1"), ("AQ1", "AI1"), ("AQ2", "AI2")] {
            laboratory
                .patch
                .connect(pin("device-PLC", input), pin("device", output));
            laboratory
                .patch
                .connect(pin("device", input), pin("device-PLC", output));
        }
        laboratory
    }

    pub fn address(&self) -> SocketAddr {
        SocketAddr::from(([127, 0, 0, 1], self.port))
    }

    /// The driver.cfg of an end.
    pub fn config(&self, role: &str, extra: &str) -> String {
        rig::config(self, role, extra)
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Starts the dispatcher, unless it runs.
    pub fn serve(&self) {
        let mut state = self.state();
        if matches!(*state, State::Serving(..)) {
            return;
        }
        *state = State::Lied;
        let address = Address::local(self.port);
        let listener = eventually("the port is free", || Listener::bind(&address).ok());
        let stop = Stop::new();
        let (patch, ended) = (self.patch.clone(), stop.clone());
        let serving = thread::spawn(move || {
            let mut dispatcher = Dispatcher::new(Settings::default(), patch);
            let hosting = Hosting {
                clock: &*Monotonic::shared(),
                stop: &ended,
                patch_file: None,
                door: None,
                news: &mut |_| {},
            };
            listener.run(&mut dispatcher, hosting).expect("it serves");
            dispatcher.patch().clone()
        });
        *state = State::Serving(stop, serving);
    }

    /// Stops the dispatcher.
    pub fn stop(&self) {
        let state = std::mem::replace(&mut *self.state(), State::Lied);
        if let State::Serving(stop, serving) = state {
            stop.stop();
            serving.join().expect("no panic");
        }
    }
}

impl Drop for Laboratory {
    fn drop(&mut self) {
        self.stop();
    }
}

impl Bus for Laboratory {
    fn kinds(&self) -> &'static Kinds {
        &KINDS
    }

    fn fieldbus(&self, role: &str) -> String {
        let address = format!("kind = \"dispatcher\"\naddress = \"{}\"", self.address());
        if role == "device" {
            return address;
        }
        self.serve();
        format!("{address}\nname = \"device-PLC\"")
    }

    fn liar(&self, _clock: &Arc<Manual>) -> Liar {
        let State::Reserved(listener) = std::mem::replace(&mut *self.state(), State::Lied) else {
            panic!("it serves already");
        };
        let stop = Stop::new();
        let lying = thread::spawn({
            let stop = stop.clone();
            move || {
                while !stop.is_stopped() {
                    let (mut stream, _) = listener.accept().expect("a machine");
                    // The machine may be gone before it has received everything.
                    let _ = stream.write_all(b"OK VP\r\nP I1=24 AI1=7\r\nP Q1=24\r\n");
                }
            }
        });
        Liar {
            peer: Box::new(Lying {
                stop,
                thread: Some(lying),
                address: self.address(),
            }),
            cause: "protocol",
            words: "the line \"P Q1=24\" came, but Q1 is no input of this client",
        }
    }

    fn wrong(&self) -> Vec<(&'static str, &'static str)> {
        vec![
            (
                "kind = \"dispatcher\"\naddress = \"127.0.0.1:0\"",
                "port 0 cannot be connected to",
            ),
            ("kind = \"dispatcher\"\nname = \"a b\"", "letters, digits"),
            (
                "kind = \"dispatcher\"\nconnect = \"I1:A:Q1\"",
                "connect = [\"I1:PUMP:Q2\"]",
            ),
            ("kind = \"dispatcher\"\nconnect = [\"I1:A\"]", "I1:NAME:Q2"),
            (
                "kind = \"dispatcher\"\nconnect = [\"I1:A:I1\"]",
                "connect an output with an input",
            ),
            (
                "kind = \"dispatcher\"\nconnect = [\"I9:A:Q1\"]",
                "it has I1 to I1",
            ),
            (
                "kind = \"dispatcher\"\n[fieldbus.at]\ns = \"Q1\"",
                "write one from I1 to I256",
            ),
            ("kind = \"dispatcher\"\nport = 1", "port"),
        ]
    }
}

/// A thread that lies until this is dropped.
struct Lying {
    stop: Stop,
    thread: Option<JoinHandle<()>>,
    address: SocketAddr,
}

impl Drop for Lying {
    fn drop(&mut self) {
        self.stop.stop();
        // The thread wakes by a last connection.
        let _last = std::net::TcpStream::connect(self.address);
        if let Some(thread) = self.thread.take() {
            thread.join().expect("no panic");
        }
    }
}
