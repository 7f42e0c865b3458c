//! Runs: signals of one type, byte order and scaling, converted in one loop.

use std::array;
use std::fmt::Debug;
use std::marker::PhantomData;
use std::ops::Range;

use super::number::Codec;
use super::word::{Order, Word};
use super::{Conversions, index};
use crate::signal::{Signal, Slot};

/// A signal and its slot number.
pub(super) type Member<'a> = (usize, &'a Signal);

/// Fewer adjacent signals than this are not worth a separate loop.
const SHORTEST_DENSE: usize = 4;

/// The number of values that a dense run encodes before it checks that all of them fitted.
const BLOCK: usize = 32;

/// Signals that are converted by the same instructions.
pub(super) trait Run: Debug + Send + Sync {
    /// Encodes the run's slots into their bytes of the frame.
    fn encode(&self, slots: &[Slot], frame: &mut [u8], conversions: &mut Conversions);

    /// Decodes the run's bytes of the frame into their slots.
    fn decode(&self, frame: &[u8], slots: &mut [Slot]);
}

/// Bytes that no signal touches: encoded as zero.
#[derive(Debug)]
pub(super) struct Gaps(pub(super) Vec<Range<usize>>);

impl Run for Gaps {
    fn encode(&self, _: &[Slot], frame: &mut [u8], _: &mut Conversions) {
        for gap in &self.0 {
            frame[gap.clone()].fill(0);
        }
    }

    fn decode(&self, _: &[u8], _: &mut [Slot]) {}
}

/// Arranges `members`, all of codec `C` and order `O` and in slot order: those adjacent both in slots and in
/// bytes become dense runs, all others share a scattered one.
pub(super) fn lay_out<C: Codec, O: Order>(members: &[Member]) -> Vec<Box<dyn Run>> {
    let mut runs: Vec<Box<dyn Run>> = Vec::new();
    let mut scattered = Vec::new();
    let neighbours =
        |a: &Member, b: &Member| b.0 == a.0 + 1 && b.1.byte == a.1.byte + <C::Word as Word>::BYTES;
    for stretch in members.chunk_by(neighbours) {
        if stretch.len() < SHORTEST_DENSE {
            scattered.extend_from_slice(stretch);
        } else {
            runs.push(Box::new(Dense::<C, O>::new(stretch)));
        }
    }
    if !scattered.is_empty() {
        runs.push(Box::new(Scattered::<C, O>::new(&scattered)));
    }
    runs
}

/// A run's data of its signals, in the order of the run.
#[derive(Debug)]
struct Values<C: Codec> {
    scales: Box<[C::Scale]>,
    fail_safes: Box<[C::Word]>,
}

impl<C: Codec> Values<C> {
    fn new(members: &[Member]) -> Self {
        let scales = members.iter().map(|(_, signal)| C::scale(signal.scale));
        let fail_safes = members
            .iter()
            .map(|(_, signal)| C::fail_safe(signal.fail_safe, C::scale(signal.scale)));
        Self {
            scales: scales.collect(),
            fail_safes: fail_safes.collect(),
        }
    }
}

/// Consecutive slots, consecutive bytes.
#[derive(Debug)]
struct Dense<C: Codec, O> {
    slot: usize,
    byte: usize,
    values: Values<C>,
    order: PhantomData<O>,
}

impl<C: Codec, O: Order> Dense<C, O> {
    const BYTES: usize = <C::Word as Word>::BYTES;

    fn new(members: &[Member]) -> Self {
        let (slot, first) = members[0];
        Self {
            slot,
            byte: first.byte,
            values: Values::new(members),
            order: PhantomData,
        }
    }

    /// Encodes values one by one, checking each.
    #[inline(never)]
    fn one_by_one(
        slots: &[Slot],
        scales: &[C::Scale],
        fail_safes: &[C::Word],
        bytes: &mut [u8],
        conversions: &mut Conversions,
    ) {
        let values = slots.iter().zip(scales).zip(fail_safes);
        for (((slot, scale), fail_safe), bytes) in values.zip(bytes.chunks_exact_mut(Self::BYTES)) {
            O::arrange(C::encode(*slot, *scale, *fail_safe, conversions)).put(bytes);
        }
    }
}

impl<C: Codec, O: Order> Run for Dense<C, O> {
    fn encode(&self, slots: &[Slot], frame: &mut [u8], conversions: &mut Conversions) {
        let Values { scales, fail_safes } = &self.values;
        let slots = &slots[self.slot..][..scales.len()];
        let bytes = &mut frame[self.byte..][..scales.len() * Self::BYTES];
        // Blocks of a constant length become vector code without remainders.
        let (slot_blocks, last_slots) = slots.as_chunks::<BLOCK>();
        let (scale_blocks, last_scales) = scales.as_chunks::<BLOCK>();
        let (fail_safe_blocks, last_fail_safes) = fail_safes.as_chunks::<BLOCK>();
        let mut byte_blocks = bytes.chunks_exact_mut(BLOCK * Self::BYTES);
        let blocks = slot_blocks.iter().zip(scale_blocks).zip(fail_safe_blocks);
        for (((slots, scales), fail_safes), bytes) in blocks.zip(&mut byte_blocks) {
            let raws: [C::Raw; BLOCK] = array::from_fn(|i| C::raw(slots[i], scales[i]));
            if raws.iter().fold(true, |all, raw| all & C::fits(*raw)) {
                for (raw, bytes) in raws.iter().zip(bytes.chunks_exact_mut(Self::BYTES)) {
                    O::arrange(C::word(*raw)).put(bytes);
                }
            } else {
                Self::one_by_one(slots, scales, fail_safes, bytes, conversions);
            }
        }
        let last_bytes = byte_blocks.into_remainder();
        Self::one_by_one(
            last_slots,
            last_scales,
            last_fail_safes,
            last_bytes,
            conversions,
        );
    }

    fn decode(&self, frame: &[u8], slots: &mut [Slot]) {
        let scales = &self.values.scales;
        let slots = &mut slots[self.slot..][..scales.len()];
        let bytes = &frame[self.byte..][..scales.len() * Self::BYTES];
        let values = slots.iter_mut().zip(scales);
        for ((slot, scale), bytes) in values.zip(bytes.chunks_exact(Self::BYTES)) {
            *slot = C::decode(O::arrange(C::Word::get(bytes)), *scale);
        }
    }
}

/// The slot and the byte of one signal of a scattered run.
#[derive(Clone, Copy, Debug)]
struct SlotOffset {
    slot: u32,
    byte: u32,
}

/// Any slots, any bytes.
#[derive(Debug)]
struct Scattered<C: Codec, O> {
    places: Box<[SlotOffset]>,
    values: Values<C>,
    order: PhantomData<O>,
}

impl<C: Codec, O: Order> Scattered<C, O> {
    const BYTES: usize = <C::Word as Word>::BYTES;

    fn new(members: &[Member]) -> Self {
        let places = members.iter().map(|(slot, signal)| SlotOffset {
            slot: index(*slot),
            byte: index(signal.byte),
        });
        Self {
            places: places.collect(),
            values: Values::new(members),
            order: PhantomData,
        }
    }
}

impl<C: Codec, O: Order> Run for Scattered<C, O> {
    fn encode(&self, slots: &[Slot], frame: &mut [u8], conversions: &mut Conversions) {
        let Values { scales, fail_safes } = &self.values;
        for ((place, scale), fail_safe) in self.places.iter().zip(scales).zip(fail_safes) {
            let slot = slots[place.slot as usize];
            let bytes = &mut frame[place.byte as usize..][..Self::BYTES];
            O::arrange(C::encode(slot, *scale, *fail_safe, conversions)).put(bytes);
        }
    }

    fn decode(&self, frame: &[u8], slots: &mut [Slot]) {
        for (place, scale) in self.places.iter().zip(&self.values.scales) {
            let bytes = &frame[place.byte as usize..][..Self::BYTES];
            slots[place.slot as usize] = C::decode(O::arrange(C::Word::get(bytes)), *scale);
        }
    }
}
