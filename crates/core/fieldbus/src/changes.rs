//! Events derived from frames: every change of a signal between two received frames, and every write if the bus knows
//! which bits were written.

use std::ops::Range;

use tickbus_base::time::Nanos;
use tickbus_image::signal::{Area, Plan, SignalTable, Slot};
use tickbus_image::{Event, Producer};

/// Compares the frames that one station receives, signal by signal.
#[derive(Debug)]
pub struct ChangeEvents {
    plan: Plan,
    /// The indices of the station's signals in the signal table, and the bits of each in the frame.
    signals: Box<[(usize, Range<usize>)]>,
    /// The bits written by the peer since the last frame, changed or not.
    written: Vec<Range<usize>>,
    /// All slots of the table for the previous and for the current frame.
    before: Box<[Slot]>,
    now: Box<[Slot]>,
}

impl ChangeEvents {
    /// Watches the frames received in `area` of the station with index `station`.
    pub fn new(table: &SignalTable, station: usize, area: Area) -> Self {
        let signals = table.signals.iter().enumerate();
        let signals = signals
            .filter(|(_, signal)| signal.station == station && signal.area == area)
            .map(|(index, signal)| (index, signal.address().bits()))
            .collect();
        let plan = Plan::new(table, station, area);
        let mut before = vec![Slot::default(); table.signals.len()];
        plan.fail_safe(&mut before);
        Self {
            plan,
            signals,
            written: Vec::new(),
            now: before.clone().into(),
            before: before.into(),
        }
    }

    /// Records that the next frame writes these bits: their signals are reported even if they do not change.
    pub fn written(&mut self, bits: Range<usize>) {
        self.written.push(bits);
    }

    /// Discards the [written](Self::written) bits, because their frame was lost.
    pub fn forget(&mut self) {
        self.written.clear();
    }

    /// Pushes an event for each signal that `frame` changes or writes.
    pub fn observe(&mut self, time: Nanos, frame: &[u8], events: &mut Producer) {
        self.plan.decode(frame, &mut self.now);
        for (index, bits) in &self.signals {
            let index = *index;
            let value = self.now[index];
            let overlaps =
                |written: &Range<usize>| written.start < bits.end && bits.start < written.end;
            let changed = value != std::mem::replace(&mut self.before[index], value);
            if changed || self.written.iter().any(overlaps) {
                let signal = u32::try_from(index).expect("tables hold fewer than 2^32 signals");
                events.push(Event {
                    signal,
                    value,
                    time,
                });
            }
        }
        self.written.clear();
    }
}
