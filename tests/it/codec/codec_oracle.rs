//! A codec that works bit by bit and computes only with integers, to check the plan against.
//!
//! The oracle shares no formula with the plan except the scale's own: (value − offset) / gain and raw × gain + offset.

use std::cmp::Ordering;

use tickbus::signal::{Area, ByteOrder, Conversions, DataType, Signal, SignalTable, Slot};

/// The number of bits that a type occupies in the frame.
pub(crate) fn bits(data_type: DataType) -> usize {
    match format!("{data_type:?}").to_uppercase().as_str() {
        "BOOL" => 1,
        "BYTE" | "SINT" | "USINT" => 8,
        "WORD" | "INT" | "UINT" => 16,
        "DWORD" | "DINT" | "UDINT" | "REAL" => 32,
        _ => 64,
    }
}

/// True if a signal's slot holds an integer rather than a double.
pub(crate) fn is_integer_slot(signal: &Signal) -> bool {
    let wide = [DataType::Lword, DataType::Lint, DataType::Ulint];
    wide.contains(&signal.data_type) && signal.scale.is_none()
}

/// Bytes that look random.
pub(crate) fn noise(seed: u64) -> impl Iterator<Item = u8> {
    let mut state = seed | 1;
    std::iter::from_fn(move || {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        Some(state.to_be_bytes()[3])
    })
}

/// One frame's codec.
pub(crate) struct Oracle<'a> {
    table: &'a SignalTable,
    station: usize,
    area: Area,
}

impl<'a> Oracle<'a> {
    pub(crate) fn new(table: &'a SignalTable, station: usize, area: Area) -> Self {
        Self {
            table,
            station,
            area,
        }
    }

    pub(crate) fn bytes(&self) -> usize {
        let station = &self.table.stations[self.station];
        match self.area {
            Area::Input => station.input_bytes,
            Area::Output => station.output_bytes,
        }
    }

    fn signals(&self) -> impl Iterator<Item = (usize, &Signal)> {
        (self.table.signals.iter().enumerate())
            .filter(|(_, signal)| signal.station == self.station && signal.area == self.area)
    }

    pub(crate) fn encode(&self, slots: &[Slot]) -> (Vec<u8>, Conversions) {
        let mut frame = vec![0; self.bytes()];
        let mut conversions = Conversions::default();
        for (number, signal) in self.signals() {
            let word = word_of(signal, slots[number], &mut conversions);
            for (power, (byte, bit)) in places(signal).into_iter().enumerate() {
                if word >> power & 1 == 1 {
                    frame[byte] |= 1 << bit;
                }
            }
        }
        (frame, conversions)
    }

    pub(crate) fn decode(&self, frame: &[u8], slots: &mut [Slot]) {
        for (number, signal) in self.signals() {
            let word = (places(signal).into_iter().enumerate())
                .map(|(power, (byte, bit))| u64::from(frame[byte] >> bit & 1) << power)
                .sum();
            slots[number] = slot_of(signal, word);
        }
    }
}

/// The places of a signal's bits, starting with the one of value 2^0.
fn places(signal: &Signal) -> Vec<(usize, u8)> {
    let count = bits(signal.data_type);
    if count == 1 {
        return vec![(signal.byte, signal.bit)];
    }
    // Spells out the order of the bytes; A is the most significant one.
    let letters: Vec<usize> = (0..count / 8).collect();
    let pair = if count == 8 { 1 } else { 2 };
    let mut words: Vec<Vec<usize>> = letters.chunks(pair).map(<[usize]>::to_vec).collect();
    if matches!(signal.order, ByteOrder::Badc | ByteOrder::Dcba) {
        for word in &mut words {
            word.reverse();
        }
    }
    if matches!(signal.order, ByteOrder::Cdab | ByteOrder::Dcba) {
        words.reverse();
    }
    let spelled: Vec<usize> = words.concat();
    (0..count)
        .map(|power| {
            let letter = count / 8 - 1 - power / 8;
            let position = spelled.iter().position(|found| *found == letter);
            let offset = position.expect("every letter is spelled once");
            (
                signal.byte + offset,
                u8::try_from(power % 8).expect("below 8"),
            )
        })
        .collect()
}

fn word_of(signal: &Signal, slot: Slot, conversions: &mut Conversions) -> u64 {
    if is_integer_slot(signal) {
        return slot.0;
    }
    let value = slot.real();
    let raw = signal
        .scale
        .map_or(value, |scale| (value - scale.offset) / scale.gain);
    if raw.is_nan() {
        conversions.not_a_number += 1;
        let fail_safe = signal.fail_safe;
        return if is_nan(fail_safe.0) {
            0
        } else {
            word_of(signal, fail_safe, &mut Conversions::default())
        };
    }
    let (word, saturated) = match signal.data_type {
        DataType::Bool => (u64::from(raw.to_bits() << 1 != 0), false),
        DataType::Real => real(raw, is_infinite(slot.0)),
        DataType::Lreal => lreal(raw, is_infinite(slot.0)),
        _ => integer(signal.data_type, raw),
    };
    conversions.saturated += u32::from(saturated);
    word
}

fn slot_of(signal: &Signal, word: u64) -> Slot {
    let raw = match signal.data_type {
        _ if is_integer_slot(signal) => return Slot(word),
        DataType::Real => widened(word),
        DataType::Lreal => f64::from_bits(word),
        data_type => {
            let count = bits(data_type);
            let is_negative = is_signed(data_type) && word >> (count - 1) == 1;
            let magnitude = i128::from(word) - if is_negative { 1 << count } else { 0 };
            integer_as_double(magnitude)
        }
    };
    let value = signal
        .scale
        .map_or(raw, |scale| raw * scale.gain + scale.offset);
    Slot::from_real(value)
}

fn is_signed(data_type: DataType) -> bool {
    matches!(
        data_type,
        DataType::Sint | DataType::Int | DataType::Dint | DataType::Lint
    )
}

fn is_nan(double: u64) -> bool {
    double >> 52 & 0x7FF == 0x7FF && double << 12 != 0
}

fn is_infinite(double: u64) -> bool {
    double << 1 == 0x7FF << 53
}

/// A finite double as sign, integer mantissa and power of two.
fn parts(double: u64) -> (bool, u128, i32) {
    let exponent = i32::try_from(double >> 52 & 0x7FF).expect("eleven bits");
    let fraction = u128::from(double & ((1 << 52) - 1));
    let negative = double >> 63 == 1;
    if exponent == 0 {
        (negative, fraction, -1074)
    } else {
        (negative, fraction | 1 << 52, exponent - 1075)
    }
}

/// The two's complement of `raw`, rounded half away from zero, and whether it saturated.
fn integer(data_type: DataType, raw: f64) -> (u64, bool) {
    let count = bits(data_type);
    let (low, high) = if is_signed(data_type) {
        (-(1_i128 << (count - 1)), (1_i128 << (count - 1)) - 1)
    } else {
        (0, (1_i128 << count) - 1)
    };
    let double = raw.to_bits();
    let (negative, mantissa, exponent) = parts(double);
    let magnitude = if is_infinite(double) || exponent > 64 {
        1 << 100
    } else if exponent >= 0 {
        mantissa << exponent
    } else if exponent < -60 {
        0
    } else {
        // Floor of the number plus one half, in units of the mantissa.
        (mantissa + (1 << (-exponent - 1))) >> -exponent
    };
    let magnitude = i128::try_from(magnitude).expect("at most 2^118");
    let number = if negative { -magnitude } else { magnitude };
    let nearest = number.clamp(low, high);
    let modulus = 1_i128 << count;
    let word = u64::try_from(nearest.rem_euclid(modulus)).expect("at most 64 bits");
    (word, nearest != number)
}

/// The bits of the REAL nearest to `raw`, ties to even, and whether it saturated.
fn real(raw: f64, value_is_infinite: bool) -> (u64, bool) {
    const MAX: u64 = 0x7F7F_FFFF;
    let double = raw.to_bits();
    let sign = double >> 63 << 31;
    if is_infinite(double) {
        return if value_is_infinite {
            (sign | 0x7F80_0000, false)
        } else {
            (sign | MAX, true)
        };
    }
    let (_, mantissa, exponent) = parts(double);
    // The REAL's unit in the last place: 2^-149 for the smallest, otherwise from the leading bit.
    let leading =
        i32::try_from(128 - mantissa.leading_zeros()).expect("at most 128") - 1 + exponent;
    let unit = (leading - 23).max(-149);
    let shift = unit - exponent;
    let steps = if mantissa == 0 || shift > 100 {
        0
    } else if shift <= 0 {
        mantissa << -shift
    } else {
        let floor = mantissa >> shift;
        let rest = mantissa - (floor << shift);
        match rest.cmp(&(1 << (shift - 1))) {
            Ordering::Less => floor,
            Ordering::Equal => floor + (floor & 1),
            Ordering::Greater => floor + 1,
        }
    };
    // Anything greater than the greatest REAL, even by less than half a unit.
    let beyond = leading > 127 || (leading == 127 && mantissa > 0xFF_FFFF << shift.max(0));
    if beyond {
        return (sign | MAX, true);
    }
    // Counting REALs upwards from zero counts their bit patterns.
    let binade = u64::try_from(unit + 149).expect("not negative");
    let steps = u64::try_from(steps).expect("at most 25 bits");
    (sign | ((binade << 23) + steps), false)
}

/// The bits of an LREAL, and whether it saturated.
fn lreal(raw: f64, value_is_infinite: bool) -> (u64, bool) {
    let double = raw.to_bits();
    if is_infinite(double) && !value_is_infinite {
        (double - 1, true)
    } else {
        (double, false)
    }
}

/// The double of the same value as a REAL's bits; a NaN stays the same NaN, made quiet.
fn widened(word: u64) -> f64 {
    let sign = word >> 31 << 63;
    let exponent = word >> 23 & 0xFF;
    let fraction = word & 0x7F_FFFF;
    let double = match (exponent, fraction) {
        (0xFF, 0) => 0x7FF << 52,
        (0xFF, _) => 0x7FF << 52 | 1 << 51 | fraction << 29,
        (0, 0) => 0,
        (0, _) => {
            let leading = u64::from(fraction.ilog2());
            let rest = fraction - (1 << leading);
            (leading + 1023 - 149) << 52 | rest << (52 - leading)
        }
        _ => (exponent + 1023 - 127) << 52 | fraction << 29,
    };
    f64::from_bits(sign | double)
}

/// The double nearest to an integer, ties to even.
fn integer_as_double(number: i128) -> f64 {
    let sign = if number < 0 { 1 << 63 } else { 0 };
    let magnitude = number.unsigned_abs();
    if magnitude == 0 {
        return 0.0;
    }
    let leading = magnitude.ilog2();
    let fraction = if leading <= 52 {
        (magnitude << (52 - leading)) - (1 << 52)
    } else {
        let shift = leading - 52;
        let floor = magnitude >> shift;
        let rest = magnitude - (floor << shift);
        let half = 1 << (shift - 1);
        let up = rest > half || (rest == half && floor & 1 == 1);
        // A carry out of the fraction goes into the exponent, where it belongs.
        floor - (1 << 52) + u128::from(up)
    };
    let fraction = u64::try_from(fraction).expect("at most 2^52");
    f64::from_bits(sign | (((u64::from(leading) + 1023) << 52) + fraction))
}
