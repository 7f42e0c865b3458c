//! Who writes to a station of a server: two controllers on one machine undo each other's outputs.

use std::fmt::Display;
use std::net::SocketAddr;
use std::ops::Range;
use std::sync::{Arc, Weak};

use tickbus_base::time::Nanos;
use tickbus_base::toml_text::Table;

use crate::Port;

/// A client of a server, as its writes know it. They forget it once it is dropped.
pub type Writer = Arc<SocketAddr>;

/// Who wrote each bit of one station last.
#[derive(Debug, Default)]
pub struct Writers {
    is_single: bool,
    clients: Vec<Weak<SocketAddr>>,
    /// Up to the last bit that was ever written.
    bits: Vec<Option<Write>>,
}

/// The last write to a bit.
#[derive(Clone, Copy, Debug)]
struct Write {
    /// Index of its client.
    client: u32,
    at: Nanos,
}

impl Writers {
    /// No writes yet; with `is_single` a second writer is refused.
    pub fn new(is_single: bool) -> Self {
        Self {
            is_single,
            ..Self::default()
        }
    }

    /// Reads the key `writers`: whether a second writer is refused.
    pub fn read(table: &mut Table<'_>) -> Option<bool> {
        let writers = table.take("writers");
        writers.map_or(Some(false), |value| value.whole(1..=1).map(|_| true))
    }

    /// Whether a second writer is refused.
    pub fn is_single(&self) -> bool {
        self.is_single
    }

    /// Whether `writer` may write these bits at `now`. If another client has written any of them within `max_age`, that
    /// is counted as `counter` and logged.
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

    /// The index of a client, which may be that of one that has left.
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

    /// The client other than `own` that has written one of these bits at or after `since`, and that is still there.
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

/// Counts and logs that `writer` writes what `other` wrote within `max_age`; `is_refused`: this write has no effect.
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
