//! A dispatcher's knowledge of the other dispatchers in its laboratory. No I/O; no knowledge of clients and lines.

pub(crate) mod link;
pub(crate) mod message;

use std::collections::{BTreeMap, BTreeSet, HashMap, VecDeque};
use std::ops::Bound;

use tickbus_base::time::Nanos;

use crate::board::Place;
use crate::channel::Channel;
use crate::host::{HostId, Rank};
use crate::name::{LONGEST_NAME, is_name};
use crate::patch::Patch;

use link::Link;
use message::{Body, Joint, Letter, to_wire};

/// Above all numbers of wants, which appear in lines of values.
pub(crate) const MOST_WANTS: u32 = 10_000_000;

/// A dispatcher's identity in its laboratory.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Identity {
    /// A number that no other process has.
    pub host: HostId,
    /// The name of its computer, for people.
    pub name: String,
    /// The time of day at the zero of the dispatcher's clock, in nanoseconds since 1970. A rough value will do: of two
    /// clients that took one name on two hosts while these were cut off, the earlier one keeps it.
    pub since: u64,
}

impl Identity {
    /// `name` may be any text: characters that a name cannot have are replaced by `-`.
    pub fn new(host: HostId, name: &str, since: u64) -> Self {
        let letters = name.chars().take(LONGEST_NAME);
        let letters = letters.map(|letter| match letter {
            'a'..='z' | 'A'..='Z' | '0'..='9' | '_' | '-' | '.' => letter,
            _ => '-',
        });
        let name: String = letters.collect();
        let name = if is_name(&name) {
            name
        } else {
            "host".to_owned()
        };
        Self { host, name, since }
    }
}

/// This dispatcher among the others.
#[derive(Debug)]
pub(crate) struct Federation {
    pub(crate) identity: Identity,
    pub(crate) hosts: BTreeMap<HostId, Host>,
    /// Names that several clients have, with their seats. The first client keeps the name.
    pub(crate) rivals: BTreeMap<String, BTreeMap<Rank, usize>>,
    pub(crate) news: VecDeque<String>,
    pub(crate) next_beat: Nanos,
    /// The last complaint about letters that cannot be read, so that it is not repeated for each of them.
    pub(crate) complaint: String,
    streams: u64,
    requests: u32,
    /// The host that was served last.
    served: HostId,
}

/// Another dispatcher.
#[derive(Debug)]
pub(crate) struct Host {
    pub(crate) link: Link,
    /// The name of its computer; empty until the host has sent it, and while it is cut off.
    pub(crate) name: String,
    /// The host's seat on the board, as the sink of the values that it wants.
    pub(crate) seat: usize,
    /// The seats of its clients, by the time of registration.
    pub(crate) clients: BTreeMap<u64, usize>,
    /// The connections of its clients' inputs.
    pub(crate) patch: Patch,
    /// The outputs here that the host wants, and the places on its seat that they go through.
    pub(crate) supplies: BTreeMap<Place, usize>,
    /// Places on its seat that are free, and how many there are.
    pub(crate) free: Vec<usize>,
    pub(crate) places: usize,
    /// The outputs of its clients that are wanted here, by number and back.
    pub(crate) wants: BTreeMap<Place, u32>,
    pub(crate) wanted: HashMap<u32, Place>,
    next_want: u32,
    /// Requests to the host that it has not answered.
    pub(crate) asked: BTreeMap<u32, Request>,
    /// Channels here whose newest names the host has not been sent, by the registration of their clients.
    pub(crate) renamed: BTreeMap<u64, BTreeSet<Channel>>,
}

/// Connections that another dispatcher is to make and to cut.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct Request {
    pub(crate) connect: Vec<Joint>,
    pub(crate) cut: Vec<Joint>,
}

impl Federation {
    pub(crate) fn new(identity: Identity) -> Self {
        Self {
            identity,
            hosts: BTreeMap::new(),
            rivals: BTreeMap::new(),
            news: VecDeque::new(),
            next_beat: Nanos::ZERO,
            complaint: String::new(),
            streams: 0,
            requests: 0,
            served: HostId::default(),
        }
    }

    /// Sends a letter to all hosts.
    pub(crate) fn tell_all(&mut self, mut body: impl FnMut() -> Body) {
        for host in self.hosts.values_mut() {
            host.link.send(body());
        }
    }

    /// Begins a new stream of letters to a host; repeats requests that it has not answered.
    pub(crate) fn open(&mut self, now: Nanos, host: HostId, snapshot: Body) {
        self.streams += 1;
        let Some(host) = self.hosts.get_mut(&host) else {
            return;
        };
        host.link.open(now, self.streams);
        host.link.send(snapshot);
        // The snapshot has all names.
        host.renamed.clear();
        host.ask_again();
    }

    /// Asks a host for changes of its patch; returns the number of the request.
    pub(crate) fn request(&mut self, id: HostId, request: Request) -> u32 {
        self.requests = self.requests.wrapping_add(1);
        let number = self.requests;
        if let Some(host) = self.hosts.get_mut(&id) {
            host.link.send(request.letter(number));
            host.asked.insert(number, request);
        }
        number
    }

    /// The next letter for a host, and the host; `newest` makes a letter of what changes often, so that only its newest state is
    /// sent.
    pub(crate) fn next_letter(
        &mut self,
        mut newest: impl FnMut(&mut Host) -> Option<Body>,
    ) -> Option<(HostId, Letter)> {
        for _ in 0..self.hosts.len() {
            let behind = (Bound::Excluded(self.served), Bound::Unbounded);
            let behind = self.hosts.range(behind).next();
            let (id, _) = behind.or_else(|| self.hosts.first_key_value())?;
            self.served = *id;
            let host = self.hosts.get_mut(&self.served)?;
            if let Some(letter) = host.link.take(self.identity.host) {
                return Some((self.served, letter));
            }
            if host.link.is_open
                && let Some(body) = newest(host)
            {
                host.link.send(body);
                let letter = host.link.take(self.identity.host)?;
                return Some((self.served, letter));
            }
        }
        None
    }
}

impl Host {
    pub(crate) fn new(now: Nanos, seat: usize) -> Self {
        Self {
            link: Link::new(now),
            name: String::new(),
            seat,
            clients: BTreeMap::new(),
            patch: Patch::new(),
            supplies: BTreeMap::new(),
            free: Vec::new(),
            places: 0,
            wants: BTreeMap::new(),
            wanted: HashMap::new(),
            next_want: 0,
            asked: BTreeMap::new(),
            renamed: BTreeMap::new(),
        }
    }

    /// Notes that an output is wanted; returns the number of this want.
    pub(crate) fn want(&mut self, output: Place) -> u32 {
        // By the time a number is reused, no letter contains it any more.
        while self.wanted.contains_key(&self.next_want) {
            self.next_want = (self.next_want + 1) % MOST_WANTS;
        }
        let number = self.next_want;
        self.next_want = (self.next_want + 1) % MOST_WANTS;
        self.wants.insert(output, number);
        self.wanted.insert(number, output);
        number
    }

    /// Notes that an output is not wanted any more; returns whether it was.
    pub(crate) fn unwant(&mut self, output: Place) -> bool {
        let number = self.wants.remove(&output);
        number.is_some_and(|number| self.wanted.remove(&number).is_some())
    }

    pub(crate) fn ask_again(&mut self) {
        for (number, request) in &self.asked {
            self.link.send(request.letter(*number));
        }
    }
}

impl Request {
    fn letter(&self, number: u32) -> Body {
        Body::Request {
            number,
            connect: to_wire(&self.connect),
            cut: to_wire(&self.cut),
        }
    }
}

/// All places on a seat.
pub(crate) fn on_seat(seat: usize) -> std::ops::RangeInclusive<Place> {
    let place = |channel| Place { seat, channel };
    place(0)..=place(usize::MAX)
}
