//! One station of a replay: the received values that it shows again, and the values that it is expected to send.

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
    /// The edges in the current tick, and in total.
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
    /// The signals that this station receives.
    received: Vec<usize>,
    latched: Vec<Latched>,
    sent: Vec<Sent>,
    /// The station's status in the last recorded tick.
    pub(super) status: i32,
    /// The number of recorded ticks that fell on the current tick, and whether any of them was fresh.
    ticks: usize,
    is_fresh: bool,
    /// The last frame delivered, and the one being built.
    fed: Box<[u8]>,
    frame: Box<[u8]>,
    /// Shows the edges of several recorded ticks that fell on one tick; `owed` has their counts.
    shaper: PulseShaper,
    owed: Box<[u32]>,
    /// The last frame that this end sent.
    seen: Box<[u8]>,
    /// Builds the expected frame from recorded values, with pulses and hold times.
    expected: DirectStream,
    /// Slots for the comparison.
    slots: [Vec<Slot>; 2],
}

impl Station {
    /// Returns the stations of the driver that `config` describes; `edges` has, per signal, the column with its edge
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
                // The recorded levels have been held already.
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

    /// Begins a tick, on which no recorded tick has fallen yet.
    pub(super) fn begin(&mut self) {
        (self.ticks, self.is_fresh) = (0, false);
        for latched in &mut self.latched {
            latched.count = 0;
        }
    }

    /// Lets a recorded tick fall on the current one; `before` are the values until then.
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
                // The signal was not latched in the recording.
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

    /// Returns the frame to deliver for these values, unless the frame brings nothing new.
    pub(super) fn frame(&mut self, slots: &[Slot]) -> Option<&[u8]> {
        self.receive.encode(slots, &mut self.frame);
        if !self.is_fresh && self.frame == self.fed {
            return None;
        }
        self.fed.copy_from_slice(&self.frame);
        Some(&self.fed)
    }

    /// Shapes the levels in `slots`, so that the edges of several recorded ticks within one tick are visible, too.
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

    /// Returns the status to show in the current tick; `None` if the recording only says that the exchange failed.
    pub(super) fn code(&self) -> Option<Code> {
        match self.status {
            FRESH | UNCHANGED if self.is_fresh => Some(Code::Fresh),
            FRESH | UNCHANGED => Some(Code::Unchanged),
            STALE => Some(Code::Stale),
            _ => None,
        }
    }

    /// Puts the values that this station received into `slots`; `values` contains them.
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

    /// Calls `tell` with every latched signal and the number of its edges so far.
    pub(super) fn edges(&self, tell: &mut impl FnMut(usize, u32)) {
        for latched in &self.latched {
            tell(latched.bit.signal, latched.total);
        }
    }

    /// Keeps the frame that this end sends.
    pub(super) fn sees(&mut self, frame: &[u8]) {
        self.seen.copy_from_slice(frame);
    }

    /// Compares the values that this end sends with those expected from the recorded `slots`, and calls `differs` for
    /// every signal that differs.
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
                // The codec may round a scaled value that was on the line to its neighbour.
                let is_recorded = *kind != ValueKind::Bit && slots[*signal] == seen;
                if expected != seen && !is_recorded {
                    differs(*signal, *kind, name, expected, seen);
                }
            }
        }
    }
}

/// Returns true if an edge to this level counts.
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

/// Converts a recorded count to an integer.
fn whole(count: f64) -> u32 {
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "a cast saturates"
    )]
    let count = count as u32;
    count
}
