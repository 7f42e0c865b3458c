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
    /// The last writes, in the order of their bits; no two have a bit in common.
    runs: Vec<Run>,
}

/// Neighbouring bits with the same last write.
#[derive(Clone, Debug)]
struct Run {
    bits: Range<usize>,
    writer: Weak<SocketAddr>,
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
        if bits.is_empty() {
            return true;
        }
        let from = self.runs.partition_point(|run| run.bits.end <= bits.start);
        let rest = self.runs[from..].iter();
        let count = rest.take_while(|run| run.bits.start < bits.end).count();
        let met = &mut self.runs[from..from + count];
        if let Some(other) = other(writer, met, now - port.max_age()) {
            report_second(port, counter, (writer, &other), self.is_single);
            if self.is_single {
                return false;
            }
        }
        let is_own = |run: &Run| run.writer.as_ptr() == Arc::as_ptr(writer);
        // Clients usually repeat their requests.
        if let [run] = &mut *met
            && run.bits == bits
            && is_own(run)
        {
            run.at = now;
            return true;
        }
        let part = |run: &Run, bits: Range<usize>| {
            let run = Run {
                bits: bits.clone(),
                ..run.clone()
            };
            (!bits.is_empty()).then_some(run)
        };
        let before = met
            .first()
            .and_then(|run| part(run, run.bits.start..bits.start));
        let after = met.last().and_then(|run| part(run, bits.end..run.bits.end));
        let writer = Arc::downgrade(writer);
        let new = Run {
            bits,
            writer,
            at: now,
        };
        let runs = before.into_iter().chain([new]).chain(after);
        self.runs.splice(from..from + count, runs);
        true
    }
}

/// The client other than `writer` that made one of these writes at or after `since`, and is still connected.
fn other(writer: &Writer, writes: &[Run], since: Nanos) -> Option<Writer> {
    let others = writes.iter().filter(|run| run.at >= since);
    others
        .filter(|run| run.writer.as_ptr() != Arc::as_ptr(writer))
        .find_map(|run| run.writer.upgrade())
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

#[cfg(all(test, not(loom)))]
mod tests {
    use super::*;
    use crate::{LinkStatus, Role};
    use tickbus_base::time::Manual;
    use tickbus_image::image;

    const MAX_AGE: Nanos = Nanos(10);

    fn port() -> Port {
        tickbus_test_log::expect("each undoes what the other one does");
        let status = LinkStatus::new("test", MAX_AGE);
        Port::new(
            image(Vec::new()).1,
            Manual::new(),
            Role::Device,
            None,
            status,
        )
    }

    fn client(number: u16) -> Writer {
        Arc::new(SocketAddr::from(([127, 0, 0, 1], number)))
    }

    #[test]
    fn a_second_writer_of_a_bit_is_refused_until_the_first_is_silent_or_gone() {
        let (port, mut writers) = (port(), Writers::new(true));
        let mut writes = |writer: &Writer, bits, now| {
            writers.may_write(writer, bits, Nanos(now), (&port, "test.second"))
        };
        let (one, two) = (client(1), client(2));
        assert!(writes(&one, 8..16, 0));
        assert!(
            writes(&two, 0..8, 1) && writes(&two, 16..17, 1),
            "its neighbours"
        );
        assert!(!writes(&two, 15..18, 2) && !writes(&two, 0..9, 10));
        assert!(writes(&two, 9..9, 2), "nothing");
        assert!(writes(&two, 9..10, 11), "the first one is silent");
        assert!(!writes(&one, 8..16, 12) && writes(&one, 10..16, 12));
        drop(two);
        assert!(writes(&one, 0..20, 13), "the second one is gone");
    }

    /// The same record, bit by bit.
    #[test]
    fn runs_of_bits_say_the_same_as_single_bits() {
        const BITS: usize = 40;
        let port = port();
        let mut writers = Writers::new(true);
        let mut clients: Vec<Writer> = (0..3).map(client).collect();
        let mut single: Vec<Option<(u16, i64)>> = vec![None; BITS];
        let mut seed = 1_u64;
        let mut random = |below: usize| {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            usize::try_from(seed >> 33).expect("31 bits") % below
        };
        let mut next = 3;
        let mut refused = 0;
        for now in 0..20_000 {
            let which = random(3);
            if random(50) == 0 {
                clients[which] = client(next);
                next += 1;
            }
            let writer = Arc::clone(&clients[which]);
            let start = random(BITS);
            let bits = start..start + random(BITS - start + 1);
            let is_other = |write: &(u16, i64)| {
                let mut others = clients.iter().filter(|other| !Arc::ptr_eq(other, &writer));
                now - write.1 <= MAX_AGE.0 && others.any(|other| other.port() == write.0)
            };
            let expected = !single[bits.clone()].iter().flatten().any(is_other);
            if expected {
                single[bits.clone()].fill(Some((writer.port(), now)));
            }
            let may = writers.may_write(&writer, bits, Nanos(now), (&port, "test.second"));
            assert_eq!(may, expected, "at {now}");
            refused += usize::from(!may);
        }
        assert!((2_000..18_000).contains(&refused), "{refused}");
        assert!(writers.runs.len() <= BITS);
    }
}
