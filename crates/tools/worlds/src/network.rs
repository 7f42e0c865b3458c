//! The network of a simulated world: TCP as its ends see it, with everything that may happen to bytes on their way.

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::io::{self, ErrorKind};
use std::net::{Ipv4Addr, SocketAddr};

use tickbus_base::time::{Interest, Ready};

use crate::delivery::Delivery;
use crate::random::Random;
use crate::wire::{self, Wire};

/// Returns the listener of a process, or `None` if the process was killed before it listened.
///
/// # Panics
///
/// If it cannot listen for another reason, such as an address in use: no course of a world permits that.
pub(crate) fn unless_killed<L>(bound: io::Result<L>) -> Option<L> {
    match bound {
        Ok(listener) => Some(listener),
        Err(error) if error.kind() == ErrorKind::AddrNotAvailable => None,
        Err(error) => panic!("nobody else listens there: {error}"),
    }
}

/// The behaviour of a world's network.
#[derive(Clone, Copy, Debug)]
pub struct Conditions {
    /// The minimum and the maximum latency of bytes, in ns.
    pub latency: (i64, i64),
    /// On average, one write in this many arrives in pieces, each at its own time; 0 for never.
    pub splits: u64,
    /// The number of unread bytes that a connection holds.
    pub capacity: usize,
}

impl Default for Conditions {
    fn default() -> Self {
        Self {
            latency: (1_000, 50_000),
            splits: 0,
            capacity: 64 * 1024,
        }
    }
}

/// The time after which an end that sends nothing checks that the other end is still there, in ns.
const KEEP_ALIVE: i64 = 1_000_000_000;

/// Bytes on their way, or waiting to be read.
#[derive(Debug)]
struct Piece {
    /// When they arrive.
    at: i64,
    /// The time since which the sender had run without a wait when it sent them.
    sent: i64,
    /// The sender's process.
    from: usize,
    /// True for the piece with the last bytes of a write.
    is_last: bool,
    bytes: Vec<u8>,
    read: usize,
}

#[derive(Debug)]
struct End {
    process: usize,
    own: SocketAddr,
    peer: SocketAddr,
    other: u64,
    /// When the attempt to connect succeeds or fails; `error` has the failure.
    connected: i64,
    error: Option<ErrorKind>,
    incoming: VecDeque<Piece>,
    /// Nothing arrives before this time.
    held_until: i64,
    /// When the end of what the peer sends arrives.
    fin: Option<i64>,
    /// When the connection breaks for this end.
    reset: Option<i64>,
    has_shut_down: bool,
    /// The time since which the sender had run without a wait when it began a write that the connection has not fully
    /// taken.
    owed_since: Option<i64>,
}

#[derive(Debug)]
struct Listening {
    address: SocketAddr,
    process: usize,
    waiting: VecDeque<u64>,
}

/// All sockets of a world.
#[derive(Debug, Default)]
pub(crate) struct Network {
    pub(crate) conditions: Conditions,
    ends: BTreeMap<u64, End>,
    listeners: BTreeMap<u64, Listening>,
    next: u64,
    ports: u16,
    /// The processes that were killed. One that was suspended meanwhile runs on for a moment: it reaches nobody.
    killed: BTreeSet<usize>,
    /// The time until which the cable is pulled.
    cut_until: i64,
    /// When the newest connection of each process was made, even if it has ended.
    last_connected: BTreeMap<usize, i64>,
    /// The serial line.
    pub(crate) wire: Wire,
    /// The deliveries that each process has read.
    pub(crate) deliveries: BTreeMap<usize, Vec<Delivery>>,
}

impl End {
    fn room(&self, capacity: usize) -> usize {
        let held: usize = self
            .incoming
            .iter()
            .map(|piece| piece.bytes.len() - piece.read)
            .sum();
        capacity.saturating_sub(held)
    }

    fn readable_at(&self) -> i64 {
        let piece = self.incoming.front().map_or(i64::MAX, |piece| piece.at);
        let fin = self.fin.unwrap_or(i64::MAX);
        piece.min(fin).min(self.reset.unwrap_or(i64::MAX))
    }
}

impl Network {
    /// When the newest connection of a process was made.
    pub(crate) fn last_connected(&self, process: usize) -> i64 {
        self.last_connected
            .get(&process)
            .copied()
            .unwrap_or_default()
    }

    fn identity(&mut self) -> u64 {
        self.next += 1;
        self.next
    }

    /// The next time at which one of these sockets is ready.
    pub(crate) fn due(&self, sockets: &[(u64, Interest)]) -> i64 {
        let due = sockets.iter().map(|(id, interest)| {
            let (read, write) = self.ready_at(*id, *interest);
            read.min(write)
        });
        due.min().unwrap_or(i64::MAX)
    }

    /// The times at which a socket can be read and written; `i64::MAX` for a direction without interest.
    fn ready_at(&self, id: u64, interest: Interest) -> (i64, i64) {
        let (reads, writes) = (interest != Interest::Write, interest != Interest::Read);
        if let Some(listening) = self.listeners.get(&id) {
            let waiting = listening.waiting.iter();
            // Accepting reports a connection that is already closed.
            let connected = waiting.map(|id| self.ends.get(id).map_or(0, |end| end.connected));
            let connected = connected.min().filter(|_| reads);
            return (connected.unwrap_or(i64::MAX), i64::MAX);
        }
        let of_interest = |at: i64, is: bool| if is { at } else { i64::MAX };
        if let Some(at) = self.wire.readable_at(id) {
            return (of_interest(at, reads), of_interest(i64::MIN, writes));
        }
        let Some(end) = self.ends.get(&id) else {
            return (of_interest(i64::MIN, reads), of_interest(i64::MIN, writes));
        };
        let read = of_interest(end.readable_at().max(end.connected), reads);
        if !writes {
            return (read, i64::MAX);
        }
        let reset = end.reset.unwrap_or(i64::MAX);
        let other = self.ends.get(&end.other);
        let has_room = other.is_none_or(|other| other.room(self.conditions.capacity) > 0);
        let write = if has_room { end.connected } else { i64::MAX };
        (read, write.min(reset))
    }

    pub(crate) fn look(
        &self,
        sockets: &[(usize, u64, Interest)],
        now: i64,
        ready: &mut Vec<Ready>,
    ) {
        for (key, id, interest) in sockets {
            let (read, write) = self.ready_at(*id, *interest);
            let found = Ready {
                key: *key,
                is_readable: read <= now,
                is_writable: write <= now,
            };
            if found.is_readable || found.is_writable {
                ready.push(found);
            }
        }
    }

    pub(crate) fn listen(&mut self, process: usize, addresses: &[SocketAddr]) -> io::Result<u64> {
        let address = *addresses.first().ok_or(ErrorKind::InvalidInput)?;
        if self.killed.contains(&process) {
            return Err(ErrorKind::AddrNotAvailable.into());
        }
        let mut taken = self.listeners.values();
        if taken.any(|listening| listening.address.port() == address.port()) {
            return Err(ErrorKind::AddrInUse.into());
        }
        let id = self.identity();
        self.listeners.insert(
            id,
            Listening {
                address,
                process,
                waiting: VecDeque::new(),
            },
        );
        Ok(id)
    }

    pub(crate) fn connect(
        &mut self,
        address: SocketAddr,
        process: usize,
        now: i64,
        random: &mut Random,
    ) -> u64 {
        self.ports += 1;
        let own = SocketAddr::from((Ipv4Addr::LOCALHOST, 40_000 + self.ports));
        let (one, other) = (self.identity(), self.identity());
        let (least, most) = self.conditions.latency;
        let end = |process, own, peer, other, connected, error| End {
            process,
            own,
            peer,
            other,
            connected,
            error,
            incoming: VecDeque::new(),
            held_until: 0,
            fin: None,
            reset: None,
            has_shut_down: false,
            owed_since: None,
        };
        // While nobody answers, the system retries after 1, 3 and 7 s.
        let tries = [0, 1, 3, 7].map(|seconds| now + seconds * 1_000_000_000);
        let heard = tries.into_iter().find(|at| *at >= self.cut_until);
        let there = heard.unwrap_or(tries[3]) + random.within(least, most);
        let back = there + random.within(least, most);
        let listener = self
            .listeners
            .values_mut()
            .find(|listening| listening.address.port() == address.port())
            .filter(|_| !self.killed.contains(&process));
        let Some(listening) = listener else {
            let refused = Some(ErrorKind::ConnectionRefused);
            self.ends
                .insert(one, end(process, own, address, other, back, refused));
            return one;
        };
        listening.waiting.push_back(other);
        let theirs = listening.process;
        self.last_connected.insert(process, back);
        self.last_connected.insert(theirs, there);
        self.ends
            .insert(one, end(process, own, address, other, back, None));
        self.ends
            .insert(other, end(theirs, address, own, one, there, None));
        one
    }

    /// Breaks every connection, as a device in the middle that restarts does.
    pub(crate) fn reset_all(&mut self, now: i64) {
        for end in self.ends.values_mut() {
            end.reset.get_or_insert(now);
            end.incoming.clear();
        }
        self.wire.unplug();
    }

    /// Holds back everything for `span`; then all of it arrives.
    pub(crate) fn hold_all(&mut self, now: i64, span: i64) {
        for end in self.ends.values_mut() {
            end.held_until = end.held_until.max(now + span);
            for piece in &mut end.incoming {
                if piece.at > now {
                    piece.at = piece.at.max(end.held_until);
                }
            }
            // The end of a connection does not overtake its last bytes.
            for ended in [&mut end.fin, &mut end.reset].into_iter().flatten() {
                if *ended > now {
                    *ended = (*ended).max(end.held_until);
                }
            }
        }
        self.cut_until = self.cut_until.max(now + span);
        self.wire.cut(now + span);
    }

    /// Closes everything that a killed process has left, as the system does.
    pub(crate) fn kill(&mut self, process: usize, now: i64) {
        self.killed.insert(process);
        self.wire.kill(process);
        self.listeners
            .retain(|_, listening| listening.process != process);
        let ids: Vec<u64> = self
            .ends
            .iter()
            .filter(|(_, end)| end.process == process)
            .map(|(id, _)| *id)
            .collect();
        for id in ids {
            self.close(id, now);
        }
    }

    pub(crate) fn close(&mut self, id: u64, now: i64) {
        let latency = self.conditions.latency.1;
        let Some(end) = self.ends.remove(&id) else {
            return;
        };
        if let Some(other) = self.ends.get_mut(&end.other) {
            let last = other.incoming.back().map_or(now, |piece| piece.at);
            let at = last.max(now + latency).max(other.held_until);
            if end.incoming.iter().any(|piece| piece.at <= now) {
                other.reset.get_or_insert(at);
            } else if !end.has_shut_down {
                other.fin.get_or_insert(at);
            }
        }
    }

    /// Closes a connection like [`close`](Self::close), but drops bytes that would arrive after the reset.
    pub(crate) fn close_by_reset(&mut self, id: u64, now: i64) {
        let Some(end) = self.ends.remove(&id) else {
            return;
        };
        let last = now + self.conditions.latency.1;
        if let Some(other) = self.ends.get_mut(&end.other) {
            other.incoming.retain(|piece| piece.at <= last);
            // Nobody repeats a reset: while the cable is pulled it is lost, and the other end notices by its
            // keep-alive.
            let is_cut = other.held_until > last;
            let found = if is_cut {
                other.held_until + KEEP_ALIVE
            } else {
                last
            };
            other.reset.get_or_insert(found);
        }
    }

    /// Opens a port of the serial line.
    pub(crate) fn open_serial(&mut self, process: usize, now: i64) -> u64 {
        let id = self.identity();
        if self.killed.contains(&process) {
            return id;
        }
        self.wire.open(id, process);
        self.last_connected.insert(process, now);
        id
    }

    /// Reads from a port of the serial line.
    pub(crate) fn read_serial(
        &mut self,
        id: u64,
        buffer: &mut [u8],
        now: i64,
    ) -> io::Result<usize> {
        self.wire.read(id, buffer, now, &mut self.deliveries)
    }

    /// Writes to a port of the serial line. If connections carry their bytes in pieces, some telegrams are damaged
    /// here.
    pub(crate) fn write_serial(
        &mut self,
        id: u64,
        bytes: &[u8],
        times: (i64, i64),
        random: &mut Random,
    ) -> io::Result<usize> {
        let conditions = wire::Conditions {
            latency: self.conditions.latency,
            damages: self.conditions.splits * 20,
        };
        self.wire.write(id, bytes, times, conditions, random)
    }

    /// The next connection of a listener, and the address of the other end.
    pub(crate) fn accept(&mut self, id: u64, now: i64) -> io::Result<(u64, SocketAddr)> {
        let listening = self.listeners.get_mut(&id).ok_or(ErrorKind::InvalidInput)?;
        let ends = &self.ends;
        let connected = |id: &u64| ends.get(id).map_or(0, |end| end.connected);
        let place = listening.waiting.iter().position(|id| connected(id) <= now);
        let place = place.ok_or(ErrorKind::WouldBlock)?;
        let id = listening.waiting.remove(place).expect("it was just found");
        let end = self.ends.get(&id).ok_or(ErrorKind::ConnectionAborted)?;
        Ok((id, end.peer))
    }

    /// Closes a listener.
    pub(crate) fn close_listener(&mut self, id: u64, now: i64) {
        if let Some(listening) = self.listeners.remove(&id) {
            for id in listening.waiting {
                self.close(id, now);
            }
        }
    }

    /// Closes the sending direction of a connection.
    pub(crate) fn shut_down(&mut self, id: u64, now: i64) -> io::Result<()> {
        let latency = self.conditions.latency.1;
        let end = self.ends.get_mut(&id).ok_or(ErrorKind::NotConnected)?;
        end.has_shut_down = true;
        let other = end.other;
        if let Some(other) = self.ends.get_mut(&other) {
            let last = other.incoming.back().map_or(now, |piece| piece.at);
            let at = last.max(now + latency).max(other.held_until);
            other.fin.get_or_insert(at);
        }
        Ok(())
    }

    /// The addresses of a socket and of its other end.
    pub(crate) fn addresses(&self, id: u64) -> io::Result<(SocketAddr, SocketAddr)> {
        if let Some(listening) = self.listeners.get(&id) {
            return Ok((listening.address, listening.address));
        }
        let end = self.ends.get(&id).ok_or(ErrorKind::NotConnected)?;
        Ok((end.own, end.peer))
    }

    /// Takes the reason why connecting failed.
    pub(crate) fn take_error(&mut self, id: u64) -> io::Result<Option<ErrorKind>> {
        let end = self.ends.get_mut(&id).ok_or(ErrorKind::NotConnected)?;
        Ok(end.error.take())
    }

    pub(crate) fn read(&mut self, id: u64, buffer: &mut [u8], now: i64) -> io::Result<usize> {
        let end = self.ends.get_mut(&id).ok_or(ErrorKind::NotConnected)?;
        if end.connected > now {
            return Err(ErrorKind::WouldBlock.into());
        }
        // Bytes that came before the connection broke can still be read, as on Linux.
        let until = now.min(end.reset.unwrap_or(i64::MAX));
        let mut count = 0;
        let log = self.deliveries.entry(end.process).or_default();
        while let Some(piece) = end.incoming.front_mut()
            && piece.at <= until
            && count < buffer.len()
        {
            let rest = &piece.bytes[piece.read..];
            let taken = rest.len().min(buffer.len() - count);
            buffer[count..count + taken].copy_from_slice(&rest[..taken]);
            count += taken;
            piece.read += taken;
            if piece.read == piece.bytes.len() {
                log.push(Delivery {
                    at: piece.at,
                    sent: piece.sent,
                    from: piece.from,
                    is_whole: piece.is_last,
                });
                end.incoming.pop_front();
            }
        }
        if count > 0 || buffer.is_empty() {
            return Ok(count);
        }
        if end.fin.is_some_and(|at| at <= until) {
            return Ok(0);
        }
        if end.reset.is_some_and(|at| at <= now) {
            return Err(ErrorKind::ConnectionReset.into());
        }
        Err(ErrorKind::WouldBlock.into())
    }

    pub(crate) fn write(
        &mut self,
        id: u64,
        bytes: &[u8],
        (now, sent): (i64, i64),
        random: &mut Random,
    ) -> io::Result<usize> {
        let end = self.ends.get(&id).ok_or(ErrorKind::NotConnected)?;
        if end.reset.is_some_and(|at| at <= now) {
            return Err(ErrorKind::ConnectionReset.into());
        }
        if end.has_shut_down {
            return Err(ErrorKind::BrokenPipe.into());
        }
        if end.connected > now {
            return Err(ErrorKind::WouldBlock.into());
        }
        let (conditions, own, other, from) = (self.conditions, id, end.other, end.process);
        let (least, most) = conditions.latency;
        let Some(room) = self
            .ends
            .get(&other)
            .map(|other| other.room(conditions.capacity))
        else {
            // The other end is closed. Its computer reports that, but not before what it sent earlier has arrived.
            let end = self.ends.get_mut(&own).expect("it was just there");
            let told = (now + most).max(end.held_until);
            end.reset.get_or_insert(told);
            return Ok(bytes.len());
        };
        let count = bytes.len().min(room);
        // Bytes that the connection does not take at once are old when it does.
        let end = self.ends.get_mut(&own).expect("it was just there");
        let sent = end.owed_since.unwrap_or(sent);
        end.owed_since = (count < bytes.len()).then_some(sent);
        if count == 0 {
            return Err(ErrorKind::WouldBlock.into());
        }
        let other = self.ends.get_mut(&other).expect("it was just there");
        let mut rest = &bytes[..count];
        let splits = conditions.splits > 0 && random.once_in(conditions.splits);
        while !rest.is_empty() {
            let length = if splits {
                1 + usize::try_from(random.below(rest.len() as u64)).expect("a length")
            } else {
                rest.len()
            };
            let last = other.incoming.back().map_or(0, |piece| piece.at);
            let at = (now + random.within(least, most))
                .max(last)
                .max(other.held_until);
            let (piece, further) = rest.split_at(length);
            let is_last = further.is_empty() && count == bytes.len();
            other.incoming.push_back(Piece {
                at,
                sent,
                from,
                is_last,
                bytes: piece.to_vec(),
                read: 0,
            });
            rest = further;
        }
        Ok(count)
    }
}
