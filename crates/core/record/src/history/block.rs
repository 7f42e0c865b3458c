//! A block of a history: the state before its first tick, and what each tick changed.
#![allow(
    clippy::cast_possible_truncation,
    reason = "numbers are packed byte by byte, and fit where they come from"
)]

use tickbus_base::time::Nanos;
use tickbus_image::signal::Slot;

use crate::{Tick, ValueKind};

/// The tick's number does not follow that of the tick before.
const NUMBER: u8 = 1;
/// The time since the tick before is another than in that tick.
const STEP: u8 = 2;
/// A status is another one.
const STATUS: u8 = 4;
/// More ticks are dropped.
const DROPPED: u8 = 8;
/// Values are others.
const VALUES: u8 = 16;

/// From this status of an exchange on, and for errors, data are stale.
const STALE: i32 = 2;

/// True for the status of stale data.
pub(super) const fn is_stale(status: i32) -> bool {
    status >= STALE || status < 0
}

/// Consecutive ticks. Edge columns hold sums, not the counts of single ticks.
#[derive(Clone, Debug)]
pub(super) struct Block {
    /// The state before the first tick.
    base: Tick,
    data: Vec<u8>,
    /// A bit per column that a tick changed.
    changed: Box<[u64]>,
    /// A tick changed a status.
    pub(super) has_turn: bool,
    pub(super) ticks: u64,
    /// Number and time of the first and the last tick.
    pub(super) first: (u64, Nanos),
    pub(super) last: (u64, Nanos),
    /// The time between the last two ticks.
    step: i64,
}

impl Block {
    /// An empty block after this state.
    pub(super) fn new(base: Tick) -> Self {
        let place = (base.number, base.time);
        Self {
            changed: vec![0; base.values.len().div_ceil(64)].into(),
            base,
            data: Vec::new(),
            has_turn: false,
            ticks: 0,
            first: place,
            last: place,
            step: 0,
        }
    }

    /// The memory that the block takes, in bytes.
    pub(super) fn bytes(&self) -> usize {
        let words = self.base.values.len() + self.base.stations.len() / 2 + self.changed.len();
        size_of::<Self>() + words * size_of::<u64>() + self.data.capacity()
    }

    /// The bytes that its ticks take.
    pub(super) fn len(&self) -> usize {
        self.data.len()
    }

    /// Gives back unused memory.
    pub(super) fn shrink(&mut self) {
        self.data.shrink_to_fit();
    }

    /// True if a tick changed this column.
    pub(super) fn has_changed(&self, column: usize) -> bool {
        self.changed[column / 64] & (1 << (column % 64)) != 0
    }

    /// Adds a tick, and makes `now` its state.
    pub(super) fn push(&mut self, kinds: &[ValueKind], tick: &Tick, now: &mut Tick) {
        let begin = self.data.len();
        let mut flags = 0;
        self.data.push(0);
        let number = tick.number.wrapping_sub(now.number);
        if number != 1 {
            flags |= NUMBER;
            put(&mut self.data, number);
        }
        let step = tick.time.0.wrapping_sub(now.time.0);
        if step != self.step {
            flags |= STEP;
            put(&mut self.data, zigzag(step));
            self.step = step;
        }
        if (tick.status, &tick.stations) != (now.status, &now.stations) {
            flags |= STATUS;
            self.has_turn = true;
            for status in std::iter::once(&tick.status).chain(&tick.stations) {
                put(&mut self.data, zigzag(i64::from(*status)));
            }
            now.status = tick.status;
            now.stations.clone_from(&tick.stations);
        }
        if tick.dropped != now.dropped {
            flags |= DROPPED;
            put(&mut self.data, tick.dropped.wrapping_sub(now.dropped));
        }
        (now.number, now.time, now.dropped) = (tick.number, tick.time, tick.dropped);
        if self.push_values(kinds, &tick.values, &mut now.values) {
            flags |= VALUES;
        }
        self.data[begin] = flags;
        self.last = (tick.number, tick.time);
        if self.ticks == 0 {
            self.first = self.last;
        }
        self.ticks += 1;
    }

    /// Adds the changed values, each behind the distance from the one before; a distance of 0 ends them.
    fn push_values(&mut self, kinds: &[ValueKind], values: &[Slot], now: &mut [Slot]) -> bool {
        let mut next = 0;
        let columns = values.iter().zip(now).zip(kinds).enumerate();
        for (column, ((value, now), kind)) in columns {
            let is_same = match kind {
                ValueKind::Count => value.real() == 0.0,
                _ => value == now,
            };
            if is_same {
                continue;
            }
            self.changed[column / 64] |= 1 << (column % 64);
            put(&mut self.data, (column + 1 - next) as u64);
            next = column + 1;
            match kind {
                ValueKind::Count => {
                    put(&mut self.data, u64::from(crate::sink::count(value.real())));
                    *now = Slot::from_real(now.real() + value.real());
                }
                ValueKind::Bit => {
                    let bit = value.real();
                    let code = if bit.is_nan() {
                        2
                    } else {
                        u8::from(bit != 0.0)
                    };
                    self.data.push(code);
                    *now = *value;
                }
                ValueKind::Real | ValueKind::Signed | ValueKind::Unsigned => {
                    put_word(&mut self.data, value.0 ^ now.0);
                    *now = *value;
                }
            }
        }
        if next > 0 {
            self.data.push(0);
        }
        next > 0
    }
}

/// A number in groups of seven bits, lowest first.
fn put(out: &mut Vec<u8>, mut number: u64) {
    while number >= 0x80 {
        out.push(number as u8 | 0x80);
        number >>= 7;
    }
    out.push(number as u8);
}

/// A word without its zero bytes at both ends, behind their numbers.
fn put_word(out: &mut Vec<u8>, word: u64) {
    let bytes = word.to_be_bytes();
    let leading = (word.leading_zeros() / 8).min(7) as usize;
    let trailing = (word.trailing_zeros() / 8).min(7) as usize;
    let end = (8 - trailing).max(leading + 1);
    out.push((leading << 4 | (end - leading)) as u8);
    out.extend_from_slice(&bytes[leading..end]);
}

const fn zigzag(number: i64) -> u64 {
    ((number << 1) ^ (number >> 63)).cast_unsigned()
}

const fn unzigzag(number: u64) -> i64 {
    (number >> 1).cast_signed() ^ -((number & 1).cast_signed())
}

/// Walks through the ticks of a block.
pub(super) struct Cursor<'b> {
    kinds: &'b [ValueKind],
    data: &'b [u8],
    step: i64,
    /// The current tick, with sums of edges; before the first step, the state before the block.
    pub(super) tick: Tick,
    /// The columns that the current tick changed.
    pub(super) touched: Vec<usize>,
    /// The statuses before the current tick, if it changed one.
    pub(super) turned: Option<(i32, Vec<i32>)>,
}

impl<'b> Cursor<'b> {
    pub(super) fn new(block: &'b Block, kinds: &'b [ValueKind]) -> Self {
        Self {
            kinds,
            data: &block.data,
            step: 0,
            tick: block.base.clone(),
            touched: Vec::new(),
            turned: None,
        }
    }

    /// Goes to the next tick; false at the end.
    pub(super) fn step(&mut self) -> bool {
        let Some((&flags, rest)) = self.data.split_first() else {
            return false;
        };
        self.data = rest;
        let number = if flags & NUMBER == 0 {
            1
        } else {
            self.number()
        };
        self.tick.number = self.tick.number.wrapping_add(number);
        if flags & STEP != 0 {
            self.step = unzigzag(self.number());
        }
        self.tick.time = Nanos(self.tick.time.0.wrapping_add(self.step));
        self.turned = None;
        if flags & STATUS != 0 {
            self.turned = Some((self.tick.status, self.tick.stations.clone()));
            self.tick.status = self.status();
            for station in 0..self.tick.stations.len() {
                self.tick.stations[station] = self.status();
            }
        }
        if flags & DROPPED != 0 {
            self.tick.dropped = self.tick.dropped.wrapping_add(self.number());
        }
        self.touched.clear();
        if flags & VALUES != 0 {
            self.values();
        }
        true
    }

    /// True if the current tick begins an outage.
    pub(super) fn has_gone_stale(&self) -> bool {
        self.turned.as_ref().is_some_and(|(status, stations)| {
            let now = std::iter::once(self.tick.status).chain(self.tick.stations.iter().copied());
            let before = std::iter::once(*status).chain(stations.iter().copied());
            before
                .zip(now)
                .any(|(before, now)| !is_stale(before) && is_stale(now))
        })
    }

    fn values(&mut self) {
        let mut next = 0;
        loop {
            let distance = self.number() as usize;
            if distance == 0 {
                return;
            }
            let column = next + distance - 1;
            next = column + 1;
            self.touched.push(column);
            let before = self.tick.values[column];
            self.tick.values[column] = match self.kinds[column] {
                ValueKind::Count => {
                    #[expect(clippy::cast_precision_loss, reason = "made from a u32")]
                    let count = self.number() as f64;
                    Slot::from_real(before.real() + count)
                }
                ValueKind::Bit => Slot::from_real(match self.byte() {
                    0 => 0.0,
                    1 => 1.0,
                    _ => f64::NAN,
                }),
                ValueKind::Real | ValueKind::Signed | ValueKind::Unsigned => {
                    Slot(before.0 ^ self.word())
                }
            };
        }
    }

    fn byte(&mut self) -> u8 {
        let (byte, rest) = self.data.split_first().expect("a block has whole ticks");
        self.data = rest;
        *byte
    }

    fn number(&mut self) -> u64 {
        let (mut number, mut shift) = (0, 0);
        loop {
            let byte = self.byte();
            number |= u64::from(byte & 0x7f) << shift;
            if byte < 0x80 {
                return number;
            }
            shift += 7;
        }
    }

    fn status(&mut self) -> i32 {
        unzigzag(self.number()) as i32
    }

    fn word(&mut self) -> u64 {
        let head = usize::from(self.byte());
        let (leading, length) = (head >> 4, head & 15);
        let (given, rest) = self.data.split_at(length);
        self.data = rest;
        let mut bytes = [0; 8];
        bytes[leading..leading + length].copy_from_slice(given);
        u64::from_be_bytes(bytes)
    }
}
