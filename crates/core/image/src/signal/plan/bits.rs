//! Runs of BOOL signals: bytes fully covered by signals, and bytes with signals in only some bits.

use wide::{CmpEq, i16x8, i32x8, i64x2};

use super::run::{Member, Run};
use super::{Conversions, index};
use crate::signal::Slot;

/// Arranges `members`, all BOOL. A byte with any of them is encoded as a whole, either by the octets or by a run.
pub(super) fn lay_out(members: &[Member]) -> (Octets, Option<Box<dyn Run>>) {
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
    let partials = (!partials.bytes.is_empty()).then(|| Box::new(partials) as Box<dyn Run>);
    (Octets::new(octets), partials)
}

/// Bytes whose bits 0 to 7 are eight consecutive slots. They are not among the runs, since many machines consist of
/// groups of BOOLs: they are converted without a call.
#[derive(Debug)]
pub(super) struct Octets {
    all: Vec<Octet>,
    /// The first of their slots.
    first: usize,
    /// Per octet, its distance from the first one in groups of eight slots, and its bit in a word; if all octets are at
    /// such distances, in up to eight bytes.
    in_word: Option<Vec<(usize, u32)>>,
}

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
    fn new(all: Vec<Octet>) -> Self {
        let slots = all.iter().map(|octet| octet.slot as usize);
        let first = slots.min().unwrap_or_default();
        let place = |octet: &Octet| {
            let from_first = octet.slot as usize - first;
            let is_fit = from_first.is_multiple_of(8) && octet.byte < 8;
            is_fit.then_some((from_first / 8, 8 * octet.byte))
        };
        Self {
            in_word: all.iter().map(place).collect(),
            first,
            all,
        }
    }

    /// True if [`word`](Self::word) may be called.
    pub(super) fn fit_into_a_word(&self) -> bool {
        self.in_word.is_some()
    }

    /// The octets of a frame of up to eight bytes, byte k in bits 8k to 8k + 7; `None` if a value is NaN.
    #[expect(
        clippy::inline_always,
        reason = "it is most of a small tick, and called at few places"
    )]
    #[inline(always)]
    pub(super) fn word(&self, slots: &[Slot]) -> Option<u64> {
        let (mut word, mut seen) = (0, i64x2::ZERO);
        let (eights, _) = slots.get(self.first..)?.as_chunks::<8>();
        for (at, bit) in self.in_word.as_deref()? {
            word |= u64::from(pack(eights.get(*at)?, &mut seen)) << bit;
        }
        if are_plain(seen) {
            Some(word)
        } else {
            self.word_of_any(slots)
        }
    }

    /// The same for any values.
    #[cold]
    #[inline(never)]
    fn word_of_any(&self, slots: &[Slot]) -> Option<u64> {
        let (mut word, mut conversions) = (0, Conversions::default());
        for octet in &self.all {
            let slots = slots.get(octet.slot as usize..)?.first_chunk()?;
            let byte = pack_any(slots, octet.fail_safe, &mut conversions);
            word |= u64::from(byte) << (8 * octet.byte);
        }
        (conversions == Conversions::default()).then_some(word)
    }

    /// Encodes the slots into their bytes of the frame.
    #[inline]
    pub(super) fn encode(&self, slots: &[Slot], frame: &mut [u8], conversions: &mut Conversions) {
        let mut seen = i64x2::ZERO;
        for octet in &self.all {
            if let Some(slots) = slots[octet.slot as usize..].first_chunk() {
                frame[octet.byte as usize] = pack(slots, &mut seen);
            }
        }
        if !are_plain(seen) {
            self.encode_any(slots, frame, conversions);
        }
    }

    /// Encodes any values.
    #[cold]
    #[inline(never)]
    fn encode_any(&self, slots: &[Slot], frame: &mut [u8], conversions: &mut Conversions) {
        for octet in &self.all {
            if let Some(slots) = slots[octet.slot as usize..].first_chunk() {
                frame[octet.byte as usize] = pack_any(slots, octet.fail_safe, conversions);
            }
        }
    }

    /// Decodes the bytes of the frame into their slots.
    pub(super) fn decode(&self, frame: &[u8], slots: &mut [Slot]) {
        for octet in &self.all {
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

/// True if a fail-safe value is 1; false for NaN.
fn is_high(slot: Slot) -> bool {
    high(slot, false, &mut Conversions::default())
}

/// True if a BOOL is 1: for every value except zero; NaN takes `fail_safe`, and is counted.
fn high(slot: Slot, fail_safe: bool, conversions: &mut Conversions) -> bool {
    let value = slot.real();
    if value.is_nan() {
        conversions.not_a_number += 1;
        fail_safe
    } else {
        value != 0.0
    }
}

/// The bits of 1.0.
const ONE: u64 = 1.0_f64.to_bits();

/// Eight slots as one byte, the first slot as bit 0: correct if the slots [are plain](are_plain); for that check, their
/// bits are added to `seen`. One operation thus handles several slots, without looking at their values.
#[expect(
    clippy::inline_always,
    reason = "it is most of a small tick, and as a call it would keep `seen` in memory"
)]
#[inline(always)]
fn pack(slots: &[Slot; 8], seen: &mut i64x2) -> u8 {
    let pair = |first: usize| i64x2::new([slots[first].signed(), slots[first + 1].signed()]);
    let pairs = [pair(0), pair(2), pair(4), pair(6)];
    *seen |= (pairs[0] | pairs[1]) | (pairs[2] | pairs[3]);
    // The upper halves show whether a value is zero.
    let upper = |at: usize| (slots[at].signed() >> 32) as i32;
    let upper = [
        upper(0),
        upper(1),
        upper(2),
        upper(3),
        upper(4),
        upper(5),
        upper(6),
        upper(7),
    ];
    let words = i16x8::from_i32x8_saturate(i32x8::new(upper));
    let [byte, ..] = (!words.cmp_eq(i16x8::ZERO).move_mask()).to_le_bytes();
    byte
}

/// True if all slots whose bits are in `seen` are 0.0 or 1.0, as BOOLs mostly are. Other powers of two below are packed
/// correctly as well, since they also have no bits but those of 1.0.
#[inline]
fn are_plain(seen: i64x2) -> bool {
    let [one, other] = seen.to_array();
    (one | other).cast_unsigned() & !ONE == 0
}

/// Like [`pack`], for any values; NaN slots take their bit from `fail_safe` and are counted.
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

#[cfg(all(test, not(loom)))]
mod tests {
    use crate::signal::{Area, DataType, Plan, Signal, SignalTable, Slot};

    /// BOOLs in this many bytes without gaps.
    fn bools(bytes: usize) -> Plan {
        let signal = |at: usize| Signal {
            bit: u8::try_from(at % 8).expect("a bit"),
            fail_safe: Slot::from_real(1.0),
            ..Signal::new(format!("{at}"), Area::Input, at / 8, DataType::Bool)
        };
        let signals = (0..8 * bytes).map(signal).collect();
        Plan::new(
            &SignalTable::of_one_station(bytes, 0, signals),
            0,
            Area::Input,
        )
    }

    #[test]
    fn a_bool_is_high_for_every_value_but_zero() {
        let plain = &[1.0, 0.0, 0.5, f64::MIN_POSITIVE][..];
        let any = &[1.0, 0.0, -0.0, 2.0, -3.5, 1e-300, 5e-324, f64::INFINITY][..];
        for (bytes, values) in (1..=9).flat_map(|bytes| [(bytes, plain), (bytes, any)]) {
            let plan = bools(bytes);
            let mut slots = vec![Slot::from_real(0.0); 8 * bytes];
            let mut expected = [0_u8; 9];
            for step in 0..200_usize {
                let (at, value) = (step * 7 % (8 * bytes), values[step % values.len()]);
                slots[at] = Slot::from_real(value);
                expected[at / 8] &= !(1 << (at % 8));
                expected[at / 8] |= u8::from(value != 0.0) << (at % 8);
                let mut frame = vec![0; bytes];
                plan.encode(&slots, &mut frame);
                assert_eq!(frame, expected[..bytes], "step {step}");
                let word = expected[..8].try_into().map(u64::from_le_bytes);
                assert_eq!(plan.word(&slots), word.ok().filter(|_| bytes <= 8));
            }
        }
    }

    #[test]
    fn the_bytes_of_a_word_may_be_in_any_order() {
        for slots_between in [0, 3] {
            let mut signals: Vec<_> = (0..16_usize)
                .map(|at| Signal {
                    bit: u8::try_from(at % 8).expect("a bit"),
                    ..Signal::new(format!("{at}"), Area::Input, 1 - at / 8, DataType::Bool)
                })
                .collect();
            for at in 0..slots_between {
                let other = Signal::new(format!("out {at}"), Area::Output, at, DataType::Byte);
                signals.insert(8, other);
            }
            let plan = Plan::new(&SignalTable::of_one_station(2, 3, signals), 0, Area::Input);
            let mut slots = vec![Slot::from_real(0.0); 16 + slots_between];
            slots[1] = Slot::from_real(1.0);
            slots[15 + slots_between] = Slot::from_real(1.0);
            let mut frame = [0; 2];
            plan.encode(&slots, &mut frame);
            assert_eq!(frame, [0x80, 0x02]);
            let word = plan.word(&slots);
            assert_eq!(word, (slots_between == 0).then_some(0x0280));
        }
    }

    #[test]
    fn values_that_are_looked_at_one_by_one_have_no_word() {
        let plan = bools(2);
        let mut frame = [0; 2];
        let mut slots = vec![Slot::from_real(1.0); 16];
        slots[9] = Slot::from_real(f64::NAN);
        assert_eq!(plan.word(&slots), None);
        assert_eq!(plan.word(&slots[..15]), None, "too few slots");
        assert_eq!(plan.encode(&slots, &mut frame).not_a_number, 1);
        assert_eq!(frame, [0xFF; 2], "the fail-safe value is 1");
        slots[9] = Slot::from_real(f64::INFINITY);
        slots[3] = Slot::from_real(f64::NEG_INFINITY);
        assert_eq!(plan.encode(&slots, &mut frame).not_a_number, 0);
        assert_eq!(frame, [0xFF; 2]);
    }

    #[test]
    fn a_frame_that_is_not_all_octets_has_no_word() {
        let mut signals: Vec<_> = (0..8)
            .map(|bit| Signal {
                bit,
                ..Signal::new(format!("{bit}"), Area::Input, 0, DataType::Bool)
            })
            .collect();
        signals.push(Signal::new("byte", Area::Input, 1, DataType::Byte));
        let table = SignalTable::of_one_station(2, 0, signals);
        let slots = vec![Slot::from_real(1.0); 9];
        assert_eq!(Plan::new(&table, 0, Area::Input).word(&slots), None);
    }
}
