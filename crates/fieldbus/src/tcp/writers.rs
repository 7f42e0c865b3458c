//! Who writes to a station of a server: two controllers on one machine undo each other's outputs.

use std::net::SocketAddr;
use std::ops::Range;
use std::sync::{Arc, Weak};

use tickbus_base::time::Nanos;
use tickbus_base::toml_text::Table;

use crate::Port;

/// The most writes that are remembered for a station.
const REMEMBERED: usize = 64;

/// A client of a server, as its writes know it. They forget it once it is dropped.
pub type Writer = Arc<SocketAddr>;

/// The recent writes to one station.
#[derive(Debug, Default)]
pub struct Writers {
    is_single: bool,
    recent: Vec<Write>,
}

#[derive(Debug)]
struct Write {
    writer: Weak<SocketAddr>,
    bits: Range<usize>,
    at: Nanos,
}

impl Writers {
    /// No writes yet; with `is_single` a second writer is refused.
    pub fn new(is_single: bool) -> Self {
        Self {
            is_single,
            recent: Vec::new(),
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
        let max_age = port.max_age();
        self.recent
            .retain(|write| now - write.at <= max_age && write.writer.strong_count() > 0);
        let overlaps = |write: &&Write| write.bits.start < bits.end && bits.start < write.bits.end;
        let others = self.recent.iter().filter(overlaps);
        let other = others
            .filter_map(|write| write.writer.upgrade())
            .find(|other| !Arc::ptr_eq(other, writer));
        if let Some(other) = other {
            port.count(counter);
            let done = if self.is_single {
                "this is refused (writers = 1)"
            } else {
                "end one of them, or let the second one be refused by writers = 1"
            };
            port.log(
                log::Level::Warn,
                counter,
                format_args!(
                    "{writer} writes what {other} wrote less than {max_age} ago, and each undoes what the other one \
                     does; {done}"
                ),
            );
            if self.is_single {
                return false;
            }
        }
        let own = |write: &&mut Write| {
            write.bits == bits && std::ptr::eq(write.writer.as_ptr(), Arc::as_ptr(writer))
        };
        if let Some(write) = self.recent.iter_mut().find(own) {
            write.at = now;
            return true;
        }
        if self.recent.len() == REMEMBERED {
            self.recent.remove(0);
        }
        self.recent.push(Write {
            writer: Arc::downgrade(writer),
            bits,
            at: now,
        });
        true
    }
}
