//! The table of open drivers: checked ids instead of pointers.
//!
//! A handle is an index into a table, and a generation that distinguishes the current tenant of the place from all
//! previous ones. A number that denotes no open tenant is answered with a status code.
//!
//! One thread at a time uses a tenant. A tick never waits for another tick. All other calls are visits: a visit waits
//! until a running tick ends, and the end of a tick lets a waiting visit in.

#![allow(
    unsafe_code,
    reason = "a claim by one atomic word stands in for a lock, which the tick must not take"
)]

use std::cell::UnsafeCell;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::OnceLock;
use std::sync::atomic::{AtomicBool, AtomicU32, AtomicU64, Ordering};

use tickbus_base::os::raise_open_files;
use tickbus_base::time::{Clock as _, Monotonic, Nanos, Stop};
use tickbus_driver::Code;

use crate::panics::panic_message;
use crate::refusal::Refusal;

/// How many drivers can be open in one process at once.
pub const MAX_DRIVERS: usize = BLOCK * (1 + MORE_BLOCKS);

/// Places in a block. The first block always exists; the others are allocated when needed, and are never freed.
const BLOCK: usize = 64;
const MORE_BLOCKS: usize = 63;

/// The low bits of a handle are the index, the others the generation.
const INDEX_BITS: u32 = 12;
const _: () = assert!(MAX_DRIVERS <= 1 << INDEX_BITS);

/// A place's word: its generation, and in the low bits one of the states below.
const STATE_BITS: u32 = 3;
const STATE: u64 = (1 << STATE_BITS) - 1;
/// No tenant.
const FREE: u64 = 0;
/// A tenant that no call is using.
const OPEN: u64 = 1;
/// A tick is using the tenant.
const TICKING: u64 = 2;
/// Another call is using the tenant.
const VISITED: u64 = 3;
/// The tenant has panicked, and can only be closed.
const FAILED: u64 = 4;

/// How long a visit waits for a tick, and a tick for a visit. On a busy machine the other thread may get no processor
/// for a long time.
const PATIENCE: Nanos = Nanos::from_secs(2);
/// The minimum number of rounds in which a visit checks the place before it gives up.
const LEAST_ROUNDS: u32 = 20;
/// How long a visit only yields between two rounds; afterwards it also sleeps.
const AWAKE: Nanos = Nanos::from_millis(100);
/// How long a visit then sleeps, once in [`LEAST_ROUNDS`] rounds.
const NAP: Nanos = Nanos::from_millis(1);
/// How often a round checks the place before the thread yields its processor: some microseconds.
const SPINS: u32 = 200;
/// The maximum number of driver names in a refusal.
const NAMES: usize = 8;

const fn word(generation: u64, state: u64) -> u64 {
    generation << STATE_BITS | state
}

/// One place, on its own cache lines: drivers that tick on different cores share nothing.
#[repr(align(128))]
struct HandleEntry<T> {
    word: AtomicU64,
    /// True while a visit waits for the end of a tick. Only a hint: a waiting visit sets a lost flag again.
    wanted: AtomicBool,
    /// The last call of [`Handles::tick_each`] that ticked the tenant. It changes only under a claim, and fits in a gap.
    round: AtomicU32,
    /// Accessed only by the thread that has moved the word to [`TICKING`] or [`VISITED`], until that thread moves the
    /// word on.
    content: UnsafeCell<Content<T>>,
}

struct Content<T> {
    tenant: Option<T>,
    name: String,
    /// The text of the panic that ended in [`FAILED`].
    panic: String,
}

/// A table of tenants of type `T`, in blocks of `N` places.
pub struct Handles<T, const N: usize = BLOCK> {
    first: [HandleEntry<T>; N],
    more: [OnceLock<Box<[HandleEntry<T>]>>; MORE_BLOCKS],
    /// The number of calls of [`tick_each`](Self::tick_each).
    rounds: AtomicU32,
}

// SAFETY: `content` is the one part that is not Sync already. Only a `Claim` gives access to it. A claim exists from a
// successful compare-and-exchange to TICKING or VISITED (acquire) until the store that ends it (release), so one thread
// at a time has it, and sees everything that the previous one did. A thread may thus use and drop a tenant that another
// thread made, hence `T: Send`.
unsafe impl<T: Send, const N: usize> Sync for Handles<T, N> {}

impl<T, const N: usize> Default for Handles<T, N> {
    fn default() -> Self {
        Self::new()
    }
}

impl<T, const N: usize> Handles<T, N> {
    /// An empty table.
    pub const fn new() -> Self {
        Self {
            first: [const { HandleEntry::new() }; N],
            more: [const { OnceLock::new() }; MORE_BLOCKS],
            rounds: AtomicU32::new(0),
        }
    }

    /// Reserves a place for a tenant that has yet to be created.
    ///
    /// # Errors
    ///
    /// `TOO_MANY_DRIVERS`, with the names of open drivers, if all places are taken.
    pub fn reserve(&self) -> Result<Reservation<'_, T>, Refusal> {
        for index in 0..N * (1 + MORE_BLOCKS) {
            let place = match index.checked_sub(N) {
                None => &self.first[index],
                Some(index) => &self.more[index / N].get_or_init(block::<T, N>)[index % N],
            };
            let found = place.word.load(Ordering::Relaxed);
            let generation = (found >> STATE_BITS) + 1;
            if found & STATE == FREE
                && let Some(claim) = Claim::take(place, found, word(generation, VISITED), FREE)
            {
                return Ok(Reservation { claim, index });
            }
        }
        Err(Refusal::new(Code::TooManyDrivers, self.crowd()))
    }

    /// The reason why no place is left.
    fn crowd(&self) -> String {
        let most = N * (1 + MORE_BLOCKS);
        let mut names = Vec::new();
        for place in self.places() {
            let found = place.word.load(Ordering::Relaxed);
            if names.len() <= NAMES
                && found & STATE == OPEN
                && let Some(mut claim) =
                    Claim::take(place, found, word(found >> STATE_BITS, VISITED), OPEN)
                && let name = format!("\"{}\"", claim.content().name)
                && !names.contains(&name)
            {
                names.push(name);
            }
        }
        let more = names.len() > NAMES;
        names.truncate(NAMES);
        let (names, more) = (names.join(", "), if more { " and others" } else { "" });
        format!("{most} drivers are open, and that is the most: {names}{more}")
    }

    /// All places that are allocated.
    fn places(&self) -> impl Iterator<Item = &HandleEntry<T>> {
        let more = self.more.iter().filter_map(OnceLock::get);
        self.first.iter().chain(more.flatten())
    }

    /// A tick: calls `work` with the tenant, which no other thread can access in the meantime. Then lets a waiting
    /// visit in.
    ///
    /// A panic in `work` marks the tenant as failed; from then on it returns INTERNAL until closed.
    ///
    /// # Errors
    ///
    /// The handle was never open or is closed; another thread ticks the tenant; or the tenant has failed.
    #[inline]
    pub fn tick<R>(&self, handle: i64, work: impl FnOnce(&mut T) -> R) -> Result<R, Code> {
        self.claimed(handle, |claim| claim.run(work))
    }

    /// Ticks each of these tenants once, one after the other, on this thread: calls `work` with the place in the list and
    /// the tenant, and `done` with the place and the result. A tenant that fails stops no other one. The second mention
    /// of a tenant is not ticked, and has the result `BAD_ARGUMENT`.
    pub fn tick_each(
        &self,
        handles: impl IntoIterator<Item = i64>,
        mut work: impl FnMut(usize, &mut T) -> Code,
        mut done: impl FnMut(usize, Code),
    ) {
        // Never zero, with which a place begins.
        let round = self.rounds.fetch_add(1, Ordering::Relaxed) | 1 << 31;
        for (at, handle) in handles.into_iter().enumerate() {
            let ticked = self.claimed(handle, |claim| {
                if claim.place.round.load(Ordering::Relaxed) == round {
                    return Err(Code::BadArgument);
                }
                claim.place.round.store(round, Ordering::Relaxed);
                claim.run(|tenant| work(at, tenant))
            });
            done(at, ticked.unwrap_or_else(|refused| refused));
        }
    }

    /// Claims a tenant for a tick, and then lets a waiting visit in.
    #[inline(always)]
    #[expect(clippy::inline_always, reason = "a tick should not pay for this call")]
    fn claimed<R>(
        &self,
        handle: i64,
        run: impl FnOnce(Claim<'_, T>) -> Result<R, Code>,
    ) -> Result<R, Code> {
        let (place, generation) = self.place(handle).ok_or(Code::NotOpen)?;
        let claimed = word(generation, TICKING);
        let claim = match Claim::take(place, word(generation, OPEN), claimed, OPEN) {
            Some(claim) => claim,
            None => place.after_visit(generation)?,
        };
        let done = run(claim);
        if place.wanted.load(Ordering::Relaxed) {
            place.let_in(generation);
        }
        done
    }

    /// Any other call: as [`tick`](Self::tick), but first waits until a running tick ends, for at most 2 s.
    ///
    /// # Errors
    ///
    /// The handle was never open or is closed; other threads use the tenant for all this time; or the tenant has
    /// failed, and the refusal has the message of its panic.
    pub fn visit<R>(&self, handle: i64, work: impl FnOnce(&mut T) -> R) -> Result<R, Refusal> {
        let claim = self.enter(handle, OPEN, PATIENCE);
        claim
            .and_then(|claim| claim.run(work))
            .map_err(|code| self.reason(handle, code))
    }

    /// The reason why the tenant of this handle was refused with `code`.
    pub fn reason(&self, handle: i64, code: Code) -> Refusal {
        match self.panic_of(handle) {
            Some(text) => Refusal::new(code, format!("panic: {text}")),
            None => Refusal::plain(code),
        }
    }

    /// Ends a tenancy: calls `close` with the tenant, failed or not. The place is free and the handle is closed before
    /// `close` begins, however long that takes. Waits until a running tick ends, for at most 2 s.
    ///
    /// # Errors
    ///
    /// The handle was never open or is closed already, or other threads use the tenant for all this time.
    pub fn close<R>(&self, handle: i64, close: impl FnOnce(T) -> R) -> Result<R, Code> {
        self.close_within(PATIENCE, handle, close)
    }

    fn close_within<R>(
        &self,
        patience: Nanos,
        handle: i64,
        close: impl FnOnce(T) -> R,
    ) -> Result<R, Code> {
        let claim = match self.enter(handle, OPEN, patience) {
            Err(Code::Internal) => self.enter(handle, FAILED, patience)?,
            other => other?,
        };
        claim.vacate().map(close).ok_or(Code::Internal)
    }

    /// Ends all tenancies, as at the end of the process. Skips a tenant that another thread does not release in time.
    pub fn close_all(&self, mut close: impl FnMut(T)) {
        for place in self.places() {
            let found = place.word.load(Ordering::Relaxed);
            let generation = found >> STATE_BITS;
            let state = if found & STATE == FAILED {
                FAILED
            } else {
                OPEN
            };
            if let Ok(claim) = place.wait(generation, state, PATIENCE)
                && let Some(tenant) = claim.vacate()
            {
                close(tenant);
            }
        }
    }

    /// The message of the panic that made this handle's tenant fail.
    fn panic_of(&self, handle: i64) -> Option<String> {
        let (place, generation) = self.place(handle)?;
        let (failed, claimed) = (word(generation, FAILED), word(generation, VISITED));
        let mut claim = Claim::take(place, failed, claimed, FAILED)?;
        Some(claim.content().panic.clone())
    }

    /// The place of a handle, if any, and the generation that its tenant must have.
    #[inline]
    fn place(&self, handle: i64) -> Option<(&HandleEntry<T>, u64)> {
        // A negative handle becomes a generation that no place will ever reach.
        let handle = handle.cast_unsigned();
        let generation = handle >> INDEX_BITS;
        let index = usize::try_from(handle & ((1 << INDEX_BITS) - 1)).unwrap_or(usize::MAX);
        let place = match self.first.get(index) {
            Some(place) => place,
            None => self.more.get((index - N) / N)?.get()?.get(index % N)?,
        };
        Some((place, generation))
    }

    fn enter(&self, handle: i64, from: u64, patience: Nanos) -> Result<Claim<'_, T>, Code> {
        let (place, generation) = self.place(handle).ok_or(Code::NotOpen)?;
        place.wait(generation, from, patience)
    }
}

/// A further block of free places, for which the limit of open files may be too low.
fn block<T, const N: usize>() -> Box<[HandleEntry<T>]> {
    raise_open_files();
    (0..N).map(|_| HandleEntry::new()).collect()
}

impl<T> HandleEntry<T> {
    const fn new() -> Self {
        Self {
            word: AtomicU64::new(word(0, FREE)),
            wanted: AtomicBool::new(false),
            round: AtomicU32::new(0),
            content: UnsafeCell::new(Content {
                tenant: None,
                name: String::new(),
                panic: String::new(),
            }),
        }
    }

    /// Claims a place in the state `from` for a visit, and waits while another thread has the place.
    fn wait(&self, generation: u64, from: u64, patience: Nanos) -> Result<Claim<'_, T>, Code> {
        let (found, claimed) = (word(generation, from), word(generation, VISITED));
        let take = || Claim::take(self, found, claimed, from);
        if let Some(claim) = take() {
            return Ok(claim);
        }
        let clock = Monotonic::shared();
        let begin = clock.now();
        for round in 1_u32.. {
            self.wanted.store(true, Ordering::Relaxed);
            let waited = clock.now() - begin;
            for _ in 0..SPINS {
                if let Some(claim) = take() {
                    self.wanted.store(false, Ordering::Relaxed);
                    return Ok(claim);
                }
                match self.refusal(generation) {
                    Code::Busy => std::hint::spin_loop(),
                    refused => return Err(refused),
                }
            }
            // On a busy machine the time may have passed while this thread had no processor.
            if waited > patience && round >= LEAST_ROUNDS {
                break;
            }
            if waited > AWAKE && round % LEAST_ROUNDS == 0 {
                clock.wait_until(clock.now() + NAP, &Stop::new());
            } else {
                std::thread::yield_now();
            }
        }
        Err(Code::Busy)
    }

    /// Claims a place for a tick once the running visit has ended.
    #[cold]
    fn after_visit(&self, generation: u64) -> Result<Claim<'_, T>, Code> {
        let (open, claimed) = (word(generation, OPEN), word(generation, TICKING));
        let mut begin = None;
        loop {
            for _ in 0..SPINS {
                if let Some(claim) = Claim::take(self, open, claimed, OPEN) {
                    return Ok(claim);
                }
                let found = self.word.load(Ordering::Relaxed);
                if found != open && found != word(generation, VISITED) {
                    return Err(self.refusal(generation));
                }
                std::hint::spin_loop();
            }
            std::thread::yield_now();
            let now = Monotonic::shared().now();
            if now - *begin.get_or_insert(now) > PATIENCE {
                return Err(Code::Busy);
            }
        }
    }

    /// Gives a waiting visit one chance to enter after a tick. A visit that has no processor at the time misses it.
    #[cold]
    fn let_in(&self, generation: u64) {
        self.wanted.store(false, Ordering::Relaxed);
        for _ in 0..SPINS {
            if self.word.load(Ordering::Relaxed) != word(generation, OPEN) {
                return;
            }
            std::hint::spin_loop();
        }
        std::thread::yield_now();
    }

    /// The code for a failed claim with this generation.
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
    /// The word that the claim stores in the place when it ends.
    end: u64,
}

impl<'a, T> Claim<'a, T> {
    /// Moves the word from `found` to `claimed`; the place is left in the state `end`.
    #[inline]
    fn take(place: &'a HandleEntry<T>, found: u64, claimed: u64, end: u64) -> Option<Self> {
        place
            .word
            .compare_exchange(found, claimed, Ordering::Acquire, Ordering::Relaxed)
            .is_ok()
            // The claim is made only on success, since dropping a claim moves the word.
            .then_some(claimed & !STATE | end)
            .map(|end| Self { place, end })
    }

    #[inline]
    fn content(&mut self) -> &mut Content<T> {
        // SAFETY: this claim moved the word to TICKING or VISITED, which succeeds for one thread at a time and
        // only from a state in which no claim exists; `&mut self` keeps this thread to one reference.
        unsafe { &mut *self.place.content.get() }
    }

    fn leave_as(&mut self, state: u64) {
        self.end = self.end & !STATE | state;
    }

    /// Calls `work` with the tenant, and ends the claim.
    #[inline]
    fn run<R>(mut self, work: impl FnOnce(&mut T) -> R) -> Result<R, Code> {
        let Some(tenant) = self.content().tenant.as_mut() else {
            return Err(Code::Internal);
        };
        match catch_unwind(AssertUnwindSafe(|| work(tenant))) {
            Ok(done) => Ok(done),
            Err(payload) => {
                self.content().panic = panic_message(payload);
                self.leave_as(FAILED);
                Err(Code::Internal)
            }
        }
    }

    /// Takes the tenant out, and leaves the place free.
    fn vacate(mut self) -> Option<T> {
        self.leave_as(FREE);
        self.content().panic = String::new();
        self.content().name = String::new();
        self.content().tenant.take()
    }
}

impl<T> Drop for Claim<'_, T> {
    #[inline]
    fn drop(&mut self) {
        self.place.word.store(self.end, Ordering::Release);
    }
}

/// A place that waits for its tenant. The place is free again if the reservation is dropped unfilled.
pub struct Reservation<'a, T> {
    claim: Claim<'a, T>,
    index: usize,
}

impl<T> Reservation<'_, T> {
    /// Adds the tenant under a name for messages, and returns its handle, which is positive.
    pub fn fill(mut self, name: &str, tenant: T) -> i64 {
        let content = self.claim.content();
        content.tenant = Some(tenant);
        name.clone_into(&mut content.name);
        self.claim.leave_as(OPEN);
        let generation = self.claim.end >> STATE_BITS;
        (generation << INDEX_BITS | self.index as u64).cast_signed()
    }
}

#[cfg(test)]
mod tests;
