//! Faults that change the values of signals.

use super::SignalEffect;
use super::random::Random;
use tickbus_base::time::Nanos;
use tickbus_image::signal::{DataType, Latch, Signal, Slot};

/// One fault of a signal's value.
#[derive(Debug)]
pub(super) struct SignalFault {
    slot: usize,
    /// The slot that counts the signal's edges, if this end reads it and it is latched.
    edges: Option<(usize, Latch)>,
    kind: Kind,
    change: SignalEffect,
    random: Random,
    /// The value at which the signal is stuck, or that a ramp has reached.
    held: Slot,
    /// The value at which a ramp begins, and when.
    start: (Slot, Nanos),
    /// The level shown last, with which the next level is compared to find edges.
    level: bool,
    /// The true value and the true edge count, while the slots hold the changed ones.
    truth: Option<(Slot, Slot)>,
}

/// The type of the value in the slot.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Bit,
    /// A bit string as a number; this is the number with all bits set.
    Bits(u32),
    /// Another integer of at most 32 bits, without a scale.
    Whole,
    Real,
    Signed,
    Unsigned,
}

impl Kind {
    fn of(signal: &Signal) -> Self {
        match signal.data_type {
            DataType::Bool => Self::Bit,
            DataType::Lint if signal.is_integer_slot() => Self::Signed,
            _ if signal.is_integer_slot() => Self::Unsigned,
            DataType::Byte if signal.scale.is_none() => Self::Bits(0xFF),
            DataType::Word if signal.scale.is_none() => Self::Bits(0xFFFF),
            DataType::Dword if signal.scale.is_none() => Self::Bits(u32::MAX),
            data_type if data_type.is_integer() && signal.scale.is_none() => Self::Whole,
            _ => Self::Real,
        }
    }

    /// The value on the way from one to another, after a part of the time.
    #[expect(
        clippy::cast_precision_loss,
        clippy::cast_possible_truncation,
        reason = "saturates; the ends are exact"
    )]
    fn between(self, (from, to): (Slot, Slot), (passed, within): (Nanos, Nanos)) -> Slot {
        if passed >= within {
            return to;
        }
        let share = passed.0.max(0) as f64 / within.0 as f64;
        let step = |from: i128, to: i128| from + ((to - from) as f64 * share).round() as i128;
        match self {
            Self::Signed => {
                let value = step(from.signed().into(), to.signed().into());
                Slot::from_signed(i64::try_from(value).unwrap_or(to.signed()))
            }
            Self::Unsigned => {
                let value = step(from.unsigned().into(), to.unsigned().into());
                Slot::from_unsigned(u64::try_from(value).unwrap_or(to.unsigned()))
            }
            Self::Real => Slot::from_real(from.real() + (to.real() - from.real()) * share),
            Self::Bit | Self::Bits(_) | Self::Whole => {
                let (from, to) = (from.real(), to.real());
                Slot::from_real((from + (to - from) * share).round())
            }
        }
    }
}

/// The value of a ramp of a signal on its way from one value to another, after a part of its time.
pub fn between(signal: &Signal, ends: (Slot, Slot), times: (Nanos, Nanos)) -> Slot {
    Kind::of(signal).between(ends, times)
}

impl SignalFault {
    /// `slot` holds the signal; `edges` counts its edges, if this end reads it and it is latched.
    pub(super) fn new(
        signal: &Signal,
        (slot, edges): (usize, Option<usize>),
        change: SignalEffect,
        random: Random,
    ) -> Self {
        Self {
            slot,
            edges: edges.zip(signal.latch),
            kind: Kind::of(signal),
            change,
            random,
            held: Slot::default(),
            start: (Slot::default(), Nanos::ZERO),
            level: false,
            truth: None,
        }
    }

    /// The index of the signal.
    pub(super) fn signal(&self) -> usize {
        self.slot
    }

    /// Begins the fault at a time; the slots hold the true values.
    pub(super) fn begin(&mut self, slots: &[Slot], time: Nanos) {
        let slot = slots[self.slot];
        self.level = slot.real() != 0.0;
        self.held = match self.change {
            SignalEffect::Stuck(Some(value)) => value,
            SignalEffect::Ramp { from, .. } => from.unwrap_or(slot),
            _ => slot,
        };
        self.start = (self.held, time);
    }

    /// The value that a ramp has at a time; `None` for other faults.
    pub(super) fn climb(&mut self, time: Nanos) -> Option<Slot> {
        let SignalEffect::Ramp { to, within, .. } = self.change else {
            return None;
        };
        let (start, since) = self.start;
        self.held = self.kind.between((start, to), (time - since, within));
        Some(self.held)
    }

    /// Replaces the value in the signal's slot by the changed one.
    pub(super) fn apply_to(&mut self, slots: &mut [Slot]) {
        let truth = slots[self.slot];
        let bent = self.bent(truth);
        slots[self.slot] = bent;
        let mut counted = Slot::default();
        if let Some((edges, latch)) = self.edges {
            // An edge that the simulation does not see must not be counted either.
            let level = bent.real() != 0.0;
            let is_edge = level != self.level
                && match latch {
                    Latch::Rising => level,
                    Latch::Falling => !level,
                    Latch::Both => true,
                };
            self.level = level;
            counted = std::mem::replace(
                &mut slots[edges],
                Slot::from_real(f64::from(u8::from(is_edge))),
            );
        }
        self.truth = Some((truth, counted));
    }

    /// Restores the true value, if the slot holds the changed one.
    pub(super) fn restore(&mut self, slots: &mut [Slot]) {
        if let Some((truth, counted)) = self.truth.take() {
            slots[self.slot] = truth;
            if let Some((edges, _)) = self.edges {
                slots[edges] = counted;
            }
        }
    }

    fn bent(&mut self, truth: Slot) -> Slot {
        match self.change {
            SignalEffect::Stuck(_) | SignalEffect::Ramp { .. } => self.held,
            SignalEffect::Invert => self.inverted(truth),
            SignalEffect::Offset(by) => self.moved(truth, by),
            SignalEffect::Noise(amplitude) => {
                let by = amplitude * self.random.around_zero();
                self.moved(truth, by)
            }
            SignalEffect::Flicker(chance) if self.random.happens(chance) => self.inverted(truth),
            SignalEffect::Flicker(_) => truth,
        }
    }

    fn inverted(&self, truth: Slot) -> Slot {
        match self.kind {
            Kind::Bit => Slot::from_real(f64::from(u8::from(truth.real() == 0.0))),
            Kind::Bits(all) => {
                let all = f64::from(all);
                // Rounded and saturated as by the codec.
                Slot::from_real(all - truth.real().round().clamp(0.0, all))
            }
            Kind::Signed | Kind::Unsigned => Slot::from_unsigned(!truth.unsigned()),
            Kind::Whole | Kind::Real => Slot::from_real(-truth.real()),
        }
    }

    fn moved(&self, truth: Slot, by: f64) -> Slot {
        #[expect(clippy::cast_possible_truncation, reason = "saturates, as is meant")]
        let whole = by.round() as i64;
        match self.kind {
            Kind::Signed => Slot::from_signed(truth.signed().saturating_add(whole)),
            Kind::Unsigned => Slot::from_unsigned(truth.unsigned().saturating_add_signed(whole)),
            Kind::Bit | Kind::Bits(_) | Kind::Whole | Kind::Real => {
                Slot::from_real(truth.real() + by)
            }
        }
    }
}
