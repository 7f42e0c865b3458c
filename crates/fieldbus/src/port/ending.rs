//! The end of a driver: its last cycle, and what its peer is left with.

use std::ops::Range;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{self, Receiver, RecvTimeoutError, Sender};
use std::time::Duration;

use super::{Port, Receipt};

/// What the peer gets where the values of the program can no longer be trusted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Outputs {
    /// The fail-safe values of the signals.
    FailSafe,
    /// The values that were sent last.
    #[default]
    Hold,
}

impl Outputs {
    /// Both, by their names in a driver.cfg.
    pub const CHOICES: [(&'static str, Self); 2] =
        [("fail_safe", Self::FailSafe), ("hold", Self::Hold)];
}

/// Lets another thread end the exchange of a [`Port`] with the fail-safe values.
#[derive(Debug)]
pub struct Farewell {
    shared: Arc<Shared>,
    /// Whether any station sends anything.
    sends: bool,
    done: Receiver<()>,
}

#[derive(Debug, Default)]
struct Shared {
    begun: AtomicBool,
    /// Something was sent since the line was opened.
    is_used: AtomicBool,
    /// The peer is one that nothing may be written to.
    is_blocked: AtomicBool,
}

impl Farewell {
    /// Whether a peer may have got anything by this line.
    pub fn is_due(&self) -> bool {
        self.sends
            && self.shared.is_used.load(Ordering::Relaxed)
            && !self.shared.is_blocked.load(Ordering::Relaxed)
    }

    /// From now on every station sends its fail-safe values.
    pub fn begin(&self) {
        self.shared.begun.store(true, Ordering::Relaxed);
    }

    /// Waits until the peers of all stations have these values, or the line has ended; at most for `limit`. Returns
    /// whether that was in time.
    pub fn wait(&self, limit: Duration) -> bool {
        self.done.recv_timeout(limit) != Err(RecvTimeoutError::Timeout)
    }
}

/// The port's side of a [`Farewell`].
#[derive(Debug)]
pub(super) struct Ending {
    shared: Arc<Shared>,
    /// As the last cycle found it: all frames of a cycle are of one kind.
    is_begun: bool,
    /// Per station, the cycles after which its peer has the last values.
    missing: Box<[u32]>,
    done: Sender<()>,
}

impl Ending {
    fn new(missing: Box<[u32]>) -> (Self, Farewell) {
        let (sender, done) = mpsc::channel();
        let sends = missing.iter().any(|cycles| *cycles > 0);
        let shared = Arc::<Shared>::default();
        let ending = Self {
            shared: Arc::clone(&shared),
            is_begun: false,
            missing,
            done: sender,
        };
        let farewell = Farewell {
            shared,
            sends,
            done,
        };
        (ending, farewell)
    }

    /// A cycle begins.
    fn look(&mut self) {
        self.is_begun = self.shared.begun.load(Ordering::Relaxed);
    }

    pub(super) fn is_begun(&self) -> bool {
        self.is_begun
    }

    /// A frame is about to be sent.
    pub(super) fn is_used(&self) {
        self.shared.is_used.store(true, Ordering::Relaxed);
    }

    /// A peer has whole frames.
    fn sent(&mut self, stations: Range<usize>) {
        for cycles in &mut self.missing[stations] {
            *cycles = cycles.saturating_sub(1);
        }
        if self.missing.iter().all(|cycles| *cycles == 0) {
            // A closer that waits no longer needs no news.
            let _ = self.done.send(());
        }
    }
}

impl Port {
    /// Lets `outputs` be sent while the peer is stale or its data are invalid.
    pub fn set_while_stale(&mut self, outputs: Outputs) {
        let stations = self.stations();
        self.image.blind = (outputs == Outputs::FailSafe).then(|| vec![false; stations].into());
    }

    /// Lets another thread end the exchange with the fail-safe values, which the peer of each station has after this many
    /// `cycles`.
    pub fn farewell(&mut self, cycles: u32) -> Farewell {
        let missing = (0..self.stations()).map(|station| match self.sizes(station).0 {
            0 => 0,
            _ => cycles,
        });
        let (ending, farewell) = Ending::new(missing.collect());
        self.image.ending = Some(ending);
        farewell
    }

    /// Whether the driver closes, and these are its last cycles: a bus then spares no station that has refused.
    pub fn is_ending(&self) -> bool {
        self.image.ending.as_ref().is_some_and(Ending::is_begun)
    }

    /// The line has failed, or the last peer has left: nobody waits for it.
    pub fn line_ended(&mut self) {
        if let Some(ending) = &self.image.ending {
            ending.shared.is_used.store(false, Ordering::Relaxed);
            if ending.shared.begun.load(Ordering::Relaxed) {
                let _ = ending.done.send(());
            }
        }
    }

    /// Whether the peer may be written to at all.
    pub(crate) fn set_may_write(&self, may_write: bool) {
        if let Some(ending) = &self.image.ending {
            let blocked = &ending.shared.is_blocked;
            blocked.store(!may_write, Ordering::Relaxed);
        }
    }

    /// The peer of a station has the last values of all signals that it takes. For buses that send each signal alone: no
    /// receipt of theirs is of a whole frame.
    pub fn has_last(&mut self, station: usize) {
        if let Some(ending) = &mut self.image.ending {
            ending.sent(station..station + 1);
        }
    }

    /// A cycle begins.
    #[inline]
    pub(super) fn look_for_end(&mut self) {
        if let Some(ending) = &mut self.image.ending {
            ending.look();
        }
    }

    #[cold]
    fn had_last(&mut self, receipt: &Receipt) {
        let stations = receipt.stations.clone();
        let is_whole = receipt.bits.as_ref().is_none_or(|bits| {
            let size = self.sizes(stations.start).0;
            bits.start == 0 && bits.end >= 8 * size
        });
        if let (true, Some(ending)) = (is_whole, &mut self.image.ending) {
            ending.sent(stations);
        }
    }

    /// The peer has the frames of this receipt.
    #[inline]
    pub(super) fn had(&mut self, receipt: &Receipt) {
        if receipt.is_last {
            self.had_last(receipt);
        }
    }
}
