//! Runs of BOOL signals: bytes that are all signals, and bytes of which only some bits are.

use std::array;

use wide::{CmpNe, f64x4};

use super::run::{Member, Run};
use super::{Conversions, index};
use crate::signal::Slot;

/// Arranges `members`, all BOOL, into runs. A byte with any of them is encoded as a whole, by one run.
pub(super) fn lay_out(members: &[Member]) -> Vec<Box<dyn Run>> {
    let mut members = members.to_vec();
    members.sort_by_key(|(_, signal)| (signal.byte, signal.bit));
    let mut octets = Vec::new();
    let mut partials = Partials::default();
    for in_byte in members.chunk_by(|a, b| a.1.byte == b.1.byte) {
        match Octet::of(in_byte) {
            Some(octet) => octets.push(octet),
            None => partials.push(in_byte),
        }
    }
    let mut runs: Vec<Box<dyn Run>> = Vec::new();
    if !octets.is_empty() {
        runs.push(Box::new(Octets(octets)));
    }
    if !partials.bytes.is_empty() {
        runs.push(Box::new(partials));
    }
    runs
}

/// Bytes whose bits 0 to 7 are eight consecutive slots.
#[derive(Debug)]
struct Octets(Vec<Octet>);

#[derive(Debug)]
struct Octet {
    slot: u32,
    byte: u32,
    fail_safe: u8,
}

impl Octet {
    /// Of the members in one byte, by bit.
    fn of(members: &[Member]) -> Option<Self> {
        let (slot, first) = members[0];
        let expected = (slot..).zip(0..8);
        let found = members.iter().map(|(slot, signal)| (*slot, signal.bit));
        found.eq(expected).then(|| Self {
            slot: index(slot),
            byte: index(first.byte),
            fail_safe: (members.iter()).fold(0, |byte, (_, signal)| {
                byte | u8::from(is_high(signal.fail_safe)) << signal.bit
            }),
        })
    }
}

impl Octets {
    /// Encodes values some of which are NaN.
    #[cold]
    #[inline(never)]
    fn encode_any(&self, slots: &[Slot], frame: &mut [u8], conversions: &mut Conversions) {
        for octet in &self.0 {
            if let Some(slots) = slots[octet.slot as usize..].first_chunk() {
                frame[octet.byte as usize] = pack_any(slots, octet.fail_safe, conversions);
            }
        }
    }
}

impl Run for Octets {
    fn encode(&self, slots: &[Slot], frame: &mut [u8], conversions: &mut Conversions) {
        let mut nans = f64x4::ZERO;
        for octet in &self.0 {
            if let Some(slots) = slots[octet.slot as usize..].first_chunk() {
                frame[octet.byte as usize] = pack(slots, &mut nans);
            }
        }
        if nans.any() {
            self.encode_any(slots, frame, conversions);
        }
    }

    fn decode(&self, frame: &[u8], slots: &mut [Slot]) {
        for octet in &self.0 {
            if let Some(slots) = slots[octet.slot as usize..].first_chunk_mut() {
                unpack(frame[octet.byte as usize], slots);
            }
        }
    }
}

/// Bytes with fewer than eight signals, or with signals in another order.
#[derive(Debug, Default)]
struct Partials {
    bytes: Vec<u32>,
    /// The bits of all bytes.
    bits: Vec<Bit>,
}

#[derive(Debug)]
struct Bit {
    slot: u32,
    byte: u32,
    place: u8,
    fail_safe: bool,
}

impl Partials {
    /// Adds the members in one byte.
    fn push(&mut self, members: &[Member]) {
        let byte = index(members[0].1.byte);
        self.bytes.push(byte);
        self.bits.extend(members.iter().map(|(slot, signal)| Bit {
            slot: index(*slot),
            byte,
            place: signal.bit,
            fail_safe: is_high(signal.fail_safe),
        }));
    }
}

impl Run for Partials {
    fn encode(&self, slots: &[Slot], frame: &mut [u8], conversions: &mut Conversions) {
        for byte in &self.bytes {
            frame[*byte as usize] = 0;
        }
        for bit in &self.bits {
            let high = high(slots[bit.slot as usize], bit.fail_safe, conversions);
            frame[bit.byte as usize] |= u8::from(high) << bit.place;
        }
    }

    fn decode(&self, frame: &[u8], slots: &mut [Slot]) {
        for bit in &self.bits {
            let level = frame[bit.byte as usize] >> bit.place & 1;
            slots[bit.slot as usize] = Slot::from_real(f64::from(level));
        }
    }
}

/// Whether a fail-safe value is 1; not when it is NaN.
fn is_high(slot: Slot) -> bool {
    high(slot, false, &mut Conversions::default())
}

/// Whether a BOOL is 1: for every value except zero; NaN takes `fail_safe`, and is counted.
fn high(slot: Slot, fail_safe: bool, conversions: &mut Conversions) -> bool {
    let value = slot.real();
    if value.is_nan() {
        conversions.not_a_number += 1;
        fail_safe
    } else {
        value != 0.0
    }
}

/// Eight slots as one byte, the first slot as bit 0; notes in `nans` whether any of them is NaN, and then the byte is
/// wrong.
#[inline]
fn pack(slots: &[Slot; 8], nans: &mut f64x4) -> u8 {
    let [low, high] = [0, 4].map(|first| f64x4::new(array::from_fn(|i| slots[first + i].real())));
    *nans = *nans | low.is_nan() | high.is_nan();
    let [low_bits, high_bits] = [low, high].map(|four| four.cmp_ne(f64x4::ZERO).move_mask());
    let [byte, ..] = (low_bits | high_bits << 4).to_le_bytes();
    byte
}

/// As [`pack`], checking each value; NaN slots take their bit from `fail_safe` and are counted.
fn pack_any(slots: &[Slot; 8], fail_safe: u8, conversions: &mut Conversions) -> u8 {
    (0..8).zip(slots).fold(0, |byte, (bit, slot)| {
        let fail_safe = fail_safe >> bit & 1 == 1;
        byte | u8::from(high(*slot, fail_safe, conversions)) << bit
    })
}

/// The slots of four bits, bit 0 first.
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

/// One byte as eight slots, bit 0 first.
fn unpack(byte: u8, slots: &mut [Slot; 8]) {
    let (low, high) = slots.split_at_mut(4);
    low.copy_from_slice(&NIBBLES[usize::from(byte & 15)]);
    high.copy_from_slice(&NIBBLES[usize::from(byte >> 4)]);
}
