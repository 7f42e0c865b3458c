//! A memory barrier between two sides, of which one pays for both.

/// A barrier between a thread that passes it millions of times per second and others that do so rarely: it costs the first
/// nothing, and the others a call of the system.
///
/// Of two threads of which each writes, passes the barrier and then reads what the other wrote, one by
/// [`light`](Self::light), one by [`heavy`](Self::heavy), at least one sees the other's write. With two atomic fences it
/// would be the same, but such a fence waits until the processor has written everything, which takes longer than the rest
/// of what the tick does.
#[derive(Clone, Copy, Debug)]
pub struct OneSidedBarrier(());

impl OneSidedBarrier {
    /// The barrier, where the system has it (`MEMBARRIER_CMD_PRIVATE_EXPEDITED`, Linux 4.14). It is the same for the whole
    /// process.
    pub fn get() -> Option<Self> {
        #[cfg(all(any(target_os = "linux", target_os = "android"), not(miri)))]
        {
            use rustix::thread::{MembarrierCommand, membarrier};
            use std::sync::LazyLock;

            static IS_REGISTERED: LazyLock<bool> = LazyLock::new(|| {
                membarrier(MembarrierCommand::RegisterPrivateExpedited).is_ok()
                    && membarrier(MembarrierCommand::PrivateExpedited).is_ok()
            });
            IS_REGISTERED.then_some(Self(()))
        }
        #[cfg(not(all(any(target_os = "linux", target_os = "android"), not(miri))))]
        None
    }

    /// The side that passes often.
    #[inline]
    pub fn light(self) {
        // The processor does what the compiler says; when it matters, `heavy` makes it keep to that order.
        std::sync::atomic::compiler_fence(std::sync::atomic::Ordering::SeqCst);
    }

    /// The side that passes rarely: when this returns, every other thread of the process has passed a full fence. False if
    /// the system refuses; then nothing is promised.
    #[must_use]
    pub fn heavy(self) -> bool {
        std::sync::atomic::fence(std::sync::atomic::Ordering::SeqCst);
        #[cfg(any(target_os = "linux", target_os = "android"))]
        {
            use rustix::thread::{MembarrierCommand, membarrier};
            membarrier(MembarrierCommand::PrivateExpedited).is_ok()
        }
        #[cfg(not(any(target_os = "linux", target_os = "android")))]
        false
    }
}

#[cfg(all(test, target_os = "linux", not(miri)))]
mod tests {
    use super::OneSidedBarrier;
    use std::sync::Barrier;
    use std::sync::atomic::{AtomicUsize, Ordering};

    #[test]
    fn of_two_threads_that_write_and_then_read_one_sees_the_other() {
        const ROUNDS: usize = 20_000;
        let Some(barrier) = OneSidedBarrier::get() else {
            return;
        };
        let (often, rarely) = (AtomicUsize::new(0), AtomicUsize::new(0));
        let (start, end) = (Barrier::new(2), Barrier::new(2));
        let (start, end) = (&start, &end);
        std::thread::scope(|scope| {
            let light = scope.spawn(|| {
                let mut seen = Vec::with_capacity(ROUNDS);
                for round in 1..=ROUNDS {
                    start.wait();
                    often.store(round, Ordering::Relaxed);
                    barrier.light();
                    seen.push(rarely.load(Ordering::Relaxed));
                    end.wait();
                }
                seen
            });
            let mut seen = Vec::with_capacity(ROUNDS);
            for round in 1..=ROUNDS {
                start.wait();
                rarely.store(round, Ordering::Relaxed);
                assert!(barrier.heavy(), "it was registered");
                seen.push(often.load(Ordering::Relaxed));
                end.wait();
            }
            let light = light.join().expect("no panic");
            for (round, (one, other)) in (1..).zip(light.into_iter().zip(seen)) {
                assert!(
                    one == round || other == round,
                    "neither saw the other in {round}"
                );
            }
        });
    }
}
