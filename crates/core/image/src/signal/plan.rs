//! The codec plan: how slots become frame bytes and back, compiled once from the signal table.
//!
//! Compiling sorts the signals into *runs*, each converted by one loop that is monomorphised for its type,
//! byte order and scaling. At run time nothing is decided per signal, and encoding and decoding neither
//! allocate nor block.

mod bits;
mod number;
mod run;
mod word;

use std::ops::Range;

use self::bits::Octets;
use self::number::{Codec, Integer64, Number, Real, Unscaled};
use self::run::{Gaps, Member, Run};
use super::{Area, ByteOrder, DataType, Scale, Signal, SignalTable, Slot};

/// The number of values that could not be encoded unchanged.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Conversions {
    /// Values beyond the range of their type, replaced by its nearest limit.
    pub saturated: u32,
    /// NaN values, replaced by the signal's fail-safe value.
    pub not_a_number: u32,
}

/// The frame of `area` of the station with index `station` that holds the fail-safe value of every signal.
pub fn fail_safe_frame(table: &SignalTable, station: usize, area: Area) -> Box<[u8]> {
    let plan = Plan::new(table, station, area);
    let mut slots = vec![Slot::default(); table.signals.len()];
    let mut frame = vec![0; table.stations[station].bytes(area)];
    plan.fail_safe(&mut slots);
    plan.encode(&slots, &mut frame);
    frame.into()
}

/// The conversion between slots and one frame (one area of one station).
///
/// The raw number of a signal with a scale is (value − offset) / gain; without a scale it is the value
/// itself. Decoding is raw × gain + offset. Encoding has these rules:
///
/// - integers round half away from zero, and results beyond the type's range saturate, infinities included;
/// - a REAL beyond ±[`f32::MAX`] and an LREAL beyond ±[`f64::MAX`] saturate there, but infinite values stay
///   infinite, because these types have infinities;
/// - NaN becomes the signal's fail-safe value (zero if that is NaN as well);
/// - a BOOL is 0 for zero of either sign, and 1 for everything else except NaN.
///
/// Decoding changes nothing: a REAL that is NaN or infinite stays so, a BOOL becomes 0.0 or 1.0. An unscaled
/// LWORD, LINT or ULINT passes bit by bit in both directions.
#[derive(Debug)]
pub struct Plan {
    /// The number of slots and frame bytes that the plan needs.
    slots: usize,
    bytes: usize,
    octets: Octets,
    runs: Vec<Box<dyn Run>>,
    /// True if a frame of up to eight bytes consists only of octets.
    is_word: bool,
    fail_safes: Vec<(usize, Slot)>,
}

impl Plan {
    /// Compiles the plan for `area` of the station with index `station`.
    ///
    /// Slot numbers are positions in `table.signals`. Frames must be as long as the station's area; further
    /// bytes of a longer frame are not touched. The table is expected to be checked: which of two overlapping
    /// signals is encoded is unspecified.
    pub fn new(table: &SignalTable, station: usize, area: Area) -> Self {
        let members: Vec<Member> = (table.signals.iter().enumerate())
            .filter(|(_, signal)| signal.station == station && signal.area == area)
            .collect();
        let station_bytes = table.stations.get(station).map_or(0, |station| match area {
            Area::Input => station.input_bytes,
            Area::Output => station.output_bytes,
        });
        let ends = members
            .iter()
            .map(|(_, s)| s.byte + s.data_type.size_bytes());
        let bytes = ends
            .max()
            .map_or(station_bytes, |end| end.max(station_bytes));
        let gaps = gaps(&members, bytes);
        let (octets, mut runs) = runs(&members);
        let is_word = runs.is_empty() && bytes <= size_of::<u64>() && octets.fit_into_a_word();
        if !gaps.is_empty() {
            runs.push(Box::new(Gaps(gaps)));
        }
        Self {
            slots: members.last().map_or(0, |(slot, _)| slot + 1),
            bytes,
            octets,
            runs,
            is_word,
            fail_safes: (members.iter().map(|(slot, s)| (*slot, s.fail_safe))).collect(),
        }
    }

    /// Encodes the area's slots into `frame`. Bytes and bits that no signal covers become zero.
    ///
    /// # Panics
    ///
    /// When `frame` or `slots` is shorter than the plan needs.
    #[inline]
    pub fn encode(&self, slots: &[Slot], frame: &mut [u8]) -> Conversions {
        self.check(slots.len(), frame.len());
        let mut conversions = Conversions::default();
        self.octets.encode(slots, frame, &mut conversions);
        for run in &self.runs {
            run.encode(slots, frame, &mut conversions);
        }
        conversions
    }

    /// The frame that [`encode`](Self::encode) would make, as a number whose least significant byte comes first, if the
    /// frame has up to eight bytes that are all BOOLs, eight to a byte in the order of the slots. `None` for other
    /// frames, if a value is NaN, and if `slots` is shorter than the plan needs.
    #[expect(
        clippy::inline_always,
        reason = "it is most of a small tick, and called at few places"
    )]
    #[inline(always)]
    pub fn word(&self, slots: &[Slot]) -> Option<u64> {
        if self.is_word {
            self.octets.word(slots)
        } else {
            None
        }
    }

    /// Decodes `frame` into the area's slots; other slots are not touched.
    ///
    /// # Panics
    ///
    /// When `frame` or `slots` is shorter than the plan needs.
    pub fn decode(&self, frame: &[u8], slots: &mut [Slot]) {
        self.check(slots.len(), frame.len());
        self.octets.decode(frame, slots);
        for run in &self.runs {
            run.decode(frame, slots);
        }
    }

    /// Writes the fail-safe values of the area's signals into their slots.
    ///
    /// # Panics
    ///
    /// When `slots` is shorter than the plan needs.
    pub fn fail_safe(&self, slots: &mut [Slot]) {
        self.check(slots.len(), self.bytes);
        for (slot, fail_safe) in &self.fail_safes {
            slots[*slot] = *fail_safe;
        }
    }

    /// The only check of lengths: all indices below are within the checked lengths.
    #[inline]
    fn check(&self, slots: usize, bytes: usize) {
        assert!(
            slots >= self.slots && bytes >= self.bytes,
            "the plan needs {} slots and {} frame bytes, but was given {slots} and {bytes}",
            self.slots,
            self.bytes,
        );
    }
}

/// The properties that select a loop for a signal.
#[derive(Clone, Copy, PartialEq, Eq)]
struct Kind {
    data_type: DataType,
    order: ByteOrder,
    scaled: bool,
}

impl Kind {
    /// Types and orders with the same bytes are one kind, so that their signals share runs.
    fn of(signal: &Signal) -> Self {
        let scaled = signal.scale.is_some();
        let data_type = match signal.data_type {
            DataType::Byte => DataType::Usint,
            DataType::Word => DataType::Uint,
            DataType::Dword => DataType::Udint,
            DataType::Lword => DataType::Ulint,
            DataType::Lint if !scaled => DataType::Ulint,
            other => other,
        };
        let order = match (data_type.size_bytes(), signal.order) {
            (1, _) | (2, ByteOrder::Cdab) => ByteOrder::Abcd,
            (2, ByteOrder::Badc) => ByteOrder::Dcba,
            (_, order) => order,
        };
        Self {
            data_type,
            order,
            scaled,
        }
    }

    /// The runs of `members`, all of this kind, which is not BOOL.
    fn runs(self, members: &[Member]) -> Vec<Box<dyn Run>> {
        match self.data_type {
            DataType::Bool => Vec::new(),
            DataType::Sint => self.number::<i8>(members),
            DataType::Byte | DataType::Usint => self.number::<u8>(members),
            DataType::Int => self.number::<i16>(members),
            DataType::Word | DataType::Uint => self.number::<u16>(members),
            DataType::Dint => self.number::<i32>(members),
            DataType::Dword | DataType::Udint => self.number::<u32>(members),
            DataType::Real => self.number::<f32>(members),
            DataType::Lreal => self.number::<f64>(members),
            DataType::Lint if self.scaled => self.number::<i64>(members),
            DataType::Lword | DataType::Ulint if self.scaled => self.number::<u64>(members),
            DataType::Lword | DataType::Lint | DataType::Ulint => self.codec::<Integer64>(members),
        }
    }

    fn number<N: Number>(self, members: &[Member]) -> Vec<Box<dyn Run>> {
        if self.scaled {
            self.codec::<Real<N, Scale>>(members)
        } else {
            self.codec::<Real<N, Unscaled>>(members)
        }
    }

    fn codec<C: Codec>(self, members: &[Member]) -> Vec<Box<dyn Run>> {
        match self.order {
            ByteOrder::Abcd => run::lay_out::<C, word::Abcd>(members),
            ByteOrder::Cdab => run::lay_out::<C, word::Cdab>(members),
            ByteOrder::Badc => run::lay_out::<C, word::Badc>(members),
            ByteOrder::Dcba => run::lay_out::<C, word::Dcba>(members),
        }
    }
}

/// The octets and the runs of all signals.
fn runs(members: &[Member]) -> (Octets, Vec<Box<dyn Run>>) {
    let mut kinds: Vec<(Kind, Vec<Member>)> = Vec::new();
    let (bools, numbers): (Vec<Member>, Vec<Member>) =
        (members.iter().copied()).partition(|(_, signal)| signal.data_type == DataType::Bool);
    let (octets, partials) = bits::lay_out(&bools);
    for member in &numbers {
        let kind = Kind::of(member.1);
        match kinds.iter_mut().find(|(known, _)| *known == kind) {
            Some((_, alike)) => alike.push(*member),
            None => kinds.push((kind, vec![*member])),
        }
    }
    let numbers = (kinds.iter()).flat_map(|(kind, members)| kind.runs(members));
    (octets, partials.into_iter().chain(numbers).collect())
}

/// The bytes of a frame that no signal touches.
fn gaps(members: &[Member], frame_bytes: usize) -> Vec<Range<usize>> {
    let mut spans: Vec<Range<usize>> = (members.iter())
        .map(|(_, signal)| signal.byte..signal.byte + signal.data_type.size_bytes())
        .collect();
    spans.sort_by_key(|span| span.start);
    let mut gaps = Vec::new();
    let mut covered = 0;
    for span in spans {
        if span.start > covered {
            gaps.push(covered..span.start);
        }
        covered = covered.max(span.end);
    }
    if covered < frame_bytes {
        gaps.push(covered..frame_bytes);
    }
    gaps
}

/// A slot or byte number as runs store it: half the size, so that twice as many fit into the cache.
fn index(number: usize) -> u32 {
    u32::try_from(number).expect("signal tables and frames have fewer than 2^32 slots and bytes")
}

/// An unscaled number as the codec rounds it. `f64::round` is that of the C library, which in MinGW turns
/// 0.49999999999999994 into 1.
pub(super) fn rounded(raw: f64) -> f64 {
    number::nudge(raw).trunc()
}

#[cfg(all(test, not(loom)))]
mod tests;
