//! The search by datagrams: a question to each address at a bounded rate, and more to those that answer.

use std::collections::BTreeSet;
use std::io;
use std::net::{IpAddr, Ipv4Addr, Ipv6Addr, SocketAddr, UdpSocket};
use std::sync::Arc;

use tickbus_base::time::{Clock, Nanos, Stop};
use tickbus_fieldbus::examine::{Datagrams, Peer, Search, Searching};

use crate::device::{ANSWER, CONNECT, Device, legible};
use crate::plan::Plan;

/// How often the sockets are read while an answer is awaited.
const TURN: Nanos = Nanos::from_millis(5);

/// The servers of the plan's buses that answer datagrams.
///
/// # Errors
///
/// The system has no socket.
pub(crate) fn find(plan: &Plan, clock: &Arc<dyn Clock>, stop: &Stop) -> io::Result<Vec<Device>> {
    let mut devices = Vec::new();
    for (search, port) in &plan.searches {
        let Some(datagrams) = search.datagrams else {
            continue;
        };
        let usual = plan.searches.iter().map(|(_, port)| *port);
        let usual: BTreeSet<u16> = usual.collect();
        // An address of its own port, too: whatever speaks there.
        let at_port = plan.addresses.iter().copied();
        let at_port = at_port.filter(|own| own.port() == *port || !usual.contains(&own.port()));
        let answered = question(plan, &datagrams, at_port.collect(), (&**clock, stop))?;
        for address in answered {
            if !stop.is_stopped() {
                devices.extend(ask(plan, search, address, clock));
            }
        }
    }
    Ok(devices)
}

/// The addresses that answer a question.
fn question(
    plan: &Plan,
    datagrams: &Datagrams,
    mut silent: Vec<SocketAddr>,
    (clock, stop): (&dyn Clock, &Stop),
) -> io::Result<BTreeSet<SocketAddr>> {
    let units = match &plan.units[..] {
        [] => datagrams.units,
        listed => listed,
    };
    let sockets = Sockets::open(&silent)?;
    let mut answered = BTreeSet::new();
    let interval = Nanos(Nanos::from_secs(1).0 / i64::from(plan.rate.max(1)));
    for unit in units {
        let question = (datagrams.question)(*unit);
        let mut due = clock.now();
        for address in &silent {
            if stop.is_stopped() {
                return Ok(answered);
            }
            sockets.send(&question, *address);
            sockets.receive(&mut answered);
            due += interval;
            clock.wait_until(due, stop);
        }
        let end = clock.now() + ANSWER;
        while clock.now() < end && !stop.is_stopped() {
            sockets.receive(&mut answered);
            clock.wait_until(end.min(clock.now() + TURN), stop);
        }
        sockets.receive(&mut answered);
        silent.retain(|address| !answered.contains(address));
    }
    // Somebody who was not asked is not believed.
    answered.retain(|address| plan.addresses.contains(address));
    Ok(answered)
}

/// Asks an address that has answered who it is.
fn ask(plan: &Plan, search: &Search, address: SocketAddr, clock: &Arc<dyn Clock>) -> Vec<Device> {
    let peer = Peer::new(address, CONNECT, ANSWER, clock).by_datagrams();
    let Ok(wire) = peer.dial() else {
        return Vec::new();
    };
    let found = (search.ask)(Searching {
        peer,
        wire,
        units: &plan.units,
    });
    let device = |found| Device {
        address,
        bus: search.bus,
        found: legible(found),
    };
    found.into_iter().map(device).collect()
}

/// A socket for each version of IP that is needed.
struct Sockets(Vec<UdpSocket>);

impl Sockets {
    fn open(addresses: &[SocketAddr]) -> io::Result<Self> {
        let any: [(bool, IpAddr); 2] = [
            (false, Ipv4Addr::UNSPECIFIED.into()),
            (true, Ipv6Addr::UNSPECIFIED.into()),
        ];
        let needed = any.into_iter().filter(|(is_6, _)| {
            let mut addresses = addresses.iter();
            addresses.any(|address| address.is_ipv6() == *is_6)
        });
        let sockets = needed.map(|(_, any)| {
            let socket = UdpSocket::bind((any, 0))?;
            socket.set_nonblocking(true)?;
            Ok(socket)
        });
        sockets.collect::<io::Result<_>>().map(Self)
    }

    /// Sends to an address. What cannot be sent is not answered.
    fn send(&self, bytes: &[u8], address: SocketAddr) {
        let is_own = |socket: &&UdpSocket| {
            socket
                .local_addr()
                .is_ok_and(|own| own.is_ipv6() == address.is_ipv6())
        };
        if let Some(socket) = self.0.iter().find(is_own) {
            let _ = socket.send_to(bytes, address);
        }
    }

    /// Takes all answers that have come.
    fn receive(&self, answered: &mut BTreeSet<SocketAddr>) {
        let mut bytes = [0; 512];
        for socket in &self.0 {
            loop {
                match socket.recv_from(&mut bytes) {
                    Ok((_, from)) => {
                        answered.insert(from);
                    }
                    // Windows reports that a port is closed like this.
                    Err(error) if error.kind() == io::ErrorKind::ConnectionReset => {}
                    Err(_) => break,
                }
            }
        }
    }
}
