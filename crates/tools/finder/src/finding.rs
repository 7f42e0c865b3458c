//! The search: connections at a bounded rate, and questions to those that accept one.

use std::io;
use std::net::SocketAddr;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread;

use tickbus_base::os::raise_open_files;
use tickbus_base::time::{Clock, Stop};
use tickbus_fieldbus::examine::{Found, Peer, Search, Searching};
use tickbus_net::{Limits, Swept, sweep};

use crate::Plan;
use crate::datagrams;
use crate::device::{ANSWER, CONNECT, Device, legible};

/// How many devices are asked at the same time.
const ASKED: usize = 64;

/// The most files that one device takes while it is asked, with those of a further connection and of OPC UA's reactor.
const FILES: usize = 8;

/// The most connections that wait to be asked: some firewalls accept connections to every address.
const WAITING: usize = 256;

/// The result of a search.
#[derive(Clone, Debug, Default)]
pub struct Findings {
    /// The devices, by address and bus.
    pub devices: Vec<Device>,
    /// Ports that accept connections, but speak none of the buses.
    pub unknown: Vec<SocketAddr>,
    /// The connections that were tried.
    pub swept: Swept,
}

/// Searches. Ends early, with what was found so far, at `stop`: connections that still wait are not asked then.
///
/// # Errors
///
/// The system cannot wait for sockets, or has no more files or threads.
pub fn find(plan: &Plan, clock: &Arc<dyn Clock>, stop: &Stop) -> io::Result<Findings> {
    let mut findings = sweep_all(plan, clock, stop)?;
    if plan.udp {
        findings.devices.extend(datagrams::find(plan, clock, stop)?);
    }
    // Only those whom the user's own addresses name are believed: a chain of them has no end.
    if let Some(further) = plan.further(&findings.devices, &**clock, stop) {
        let Findings {
            devices,
            unknown,
            swept,
        } = sweep_all(&further, clock, stop)?;
        findings.devices.extend(devices);
        findings.unknown.extend(unknown);
        findings.swept.add(swept);
    }
    findings.devices.sort_by(|a: &Device, b| {
        (a.address, a.bus, &a.found.facts).cmp(&(b.address, b.bus, &b.found.facts))
    });
    findings.unknown.sort_unstable();
    Ok(findings)
}

/// Connects to each address of the plan once, and asks those that accept.
fn sweep_all(plan: &Plan, clock: &Arc<dyn Clock>, stop: &Stop) -> io::Result<Findings> {
    let limits = Limits {
        rate: plan.rate,
        patience: CONNECT,
    };
    let devices = Mutex::new(Vec::new());
    let unknown = Mutex::new(Vec::new());
    let (sender, receiver) = std::sync::mpsc::channel();
    let receiver = Mutex::new(receiver);
    let files = raise_open_files();
    // A quarter of the files is for attempts, and half of them for devices that are asked.
    let asked = ASKED
        .min(files / 2 / FILES)
        .clamp(1, plan.addresses.len().max(1));
    let most_waiting = WAITING.min(files / 8).max(1);
    let waiting = AtomicUsize::new(0);
    let work = || {
        loop {
            let next = receiver
                .lock()
                .unwrap_or_else(PoisonError::into_inner)
                .recv();
            let Ok((address, stream)) = next else {
                return;
            };
            waiting.fetch_sub(1, Ordering::Relaxed);
            if stop.is_stopped() {
                continue;
            }
            let found = ask(plan, address, stream, clock);
            if found.is_empty() {
                unknown
                    .lock()
                    .unwrap_or_else(PoisonError::into_inner)
                    .push(address);
            } else {
                devices
                    .lock()
                    .unwrap_or_else(PoisonError::into_inner)
                    .extend(found);
            }
        }
    };
    let swept = thread::scope(|scope| {
        for number in 0..asked {
            let builder = thread::Builder::new().name(format!("tickbus-ask-{number}"));
            let spawned = builder.spawn_scoped(scope, work);
            // One is enough to end; without any nobody would be asked.
            if let (Err(error), 0) = (spawned, number) {
                return Err(error);
            }
        }
        let sender = sender;
        sweep(
            plan.addresses.iter().copied(),
            limits,
            &**clock,
            stop,
            || waiting.load(Ordering::Relaxed) < most_waiting,
            |address, stream| {
                waiting.fetch_add(1, Ordering::Relaxed);
                // The receivers live as long as this scope.
                let _ = sender.send((address, stream));
            },
        )
    })?;
    Ok(Findings {
        devices: devices.into_inner().unwrap_or_else(PoisonError::into_inner),
        unknown: unknown.into_inner().unwrap_or_else(PoisonError::into_inner),
        swept,
    })
}

/// Asks whether a port speaks one of the buses that are searched at it.
fn ask(
    plan: &Plan,
    address: SocketAddr,
    stream: std::net::TcpStream,
    clock: &Arc<dyn Clock>,
) -> Vec<Device> {
    let peer = Peer::new(address, CONNECT, ANSWER, clock);
    let mut first = Some(stream);
    let at_port = plan
        .searches
        .iter()
        .filter(|(_, port)| *port == address.port());
    let mut searches: Vec<&Search> = at_port.map(|(search, _)| search).collect();
    if searches.is_empty() {
        // A target with a port of its own: whatever speaks there.
        searches = plan.searches.iter().map(|(search, _)| search).collect();
    }
    for search in searches {
        let wire = match first.take() {
            Some(stream) => peer.over(stream),
            None => peer.dial(),
        };
        let Ok(wire) = wire else {
            return Vec::new();
        };
        let searching = Searching {
            peer: peer.clone(),
            wire,
            units: &plan.units,
        };
        let found = (search.ask)(searching);
        if !found.is_empty() {
            let device = |found: Found| Device {
                address,
                bus: search.bus,
                found: legible(found),
            };
            return found.into_iter().map(device).collect();
        }
    }
    Vec::new()
}

/// The device at an address, if it speaks one of these buses.
pub(crate) fn speaks(
    address: SocketAddr,
    searches: &[Search],
    clock: &Arc<dyn Clock>,
) -> Option<Device> {
    let peer = Peer::new(address, CONNECT, ANSWER, clock);
    searches.iter().find_map(|search| {
        let searching = Searching {
            peer: peer.clone(),
            wire: peer.dial().ok()?,
            units: &[],
        };
        let found = (search.ask)(searching).into_iter().next()?;
        Some(Device {
            address,
            bus: search.bus,
            found: legible(found),
        })
    })
}

#[cfg(all(test, target_os = "linux"))]
mod tests {
    use super::*;
    use std::net::Ipv4Addr;
    use std::sync::LazyLock;
    use tickbus_base::time::Monotonic;

    static STOP: LazyLock<Stop> = LazyLock::new(Stop::new);
    static ASKS: AtomicUsize = AtomicUsize::new(0);

    /// Waits for an answer that does not come, and ends the search, as Ctrl-C does.
    fn in_vain(mut searching: Searching<'_>) -> Vec<Found> {
        ASKS.fetch_add(1, Ordering::Relaxed);
        let deadline = searching.wire.deadline();
        let _ = searching.wire.receive(&mut Vec::new(), deadline);
        STOP.stop();
        Vec::new()
    }

    /// As behind a firewall that accepts connections to every address.
    #[test]
    fn connections_do_not_pile_up_and_at_the_end_nobody_who_waits_is_asked() {
        let listener = std::net::TcpListener::bind("0.0.0.0:0").expect("a port");
        let port = listener.local_addr().expect("an address").port();
        let first = Ipv4Addr::new(127, 21, 0, 1).to_bits();
        let addresses = (first..first + 3000).map(|bits| (Ipv4Addr::from_bits(bits), port).into());
        let search = Search {
            bus: "none",
            port,
            ask: in_vain,
            datagrams: None,
        };
        let plan = Plan {
            searches: vec![(search, port)],
            addresses: addresses.collect(),
            rate: 2000,
            units: Vec::new(),
            udp: false,
        };
        thread::spawn(move || {
            let mut held = Vec::new();
            held.extend(listener.incoming());
        });
        let clock: Arc<dyn Clock> = Monotonic::shared();
        let findings = find(&plan, &clock, &STOP).expect("the system can");
        let asks = ASKS.load(Ordering::Relaxed);
        assert!((1..=2 * ASKED).contains(&asks), "{asks}");
        let attempts = findings.swept.attempts;
        // Some are under way when there is no more room.
        assert!(attempts < ASKED + WAITING + 300, "{attempts}");
    }
}
