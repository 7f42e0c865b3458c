//! The table of open drivers: checked ids instead of pointers.
//!
//! A handle is an index into a fixed table, and a generation that distinguishes the current tenant of the
//! place from all previous ones. Any number either denotes a tenant that is open now, or is answered with a
//! status code.

#![allow(
    unsafe_code,
    reason = "a claim by one atomic word stands in for a lock, which the tick must not take"
)]

use std::cell::UnsafeCell;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicU64, Ordering};

use tickbus_driver::Code;

use crate::panics::panic_message;
use crate::refusal::Refusal;

/// How many drivers can be open in one process at once.
pub const MAX_DRIVERS: usize = 64;

/// A handle's low bits are the index, the rest the generation.
const INDEX_BITS: u32 = 8;
const _: () = assert!(MAX_DRIVERS <= 1 << INDEX_BITS);

/// A place's word: its generation, and in the low bits one of the states below.
const STATE_BITS: u32 = 2;
const STATE: u64 = (1 << STATE_BITS) - 1;
/// There is no tenant.
const FREE: u64 = 0;
/// There is a tenant, not in use at the moment.
const OPEN: u64 = 1;
/// One thread is using the tenant.
const CLAIMED: u64 = 2;
/// The tenant has panicked, and waits to be closed.
const FAILED: u64 = 3;

const fn word(generation: u64, state: u64) -> u64 {
    generation << STATE_BITS | state
}

/// One place, on its own cache lines: drivers that tick on different cores share nothing.
#[repr(align(128))]
struct HandleEntry<T> {
    word: AtomicU64,
    /// Only accessed by the thread that has moved the word to [`CLAIMED`], until it moves it on.
    content: UnsafeCell<Content<T>>,
}

struct Content<T> {
    tenant: Option<T>,
    /// The text of the panic that ended in [`FAILED`].
    panic: String,
}

/// A table of tenants of type `T`.
pub struct Handles<T, const N: usize = MAX_DRIVERS> {
    places: [HandleEntry<T>; N],
}

// SAFETY: the one part that is not Sync by itself is `content`. It is reached through `Claim` alone,
// which exists only between a successful compare-and-exchange to CLAIMED (acquire) and the store that
// ends it (release), so one thread at a time has it, and sees all that the one before it did. A tenant
// may thus be used and dropped by another thread than the one that made it, hence `T: Send`.
unsafe impl<T: Send, const N: usize> Sync for Handles<T, N> {}

impl<T, const N: usize> Default for Handles<T, N> {
    fn default() -> Self {
        Self::new()
    }
}

impl<T, const N: usize> Handles<T, N> {
    /// An empty table.
    pub const fn new() -> Self {
        let places = [const {
            HandleEntry {
                word: AtomicU64::new(word(0, FREE)),
                content: UnsafeCell::new(Content {
                    tenant: None,
                    panic: String::new(),
                }),
            }
        }; N];
        Self { places }
    }

    /// Reserves a place for a tenant that has yet to be created.
    ///
    /// # Errors
    ///
    /// `TOO_MANY_DRIVERS`: all places are taken.
    pub fn reserve(&self) -> Result<Reservation<'_, T>, Refusal> {
        for (index, place) in self.places.iter().enumerate() {
            let found = place.word.load(Ordering::Relaxed);
            let generation = (found >> STATE_BITS) + 1;
            if found & STATE == FREE
                && let Some(claim) = Claim::take(place, found, generation, FREE)
            {
                return Ok(Reservation { claim, index });
            }
        }
        let text = format!("{N} drivers are open, and that is the most");
        Err(Refusal::new(Code::TooManyDrivers, text))
    }

    /// Calls `work` with the tenant, which no other thread can access in the meantime.
    ///
    /// A panic in `work` marks the tenant as failed; from then on it returns INTERNAL until closed.
    ///
    /// # Errors
    ///
    /// The handle was never open, is closed, in use by another thread, or its tenant has failed.
    #[inline]
    pub fn with<R>(&self, handle: i64, work: impl FnOnce(&mut T) -> R) -> Result<R, Code> {
        let mut claim = self.claim(handle, OPEN)?;
        let Some(tenant) = claim.content().tenant.as_mut() else {
            return Err(Code::Internal);
        };
        match catch_unwind(AssertUnwindSafe(|| work(tenant))) {
            Ok(done) => Ok(done),
            Err(payload) => {
                claim.content().panic = panic_message(payload);
                claim.end = FAILED;
                Err(Code::Internal)
            }
        }
    }

    /// As [`with`](Self::with); a failed tenant is refused with the message of its panic.
    ///
    /// # Errors
    ///
    /// As [`with`](Self::with).
    pub fn with_reason<R>(
        &self,
        handle: i64,
        work: impl FnOnce(&mut T) -> R,
    ) -> Result<R, Refusal> {
        self.with(handle, work)
            .map_err(|code| self.reason(handle, code))
    }

    /// Why the tenant of this handle was refused with `code`.
    pub fn reason(&self, handle: i64, code: Code) -> Refusal {
        match self.panic_of(handle) {
            Some(text) => Refusal::new(code, format!("panic: {text}")),
            None => Refusal::plain(code),
        }
    }

    /// Ends a tenancy: `close` is called with the tenant, failed or not. The place is free and the handle
    /// closed from then on, however long `close` takes.
    ///
    /// # Errors
    ///
    /// The handle was never open, is closed already, or in use by another thread.
    pub fn close<R>(&self, handle: i64, close: impl FnOnce(T) -> R) -> Result<R, Code> {
        let mut claim = match self.claim(handle, OPEN) {
            Err(Code::Internal) => self.claim(handle, FAILED)?,
            other => other?,
        };
        claim.end = FREE;
        claim.content().panic = String::new();
        let tenant = claim.content().tenant.take();
        drop(claim);
        tenant.map(close).ok_or(Code::Internal)
    }

    /// The message of the panic that made this handle's tenant fail.
    fn panic_of(&self, handle: i64) -> Option<String> {
        let mut claim = self.claim(handle, FAILED).ok()?;
        Some(claim.content().panic.clone())
    }

    #[inline]
    fn claim(&self, handle: i64, from: u64) -> Result<Claim<'_, T>, Code> {
        // A negative handle becomes a generation that no place will ever reach.
        let handle = handle.cast_unsigned();
        let generation = handle >> INDEX_BITS;
        let index = usize::try_from(handle & ((1 << INDEX_BITS) - 1)).unwrap_or(usize::MAX);
        let place = self.places.get(index).ok_or(Code::NotOpen)?;
        Claim::take(place, word(generation, from), generation, from)
            .ok_or_else(|| place.refusal(generation))
    }
}

impl<T> HandleEntry<T> {
    /// Why a claim with this generation failed.
    #[cold]
    fn refusal(&self, generation: u64) -> Code {
        let found = self.word.load(Ordering::Relaxed);
        let living = found >> STATE_BITS;
        if generation == 0 || generation > living {
            return Code::NotOpen;
        }
        match found & STATE {
            _ if generation < living => Code::Closed,
            FREE => Code::Closed,
            FAILED => Code::Internal,
            // OPEN: the thread that had it has released it between the claim and this check.
            _ => Code::Busy,
        }
    }
}

/// Exclusive use of a place; ends when dropped.
struct Claim<'a, T> {
    place: &'a HandleEntry<T>,
    generation: u64,
    /// The state in which the place is left.
    end: u64,
}

impl<'a, T> Claim<'a, T> {
    #[inline]
    fn take(place: &'a HandleEntry<T>, found: u64, generation: u64, end: u64) -> Option<Self> {
        let claimed = generation << STATE_BITS | CLAIMED;
        place
            .word
            .compare_exchange(found, claimed, Ordering::Acquire, Ordering::Relaxed)
            .is_ok()
            // Made only on success: dropping a claim moves the word.
            .then(|| Self {
                place,
                generation,
                end,
            })
    }

    #[inline]
    fn content(&mut self) -> &mut Content<T> {
        // SAFETY: this claim moved the word to CLAIMED, which succeeds for one thread at a time and
        // only from a state in which no claim exists; `&mut self` keeps this thread to one reference.
        unsafe { &mut *self.place.content.get() }
    }
}

impl<T> Drop for Claim<'_, T> {
    #[inline]
    fn drop(&mut self) {
        self.place
            .word
            .store(word(self.generation, self.end), Ordering::Release);
    }
}

/// A place waiting for its tenant; free again if this is dropped before.
pub struct Reservation<'a, T> {
    claim: Claim<'a, T>,
    index: usize,
}

impl<T> Reservation<'_, T> {
    /// Adds the tenant and returns its handle, which is positive.
    pub fn fill(mut self, tenant: T) -> i64 {
        self.claim.content().tenant = Some(tenant);
        self.claim.end = OPEN;
        (self.claim.generation << INDEX_BITS | self.index as u64).cast_signed()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::Barrier;
    use std::sync::atomic::AtomicUsize;

    fn open<const N: usize>(handles: &Handles<u32, N>, tenant: u32) -> i64 {
        handles.reserve().expect("a place is free").fill(tenant)
    }

    #[test]
    fn what_was_never_opened_is_not_open() {
        let handles: Handles<u32, 3> = Handles::new();
        let real = open(&handles, 7);
        for handle in [
            0,
            1,
            2,
            3,
            255,
            -1,
            i64::MIN,
            i64::MAX,
            real + 1,
            real + 256,
            real | 1 << 62,
        ] {
            assert_eq!(
                handles.with(handle, |_| ()),
                Err(Code::NotOpen),
                "{handle:#x}"
            );
            assert_eq!(
                handles.close(handle, |_| ()),
                Err(Code::NotOpen),
                "{handle:#x}"
            );
        }
        assert_eq!(handles.with(real, |tenant| *tenant), Ok(7));
    }

    #[test]
    fn a_stale_handle_stays_closed_though_its_place_has_a_new_tenant() {
        let handles: Handles<u32, 1> = Handles::new();
        let old = open(&handles, 1);
        assert_eq!(handles.close(old, |tenant| tenant), Ok(1));
        assert_eq!(handles.with(old, |_| ()), Err(Code::Closed));
        let new = open(&handles, 2);
        assert_eq!(handles.with(old, |_| ()), Err(Code::Closed));
        assert_eq!(handles.close(old, |_| ()), Err(Code::Closed));
        assert_eq!(handles.with(new, |tenant| *tenant), Ok(2));
    }

    #[test]
    fn places_run_out_and_come_back() {
        let handles: Handles<u32, 2> = Handles::new();
        let first = open(&handles, 1);
        open(&handles, 2);
        let refusal = handles.reserve().err().expect("both places are taken");
        assert_eq!(refusal.code, Code::TooManyDrivers);
        handles.close(first, drop).expect("it is open");
        drop(handles.reserve().expect("the place is free again"));
        open(&handles, 3);
    }

    #[test]
    fn a_tenant_in_use_is_busy_and_stays_open() {
        let handles: Handles<u32, 1> = Handles::new();
        let handle = open(&handles, 1);
        let answers = handles.with(handle, |_| {
            (handles.with(handle, |_| ()), handles.close(handle, |_| ()))
        });
        assert_eq!(answers, Ok((Err(Code::Busy), Err(Code::Busy))));
        assert_eq!(handles.with(handle, |tenant| *tenant), Ok(1));
    }

    #[test]
    fn a_panic_fails_the_tenant_until_it_is_closed() {
        let handles: Handles<u32, 1> = Handles::new();
        let handle = open(&handles, 1);
        let text = "formatted at run time".to_owned();
        assert_eq!(
            handles.with(handle, |_| panic!("{text}")),
            Err::<(), _>(Code::Internal)
        );
        assert_eq!(handles.with(handle, |_| ()), Err(Code::Internal));
        assert_eq!(handles.panic_of(handle), Some(text));
        assert_eq!(handles.close(handle, |tenant| tenant), Ok(1));
        assert_eq!(handles.with(handle, |_| ()), Err(Code::Closed));
        assert_eq!(handles.panic_of(handle), None);
    }

    #[test]
    fn a_tenant_that_takes_its_time_to_close_keeps_nobody_waiting() {
        let handles: Handles<u32, 1> = Handles::new();
        let handle = open(&handles, 1);
        let met = handles.close(handle, |_| {
            let next = open(&handles, 2);
            (
                handles.with(handle, |_| ()),
                handles.with(next, |tenant| *tenant),
            )
        });
        assert_eq!(met, Ok((Err(Code::Closed), Ok(2))));
    }

    #[test]
    fn a_panic_while_closing_frees_the_place() {
        let handles: Handles<u32, 1> = Handles::new();
        let handle = open(&handles, 1);
        let closing = catch_unwind(AssertUnwindSafe(|| {
            handles.close(handle, |_| panic!("stuck"))
        }));
        assert_eq!(panic_message(closing.expect_err("close panicked")), "stuck");
        assert_eq!(handles.with(handle, |_| ()), Err(Code::Closed));
        open(&handles, 2);
    }

    #[test]
    fn two_threads_never_have_the_tenant_at_once() {
        let handles: Handles<u32, 1> = Handles::new();
        let handle = open(&handles, 0);
        let (inside, start) = (AtomicUsize::new(0), Barrier::new(2));
        let rounds = if cfg!(miri) { 200 } else { 100_000 };
        let work = || {
            start.wait();
            let mut done = 0;
            for _ in 0..rounds {
                let entered = handles.with(handle, |tenant| {
                    assert_eq!(inside.fetch_add(1, Ordering::Relaxed), 0);
                    *tenant += 1;
                    assert_eq!(inside.fetch_sub(1, Ordering::Relaxed), 1);
                });
                match entered {
                    Ok(()) => done += 1,
                    Err(refusal) => assert_eq!(refusal, Code::Busy),
                }
            }
            done
        };
        let done: u32 = std::thread::scope(|scope| {
            let other = scope.spawn(work);
            work() + other.join().expect("no panic")
        });
        assert_eq!(handles.with(handle, |tenant| *tenant), Ok(done));
    }
}
