//! A triple buffer: the newest value from one writer to one reader, wait-free on both sides.
//!
//! ```text
//!   writer's buffer        hand-over buffer        reader's buffer
//!        [ w ]  ──publish──▶   [ h ]   ──update──▶      [ r ]
//! ```
//!
//! The three indices are always a permutation of 0, 1, 2. Publishing swaps w with h, updating swaps r with h;
//! each is one atomic exchange, so that neither side ever waits and no value is ever torn. A value that was
//! not picked up before the next one is overwritten: readers want the newest.
//!
//! A sequence lock would be simpler, but a writer in a tight loop starves its readers.
#![allow(
    unsafe_code,
    reason = "the exchange of indices is what proves exclusive access; the compiler cannot see it"
)]

use super::sync::{Arc, AtomicU8, Ordering, UnsafeCell};

/// Set in the shared state when the hand-over buffer holds a value that the reader has not seen.
const FRESH: u8 = 0b100;
const INDEX: u8 = 0b011;

#[derive(Debug)]
struct Shared<T> {
    buffers: [UnsafeCell<T>; 3],
    /// Index of the hand-over buffer, and [`FRESH`].
    state: AtomicU8,
}

// SAFETY: a buffer is written only by the side that holds its index. The three indices are a
// permutation at any time, and an index changes sides only through the exchange on `state`, whose
// release half orders the accesses before it, and whose acquire half those after it. So a `T` is
// accessed by both sides in turn, for which it has to be `Send`; and it is read by both at once, when the
// writer looks at what it published last, or by threads that share a reader, for which it has to be `Sync`.
unsafe impl<T: Send + Sync> Sync for Shared<T> {}

/// The writing side of a triple buffer.
#[derive(Debug)]
pub struct Writer<T> {
    shared: Arc<Shared<T>>,
    index: u8,
    /// The buffer published last; before the first one, the initial value that waits to be taken back.
    last: u8,
}

/// The reading side of a triple buffer.
#[derive(Debug)]
pub struct Reader<T> {
    shared: Arc<Shared<T>>,
    index: u8,
}

/// Creates a triple buffer whose three buffers are copies of `initial`.
///
/// The reader starts with `initial`, which does not count as fresh.
pub fn triple_buffer<T: Clone + Send>(initial: &T) -> (Writer<T>, Reader<T>) {
    let buffers = [(); 3].map(|()| UnsafeCell::new(initial.clone()));
    let shared = Arc::new(Shared {
        buffers,
        state: AtomicU8::new(1),
    });
    (
        Writer {
            shared: Arc::clone(&shared),
            index: 0,
            last: 1,
        },
        Reader { shared, index: 2 },
    )
}

impl<T> Shared<T> {
    fn buffer(&self, index: u8) -> &UnsafeCell<T> {
        &self.buffers[usize::from(index)]
    }
}

impl<T> Writer<T> {
    /// Lets `write` fill the writer's buffer, which still holds an earlier value.
    #[inline]
    pub fn with_buffer<R>(&mut self, write: impl FnOnce(&mut T) -> R) -> R {
        self.shared.buffer(self.index).with_mut(|buffer| {
            // SAFETY: the writer holds `self.index`, and `&mut self` lasts as long as the borrow.
            write(unsafe { &mut *buffer })
        })
    }

    /// Publishes the writer's buffer. Returns true if the reader has taken over the value published before, or if
    /// nothing was published before.
    #[inline]
    pub fn publish(&mut self) -> bool {
        self.last = self.index;
        let before = self.shared.state.swap(self.index | FRESH, Ordering::AcqRel);
        self.index = before & INDEX;
        before & FRESH == 0
    }
}

impl<T: Sync> Writer<T> {
    /// Like [`with_buffer`](Self::with_buffer), beside the value published last, or the initial one: the writer can
    /// skip publishing an unchanged value, and needs no extra copy to detect that.
    #[inline]
    pub fn with_last<R>(&mut self, write: impl FnOnce(&mut T, &T) -> R) -> R {
        self.shared.buffer(self.last).with(|last| {
            self.shared.buffer(self.index).with_mut(|buffer| {
                // SAFETY: the writer holds `self.index`, as above. `self.last` is another one: publishing exchanges the
                // two for an index that was the other side's or in between. Only a writer writes, and this one not
                // there before it gets that index back, which needs `publish` and so `&mut self`. The reader may hold
                // the index and read at the same time, which `T: Sync` allows.
                let (buffer, last) = unsafe { (&mut *buffer, &*last) };
                write(buffer, last)
            })
        })
    }
}

impl<T> Reader<T> {
    /// True if there is a value that the reader has not seen yet.
    #[inline]
    pub fn has_news(&self) -> bool {
        // Relaxed suffices for a look: a reader that acts on it takes the value over by `update`, which orders the
        // accesses.
        self.shared.state.load(Ordering::Relaxed) & FRESH != 0
    }

    /// Takes over the newest value, if it was not seen yet; returns whether there was one.
    #[inline]
    pub fn update(&mut self) -> bool {
        if !self.has_news() {
            return false;
        }
        self.index = self.shared.state.swap(self.index, Ordering::AcqRel) & INDEX;
        true
    }

    /// Lets `read` see the value that was last taken over.
    #[inline]
    pub fn with<R>(&self, read: impl FnOnce(&T) -> R) -> R {
        self.shared.buffer(self.index).with(|buffer| {
            // SAFETY: the reader holds `self.index` until the next `update`, which needs `&mut self`.
            read(unsafe { &*buffer })
        })
    }

    /// The value that was last taken over.
    #[inline]
    pub fn value(&self) -> &T {
        self.shared.buffer(self.index).with(|buffer| {
            // SAFETY: as in `with`; the borrow of `self` lasts as long as the reference.
            unsafe { &*buffer }
        })
    }
}

#[cfg(all(test, not(loom)))]
mod tests {
    use super::*;

    #[test]
    fn the_reader_gets_the_newest_and_only_once() {
        let (mut writer, mut reader) = triple_buffer(&0);
        assert!(!reader.update());
        for value in [1, 2, 3] {
            writer.with_buffer(|buffer| *buffer = value);
            writer.publish();
        }
        assert!(reader.update());
        assert_eq!(reader.with(|value| *value), 3);
        assert!(!reader.update());
        assert_eq!(reader.with(|value| *value), 3);
    }

    #[test]
    fn the_writer_sees_what_it_published_last() {
        let (mut writer, mut reader) = triple_buffer(&7);
        let mut last = 7;
        for step in 0..100 {
            let value = 100 + step;
            writer.with_last(|buffer, seen| {
                assert_eq!(*seen, last, "step {step}");
                *buffer = value;
            });
            // Some values are not published, and some not read.
            if step % 3 != 0 {
                writer.publish();
                last = value;
            }
            if step % 5 < 3 {
                reader.update();
                assert_eq!(*reader.value(), last);
            }
        }
    }

    #[test]
    fn nothing_is_torn_between_threads() {
        const LAST: u64 = if cfg!(miri) { 200 } else { 200_000 };
        let (mut writer, mut reader) = triple_buffer(&[0_u64; 32]);
        let writing = std::thread::spawn(move || {
            for value in 1..=LAST {
                writer.with_last(|buffer, last| {
                    assert_eq!(*last, [value - 1; 32]);
                    buffer.fill(value);
                });
                writer.publish();
            }
        });
        let mut newest = 0;
        while newest < LAST {
            reader.update();
            reader.with(|value| {
                assert!(
                    value.iter().all(|word| *word == value[0]),
                    "torn: {value:?}"
                );
                assert!(
                    value[0] >= newest,
                    "went back from {newest} to {}",
                    value[0]
                );
                newest = value[0];
            });
        }
        writing.join().expect("no panic");
    }
}

#[cfg(all(test, loom))]
mod loom_tests {
    use super::*;

    #[test]
    fn loom_no_torn_or_stale_value_in_any_interleaving() {
        loom::model(|| {
            let (mut writer, mut reader) = triple_buffer(&[0_u8; 2]);
            let writing = loom::thread::spawn(move || {
                for value in 1..=3 {
                    writer.with_last(|buffer, last| {
                        assert_eq!(*last, [value - 1; 2]);
                        *buffer = [value; 2];
                    });
                    writer.publish();
                }
            });
            let mut newest = 0;
            for _ in 0..3 {
                let fresh = reader.update();
                reader.with(|value| {
                    assert_eq!(value[0], value[1]);
                    assert!(if fresh {
                        value[0] > newest
                    } else {
                        value[0] == newest
                    });
                    newest = value[0];
                });
            }
            writing.join().unwrap();
            reader.update();
            reader.with(|value| assert_eq!(*value, [3; 2]));
        });
    }
}
