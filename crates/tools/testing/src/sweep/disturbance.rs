//! The kinds of faults in a sweep, and what each does to a signal, a station or the line.

use tickbus_base::time::Nanos;
use tickbus_base::toml_text::short_number;
use tickbus_fieldbus::faults::{Begin, Effect, Fault, Lasts, LineEffect, SignalEffect};
use tickbus_image::signal::{DataType, Signal, Slot};

/// How late a signal is, unless the file says it.
const LATE: Nanos = Nanos::from_millis(200);

/// How likely a noisy BOOL is inverted at a tick, unless the file says it.
const CHANCE: f64 = 0.1;

/// How long the line or a station is gone, unless the file says it.
const GONE: Nanos = Nanos::from_secs(1);

/// The fault of a run.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Disturbance {
    /// A fault that the driver injects.
    Fault(Box<Fault>),
    /// The signal with this index is late by this many ticks.
    Late(usize, usize),
}

/// A kind of fault, with its numbers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Kind {
    StuckOn,
    StuckOff,
    Inverted,
    Late(Nanos),
    /// The chance of a BOOL; the amplitude of a number, which has no noise without one.
    Noise(f64, Option<f64>),
    Frozen,
    LineDown(Nanos),
    StationDown(Nanos),
    /// A fault of the machine's model with this value: the one with this place among those in the file, or each that is
    /// on or off.
    Model(Option<usize>, f64),
}

impl Kind {
    /// All kinds with their usual numbers, in the order of the matrices.
    pub(super) const USUAL: [(&'static str, Self); 9] = [
        ("stuck-on", Self::StuckOn),
        ("stuck-off", Self::StuckOff),
        ("inverted", Self::Inverted),
        ("late", Self::Late(LATE)),
        ("noise", Self::Noise(CHANCE, None)),
        ("frozen", Self::Frozen),
        ("line-down", Self::LineDown(GONE)),
        ("station-down", Self::StationDown(GONE)),
        ("model", Self::Model(None, 1.0)),
    ];

    /// The kind's name in the file.
    pub(super) fn name(self) -> &'static str {
        let same = |usual: Self| std::mem::discriminant(&usual) == std::mem::discriminant(&self);
        let found = Self::USUAL.iter().find(|(_, usual)| same(*usual));
        found.map_or("", |(name, _)| *name)
    }

    /// The kind's name in matrices: with its numbers, if they are not the usual ones.
    pub(super) fn label(self) -> String {
        let name = self.name();
        if Self::USUAL.iter().any(|(_, usual)| *usual == self) {
            return name.to_owned();
        }
        match self {
            Self::Late(by) | Self::LineDown(by) | Self::StationDown(by) => format!("{name} {by}"),
            Self::Noise(chance, None) => format!("{name} {}", short_number(chance)),
            Self::Noise(CHANCE, Some(amplitude)) => format!("{name} {}", short_number(amplitude)),
            Self::Noise(chance, Some(amplitude)) => {
                format!(
                    "{name} {} {}",
                    short_number(chance),
                    short_number(amplitude)
                )
            }
            Self::StuckOn
            | Self::StuckOff
            | Self::Inverted
            | Self::Frozen
            | Self::Model(Some(_), 1.0) => name.to_owned(),
            Self::Model(_, value) => format!("{name} {}", short_number(value)),
        }
    }

    /// This kind of fault of a signal; `None` if the signal has no such fault.
    pub(super) fn of_signal(
        self,
        index: usize,
        signal: &Signal,
        step: Nanos,
    ) -> Option<Disturbance> {
        let is_bool = signal.data_type == DataType::Bool;
        let is_bits = matches!(
            signal.data_type,
            DataType::Bool | DataType::Byte | DataType::Word | DataType::Dword | DataType::Lword
        ) && signal.scale.is_none();
        let effect = match self {
            Self::StuckOn if is_bool => SignalEffect::Stuck(Some(Slot::from_real(1.0))),
            Self::StuckOff if is_bool => SignalEffect::Stuck(Some(Slot::from_real(0.0))),
            Self::Inverted if is_bits => SignalEffect::Invert,
            Self::Noise(chance, _) if is_bool => SignalEffect::Flicker(chance),
            Self::Noise(_, Some(amplitude)) if !is_bits => SignalEffect::Noise(amplitude),
            Self::Frozen if !is_bool => SignalEffect::Stuck(None),
            Self::Late(by) => {
                let ticks = by.0.div_euclid(step.0) + i64::from(by.0 % step.0 != 0);
                return Some(Disturbance::Late(index, usize::try_from(ticks).ok()?));
            }
            _ => return None,
        };
        Some(self.fault(Effect::Signal(index, effect), Lasts::UntilEnded))
    }

    /// This kind of fault of the line; `None` if the line has no such fault.
    pub(super) fn of_line(self) -> Option<Disturbance> {
        match self {
            Self::LineDown(span) => {
                Some(self.fault(Effect::Line(LineEffect::LinkDown), Lasts::For(span)))
            }
            _ => None,
        }
    }

    /// This kind of fault of a station of several; `None` if stations have no such fault.
    pub(super) fn of_station(self, station: usize) -> Option<Disturbance> {
        match self {
            Self::StationDown(span) => {
                let effect = Effect::Line(LineEffect::StationDown(station));
                Some(self.fault(effect, Lasts::For(span)))
            }
            _ => None,
        }
    }

    /// This kind of fault of the machine's model, by its name; `None` if models have no such fault.
    pub(super) fn of_model(self, name: &str) -> Option<Disturbance> {
        match self {
            Self::Model(_, value) => Some(fault(
                name.to_owned(),
                Effect::Model(value),
                Lasts::UntilEnded,
            )),
            _ => None,
        }
    }

    fn fault(self, effect: Effect, lasts: Lasts) -> Disturbance {
        fault(self.label(), effect, lasts)
    }
}

fn fault(name: String, effect: Effect, lasts: Lasts) -> Disturbance {
    Disturbance::Fault(Box::new(Fault {
        name,
        effect,
        begin: Begin::AtOnce,
        lasts,
        times: 1,
        seed: 1,
    }))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn unusual_numbers_are_part_of_the_name() {
        for (kind, label) in [
            (Kind::Late(LATE), "late"),
            (Kind::Late(Nanos::from_millis(500)), "late 500ms"),
            (Kind::Noise(CHANCE, None), "noise"),
            (Kind::Noise(0.2, None), "noise 0.2"),
            (Kind::Noise(CHANCE, Some(2.5)), "noise 2.5"),
            (Kind::Noise(0.2, Some(2.5)), "noise 0.2 2.5"),
            (Kind::LineDown(Nanos::from_secs(2)), "line-down 2s"),
            (Kind::Model(None, 1.0), "model"),
            (Kind::Model(Some(0), 1.0), "model"),
            (Kind::Model(Some(0), 0.4), "model 0.4"),
        ] {
            assert_eq!(kind.label(), label);
        }
    }
}
