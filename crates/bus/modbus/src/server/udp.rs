//! The units of a server over UDP: a telegram of Modbus TCP in each datagram.

use std::collections::BTreeMap;
use std::net::{SocketAddr, UdpSocket};
use std::sync::Arc;

use crate::mbap::{self, ADU_LIMIT, Telegram};
use crate::{Exception, refuse};
use tickbus_base::os::{Interest, PollSet};
use tickbus_base::time::{Nanos, Stop};
use tickbus_fieldbus::tcp::no_wait;
use tickbus_fieldbus::{BusError, Port, Renewal};
use tickbus_net::{Address, bind_udp};

use super::units::{Carried, ServedUnits, Source};

/// At most this many datagrams are answered before anything else is done.
const READS: usize = 64;

/// The number of the error with which Windows reports a datagram that is longer than the buffer: `WSAEMSGSIZE`. Others
/// cut it, and have no error of this number.
const TOO_LONG: i32 = 10_040;

/// At most this many answers are held back by a fault.
const HELD: usize = 1000;

/// Serves the units until `stop`.
///
/// # Errors
///
/// The address cannot be listened on, or the system cannot wait.
pub(super) fn serve(
    address: &Address,
    units: &mut ServedUnits,
    clients: usize,
    port: &mut Port,
    stop: &Stop,
) -> Result<(), BusError> {
    let since = port.clock().now();
    port.opening(&format!("beginning to listen on {address} (UDP)"));
    let clock = Arc::clone(port.clock());
    let Some((socket, bound)) = bind_udp(address, &*clock, stop)? else {
        return Ok(());
    };
    port.tell("address", &bound.to_string());
    if !bound.ip().is_loopback() {
        log::info!("listening on {bound}: any computer that reaches this port can act as the peer");
    }
    port.opening(&format!("listening on {bound} (UDP)"));
    let mut set = PollSet::new(stop);
    set.add(0, &socket, Interest::Read)
        .map_err(|error| no_wait(&error))?;
    let mut server = Server {
        units,
        limit: clients,
        clients: BTreeMap::new(),
        held: BTreeMap::new(),
        number: 0,
    };
    let mut now = since;
    port.begin_to_look(since);
    while !stop.is_stopped() {
        let deadline = server.due().min(port.due()).min(port.next_look());
        let deadline = deadline.min(port.stale_at(now));
        set.wait_after(now, &*clock, deadline)
            .map_err(|error| no_wait(&error))?;
        now = clock.now();
        port.look_at_line(now);
        server.read(&socket, now, port);
        server.send_due(&socket, now, port);
        port.observe(now);
    }
    Ok(())
}

struct Server<'a> {
    units: &'a mut ServedUnits,
    /// The most clients.
    limit: usize,
    clients: BTreeMap<SocketAddr, Client>,
    /// Answers that a fault holds back, by the time when they are due and a number.
    held: BTreeMap<(Nanos, u64), Answer>,
    /// The number of the next of them.
    number: u64,
}

/// A client, by the address of its datagrams.
struct Client {
    source: Source,
    /// When it was last heard from.
    heard: Nanos,
    /// When the last answer to it is due.
    due: Nanos,
}

struct Answer {
    to: SocketAddr,
    bytes: Vec<u8>,
    carried: Option<Carried>,
    /// The stations that answer late.
    stations: Vec<usize>,
}

impl Server<'_> {
    /// When the next answer is due.
    fn due(&self) -> Nanos {
        let first = self.held.keys().next();
        first.map_or(Nanos::MAX, |(due, _)| *due)
    }

    /// Answers the datagrams that have arrived.
    fn read(&mut self, socket: &UdpSocket, now: Nanos, port: &mut Port) {
        // One byte more than a telegram shows that a datagram is longer.
        let mut bytes = [0; ADU_LIMIT + 1];
        for _ in 0..READS {
            let (count, from) = match socket.recv_from(&mut bytes) {
                Ok(received) => received,
                Err(error) if error.raw_os_error() == Some(TOO_LONG) => {
                    port.count("modbus-server.damaged");
                    self.units.damaged(true);
                    continue;
                }
                // Windows reports here that an earlier answer had no receiver.
                Err(_) => return,
            };
            port.read(0, count);
            let Some((answer, late)) = self.datagram(from, &bytes[..count], now, port) else {
                continue;
            };
            let client = self.clients.get_mut(&from);
            let due = client.map_or(now, |client| {
                client.due = client.due.max(now + late);
                client.due
            });
            if due <= now {
                self.send(socket, &answer, port);
            } else if self.held.len() < HELD {
                self.held.insert((due, self.number), answer);
                self.number += 1;
            } else {
                port.count("clients.dropped");
            }
        }
        port.look_leaves_some();
    }

    fn send_due(&mut self, socket: &UdpSocket, now: Nanos, port: &mut Port) {
        while let Some(first) = self.held.first_entry()
            && first.key().0 <= now
        {
            let answer = first.remove();
            // What would go out over a line that is down is lost, and a dead station sends nothing.
            let mut stations = answer.stations.iter();
            if port.is_up(now) && stations.all(|at| port.is_station_up(*at, now)) {
                self.send(socket, &answer, port);
            } else if let Some(client) = self.clients.get_mut(&answer.to) {
                Renewal::lost_all(&mut client.source.renewals, now, port.max_age());
            }
        }
    }

    /// Sends an answer. One that the system does not accept is lost, as on the line.
    fn send(&self, socket: &UdpSocket, answer: &Answer, port: &mut Port) {
        if socket.send_to(&answer.bytes, answer.to).is_err() {
            return;
        }
        port.wrote(0, answer.bytes.len(), true);
        if let Some(carried) = &answer.carried {
            self.units.carried(carried, port);
        }
    }

    /// The answer to a datagram, and how late a fault makes it.
    fn datagram(
        &mut self,
        from: SocketAddr,
        bytes: &[u8],
        now: Nanos,
        port: &mut Port,
    ) -> Option<(Answer, Nanos)> {
        let whole = Telegram::parse(bytes).ok().flatten();
        let whole = whole.filter(|(_, length)| *length == bytes.len());
        let Some((telegram, _)) = whole else {
            // Anybody can send datagrams: nobody is blamed.
            port.count("modbus-server.damaged");
            self.units.damaged(bytes.len() > ADU_LIMIT);
            return None;
        };
        if !self.knows(from, now, port) {
            return None;
        }
        let client = self.clients.get_mut(&from)?;
        client.heard = now;
        if !port.is_up(now) {
            Renewal::lost_all(&mut client.source.renewals, now, port.max_age());
            return None;
        }
        self.units.heard();
        let Telegram {
            transaction,
            unit,
            pdu,
        } = telegram;
        let mut bytes = Vec::new();
        let mut carried = mbap::append(transaction, unit, &mut bytes, |reply| {
            if let Some(station) = self.units.station(unit) {
                let source = &mut client.source;
                return self.units.answer(station, now, pdu, source, reply, port);
            }
            port.count("modbus-server.unknown_unit");
            refuse(pdu[0], Exception::GATEWAY_TARGET_FAILED, reply);
            None
        });
        if let Some(wrong) = port.take_wrong() {
            mbap::spoil(&mut bytes, 0, wrong);
            carried = None;
        }
        let late = port.take_lateness();
        let stations = if late > Nanos::ZERO {
            port.take_late_stations()
        } else {
            Vec::new()
        };
        port.running("a client is talking");
        let answer = Answer {
            to: from,
            bytes,
            carried,
            stations,
        };
        (!answer.bytes.is_empty()).then_some((answer, late))
    }

    /// Returns true if `from` is a client, perhaps from now on. If there are too many, one that has been silent for longer
    /// than `max_age` leaves.
    fn knows(&mut self, from: SocketAddr, now: Nanos, port: &Port) -> bool {
        if self.clients.contains_key(&from) {
            return true;
        }
        if self.clients.len() >= self.limit {
            let clients = self.clients.iter();
            let silent = clients.min_by_key(|(_, client)| client.heard);
            let silent = silent.map(|(address, client)| (*address, client.heard));
            match silent {
                Some((address, heard)) if now - heard > port.max_age() => {
                    self.clients.remove(&address);
                }
                _ => {
                    port.count("clients.turned_away");
                    return false;
                }
            }
        }
        let renewals = vec![Renewal::of_new_client(); self.units.len()];
        let source = Source {
            renewals: renewals.into(),
            writer: Some(Arc::new(from)),
            may_write: true,
        };
        let client = Client {
            source,
            heard: now,
            due: now,
        };
        self.clients.insert(from, client);
        true
    }
}
