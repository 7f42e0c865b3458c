//! The event ring: every write of a peer, in order; the image itself would only show the last one.

use super::row_ring::{RowReader, RowWriter, row_ring};
use super::sync::{Arc, AtomicU64, Ordering};
use crate::signal::Slot;
use tickbus_base::time::Nanos;

/// One write of the peer.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Event {
    /// Position of the signal in the signal table.
    pub signal: u32,
    /// The value written, as the signal's slot holds it.
    pub value: Slot,
    /// The time of the write, on the driver's clock.
    pub time: Nanos,
}

/// Words per event in the ring.
const WORDS: usize = 3;

/// The bus's side of the ring.
#[derive(Debug)]
pub struct Producer {
    rows: RowWriter,
    lost: Arc<AtomicU64>,
}

/// The application's side of the ring.
#[derive(Debug)]
pub struct Consumer {
    rows: RowReader,
    /// Events that found the ring full.
    lost: Arc<AtomicU64>,
}

/// Creates a ring for `capacity` events, rounded up to a power of two.
pub fn event_ring(capacity: usize) -> (Producer, Consumer) {
    let (writer, rows) = row_ring(capacity, WORDS);
    let lost = Arc::new(AtomicU64::new(0));
    let producer = Producer {
        rows: writer,
        lost: Arc::clone(&lost),
    };
    (producer, Consumer { rows, lost })
}

impl Producer {
    /// Appends an event; if the ring is full, the event is lost and counted.
    pub fn push(&mut self, event: Event) {
        let time = event.time.0.cast_unsigned();
        let head = [event.signal.into(), time];
        if !self.rows.push(&head, &[event.value]) {
            self.lost.fetch_add(1, Ordering::Relaxed);
        }
    }
}

impl Consumer {
    /// Takes the oldest event.
    pub fn pop(&mut self) -> Option<Event> {
        let mut words = [0; WORDS];
        let [signal, time, value] = self.rows.take(&mut words).then_some(words)?;
        Some(Event {
            // Only `push` writes this word, from a u32.
            #[allow(clippy::cast_possible_truncation)]
            signal: signal as u32,
            value: Slot(value),
            time: Nanos(time.cast_signed()),
        })
    }

    /// Events lost so far because the ring was full.
    pub fn lost(&self) -> u64 {
        self.lost.load(Ordering::Relaxed)
    }
}

#[cfg(all(test, not(loom)))]
mod tests {
    use super::*;

    fn event(n: u32) -> Event {
        Event {
            signal: n,
            value: Slot::from_real(f64::from(n)),
            time: Nanos(i64::from(n)),
        }
    }

    #[test]
    fn events_come_out_in_order_and_overflow_is_counted() {
        let (mut producer, mut consumer) = event_ring(4);
        for n in 0..6 {
            producer.push(event(n));
        }
        assert_eq!(consumer.lost(), 2);
        for n in 0..4 {
            assert_eq!(consumer.pop(), Some(event(n)));
        }
        assert_eq!(consumer.pop(), None);
        producer.push(event(9));
        assert_eq!(consumer.pop(), Some(event(9)));
    }

    #[test]
    fn threads_lose_nothing_but_what_is_counted() {
        const SENT: u32 = if cfg!(miri) { 300 } else { 100_000 };
        let (mut producer, mut consumer) = event_ring(64);
        let pushing = std::thread::spawn(move || (0..SENT).for_each(|n| producer.push(event(n))));
        let (mut received, mut last) = (0_u64, None);
        while !pushing.is_finished() || received + consumer.lost() < u64::from(SENT) {
            while let Some(next) = consumer.pop() {
                assert_eq!(next, event(next.signal));
                assert!(last < Some(next.signal));
                last = Some(next.signal);
                received += 1;
            }
        }
        pushing.join().expect("no panic");
        assert_eq!(received + consumer.lost(), u64::from(SENT));
    }
}

#[cfg(all(test, loom))]
mod loom_tests {
    use super::*;

    #[test]
    fn loom_events_arrive_whole_and_in_order() {
        loom::model(|| {
            let (mut producer, mut consumer) = event_ring(2);
            let pushing = loom::thread::spawn(move || {
                for n in 1..=3 {
                    producer.push(Event {
                        signal: n,
                        value: Slot(n.into()),
                        time: Nanos(n.into()),
                    });
                }
            });
            let mut last = 0;
            for _ in 0..3 {
                if let Some(event) = consumer.pop() {
                    assert_eq!(event.value, Slot(event.signal.into()));
                    assert!(event.signal > last);
                    last = event.signal;
                }
            }
            pushing.join().unwrap();
        });
    }
}
