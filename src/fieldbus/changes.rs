//! Events from frames: every change of a signal between two received frames.

use crate::image::{Event, Producer};
use crate::signal::{Area, Plan, SignalTable, Slot};
use crate::time::Nanos;

/// Compares the frames that one station receives, signal by signal.
#[derive(Debug)]
pub struct ChangeEvents {
    plan: Plan,
    /// Positions of the station's signals in the signal table.
    signals: Box<[usize]>,
    /// All slots of the table, as the frame before and the present one have them.
    before: Box<[Slot]>,
    now: Box<[Slot]>,
}

impl ChangeEvents {
    /// Watches what arrives in `area` of the station with index `station`.
    pub fn new(table: &SignalTable, station: usize, area: Area) -> Self {
        let signals = table.signals.iter().enumerate();
        let signals = signals
            .filter(|(_, signal)| signal.station == station && signal.area == area)
            .map(|(index, _)| index)
            .collect();
        let plan = Plan::new(table, station, area);
        let mut before = vec![Slot::default(); table.signals.len()];
        plan.fail_safe(&mut before);
        Self {
            plan,
            signals,
            now: before.clone().into(),
            before: before.into(),
        }
    }

    /// Pushes an event for each signal that `frame` changes.
    pub fn observe(&mut self, time: Nanos, frame: &[u8], events: &mut Producer) {
        self.plan.decode(frame, &mut self.now);
        for &index in &self.signals {
            let value = self.now[index];
            if value != std::mem::replace(&mut self.before[index], value) {
                let signal = u32::try_from(index).expect("tables hold fewer than 2^32 signals");
                events.push(Event {
                    signal,
                    value,
                    time,
                });
            }
        }
    }
}
