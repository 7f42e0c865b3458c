//! The order of bytes and the place of a value: how plausible the values are in each reading.

use tickbus_base::toml_text::short_number;
use tickbus_image::signal::{ByteOrder, DataType, Signal};

use super::Examination;

/// The bytes of a signal at its place, and at the places before and behind it.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Neighbours {
    /// The signal's position in the table.
    pub signal: usize,
    /// The bytes at the signal's place.
    pub here: Vec<u8>,
    /// The bytes one element lower, if they can be read.
    pub below: Option<Vec<u8>>,
    /// The bytes one element higher, if they can be read.
    pub above: Option<Vec<u8>>,
    /// The places, as the bus writes them: the signal's own, the one below and the one above.
    pub places: [String; 3],
}

/// A reading of the same memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Hypothesis {
    AsConfigured,
    Order(ByteOrder),
    Below,
    Above,
}

/// From this penalty on a value is suspicious.
const SUSPICIOUS: u32 = 10;

/// A measured or set value of a machine is hardly ever closer to zero, or further from it.
const REALISTIC: std::ops::Range<f64> = 1e-6..1e9;

impl Neighbours {
    fn bytes(&self, hypothesis: Hypothesis) -> Option<&[u8]> {
        match hypothesis {
            Hypothesis::AsConfigured | Hypothesis::Order(_) => Some(&self.here),
            Hypothesis::Below => self.below.as_deref(),
            Hypothesis::Above => self.above.as_deref(),
        }
    }
}

/// The value of `bytes`, as the image's codec reads them.
fn raw(bytes: &[u8], order: ByteOrder) -> u64 {
    let size = bytes.len();
    (0..size).fold(0, |value, significance| {
        value | u64::from(bytes[order.byte_position(size, significance)]) << (8 * significance)
    })
}

#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_possible_wrap,
    clippy::cast_precision_loss,
    reason = "the widths are those of the types, and a value for people may be rounded"
)]
fn number(raw: u64, data_type: DataType) -> f64 {
    match data_type {
        DataType::Real => f64::from(f32::from_bits(raw as u32)),
        DataType::Lreal => f64::from_bits(raw),
        DataType::Sint => f64::from(raw as u8 as i8),
        DataType::Int => f64::from(raw as u16 as i16),
        DataType::Dint => f64::from(raw as u32 as i32),
        DataType::Lint => raw as i64 as f64,
        _ => raw as f64,
    }
}

/// The number of digits of a number, without zeros at either end: people set values with few digits, and the wrong half of
/// a number has many.
fn digits(raw: u64, data_type: DataType) -> u32 {
    let text = match data_type {
        DataType::Real => f32::from_bits(u32::try_from(raw).unwrap_or_default()).to_string(),
        _ => number(raw, data_type).to_string(),
    };
    let digits: String = text.chars().filter(char::is_ascii_digit).collect();
    u32::try_from(digits.trim_matches('0').len()).unwrap_or(u32::MAX)
}

/// How implausible a raw value is: 0 for a perfectly usual one.
fn penalty(raw: u64, signal: &Signal) -> u32 {
    let data_type = signal.data_type;
    let value = number(raw, data_type);
    let mut penalty = match data_type {
        DataType::Real | DataType::Lreal if value == 0.0 => 0,
        DataType::Real | DataType::Lreal if !REALISTIC.contains(&value.abs()) => 20,
        DataType::Real | DataType::Lreal => digits(raw, data_type).min(8),
        DataType::Dint | DataType::Udint | DataType::Lint | DataType::Ulint => {
            let size = value.abs();
            if size < 65_536.0 {
                digits(raw, data_type).min(2)
            } else if raw.trailing_zeros() >= 16 {
                // Only the upper word has a value: a small number with its words swapped.
                15
            } else if size < 16_777_216.0 {
                4
            } else {
                8
            }
        }
        DataType::Int | DataType::Uint if raw != 0 && raw.trailing_zeros() >= 8 => 6,
        _ => 1,
    };
    if let (Some([low, high]), false) = (signal.range, data_type == DataType::Bool) {
        let shown = signal.scale.map_or(value, |scale| scale.value(value));
        let (low, high) = (low.min(high), low.max(high));
        let margin = (high - low) / 10.0;
        if !(low - margin..=high + margin).contains(&shown) {
            penalty += 12;
        }
    }
    penalty
}

/// True if bytes of the signal have an order, or its value limits, that can be judged.
fn is_judged(signal: &Signal) -> bool {
    signal.data_type != DataType::Bool
        && signal.data_type.size_bytes() > 1
        && (signal.range.is_some()
            || !matches!(
                signal.data_type,
                DataType::Word | DataType::Dword | DataType::Lword
            ))
}

fn text(bytes: &[u8], order: ByteOrder, signal: &Signal) -> String {
    let value = number(raw(bytes, order), signal.data_type);
    let value = signal.scale.map_or(value, |scale| scale.value(value));
    let unit = signal
        .unit
        .as_ref()
        .map(|unit| format!(" {unit}"))
        .unwrap_or_default();
    format!("{}{unit}", short_number(value))
}

/// The sum of the penalties in a reading, and the number of suspicious values; `None` if the reading cannot be had.
fn score(hypothesis: Hypothesis, all: &[(&Neighbours, &Signal)]) -> Option<(u32, usize)> {
    let mut sum = 0;
    let mut suspicious = 0;
    for (neighbours, signal) in all {
        let order = match hypothesis {
            Hypothesis::Order(order) => order,
            _ => signal.order,
        };
        let penalty = penalty(raw(neighbours.bytes(hypothesis)?, order), signal);
        sum += penalty;
        suspicious += usize::from(penalty >= SUSPICIOUS);
    }
    Some((sum, suspicious))
}

impl Examination<'_> {
    /// Judges whether values are plausible: the step `values`. Shows suspicious ones in every reading.
    pub fn judge_values(&mut self, all: &[Neighbours]) {
        let signals = &self.setup.table.signals;
        let judged: Vec<(&Neighbours, &Signal)> = all
            .iter()
            .map(|neighbours| (neighbours, &signals[neighbours.signal]))
            .filter(|(_, signal)| is_judged(signal))
            .collect();
        if judged.is_empty() {
            self.ok(
                "values",
                "no numbers of more than one byte, so no order of bytes to judge",
            );
            return;
        }
        let own = score(Hypothesis::AsConfigured, &judged).unwrap_or_default();
        if own.1 == 0 {
            self.ok("values", format!("{} numbers, all plausible", judged.len()));
            return;
        }
        let orders = ByteOrder::ALL.into_iter().map(Hypothesis::Order);
        let others = orders.chain([Hypothesis::Below, Hypothesis::Above]);
        let scored = others.filter_map(|other| Some((score(other, &judged)?, other)));
        let scored: Vec<_> = scored.collect();
        // The first of equal ones: swapped words are more frequent than wrong places.
        let best = scored
            .iter()
            .copied()
            .min_by_key(|((sum, suspicious), _)| (*suspicious, *sum));
        let best = best.filter(|((sum, suspicious), _)| *suspicious < own.1 && *sum < own.0);
        let (cause, mut next) = match best.map(|(_, hypothesis)| hypothesis) {
            Some(Hypothesis::Order(ByteOrder::Cdab)) => (
                "word-order",
                "the words look swapped: write order = \"CDAB\" at these signals".to_owned(),
            ),
            Some(Hypothesis::Order(order)) => (
                "byte-order",
                format!("the bytes look swapped: write order = \"{order}\" at these signals"),
            ),
            Some(hypothesis @ (Hypothesis::Below | Hypothesis::Above)) => (
                "off-by-one",
                format!(
                    "the addresses look one too {}: many manuals count from 1, and the wire counts from 0",
                    if hypothesis == Hypothesis::Below { "high" } else { "low" }
                ),
            ),
            _ => (
                "implausible-value",
                "compare with the values in the PLC's own tool, and choose the reading that matches".to_owned(),
            ),
        };
        let is_shift = |other| matches!(other, Hypothesis::Below | Hypothesis::Above);
        if let Some((_, chosen)) = best
            && scored
                .iter()
                .any(|((_, left), other)| *left == 0 && is_shift(*other) != is_shift(chosen))
        {
            next.push_str("; other readings are possible as well: compare them with the values in the PLC's own tool");
        }
        let details: Vec<String> = judged
            .iter()
            .filter(|(neighbours, signal)| {
                penalty(raw(&neighbours.here, signal.order), signal) >= SUSPICIOUS
            })
            .map(|(neighbours, signal)| readings(neighbours, signal))
            .collect();
        let step = self.warn(
            "values",
            cause,
            format!("{} of {} numbers are hardly plausible", own.1, judged.len()),
            &next,
        );
        step.details = details;
    }
}

/// A signal in every reading, for people to choose from.
fn readings(neighbours: &Neighbours, signal: &Signal) -> String {
    let [here, below, above] = &neighbours.places;
    let mut orders: Vec<ByteOrder> = ByteOrder::ALL.into();
    if signal.data_type.size_bytes() == 2 {
        orders = vec![ByteOrder::Abcd, ByteOrder::Dcba];
    }
    let orders = orders.iter().map(|order| {
        let own = if *order == signal.order {
            " (configured)"
        } else {
            ""
        };
        format!("{order} {}{own}", text(&neighbours.here, *order, signal))
    });
    let mut parts: Vec<String> = orders.collect();
    for (place, bytes) in [(below, &neighbours.below), (above, &neighbours.above)] {
        parts.extend(
            bytes
                .as_ref()
                .map(|bytes| format!("at {place} {}", text(bytes, signal.order, signal))),
        );
    }
    format!("\"{}\" at {here}: {}", signal.name, parts.join(", "))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{BusSetup, Events, Role};
    use std::path::Path;
    use std::sync::Arc;
    use tickbus_base::time::{Clock, Manual, Nanos, Stop};
    use tickbus_image::signal::{Area, SignalTable};

    /// The verdict on a memory of registers, with a signal of this type at each of these registers.
    fn verdict(registers: &[u16], at: &[usize], data_type: DataType) -> Option<&'static str> {
        let memory: Vec<u8> = registers
            .iter()
            .flat_map(|word| word.to_be_bytes())
            .collect();
        let size = data_type.size_bytes();
        let signals = at
            .iter()
            .map(|at| Signal::new(format!("s{at}"), Area::Output, at * 2, data_type));
        let table = SignalTable::of_one_station(0, memory.len() + 8, signals.collect());
        let clock: Arc<dyn Clock> = Manual::new();
        let stop = Stop::new();
        let setup = BusSetup {
            name: "x",
            id: 1,
            folder: Path::new(""),
            role: Role::Device,
            table: &table,
            cycle: None,
            max_age: Nanos::from_millis(100),
            events: Events::None,
            clock: &clock,
            hosted: None,
        };
        let read = |at: Option<usize>| {
            let begin = at? * 2;
            memory.get(begin..begin + size).map(<[u8]>::to_vec)
        };
        let all: Vec<Neighbours> = (at.iter().enumerate())
            .map(|(signal, at)| Neighbours {
                signal,
                here: read(Some(*at)).expect("it is there"),
                below: read(at.checked_sub(1)),
                above: read(Some(at + 1)),
                places: Default::default(),
            })
            .collect();
        let mut examination = Examination::new(setup, Vec::new(), Nanos::ZERO, &stop);
        examination.judge_values(&all);
        examination.steps[0].cause
    }

    fn words(values: &[f32]) -> Vec<u16> {
        let halves = values.iter().map(|value| value.to_bits());
        #[expect(clippy::cast_possible_truncation, reason = "the halves of a word")]
        halves
            .flat_map(|bits| [(bits >> 16) as u16, bits as u16])
            .collect()
    }

    #[test]
    fn the_true_order_and_place_of_reals_are_found() {
        let values = [21.37, 3.25, 0.8, 1500.0];
        let right = words(&values);
        assert_eq!(verdict(&right, &[0, 2, 4, 6], DataType::Real), None);
        let swapped: Vec<u16> = right
            .chunks(2)
            .flat_map(|pair| [pair[1], pair[0]])
            .collect();
        let cause = verdict(&swapped, &[0, 2, 4, 6], DataType::Real);
        assert_eq!(cause, Some("word-order"));
        let bytes: Vec<u16> = right.iter().map(|word| word.swap_bytes()).collect();
        assert_eq!(
            verdict(&bytes, &[0, 2, 4, 6], DataType::Real),
            Some("byte-order")
        );
        let mut framed = vec![0];
        framed.extend(&right);
        framed.push(0);
        // The signals lie from 1 on: addressed one too low, and one too high.
        let low = verdict(&framed, &[0, 2, 4, 6], DataType::Real);
        assert_eq!(low, Some("off-by-one"));
        let high = verdict(&right, &[1, 3, 5], DataType::Real);
        assert_eq!(high, Some("off-by-one"));
    }

    #[test]
    fn small_whole_numbers_in_swapped_words_are_found() {
        assert_eq!(verdict(&[0, 7, 0, 1250], &[0, 2], DataType::Dint), None);
        let cause = verdict(&[7, 0, 1250, 0], &[0, 2], DataType::Dint);
        assert_eq!(cause, Some("word-order"));
        assert_eq!(verdict(&[256, 512], &[0, 1], DataType::Int), None);
    }
}
