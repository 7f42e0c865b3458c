//! One station of a replay: the frames that it receives again, and those that it is expected to send.

use crate::frames::{area_bytes, directions};
use tickbus_base::time::Nanos;
use tickbus_driver_cfg::Config;
use tickbus_image::signal::{Area, Latch, Plan, Slot};
use tickbus_image::{DirectStream, LatchedBit, latched_bits};
use tickbus_record::{Tick, ValueKind};

use super::UNCHANGED;

/// The most edges of one signal in one tick; no bus carries more.
const MOST_EDGES: f64 = 10_000.0;

/// A latched bit that this end receives.
struct Latched {
    bit: LatchedBit,
    /// The column with its edge count.
    edges: Option<usize>,
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
    latched: Vec<Latched>,
    sent: Vec<Sent>,
    /// The last received frame, and the one being made.
    fed: Box<[u8]>,
    frame: Box<[u8]>,
    /// The last frame that this end sent.
    seen: Box<[u8]>,
    /// Turns recorded values into the expected frame, with pulses and hold times.
    expected: DirectStream,
    /// Bits with edges in the current tick: byte, mask, number of toggles, previous level.
    toggling: Vec<(usize, u8, usize, bool)>,
    /// Slots for the comparison.
    slots: [Vec<Slot>; 2],
}

impl Station {
    /// The stations of the driver that `config` describes; `edges` has, per signal, the column with its edge
    /// count.
    pub(super) fn all(config: &Config, edges: &[Option<usize>]) -> Vec<Self> {
        let (tx, rx) = config.role.areas();
        let directions = directions(&config.table, config.role);
        let stations = directions.into_iter().enumerate();
        stations
            .map(|(index, directions)| {
                let table = &config.table;
                let latched = latched_bits(table, index, rx).into_iter();
                let signals = table.signals.iter().enumerate();
                let frame = |area: Area| vec![0; area_bytes(table, index, area)].into();
                Self {
                    receive: Plan::new(table, index, rx),
                    send: Plan::new(table, index, tx),
                    latched: latched
                        .map(|bit| Latched {
                            bit,
                            edges: edges[bit.signal],
                        })
                        .collect(),
                    sent: signals
                        .filter(|(_, signal)| signal.station == index && signal.area == tx)
                        .map(|(number, signal)| Sent {
                            signal: number,
                            name: signal.name.clone(),
                            kind: ValueKind::of(signal.data_type, signal.scale.is_some()),
                        })
                        .collect(),
                    fed: directions.rx_fail_safe.clone(),
                    frame: frame(rx),
                    seen: frame(tx),
                    expected: DirectStream::new(directions.tx_fail_safe, directions.tx_latched),
                    toggling: Vec::new(),
                    slots: [(); 2].map(|()| vec![Slot::default(); table.signals.len()]),
                }
            })
            .collect()
    }

    /// Hands to `receive` the frames that make this driver show the values in `slots` and count the edges in
    /// `present`, which comes with its own status; `after` is the following tick with its status. An exchange
    /// that found nothing new gets no frame, unless it shows a change nevertheless.
    ///
    /// # Errors
    ///
    /// There are more edges than any bus carries.
    pub(super) fn feed(
        &mut self,
        slots: &[Slot],
        (status, present): (i32, &Tick),
        after: Option<(i32, &Tick)>,
        columns: &[Option<usize>],
        mut receive: impl FnMut(&[u8]),
    ) -> Result<(), String> {
        self.receive.encode(slots, &mut self.frame);
        // The recorded level of a latched bit was shaped: a pulse that was over is shown for one tick. The
        // frames must make the driver shape it in the same way.
        self.toggling.clear();
        let mut frames = 1;
        for latched in &self.latched {
            let (byte, mask) = (latched.bit.byte, latched.bit.mask);
            let count = latched
                .edges
                .map_or(0.0, |column| present.values[column].real());
            if count > MOST_EDGES {
                return Err(format!(
                    "tick {} of the recording has {count} edges of one signal",
                    present.number
                ));
            }
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "checked above; a cast saturates at 0"
            )]
            let count = count as usize;
            if count == 0 {
                continue;
            }
            let was = self.fed[byte] & mask != 0;
            let shown = self.frame[byte] & mask != 0;
            // A pulse that was over falls back in a tick without a frame.
            let falls_back = after.is_some_and(|(status, tick)| {
                let column = columns[latched.bit.signal];
                let next = column.map(|column| tick.values[column].real() != 0.0);
                status == UNCHANGED && next == Some(!shown)
            });
            let (level, toggles) = latched.way(was, shown, count, falls_back);
            set(&mut self.frame, byte, mask, level);
            frames = frames.max(toggles);
            self.toggling.push((byte, mask, toggles, was));
        }
        if status == UNCHANGED && frames == 1 && self.frame == self.fed {
            return Ok(());
        }
        for left in (0..frames).rev() {
            // All bits reach their final level together, so bits with fewer toggles start later.
            for (byte, mask, toggles, was) in &self.toggling {
                let done = toggles.saturating_sub(left);
                set(&mut self.frame, *byte, *mask, *was != (done % 2 == 1));
            }
            receive(&self.frame);
        }
        self.fed.copy_from_slice(&self.frame);
        Ok(())
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
                if expected[*signal] != seen[*signal] {
                    differs(*signal, *kind, name, expected[*signal], seen[*signal]);
                }
            }
        }
    }
}

impl Latched {
    /// The level at the end of a tick with `count` edges that matter, at least one, and the number of toggles
    /// from the level `was` to it. The tick showed `shown`.
    fn way(&self, was: bool, shown: bool, count: usize, falls_back: bool) -> (bool, usize) {
        let counted = match self.bit.latch {
            Latch::Both => return (was != (count % 2 == 1), count),
            Latch::Rising => true,
            Latch::Falling => false,
        };
        let level = counted != (shown == counted && falls_back);
        // An edge that counts is always preceded by one that does not, except the first if the level already
        // allows it.
        let toggles = 2 * count - usize::from(was != counted) + usize::from(level != counted);
        (level, toggles)
    }
}

fn set(frame: &mut [u8], byte: usize, mask: u8, level: bool) {
    if level {
        frame[byte] |= mask;
    } else {
        frame[byte] &= !mask;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Replays the toggles, and counts the edges.
    #[test]
    fn ways_have_the_edges_that_they_should() {
        for latch in [Latch::Rising, Latch::Falling, Latch::Both] {
            let bit = LatchedBit {
                signal: 0,
                byte: 0,
                mask: 1,
                latch,
                hold: Nanos::ZERO,
            };
            let latched = Latched { bit, edges: None };
            for case in 0..8 {
                let [was, shown, falls_back] = [1, 2, 4].map(|bit| case & bit != 0);
                for count in 1..5 {
                    let (end, toggles) = latched.way(was, shown, count, falls_back);
                    let (mut level, mut counted) = (was, 0);
                    for _ in 0..toggles {
                        level = !level;
                        counted += usize::from(match latch {
                            Latch::Rising => level,
                            Latch::Falling => !level,
                            Latch::Both => true,
                        });
                    }
                    assert_eq!((level, counted), (end, count), "{latch:?} {case} {count}");
                }
            }
        }
    }
}
