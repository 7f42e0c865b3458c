//! BOOL signals: whole bytes of them, and the bytes that only some bits of are signals.

use std::ops::Range;

use super::run::Member;
use super::{Conversions, index};
use crate::signal::Slot;

/// All BOOL signals of a frame. Every byte that holds one is stored whole.
#[derive(Debug)]
pub(super) struct Bits {
    octets: Box<[Octet]>,
    partials: Box<[Partial]>,
    /// The bits of all partials.
    bits: Box<[Bit]>,
}

/// A byte whose bits 0 to 7 are eight consecutive slots.
#[derive(Debug)]
struct Octet {
    slot: u32,
    byte: u32,
    fail_safe: u8,
}

/// A byte with fewer signals, or with signals in another order.
#[derive(Debug)]
struct Partial {
    byte: u32,
    /// Range in [`Bits::bits`].
    bits: Range<u32>,
}

/// One signal in a partial byte.
#[derive(Debug)]
struct Bit {
    slot: u32,
    bit: u8,
    fail_safe: bool,
}

impl Bits {
    /// Of `members`, all BOOL and in slot order.
    pub(super) fn new(members: &[Member]) -> Self {
        let mut members = members.to_vec();
        members.sort_by_key(|(_, signal)| (signal.byte, signal.bit));
        let mut octets = Vec::new();
        let mut partials = Vec::new();
        let mut bits = Vec::new();
        for in_byte in members.chunk_by(|a, b| a.1.byte == b.1.byte) {
            let byte = index(in_byte[0].1.byte);
            let is_octet = in_byte.len() == 8
                && (0..).zip(in_byte).all(|(bit, member)| member.1.bit == bit)
                && in_byte.windows(2).all(|pair| pair[1].0 == pair[0].0 + 1);
            let in_byte = in_byte.iter().map(|(slot, signal)| Bit {
                slot: index(*slot),
                bit: signal.bit,
                fail_safe: is_high(signal.fail_safe.real()),
            });
            let start = bits.len();
            bits.extend(in_byte);
            if is_octet {
                octets.push(Octet {
                    slot: bits[start].slot,
                    byte,
                    fail_safe: (bits[start..].iter())
                        .fold(0, |byte, bit| byte | u8::from(bit.fail_safe) << bit.bit),
                });
                bits.truncate(start);
            } else {
                partials.push(Partial {
                    byte,
                    bits: index(start)..index(bits.len()),
                });
            }
        }
        Self {
            octets: octets.into(),
            partials: partials.into(),
            bits: bits.into(),
        }
    }

    /// Encodes the slots of all BOOL signals into their bytes; the other bits of those become zero.
    pub(super) fn encode(&self, slots: &[Slot], frame: &mut [u8], conversions: &mut Conversions) {
        for octet in &self.octets {
            if let Some(slots) = slots[octet.slot as usize..].first_chunk() {
                frame[octet.byte as usize] = pack(slots, octet.fail_safe, conversions);
            }
        }
        for partial in &self.partials {
            let mut byte = 0;
            for bit in self.bits_of(partial) {
                let value = slots[bit.slot as usize].real();
                let mut high = is_high(value);
                if value.is_nan() {
                    conversions.not_a_number += 1;
                    high = bit.fail_safe;
                }
                byte |= u8::from(high) << bit.bit;
            }
            frame[partial.byte as usize] = byte;
        }
    }

    /// Decodes all bytes with BOOL signals into their slots.
    pub(super) fn decode(&self, frame: &[u8], slots: &mut [Slot]) {
        for octet in &self.octets {
            if let Some(slots) = slots[octet.slot as usize..].first_chunk_mut() {
                unpack(frame[octet.byte as usize], slots);
            }
        }
        for partial in &self.partials {
            let byte = frame[partial.byte as usize];
            for bit in self.bits_of(partial) {
                slots[bit.slot as usize] = NIBBLES[usize::from(byte >> bit.bit & 1)][0];
            }
        }
    }

    fn bits_of(&self, partial: &Partial) -> &[Bit] {
        &self.bits[partial.bits.start as usize..partial.bits.end as usize]
    }
}

/// Whether a BOOL is 1: every value but zero and NaN.
fn is_high(value: f64) -> bool {
    value != 0.0 && !value.is_nan()
}

/// Eight slots as one byte, the first slot as bit 0.
fn pack(slots: &[Slot; 8], fail_safe: u8, conversions: &mut Conversions) -> u8 {
    let mut byte = 0;
    let mut any_nan = false;
    for (bit, slot) in slots.iter().enumerate() {
        byte |= u8::from(slot.real() != 0.0) << bit;
        any_nan |= slot.real().is_nan();
    }
    if any_nan {
        byte = without_nan(slots, byte, fail_safe, conversions);
    }
    byte
}

/// `byte` with the bits of NaN slots taken from `fail_safe`; counted.
#[cold]
#[inline(never)]
fn without_nan(slots: &[Slot; 8], byte: u8, fail_safe: u8, conversions: &mut Conversions) -> u8 {
    let mut nan = 0;
    for (bit, slot) in slots.iter().enumerate() {
        nan |= u8::from(slot.real().is_nan()) << bit;
    }
    conversions.not_a_number += nan.count_ones();
    byte & !nan | fail_safe & nan
}

/// The slots of four bits, the first of bit 0.
static NIBBLES: [[Slot; 4]; 16] = {
    let mut nibbles = [[Slot::from_real(0.0); 4]; 16];
    let mut nibble = 0;
    while nibble < 16 {
        let mut bit = 0;
        while bit < 4 {
            if nibble >> bit & 1 == 1 {
                nibbles[nibble][bit] = Slot::from_real(1.0);
            }
            bit += 1;
        }
        nibble += 1;
    }
    nibbles
};

/// One byte as eight slots, bit 0 as the first.
fn unpack(byte: u8, slots: &mut [Slot; 8]) {
    let (low, high) = slots.split_at_mut(4);
    low.copy_from_slice(&NIBBLES[usize::from(byte & 15)]);
    high.copy_from_slice(&NIBBLES[usize::from(byte >> 4)]);
}
