//! The event ring: every write of a peer, in order; the image itself would only show the last one.

use super::sync::{Arc, AtomicU64, AtomicUsize, Ordering};
use crate::signal::Slot;
use tickbus_base::time::Nanos;

/// One write of the peer.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Event {
    /// Position of the signal in the signal table.
    pub signal: u32,
    /// The value written, as the signal's slot holds it.
    pub value: Slot,
    /// When it was written, on the driver's clock.
    pub time: Nanos,
}

/// Words per event in the ring.
const WORDS: usize = 3;

#[derive(Debug)]
struct Shared {
    /// Capacity × [`WORDS`]. Atomic words, written relaxed and ordered by the indices, keep this
    /// free of unsafe code; on today's processors they cost what plain words cost.
    words: Box<[AtomicU64]>,
    /// Events ever pushed; the slot of event n is n modulo the capacity.
    pushed: AtomicUsize,
    /// Events ever popped.
    popped: AtomicUsize,
    /// Events that found the ring full.
    lost: AtomicU64,
}

/// The bus's side of the ring.
#[derive(Debug)]
pub struct Producer {
    shared: Arc<Shared>,
}

/// The application's side of the ring.
#[derive(Debug)]
pub struct Consumer {
    shared: Arc<Shared>,
}

/// Creates a ring for `capacity` events, rounded up to a power of two.
pub fn event_ring(capacity: usize) -> (Producer, Consumer) {
    let capacity = capacity.next_power_of_two();
    let shared = Arc::new(Shared {
        words: (0..capacity * WORDS).map(|_| AtomicU64::new(0)).collect(),
        pushed: AtomicUsize::new(0),
        popped: AtomicUsize::new(0),
        lost: AtomicU64::new(0),
    });
    (
        Producer {
            shared: Arc::clone(&shared),
        },
        Consumer { shared },
    )
}

impl Shared {
    fn slot(&self, event: usize) -> &[AtomicU64] {
        let capacity = self.words.len() / WORDS;
        let start = (event & (capacity - 1)) * WORDS;
        &self.words[start..start + WORDS]
    }
}

impl Producer {
    /// Appends an event; if the ring is full, the event is lost and counted.
    pub fn push(&mut self, event: Event) {
        let shared = &*self.shared;
        let pushed = shared.pushed.load(Ordering::Relaxed);
        let capacity = shared.words.len() / WORDS;
        if pushed.wrapping_sub(shared.popped.load(Ordering::Acquire)) == capacity {
            shared.lost.fetch_add(1, Ordering::Relaxed);
            return;
        }
        let slot = shared.slot(pushed);
        slot[0].store(u64::from(event.signal), Ordering::Relaxed);
        slot[1].store(event.value.0, Ordering::Relaxed);
        slot[2].store(event.time.0.cast_unsigned(), Ordering::Relaxed);
        shared
            .pushed
            .store(pushed.wrapping_add(1), Ordering::Release);
    }
}

impl Consumer {
    /// Takes the oldest event.
    pub fn pop(&mut self) -> Option<Event> {
        let shared = &*self.shared;
        let popped = shared.popped.load(Ordering::Relaxed);
        if popped == shared.pushed.load(Ordering::Acquire) {
            return None;
        }
        let slot = shared.slot(popped);
        let event = Event {
            // Only `push` writes this word, from a u32.
            #[allow(clippy::cast_possible_truncation)]
            signal: slot[0].load(Ordering::Relaxed) as u32,
            value: Slot(slot[1].load(Ordering::Relaxed)),
            time: Nanos(slot[2].load(Ordering::Relaxed).cast_signed()),
        };
        shared
            .popped
            .store(popped.wrapping_add(1), Ordering::Release);
        Some(event)
    }

    /// Events lost so far because the ring was full.
    pub fn lost(&self) -> u64 {
        self.shared.lost.load(Ordering::Relaxed)
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
