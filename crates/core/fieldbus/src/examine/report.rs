//! The steps of an examination, and those that all buses have in common.

use std::net::{SocketAddr, UdpSocket};

use tickbus_base::time::{Nanos, Stop};
use tickbus_image::signal::{Area, Signal};
use tickbus_net::{Address, Host, Unreachable, bind, look_up, route};

use super::wire::{Peer, Wire};
use crate::{BusSetup, Role};

/// The outcome of a step.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Verdict {
    /// As it should be.
    Ok,
    /// The line runs, but something looks wrong.
    Warn,
    /// The line cannot work like this.
    Fail,
}

impl Verdict {
    /// The verdict in a report: `ok`, `warn` or `fail`.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Ok => "ok",
            Self::Warn => "warn",
            Self::Fail => "fail",
        }
    }
}

/// One step of an examination.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Step {
    /// The subject in one word, such as `port`.
    pub name: &'static str,
    /// The outcome.
    pub verdict: Verdict,
    /// The cause of a warning or a failure as a fixed word for programs, such as `port-closed`.
    pub cause: Option<&'static str>,
    /// The evidence in one line. It can contain text of the peer.
    pub evidence: String,
    /// Further evidence, one line each.
    pub details: Vec<String>,
    /// The next thing to try; can be empty.
    pub next: String,
}

/// An examination under way.
#[derive(Debug)]
pub struct Examination<'a> {
    /// The driver whose line is examined.
    pub setup: BusSetup<'a>,
    /// The signals that show that the other end is alive, each with the time within which it has to change.
    pub watched: Vec<(usize, Nanos)>,
    /// How long values are watched.
    pub watch: Nanos,
    /// The time-out of an answer of the peer.
    pub patience: Nanos,
    /// Ends the examination early.
    pub stop: &'a Stop,
    /// The address of the peer, once it has accepted a connection.
    pub reached: Option<SocketAddr>,
    /// The steps so far.
    pub steps: Vec<Step>,
}

impl<'a> Examination<'a> {
    /// The time in which a port must answer: long enough for a lost first packet to be sent a second time.
    const CONNECT: Nanos = Nanos::from_millis(2500);

    /// An examination without steps.
    pub fn new(
        setup: BusSetup<'a>,
        watched: Vec<(usize, Nanos)>,
        watch: Nanos,
        stop: &'a Stop,
    ) -> Self {
        // An answer that takes longer makes all data stale anyway.
        let patience = (setup.max_age.times(4)).clamp(Nanos::from_millis(500), Nanos::from_secs(1));
        Self {
            setup,
            watched,
            watch,
            patience,
            stop,
            reached: None,
            steps: Vec::new(),
        }
    }

    /// Adds a step that is as it should be.
    pub fn ok(&mut self, name: &'static str, evidence: impl Into<String>) -> &mut Step {
        self.add(name, Verdict::Ok, None, evidence.into(), "")
    }

    /// Adds a step with a warning, its cause and the next thing to try.
    pub fn warn(
        &mut self,
        name: &'static str,
        cause: &'static str,
        evidence: impl Into<String>,
        next: &str,
    ) -> &mut Step {
        self.add(name, Verdict::Warn, Some(cause), evidence.into(), next)
    }

    /// Adds a step that has failed, its cause and the next thing to try.
    pub fn fail(
        &mut self,
        name: &'static str,
        cause: &'static str,
        evidence: impl Into<String>,
        next: &str,
    ) -> &mut Step {
        self.add(name, Verdict::Fail, Some(cause), evidence.into(), next)
    }

    fn add(
        &mut self,
        name: &'static str,
        verdict: Verdict,
        cause: Option<&'static str>,
        evidence: String,
        next: &str,
    ) -> &mut Step {
        self.steps.push(Step {
            name,
            verdict,
            cause,
            evidence,
            details: Vec::new(),
            next: next.to_owned(),
        });
        self.steps.last_mut().expect("it was just added")
    }

    /// True if a step has failed.
    pub fn has_failed(&self) -> bool {
        self.steps.iter().any(|step| step.verdict == Verdict::Fail)
    }

    /// The signals of a station, with their positions in the table.
    pub fn signals(&self, station: usize) -> impl Iterator<Item = (usize, &'a Signal)> + use<'a> {
        let signals = self.setup.table.signals.iter().enumerate();
        signals.filter(move |(_, signal)| signal.station == station)
    }

    /// True if this end reads the signal, and does not write it.
    pub fn is_read(&self, signal: &Signal) -> bool {
        self.setup.role == Role::Observer || !self.setup.role.writes(signal.area)
    }

    /// Adds the step `sizes`: the bytes of the image, and what the bus adds.
    pub fn sizes(&mut self, further: &str) {
        let bytes = |area| {
            let stations = self.setup.table.stations.iter();
            stations
                .map(|station| station.plc_bytes(area))
                .sum::<usize>()
        };
        let (input, output) = (bytes(Area::Input), bytes(Area::Output));
        let signals = self.setup.table.signals.len();
        self.ok(
            "sizes",
            format!("{signals} signals, %I {input} bytes, %Q {output} bytes; {further}"),
        );
    }

    /// Compares the identity that the peer reports with the one that the file permits to be written to.
    pub fn compare_identity(&mut self, reported: &str, write_to: Option<&str>) {
        let writes = (self.setup.table.signals.iter()).any(|signal| !self.is_read(signal));
        match write_to {
            Some(named) if named != reported && writes => {
                self.fail(
                    "identity",
                    "identity-differs",
                    format!("the device is \"{reported}\", and write_to names \"{named}\""),
                    &format!(
                        "nothing is written into this device; if it is the right one, write write_to = \
                         \"{reported}\""
                    ),
                );
            }
            None if writes => {
                let step = self.ok("identity", format!("\"{reported}\""));
                step.next = format!(
                    "the driver only reads, as no write_to names the device; to write, add write_to = \
                     \"{reported}\""
                );
            }
            _ => {
                self.ok("identity", format!("\"{reported}\""));
            }
        }
    }

    /// Looks up the host: the step `name`. `None` if it has failed.
    fn look_up(&mut self, address: &Address) -> Option<Vec<SocketAddr>> {
        let addresses = match look_up(address, &**self.setup.clock, self.stop) {
            Ok(addresses) => addresses,
            Err(error) => {
                let next = "correct the name, or write the IP address of the PLC";
                self.fail("name", "name-unknown", error.to_string(), next);
                return None;
            }
        };
        let texts: Vec<String> = addresses
            .iter()
            .map(|found| found.ip().to_string())
            .collect();
        self.ok(
            "name",
            match &address.host {
                Host::Ip(ip) => format!("{ip} is an IP address, and needs no look-up"),
                Host::Name(name) => format!("{name} is {}", texts.join(", ")),
            },
        );
        Some(addresses)
    }

    /// Looks up a peer to which there is no connection: the steps `name` and `route`. `None` if one has failed.
    pub fn find_peer(&mut self, address: &Address) -> Option<Peer> {
        let address = self.look_up(address)?.into_iter().next()?;
        match route(address) {
            Ok(own) => {
                self.ok("route", format!("from {own}"));
                Some(Peer::new(
                    address,
                    Self::CONNECT,
                    self.patience,
                    self.setup.clock,
                ))
            }
            Err(why) => {
                self.unreachable(address, why);
                None
            }
        }
    }

    /// Looks up the host, and connects: the steps `name`, `route` and `port`. `None` if one has failed.
    pub fn reach(&mut self, address: &Address) -> Option<(Peer, Wire)> {
        let addresses = self.look_up(address)?;
        let mut last = None;
        for address in addresses {
            match self.connect(address) {
                Ok(reached) => return Some(reached),
                Err(why) => last = Some((address, why)),
            }
        }
        let (address, why) = last?;
        self.unreachable(address, why);
        None
    }

    /// Connects to one address; adds the steps `route` and `port` if that works.
    fn connect(&mut self, address: SocketAddr) -> Result<(Peer, Wire), Unreachable> {
        let own = route(address)?;
        let peer = Peer::new(address, Self::CONNECT, self.patience, self.setup.clock);
        let wire = peer.dial()?;
        self.reached = Some(address);
        self.ok("route", format!("from {own}"));
        self.ok("port", format!("{address} accepts connections"));
        Ok((peer, wire))
    }

    /// Says why there is no connection with an address.
    pub fn unreachable(&mut self, address: SocketAddr, why: Unreachable) {
        if let Unreachable::NoRoute(error) = why {
            let next = "check the network of this computer: its address and mask must fit those of the PLC, and the \
                        cable and the adapter must be up";
            self.fail(
                "route",
                "no-route",
                format!("there is no way to {address} ({error})"),
                next,
            );
            return;
        }
        if let Ok(own) = route(address) {
            self.ok("route", format!("from {own}"));
        }
        match why {
            Unreachable::Refused => self.fail(
                "port",
                "port-closed",
                format!("{address} refuses connections: a computer is there, and nothing listens on this port"),
                "switch on the server in the PLC, start its program, or correct the port",
            ),
            Unreachable::Silent => self.fail(
                "port",
                "port-filtered",
                format!("{address} does not answer within {}", Self::CONNECT),
                "check the IP address, whether the PLC is switched on, the cable, and the firewalls on the way: one \
                 that drops packets looks like this",
            ),
            Unreachable::NoRoute(error) | Unreachable::Failed(error) => self.fail(
                "port",
                "connect-failed",
                format!("this computer cannot connect to {address} ({error})"),
                "close other programs that have many connections or files open",
            ),
        };
    }

    /// Checks that a server could listen on `address`: the steps `name` and `port`. False if it could not.
    pub fn can_listen(&mut self, address: &Address) -> bool {
        self.can_have(address, |address| bind(address, None).map(drop))
    }

    /// Checks that a server could receive datagrams on `address`: the steps `name` and `port`. False if it could not.
    pub fn can_receive(&mut self, address: &Address) -> bool {
        self.can_have(address, |address| {
            UdpSocket::bind(address.to_string()).map(drop)
        })
    }

    fn can_have(
        &mut self,
        address: &Address,
        bind: impl FnOnce(&Address) -> std::io::Result<()>,
    ) -> bool {
        if let Err(error) = look_up(address, &**self.setup.clock, self.stop) {
            let next = "write an IP address of this computer, or 0.0.0.0 for all of its networks";
            self.fail("name", "name-unknown", error.to_string(), next);
            return false;
        }
        let Err(error) = bind(address) else {
            let is_local = matches!(&address.host, Host::Ip(ip) if ip.is_loopback());
            let step = self.ok("port", format!("{address} is free"));
            if is_local {
                "only programs on this computer can connect; for a PLC, write the address of the network card, or \
                 0.0.0.0 for all networks"
                    .clone_into(&mut step.next);
            }
            return true;
        };
        let (cause, next) = match error.kind() {
            std::io::ErrorKind::AddrInUse => (
                "port-taken",
                "another program listens there: end it, or give this driver another port; if it is your simulation, \
                 the port is as it should be",
            ),
            std::io::ErrorKind::AddrNotAvailable => (
                "address-not-here",
                "no network card of this computer has this address: write one that it has, or 0.0.0.0 for all",
            ),
            std::io::ErrorKind::PermissionDenied => (
                "port-forbidden",
                "ports below 1024 need a permission: on Linux, setcap cap_net_bind_service=+ep on the program, or \
                 another port",
            ),
            _ => ("cannot-listen", "see the message of the system"),
        };
        self.fail(
            "port",
            cause,
            format!("{address} cannot be listened on ({error})"),
            next,
        );
        false
    }

    /// Says that the bus, or this line of it, has no examination.
    pub fn unexamined(&mut self, why: &str) {
        self.warn(
            "line",
            "not-examined",
            format!("{why} is not examined"),
            "run the driver (tickbus mirror FILE --stats 1s), and read the state of the line",
        );
    }
}
