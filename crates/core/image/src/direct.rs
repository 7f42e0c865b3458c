//! A stream of frames whose writer and reader take turns on one thread.

use tickbus_base::time::Nanos;

use super::swallowed::Returns;
use crate::{Counted, EdgeCounter, LatchedBit, PulseShaper, Swallowed, copy_frame};

/// A stream of frames whose writer and reader take turns on one thread. As through the two ends of an
/// [`image`](fn@crate::image), no edge of a latched signal is lost, but no hand-over is needed.
#[derive(Debug)]
pub struct DirectStream {
    bytes: Box<[u8]>,
    edges: EdgeCounter,
    shaper: PulseShaper,
    /// The frame with its pulses shaped, if they need it.
    shaped: Box<[u8]>,
    returns: Returns,
    /// True if the frame was read at least once.
    is_read: bool,
}

impl DirectStream {
    /// A stream whose frame is `fail_safe` until the first one is written.
    pub fn new(fail_safe: Box<[u8]>, latched: Box<[LatchedBit]>) -> Self {
        Self {
            edges: EdgeCounter::new(&latched, &fail_safe),
            shaper: PulseShaper::new(latched, &fail_safe),
            shaped: fail_safe.clone(),
            returns: Returns::new(&[], &[], &Swallowed::new(0)),
            is_read: false,
            bytes: fail_safe,
        }
    }

    /// The same stream, which counts the changes of these signals that no reader sees.
    #[must_use]
    pub fn with_counted(mut self, counted: &[Counted], swallowed: &Swallowed) -> Self {
        self.returns = Returns::new(counted, &self.bytes, swallowed);
        self
    }

    /// Lets `write` change the frame, and counts the resulting edges.
    #[inline]
    pub fn write<R>(&mut self, write: impl FnOnce(&mut [u8]) -> R) -> R {
        let result = write(&mut self.bytes);
        if self.has_latched() {
            self.edges.observe(&self.bytes);
        }
        if !self.returns.is_empty() {
            self.returns.observe(&self.bytes, || self.is_read);
        }
        result
    }

    /// Takes over a frame whose edges do not count, since the writer's data are invalid.
    pub fn pass(&mut self, bytes: &[u8]) {
        copy_frame(&mut self.bytes, bytes);
        self.edges.pass(bytes);
        self.returns.pass(bytes);
    }

    /// The frame as written, for a reader to which its edges do not count: the edges wait.
    pub fn latest(&self) -> &[u8] {
        &self.bytes
    }

    /// The reader's view at `now`: the frame, with every edge since the last call made visible.
    #[inline]
    pub fn read(&mut self, now: Nanos) -> &[u8] {
        self.returns.taken();
        self.is_read = true;
        if !self.has_latched() {
            return &self.bytes;
        }
        let edges = self.edges.counts();
        let shapes = self.shaper.needs_shaping(edges);
        if shapes {
            self.shaped.copy_from_slice(&self.bytes);
            self.shaper.shape(edges, now, &mut self.shaped);
        } else {
            self.shaper.pass(&self.bytes);
        }
        self.shaper.confirm();
        if shapes { &self.shaped } else { &self.bytes }
    }

    /// True if there is an edge to count and to show.
    #[inline]
    fn has_latched(&self) -> bool {
        !self.shaper.bits().is_empty()
    }
}

#[cfg(all(test, not(loom)))]
mod tests {
    use super::*;
    use crate::signal::Latch;
    use crate::{Receiver, StationStreams, image};

    const STEPS: i64 = if cfg!(miri) { 100 } else { 20_000 };

    struct Shown(u8);

    impl Receiver for Shown {
        fn levels(&mut self, bytes: &[u8]) {
            self.0 = bytes[0];
        }

        fn edges(&mut self, _: usize, _: u32) {}
    }

    #[test]
    fn it_shows_what_two_ends_show_between_threads() {
        let latches = [Latch::Rising, Latch::Falling, Latch::Both, Latch::Rising];
        let latched: Box<[LatchedBit]> = (0..4)
            .map(|bit| LatchedBit {
                signal: bit,
                byte: 0,
                mask: 1 << bit,
                latch: latches[bit],
                hold: Nanos(if bit == 3 { 7 } else { 0 }),
            })
            .collect();
        let fail_safe: Box<[u8]> = Box::new([0x05]);
        let mut direct = DirectStream::new(fail_safe.clone(), latched.clone());
        let (mut tick, mut bus) = image(vec![StationStreams {
            tx_fail_safe: fail_safe.clone(),
            tx_latched: latched.clone(),
            tx_counted: Box::default(),
            rx_counted: Box::default(),
            rx_fail_safe: fail_safe.clone(),
            rx_latched: latched,
        }]);
        let (mut shown, mut random, mut shaped) = (Shown(fail_safe[0]), 1_u64, 0_i64);
        let mut written = fail_safe[0];
        for step in 0..STEPS {
            random = random
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            let (now, level) = (Nanos(2 * step), (random >> 40).to_le_bytes()[0]);
            if random >> 60 < 9 {
                written = level;
                direct.write(|frame| frame[0] = level);
                tick.write(now, |_, frame| frame[0] = level);
                bus.received(0, now, &[level], true);
                bus.hand_over();
            } else {
                let seen = direct.read(now);
                bus.attend(now, None);
                assert_eq!(seen, bus.outgoing(0, now), "step {step}");
                bus.sent(0);
                tick.update();
                tick.read(0, (now, Nanos::MAX), &mut shown);
                assert_eq!(seen, [shown.0], "step {step}");
                shaped += i64::from(seen != [written]);
            }
        }
        assert!(shaped > STEPS / 40, "pulses were shaped {shaped} times");
    }
}
