//! The table of open drivers: checked ids instead of pointers.
//!
//! A handle is an index into a fixed table, and a generation that distinguishes the current tenant of the
//! place from all previous ones. Any number either denotes a tenant that is open now, or is answered with a
//! status code.
//!
//! Whoever uses a tenant claims it. The thread that ticks does so millions of times per second, and a claim by an atomic
//! exchange would take longer than all that the tick does. So where the system has the barrier for it, the first thread
//! that ticks gets the place [`dedicated`](Dedication) to it: it then only says that it is in there, and all others look
//! for that after they have claimed the place. When another thread ticks, that ends, and both claim.

#![allow(
    unsafe_code,
    reason = "a claim by one atomic word stands in for a lock, which the tick must not take"
)]

use std::any::Any;
use std::cell::UnsafeCell;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::ptr;
use std::sync::atomic::{AtomicBool, AtomicPtr, AtomicU64, AtomicUsize, Ordering};

use tickbus_base::os::OneSidedBarrier;
use tickbus_driver::{Code, panic_text};

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
    /// Null if it is dedicated to nobody. Changed only by a thread that has claimed the place.
    dedication: AtomicPtr<Dedication>,
    /// Only accessed by the thread that has moved the word to [`CLAIMED`], until it moves it on, and by the one that the
    /// place is dedicated to, while it says so.
    content: UnsafeCell<Content<T>>,
}

struct Content<T> {
    tenant: Option<T>,
    /// The text of the panic that ended in [`FAILED`].
    panic: String,
    has_failed: bool,
    /// Those of all threads that ever had this place to themselves, and one for the next: the tick allocates nothing. They
    /// are never freed, since a thread may look at its own at any time.
    dedications: Vec<&'static Dedication>,
    /// Several threads tick this tenant.
    is_shared: bool,
}

/// The number of no thread.
const NO_THREAD: usize = 0;

/// The sign by which one thread says that it uses a place without having claimed it.
struct Dedication {
    /// The thread, by a number that no other thread has as long as it lives; [`NO_THREAD`] until there is one. Then it
    /// stays.
    thread: AtomicUsize,
    barrier: OneSidedBarrier,
    /// Written by that thread alone.
    is_inside: AtomicBool,
}

/// A table of tenants of type `T`.
pub struct Handles<T, const N: usize = MAX_DRIVERS> {
    places: [HandleEntry<T>; N],
}

// SAFETY: the one part that is not Sync by itself is `content`. It is reached through `Claim` and `Visit` alone. A `Claim`
// exists only between a successful compare-and-exchange to CLAIMED (acquire) and the store that ends it (release), so one
// thread at a time has one, and sees all that the one before it did.
// A `Visit` exists only while the sign of a dedication is set. Its thread sets the sign, passes the light side of a
// barrier, and then finds the word OPEN and the dedication in force (`HandleEntry::visit`). Whoever claims moves the word,
// passes the heavy side, and then finds the sign unset, or gives up (`Claim::take`). So if both are under way at once, the
// visitor finds the word CLAIMED or the claimer finds the sign, and at least one gives up. If the visitor finds the word
// OPEN because a claim has ended, it has acquired what that claim released: also that the claim ended the dedication. If the
// claimer finds the sign unset after a visit, it has acquired what the visit released. One thread alone writes a sign, and
// one thread makes one visit at a time, since a tenant is not reached from within `work`: the sign would be found by the
// claim, and a visit finds its own sign (`HandleEntry::visit`).
// A tenant may thus be used and dropped by another thread than the one that made it, hence `T: Send`.
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
                dedication: AtomicPtr::new(ptr::null_mut()),
                content: UnsafeCell::new(Content {
                    tenant: None,
                    panic: String::new(),
                    has_failed: false,
                    dedications: Vec::new(),
                    is_shared: false,
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
                && let Some(mut claim) = Claim::take(place, found, generation, FREE)
            {
                claim.content().prepare();
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
        self.claim(handle, OPEN)?.run(work)
    }

    /// As [`with`](Self::with), for the tick: after its first call, `thread` reaches the tenant without an atomic exchange,
    /// as long as no other thread ticks it. `thread` is a number that no other living thread has, and not zero.
    ///
    /// # Errors
    ///
    /// As [`with`](Self::with).
    #[inline]
    pub fn tick<R>(
        &self,
        handle: i64,
        thread: usize,
        work: impl FnOnce(&mut T) -> R,
    ) -> Result<R, Code> {
        let (place, generation) = self.place(handle)?;
        match place.visit(generation, thread) {
            Some(mut visit) => visit.run(work),
            None => self.tick_by_claim(handle, thread, work),
        }
    }

    #[cold]
    #[inline(never)]
    fn tick_by_claim<R>(
        &self,
        handle: i64,
        thread: usize,
        work: impl FnOnce(&mut T) -> R,
    ) -> Result<R, Code> {
        let mut claim = self.claim(handle, OPEN)?;
        claim.dedicate(thread);
        claim.run(work)
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
        claim.end_dedication();
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
    fn place(&self, handle: i64) -> Result<(&HandleEntry<T>, u64), Code> {
        // A negative handle becomes a generation that no place will ever reach.
        let handle = handle.cast_unsigned();
        let generation = handle >> INDEX_BITS;
        let index = usize::try_from(handle & ((1 << INDEX_BITS) - 1)).unwrap_or(usize::MAX);
        let place = self.places.get(index).ok_or(Code::NotOpen)?;
        Ok((place, generation))
    }

    #[inline]
    fn claim(&self, handle: i64, from: u64) -> Result<Claim<'_, T>, Code> {
        let (place, generation) = self.place(handle)?;
        Claim::take(place, word(generation, from), generation, from)
            .ok_or_else(|| place.refusal(generation))
    }
}

impl<T> HandleEntry<T> {
    /// Who the place is dedicated to.
    #[inline]
    fn dedication(&self) -> Option<&'static Dedication> {
        let dedication = self.dedication.load(Ordering::Acquire);
        // SAFETY: it is null, or was made of a `&'static Dedication`, which is only ever shared.
        unsafe { dedication.as_ref() }
    }

    /// Lets the thread in that the place is dedicated to, if the tenant of this generation is open and nobody else is
    /// about to use it.
    #[inline]
    fn visit(&self, generation: u64, thread: usize) -> Option<Visit<'_, T>> {
        let dedication = self.dedication()?;
        let is_its = dedication.thread.load(Ordering::Relaxed) == thread;
        // It is in there already if this is called from within.
        if !is_its || dedication.is_inside.load(Ordering::Acquire) {
            return None;
        }
        dedication.is_inside.store(true, Ordering::Relaxed);
        let visit = Visit {
            place: self,
            generation,
            dedication,
        };
        dedication.barrier.light();
        // In this order: the word tells whether the dedication is in force.
        let is_open = self.word.load(Ordering::Acquire) == word(generation, OPEN);
        let is_in_force = ptr::eq(self.dedication.load(Ordering::Relaxed), dedication);
        (is_open && is_in_force).then_some(visit)
    }

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

/// Use of a place by the thread that it is dedicated to; ends when dropped.
struct Visit<'a, T> {
    place: &'a HandleEntry<T>,
    generation: u64,
    dedication: &'static Dedication,
}

impl<T> Visit<'_, T> {
    /// Calls `work` with the tenant; a panic makes it fail.
    #[inline]
    fn run<R>(&mut self, work: impl FnOnce(&mut T) -> R) -> Result<R, Code> {
        // SAFETY: `HandleEntry::visit` has let this thread in; `&mut self` keeps it to one reference.
        let content = unsafe { &mut *self.place.content.get() };
        let done = content.run(work);
        if done.is_err() {
            // Before the sign is unset, so that nobody finds the tenant open.
            let from = word(self.generation, OPEN);
            let to = word(self.generation, FAILED);
            // Not if somebody is about to claim it, and gives up: the next one finds that it has failed.
            let order = (Ordering::Release, Ordering::Relaxed);
            let _ = self.place.word.compare_exchange(from, to, order.0, order.1);
        }
        done
    }
}

impl<T> Drop for Visit<'_, T> {
    #[inline]
    fn drop(&mut self) {
        self.dedication.is_inside.store(false, Ordering::Release);
    }
}

impl<T> Content<T> {
    /// Calls `work` with the tenant. An error says that it has failed.
    #[inline]
    fn run<R>(&mut self, work: impl FnOnce(&mut T) -> R) -> Result<R, Code> {
        let tenant = self.tenant.as_mut().filter(|_| !self.has_failed);
        let Some(tenant) = tenant else {
            return Err(Code::Internal);
        };
        match catch_unwind(AssertUnwindSafe(|| work(tenant))) {
            Ok(done) => Ok(done),
            Err(payload) => {
                self.panic = panic_message(payload);
                self.has_failed = true;
                Err(Code::Internal)
            }
        }
    }

    /// Prepares for a new tenant.
    fn prepare(&mut self) {
        self.is_shared = false;
        self.has_failed = false;
        let mut all = self.dedications.iter();
        if let Some(barrier) = OneSidedBarrier::get()
            && all.all(|known| known.thread.load(Ordering::Relaxed) != NO_THREAD)
        {
            self.dedications.push(Box::leak(Box::new(Dedication {
                thread: AtomicUsize::new(NO_THREAD),
                barrier,
                is_inside: AtomicBool::new(false),
            })));
        }
    }

    /// The sign of this thread: the one that it had before, or the spare one.
    fn dedication_of(&self, thread: usize) -> Option<&'static Dedication> {
        let with = |number| {
            let mut all = self.dedications.iter();
            all.find(|known| known.thread.load(Ordering::Relaxed) == number)
        };
        let found = with(thread).or_else(|| with(NO_THREAD))?;
        found.thread.store(thread, Ordering::Relaxed);
        Some(found)
    }
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
            .filter(Self::is_alone)
    }

    /// Whether the thread that the place is dedicated to is not in there. If it comes, it finds the place claimed.
    #[inline]
    fn is_alone(&self) -> bool {
        let Some(dedication) = self.place.dedication() else {
            return true;
        };
        dedication.barrier.heavy() && !dedication.is_inside.load(Ordering::Acquire)
    }

    /// Dedicates the place to a thread that is the first to tick; if another was, to none.
    fn dedicate(&mut self, thread: usize) {
        match self.place.dedication() {
            Some(dedication) if dedication.thread.load(Ordering::Relaxed) == thread => {}
            Some(_) => {
                self.end_dedication();
                self.content().is_shared = true;
            }
            None if self.content().is_shared => {}
            None => {
                if let Some(dedication) = self.content().dedication_of(thread) {
                    let dedication = ptr::from_ref(dedication).cast_mut();
                    self.place.dedication.store(dedication, Ordering::Release);
                }
            }
        }
    }

    /// The place is dedicated to nobody any more.
    fn end_dedication(&mut self) {
        self.place
            .dedication
            .store(ptr::null_mut(), Ordering::Release);
    }

    /// Calls `work` with the tenant; a panic makes it fail.
    #[inline]
    fn run<R>(mut self, work: impl FnOnce(&mut T) -> R) -> Result<R, Code> {
        let done = self.content().run(work);
        if done.is_err() {
            self.end = FAILED;
        }
        done
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

/// The message of a panic.
pub fn panic_message(payload: Box<dyn Any + Send>) -> String {
    let text = panic_text(&*payload).to_owned();
    // Dropping a payload of unknown type could panic again.
    std::mem::forget(payload);
    text
}

#[cfg(test)]
mod tests;
