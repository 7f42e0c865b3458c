//! The writers of a server's stations: two controllers on one machine undo each other's outputs.

use std::fmt::Display;
use std::net::SocketAddr;
use std::ops::Range;
use std::sync::{Arc, Weak};

use tickbus_base::time::Nanos;
use tickbus_base::toml_text::{Key, Shape, Table};

use crate::Port;

/// A client of a server, as the record of its writes names it. The record forgets a client once this value is dropped.
pub type Writer = Arc<SocketAddr>;

/// The last writer of each bit of one station.
#[derive(Debug, Default)]
pub struct Writers {
    is_single: bool,
    clients: Vec<Weak<SocketAddr>>,
    /// The last write of each bit, up to the last bit that was ever written.
    bits: Vec<Option<Write>>,
}

/// The last write to a bit.
#[derive(Clone, Copy, Debug)]
struct Write {
    /// The index of the client that wrote.
    client: u32,
    at: Nanos,
}

impl Writers {
    /// The key that [`read`](Self::read) takes.
    pub const KEYS: &'static [Key] = &[Key::new(
        "writers",
        Shape::Whole(1, 1),
        "1: a client cannot write what another one wrote within max_age; any number of writers without it",
    )];

    /// A station without writes yet; with `is_single` a second writer is refused.
    pub fn new(is_single: bool) -> Self {
        Self {
            is_single,
            ..Self::default()
        }
    }

    /// Reads the key `writers`; returns true if a second writer is refused.
    pub fn read(table: &mut Table<'_>) -> Option<bool> {
        let writers = table.take("writers");
        writers.map_or(Some(false), |value| value.whole(1..=1).map(|_| true))
    }

    /// Returns true if a second writer is refused.
    pub fn is_single(&self) -> bool {
        self.is_single
    }

    /// Returns true if `writer` may write these bits at `now`. If another client has written any of them within
    /// `max_age`, counts this as `counter` and logs it.
    pub fn may_write(
        &mut self,
        writer: &Writer,
        bits: Range<usize>,
        now: Nanos,
        (port, counter): (&Port, &'static str),
    ) -> bool {
        let own = self.index(writer);
        if let Some(other) = self.other(own, bits.clone(), now - port.max_age()) {
            report_second(port, counter, (writer, &other), self.is_single);
            if self.is_single {
                return false;
            }
        }
        if self.bits.len() < bits.end {
            self.bits.resize(bits.end, None);
        }
        let client = own.try_into().expect("fewer clients than sockets");
        self.bits[bits].fill(Some(Write { client, at: now }));
        true
    }

    /// The index of a client; may reuse the index of a client that has left.
    fn index(&mut self, writer: &Writer) -> usize {
        let mut clients = self.clients.iter();
        if let Some(known) = clients.position(|client| client.as_ptr() == Arc::as_ptr(writer)) {
            return known;
        }
        let client = Arc::downgrade(writer);
        let mut clients = self.clients.iter();
        let Some(free) = clients.position(|client| client.strong_count() == 0) else {
            self.clients.push(client);
            return self.clients.len() - 1;
        };
        self.clients[free] = client;
        for bit in &mut self.bits {
            if bit.is_some_and(|write| write.client as usize == free) {
                *bit = None;
            }
        }
        free
    }

    /// The client other than `own` that has written one of these bits at or after `since`, and is still connected.
    fn other(&self, own: usize, bits: Range<usize>, since: Nanos) -> Option<Writer> {
        if self.clients.len() == 1 {
            return None;
        }
        let written = self.bits.get(bits.start..bits.end.min(self.bits.len()))?;
        let others = written.iter().flatten();
        others
            .filter(|write| write.client as usize != own && write.at >= since)
            .find_map(|write| self.clients[write.client as usize].upgrade())
    }
}

/// Counts and logs that `writer` writes bits that `other` wrote within `max_age`. With `is_refused` this write has no
/// effect.
pub fn report_second(
    port: &Port,
    counter: &'static str,
    (writer, other): (&dyn Display, &dyn Display),
    is_refused: bool,
) {
    port.count(counter);
    let max_age = port.max_age();
    let done = if is_refused {
        "this is refused (writers = 1)"
    } else {
        "end one of them, or let the second one be refused by writers = 1"
    };
    port.log(
        log::Level::Warn,
        counter,
        format_args!(
            "{writer} writes what {other} wrote less than {max_age} ago, and each undoes what the other one does; {done}"
        ),
    );
}
