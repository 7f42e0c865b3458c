//! A controller and a machine at the two ends of a pseudo-terminal.

use std::path::PathBuf;
use std::sync::Arc;

use tempfile::TempDir;
use tickbus_base::os::{Parity, SerialPort, SerialSettings};
use tickbus_base::time::{Clock, Monotonic};
use tickbus_bus_identification::{Access, ClientOptions, Command, Family, Heads, ReaderOptions};
use tickbus_conformance::rig::{End, await_that};
use tickbus_driver_cfg::{Kind, Kinds};

pub static KINDS: Kinds = Kinds::new(&[Kind::of::<ClientOptions>(), Kind::of::<ReaderOptions>()]);

/// Octets of data at both ends.
pub const DATA: usize = 24;

/// Both ends of a line with a separate folder.
pub struct Line {
    pub folder: TempDir,
}

impl Line {
    pub fn new() -> Self {
        Self {
            folder: tempfile::tempdir().expect("a folder"),
        }
    }

    pub fn name(&self) -> PathBuf {
        self.folder.path().join("reader")
    }

    /// A driver.cfg for one end.
    fn text(
        &self,
        kind: &str,
        device: &str,
        heads: &[u8],
        extra: &str,
        signals: &[(&str, &str)],
    ) -> String {
        let mut text = format!(
            "[driver]\nid = 1\nname = \"{kind}\"\n[fieldbus]\nkind = \"{kind}\"\ndevice = \"{device}{}\"\n\
             reconnect = [\"10ms\"]\n{extra}\n",
            self.name().display()
        );
        if let [head] = heads {
            text += &format!("head = {head}\n");
        } else {
            for head in heads {
                text += &format!("[[station]]\nname = \"{head}\"\nhead = {head}\n");
            }
        }
        for head in heads {
            let (at, of) = if heads.len() > 1 {
                (format!("station = \"{head}\"\n"), format!("{head} "))
            } else {
                Default::default()
            };
            for (name, address) in signals {
                text +=
                    &format!("[[signal]]\n{at}name = \"{of}{name}\"\naddress = \"{address}\"\n");
            }
            for (area, first, name) in [('I', 4, "in"), ('Q', 4, "out")] {
                let first = if kind == "ivi-reader" { 8 } else { first };
                for octet in 0..DATA {
                    text += &format!(
                        "[[signal]]\n{at}name = \"{of}{name} {octet}\"\naddress = \"%{area}B{}\"\n",
                        first + octet
                    );
                }
            }
        }
        text
    }

    /// The machine's end, which creates the port.
    pub fn reader(&self, heads: &[u8]) -> End {
        self.reader_by("pty:", heads, &Monotonic::shared())
    }

    /// The machine's end, with this before the port's name, and this clock.
    pub fn reader_by<C: Clock + 'static>(&self, device: &str, heads: &[u8], clock: &Arc<C>) -> End {
        let signals = [
            ("present", "%IX0.0"),
            ("unplugged", "%IX0.1"),
            ("protected", "%IX0.2"),
            ("fault", "%IB1"),
            ("number", "%ID4"),
            ("taken", "%QX0.0"),
            ("writes", "%QB1"),
        ];
        End::open(
            &self.text("ivi-reader", device, heads, "", &signals),
            clock,
            &KINDS,
        )
    }

    pub fn client(&self, heads: &[u8], extra: &str) -> End {
        let role = format!("role = \"controller\"\n{extra}");
        let signals = [
            ("echo", "%IB0"),
            ("status", "%IB1"),
            ("present", "%IX2.0"),
            ("connected", "%IX2.1"),
            ("length", "%IB3"),
            ("command", "%QB0"),
            ("count", "%QB1"),
            ("address", "%QW2"),
        ];
        End::open(
            &self.text("ivi-client", "", heads, &role, &signals),
            &Monotonic::shared(),
            &KINDS,
        )
    }

    /// Opens the port as another program, once the machine has created it.
    #[track_caller]
    pub fn open_port(&self, machine: &mut End) -> SerialPort {
        let settings = SerialSettings {
            baud: 9600,
            parity: Parity::None,
            two_stop_bits: false,
            seven_bits: false,
            rs485: false,
        };
        let mut port = None;
        await_that("the port is there", || {
            machine.tick();
            port = SerialPort::open(&self.name(), settings).ok();
            port.is_some()
        });
        port.expect("it is there")
    }
}

/// A command for head 1, in the format of the line.
pub fn command(is_auto: bool, access: Access<'_>) -> Vec<u8> {
    let command = Command::Access {
        heads: Heads::One(1),
        is_auto,
        access,
    };
    let mut bytes = Vec::new();
    command.append(Family::Idc1K, &mut bytes);
    bytes
}

/// Machine and controller.
pub struct Pair {
    pub line: Line,
    pub machine: End,
    pub controller: End,
    pub toggle: u8,
}

impl Pair {
    pub fn new() -> Self {
        Self::with(&[1], "")
    }

    pub fn with(heads: &[u8], extra: &str) -> Self {
        let line = Line::new();
        let machine = line.reader(heads);
        let controller = line.client(heads, extra);
        Self {
            line,
            machine,
            controller,
            toggle: 0,
        }
    }

    #[track_caller]
    pub fn until(&mut self, what: &str, mut done: impl FnMut(&mut Self) -> bool) {
        await_that(what, || {
            self.machine.tick();
            self.controller.tick();
            done(self)
        });
    }

    /// Bus cycles of the controller.
    #[track_caller]
    pub fn cycles(&self) -> u64 {
        let cycles = self.controller.statistic("bus_cycles");
        cycles.parse().expect("a number")
    }

    /// The machine puts a carrier in front of the head.
    #[track_caller]
    pub fn put(&mut self, octets: &[u8]) {
        for (index, octet) in octets.iter().enumerate() {
            self.machine.set(&format!("in {index}"), f64::from(*octet));
        }
        self.machine.set("present", 1.0);
        self.until("the carrier is seen", |pair| {
            pair.machine.get("taken") == 1.0 && pair.controller.get("present") == 1.0
        });
    }

    pub fn command(&mut self, command: u8, address: u16, count: u8, data: &[u8]) {
        self.toggle ^= 0x80;
        for (index, octet) in data.iter().enumerate() {
            self.controller
                .set(&format!("out {index}"), f64::from(*octet));
        }
        self.controller.set("address", f64::from(address));
        self.controller.set("count", f64::from(count));
        self.controller
            .set("command", f64::from(command | self.toggle));
    }

    /// Sends a command and waits for its answer: the status, and the data.
    #[track_caller]
    pub fn ask(&mut self, command: u8, address: u16, count: u8, data: &[u8]) -> (u8, Vec<u8>) {
        self.command(command, address, count, data);
        self.answer(command)
    }

    #[track_caller]
    pub fn answer(&mut self, command: u8) -> (u8, Vec<u8>) {
        let echo = f64::from(command | self.toggle);
        self.until("the answer comes", |pair| {
            pair.controller.get("echo") == echo
        });
        #[allow(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "octets"
        )]
        let octet = |name: &str| self.controller.get(name) as u8;
        let data = (0..octet("length")).map(|index| octet(&format!("in {index}")));
        (octet("status"), data.collect())
    }
}
