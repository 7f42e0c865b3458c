//! One station of a replay: what it shows again of what it received, and what it is expected to send.

use crate::Code;
use crate::SlotMap;
use crate::frames::{area_bytes, directions};
use tickbus_base::time::Nanos;
use tickbus_driver_cfg::Config;
use tickbus_image::signal::{Area, Latch, Plan, Slot};
use tickbus_image::{DirectStream, LatchedBit, PulseShaper};
use tickbus_record::{Tick, ValueKind};

use super::{FRESH, STALE, UNCHANGED};

/// A latched bit that this end receives.
struct Latched {
    bit: LatchedBit,
    /// The column with its edge count.
    column: Option<usize>,
    /// The slot with its edge count.
    slot: Option<usize>,
    /// Its edges in the current tick, and in all.
    count: u32,
    total: u32,
}

/// A signal that this end sends.
struct Sent {
    signal: usize,
    name: String,
    kind: ValueKind,
}

pub(super) struct Station {
    receive: Plan,
    send: Plan,
    /// The signals that it receives.
    received: Vec<usize>,
    latched: Vec<Latched>,
    sent: Vec<Sent>,
    /// Its status in the last recorded tick.
    pub(super) status: i32,
    /// The recorded ticks that fell on the current one, and whether any of them was fresh.
    ticks: usize,
    is_fresh: bool,
    /// The last frame handed in, and the one being made.
    fed: Box<[u8]>,
    frame: Box<[u8]>,
    /// Shows the edges of several recorded ticks that fell on one, of which it has these counts.
    shaper: PulseShaper,
    owed: Box<[u32]>,
    /// The last frame that this end sent.
    seen: Box<[u8]>,
    /// Makes the expected frame of recorded values, with pulses and hold times.
    expected: DirectStream,
    /// Slots for the comparison.
    slots: [Vec<Slot>; 2],
}

impl Station {
    /// The stations of the driver that `config` describes; `edges` has, per signal, the column with its edge
    /// count.
    pub(super) fn all(config: &Config, edges: &[Option<usize>]) -> Vec<Self> {
        let (tx, rx) = config.role.areas();
        let map = SlotMap::new(&config.table, config.role);
        let directions = directions(&config.table, config.role);
        let stations = directions.into_iter().enumerate();
        stations
            .map(|(index, directions)| {
                let table = &config.table;
                let of = |area: Area| {
                    let signals = table.signals.iter().enumerate();
                    signals
                        .filter(move |(_, signal)| signal.station == index && signal.area == area)
                };
                let frame = |area: Area| vec![0; area_bytes(table, index, area)].into();
                // The recorded levels were held already.
                let bits: Box<[LatchedBit]> = directions
                    .rx_latched
                    .iter()
                    .map(|bit| LatchedBit {
                        hold: Nanos::ZERO,
                        ..*bit
                    })
                    .collect();
                Self {
                    receive: Plan::new(table, index, rx),
                    send: Plan::new(table, index, tx),
                    received: of(rx).map(|(number, _)| number).collect(),
                    latched: bits
                        .iter()
                        .map(|bit| Latched {
                            bit: *bit,
                            column: edges[bit.signal],
                            slot: map.edges[bit.signal],
                            count: 0,
                            total: 0,
                        })
                        .collect(),
                    sent: of(tx)
                        .map(|(number, signal)| Sent {
                            signal: number,
                            name: signal.name.clone(),
                            kind: ValueKind::of(signal.data_type, signal.scale.is_some()),
                        })
                        .collect(),
                    status: STALE,
                    ticks: 0,
                    is_fresh: false,
                    owed: vec![0; bits.len()].into(),
                    shaper: PulseShaper::new(bits, &directions.rx_fail_safe),
                    fed: directions.rx_fail_safe,
                    frame: frame(rx),
                    seen: frame(tx),
                    expected: DirectStream::new(directions.tx_fail_safe, directions.tx_latched),
                    slots: [(); 2].map(|()| vec![Slot::default(); table.signals.len()]),
                }
            })
            .collect()
    }

    /// A tick begins, on which no recorded tick has fallen yet.
    pub(super) fn begin(&mut self) {
        (self.ticks, self.is_fresh) = (0, false);
        for latched in &mut self.latched {
            latched.count = 0;
        }
    }

    /// A recorded tick falls on the current one; `before` are the values until then.
    pub(super) fn advance(
        &mut self,
        status: i32,
        tick: &Tick,
        before: &[Slot],
        columns: &[Option<usize>],
    ) {
        self.status = status;
        self.is_fresh |= status == FRESH;
        self.ticks += 1;
        for latched in &mut self.latched {
            let signal = latched.bit.signal;
            let count = match (latched.column, columns[signal]) {
                (Some(column), _) => whole(tick.values[column].real()),
                // It was not latched when it was recorded.
                (None, Some(column)) => {
                    let [was, is] = [before[signal], tick.values[column]].map(is_on);
                    u32::from(was != is && counts(latched.bit.latch, is))
                }
                (None, None) => 0,
            };
            latched.count = latched.count.wrapping_add(count);
            latched.total = latched.total.wrapping_add(count);
        }
    }

    /// The frame to hand in for these values, unless it brings nothing new.
    pub(super) fn frame(&mut self, slots: &[Slot]) -> Option<&[u8]> {
        self.receive.encode(slots, &mut self.frame);
        if !self.is_fresh && self.frame == self.fed {
            return None;
        }
        self.fed.copy_from_slice(&self.frame);
        Some(&self.fed)
    }

    /// Shapes the levels in `slots`: where several recorded ticks fall on one, their edges are seen, too.
    pub(super) fn shape(&mut self, now: Nanos, slots: &mut [Slot]) {
        if self.latched.is_empty() {
            return;
        }
        if self.ticks > 1 {
            for (owed, latched) in self.owed.iter_mut().zip(&self.latched) {
                *owed = owed.wrapping_add(latched.count);
            }
        }
        self.receive.encode(slots, &mut self.frame);
        let counts = matches!(self.status, FRESH | UNCHANGED);
        if counts && self.shaper.needs_shaping(&self.owed) {
            self.shaper.shape(&self.owed, now, &mut self.frame);
            for Latched { bit, .. } in &self.latched {
                let level = self.frame[bit.byte] & bit.mask != 0;
                slots[bit.signal] = Slot::from_real(f64::from(u8::from(level)));
            }
        } else {
            self.shaper.pass(&self.frame);
        }
        self.shaper.confirm();
    }

    /// The status to show in the current tick; `None` where the recording has nothing but that the exchange failed.
    pub(super) fn code(&self) -> Option<Code> {
        match self.status {
            FRESH | UNCHANGED if self.is_fresh => Some(Code::Fresh),
            FRESH | UNCHANGED => Some(Code::Unchanged),
            STALE => Some(Code::Stale),
            _ => None,
        }
    }

    /// Puts what this station received into `slots`, of which `values` has the values.
    pub(super) fn show(&self, values: &[Slot], slots: &mut [Slot]) {
        for signal in &self.received {
            slots[*signal] = values[*signal];
        }
        for latched in &self.latched {
            if let Some(slot) = latched.slot {
                slots[slot] = Slot::from_real(f64::from(latched.count));
            }
        }
    }

    /// Tells of every latched signal how many edges there were so far.
    pub(super) fn edges(&self, tell: &mut impl FnMut(usize, u32)) {
        for latched in &self.latched {
            tell(latched.bit.signal, latched.total);
        }
    }

    /// Records the frame that this end sends.
    pub(super) fn sees(&mut self, frame: &[u8]) {
        self.seen.copy_from_slice(frame);
    }

    /// Compares what this end sends with what is expected from the recorded `slots`, and calls back for every
    /// signal that differs.
    pub(super) fn compare(
        &mut self,
        now: Nanos,
        slots: &[Slot],
        mut differs: impl FnMut(usize, ValueKind, &str, Slot, Slot),
    ) {
        self.expected.write(|frame| self.send.encode(slots, frame));
        let frame = self.expected.read(now);
        if *frame != *self.seen {
            let [expected, seen] = &mut self.slots;
            self.send.decode(frame, expected);
            self.send.decode(&self.seen, seen);
            for Sent { signal, name, kind } in &self.sent {
                let (expected, seen) = (expected[*signal], seen[*signal]);
                // Of a scaled value that was on the line, the codec may make the next one.
                let is_recorded = *kind != ValueKind::Bit && slots[*signal] == seen;
                if expected != seen && !is_recorded {
                    differs(*signal, *kind, name, expected, seen);
                }
            }
        }
    }
}

/// Whether an edge to this level counts.
fn counts(latch: Latch, level: bool) -> bool {
    match latch {
        Latch::Rising => level,
        Latch::Falling => !level,
        Latch::Both => true,
    }
}

fn is_on(slot: Slot) -> bool {
    slot.real() != 0.0
}

/// A recorded count.
fn whole(count: f64) -> u32 {
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "a cast saturates"
    )]
    let count = count as u32;
    count
}
