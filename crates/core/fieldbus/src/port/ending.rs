//! The end of a driver: the last cycle, and the values that remain at the peer.

use std::ops::Range;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{self, Receiver, Sender};

use tickbus_base::thread::wait_for;
use tickbus_base::time::{Clock, Nanos};
use tickbus_image::signal::{Area, SignalTable};

use super::{Port, Receipt};

/// The values for the peer when those of the program can no longer be trusted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Outputs {
    /// The fail-safe values of the signals.
    FailSafe,
    /// The values that were sent last.
    #[default]
    Hold,
}

impl Outputs {
    /// Both choices, by their names in a driver.cfg.
    pub const CHOICES: [(&'static str, Self); 2] =
        [("fail_safe", Self::FailSafe), ("hold", Self::Hold)];
}

/// Lets another thread end the exchange of a [`Port`] with the fail-safe values.
#[derive(Debug)]
pub struct Farewell {
    shared: Arc<Shared>,
    done: Receiver<()>,
}

#[derive(Debug, Default)]
struct Shared {
    begun: AtomicBool,
    /// True while the closing driver waits until its peers have the last values.
    is_awaited: AtomicBool,
    /// True if something was sent since the line was opened.
    is_used: AtomicBool,
}

impl Farewell {
    /// Returns true if a peer may have received anything on this line.
    pub fn is_due(&self) -> bool {
        self.shared.is_used.load(Ordering::SeqCst)
    }

    /// From now on every station sends its fail-safe values. Returns true if the farewell [is due](Self::is_due). If
    /// not, no peer has received anything yet, and a peer that reads from now on gets these values.
    pub fn begin(&self) -> bool {
        self.shared.begun.store(true, Ordering::SeqCst);
        let is_due = self.is_due();
        self.shared.is_awaited.store(is_due, Ordering::Relaxed);
        is_due
    }

    /// Waits until the peers of all stations have these values, or the line has ended, for at most `limit`. Returns
    /// true if that was in time.
    pub fn wait(&self, clock: &dyn Clock, limit: Nanos) -> bool {
        wait_for(clock, &self.done, limit)
    }
}

/// The port's side of a [`Farewell`].
#[derive(Debug)]
pub(super) struct Ending {
    shared: Arc<Shared>,
    /// The state at the beginning of the last cycle: all frames of a cycle are of one kind.
    is_begun: bool,
    stations: Box<[Taker]>,
    done: Sender<()>,
}

/// The peer of a station, as a receiver of values.
#[derive(Clone, Debug)]
struct Taker {
    /// The bits of the frame that carry signals.
    needed: BitSet,
    /// The bits of the frame with the last values that the peer has got in parts.
    got: BitSet,
    /// The number of cycles after which the peer has the last values; 0 for a station without outputs.
    missing: u32,
    /// True if the station's write guard permits writes.
    may_write: bool,
    /// True if the bus has made a frame with the last values for the peer.
    is_offered: bool,
}

impl Taker {
    fn is_owed(&self) -> bool {
        self.may_write && self.missing > 0
    }

    /// The peer has these bits of the last values. Returns true if it thereby has those of all signals.
    fn completes(&mut self, bits: Range<usize>) -> bool {
        self.got.add(bits);
        let is_complete = self.got.has_all(&self.needed);
        if is_complete {
            self.got.clear();
        }
        is_complete
    }
}

/// Bits of a frame; bit n of byte k is 8k + n.
#[derive(Clone, Debug, Default)]
struct BitSet(Vec<u8>);

impl From<Range<usize>> for BitSet {
    fn from(bits: Range<usize>) -> Self {
        let mut set = Self::default();
        set.add(bits);
        set
    }
}

impl BitSet {
    fn add(&mut self, bits: Range<usize>) {
        self.0.resize(self.0.len().max(bits.end.div_ceil(8)), 0);
        for bit in bits {
            self.0[bit / 8] |= 1 << (bit % 8);
        }
    }

    fn has_all(&self, others: &Self) -> bool {
        let own = self.0.iter().copied().chain(std::iter::repeat(0));
        others
            .0
            .iter()
            .zip(own)
            .all(|(other, own)| other & !own == 0)
    }

    fn clear(&mut self) {
        self.0.fill(0);
    }
}

impl Ending {
    fn new(stations: impl Iterator<Item = (u32, BitSet)>) -> (Self, Farewell) {
        let (sender, done) = mpsc::channel();
        let shared = Arc::<Shared>::default();
        let ending = Self {
            shared: Arc::clone(&shared),
            is_begun: false,
            stations: stations
                .map(|(missing, needed)| Taker {
                    missing,
                    needed,
                    got: BitSet::default(),
                    may_write: true,
                    is_offered: false,
                })
                .collect(),
            done: sender,
        };
        (ending, Farewell { shared, done })
    }

    /// A cycle begins.
    fn look(&mut self) {
        self.is_begun = self.shared.begun.load(Ordering::SeqCst);
    }

    pub(super) fn is_begun(&self) -> bool {
        self.is_begun
    }

    /// A frame of this station is about to be sent.
    pub(super) fn is_used(&mut self, station: usize) {
        let taker = &mut self.stations[station];
        taker.is_offered |= self.is_begun;
        if taker.is_owed() && !self.shared.is_used.load(Ordering::Relaxed) {
            self.shared.is_used.store(true, Ordering::SeqCst);
        }
    }

    /// The peer of a station has a whole frame.
    fn sent(&mut self, station: usize) {
        let taker = &mut self.stations[station];
        taker.missing = taker.missing.saturating_sub(1);
        self.end_if_none_is_owed();
    }

    fn set_may_write(&mut self, stations: Range<usize>, may_write: bool) {
        for taker in &mut self.stations[stations] {
            taker.may_write = may_write;
        }
        // The stations that may be written to are used again in the next cycle.
        if !may_write {
            self.shared.is_used.store(false, Ordering::Relaxed);
        }
        if self.is_begun {
            self.end_if_none_is_owed();
        }
    }

    fn end_if_none_is_owed(&self) {
        if !self.stations.iter().any(Taker::is_owed) {
            // A closer that has stopped waiting needs no message.
            let _ = self.done.send(());
        }
    }
}

impl Port {
    /// Sets the values to send while the peer is stale or its data are invalid.
    pub fn set_while_stale(&mut self, outputs: Outputs) {
        let stations = self.stations();
        self.image.blind = (outputs == Outputs::FailSafe).then(|| vec![false; stations].into());
    }

    /// Lets another thread end the exchange with the fail-safe values, which reach the peer of each station after this
    /// many `cycles`. A peer that gets its frame in parts has a cycle's values when it has those of all signals in
    /// `table`, or the whole frame if there are no signals.
    pub fn farewell(&mut self, cycles: u32, table: &SignalTable) -> Farewell {
        let (sent, _) = self.role().areas();
        let stations = (0..self.stations()).map(|station| match self.sizes(station).0 {
            0 => (0, BitSet::default()),
            bytes => {
                let signals = bits_of_signals(table, station, sent);
                (
                    cycles,
                    signals.unwrap_or_else(|| BitSet::from(0..8 * bytes)),
                )
            }
        });
        let (ending, farewell) = Ending::new(stations);
        self.image.ending = Some(ending);
        farewell
    }

    /// Returns true in the last cycles of a closing driver: a bus then also tries stations that have refused.
    pub fn is_ending(&self) -> bool {
        self.image.ending.as_ref().is_some_and(Ending::is_begun)
    }

    /// The line has failed, or the last peer has left: closing does not wait for this line.
    pub fn line_ended(&mut self) {
        if let Some(ending) = &self.image.ending {
            ending.shared.is_used.store(false, Ordering::Relaxed);
            if ending.shared.begun.load(Ordering::Relaxed) {
                let _ = ending.done.send(());
            }
        }
    }

    /// Returns true if the driver closes, a station's older values may still be in transit, and no frame with the
    /// fail-safe values follows them. The bus must then stop those older values from reaching the peer.
    pub fn leaves_old_values(&self) -> bool {
        self.image.ending.as_ref().is_some_and(|ending| {
            let mut takers = ending.stations.iter();
            ending.shared.is_awaited.load(Ordering::Relaxed)
                && takers.any(|taker| taker.is_owed() && !taker.is_offered)
        })
    }

    /// A write guard permits or forbids writes to these stations. Closing does not wait for a station without
    /// permission.
    pub(crate) fn set_may_write(&mut self, stations: Range<usize>, may_write: bool) {
        if let Some(ending) = &mut self.image.ending {
            ending.set_may_write(stations, may_write);
        }
    }

    /// The peer of a station has the last values of all signals that it takes. For buses whose peers confirm nothing, and
    /// whose receipts are [of pulses](Receipt::of_pulses).
    pub fn has_last(&mut self, station: usize) {
        // Injected faults may have given the bus older values.
        if let Some(ending) = &mut self.image.ending
            && self.faults.gives_newest(station)
        {
            ending.sent(station);
        }
    }

    /// A cycle begins.
    #[inline]
    pub(super) fn look_for_end(&mut self) {
        if let Some(ending) = &mut self.image.ending {
            ending.look();
        }
    }

    #[cold]
    fn had_last(&mut self, receipt: &Receipt) {
        for station in receipt.stations.clone() {
            let completes = match (&receipt.bits, &mut self.image.ending) {
                (Some(bits), Some(ending)) if self.faults.gives_newest(station) => {
                    ending.stations[station].completes(bits.clone())
                }
                (bits, _) => bits.is_none(),
            };
            if completes {
                self.has_last(station);
            }
        }
    }

    /// The peer has the frames of this receipt.
    #[inline]
    pub(super) fn had(&mut self, receipt: &Receipt) {
        if receipt.is_last {
            self.had_last(receipt);
        }
    }
}

/// The bits of a station's frame in `area` that carry signals; `None` without signals.
fn bits_of_signals(table: &SignalTable, station: usize, area: Area) -> Option<BitSet> {
    let mut bits = BitSet::default();
    for signal in &table.signals {
        if signal.station == station && signal.area == area {
            bits.add(signal.address().bits());
        }
    }
    (!bits.0.is_empty()).then_some(bits)
}

#[cfg(all(test, not(loom)))]
mod tests {
    use tickbus_base::time::{Manual, Nanos};
    use tickbus_image::signal::{DataType, Signal};
    use tickbus_image::{StationStreams, image};

    use super::*;
    use crate::{LinkStatus, Role};

    /// A port with a station for each of these numbers of outgoing bytes.
    fn port(sizes: &[usize]) -> Port {
        let streams = sizes.iter().map(|size| StationStreams {
            tx_fail_safe: vec![0; *size].into(),
            tx_latched: Box::new([]),
            tx_counted: Box::default(),
            rx_counted: Box::default(),
            rx_fail_safe: Box::new([]),
            rx_latched: Box::new([]),
        });
        let (_, end) = image(streams.collect());
        let clock: Arc<Manual> = Manual::new();
        let status = LinkStatus::new("test", Nanos::from_millis(100));
        Port::new(end, clock, Role::Controller, None, status)
    }

    fn no_signals() -> SignalTable {
        SignalTable::of_one_station(0, 0, Vec::new())
    }

    fn send(port: &mut Port, station: usize) {
        let frames = port.take(station..station + 1, Nanos::ZERO);
        let mut frames = frames.expect("the line is up");
        frames.frame(station);
        let receipt = frames.receipt();
        port.sent(&receipt);
    }

    #[test]
    fn a_station_that_nothing_is_written_to_keeps_no_other_one_from_its_last_values() {
        let mut port = port(&[1, 1]);
        let farewell = port.farewell(1, &no_signals());
        port.set_may_write(0..1, false);
        send(&mut port, 1);
        assert!(farewell.begin(), "the second one takes values");
        assert!(
            !farewell.wait(&*Manual::new(), Nanos::ZERO),
            "it has not got the last ones"
        );
        send(&mut port, 1);
        assert!(farewell.wait(&*Manual::new(), Nanos::ZERO));
    }

    #[test]
    fn old_values_are_left_until_a_frame_has_the_last_ones() {
        let mut port = port(&[1]);
        let farewell = port.farewell(2, &no_signals());
        send(&mut port, 0);
        assert!(!port.leaves_old_values(), "they are meant");
        assert!(farewell.begin());
        assert!(port.leaves_old_values());
        // This frame follows the older values, even if the peer confirms it too late.
        send(&mut port, 0);
        assert!(!port.leaves_old_values());
    }

    #[test]
    fn who_reads_first_when_a_driver_closes_gets_the_last_values() {
        let mut port = port(&[1]);
        let farewell = port.farewell(1, &no_signals());
        assert!(!farewell.begin(), "nobody has got anything");
        assert!(!port.leaves_old_values());
        let frames = port.take(0..1, Nanos::ZERO);
        assert!(frames.expect("the line is up").receipt().is_last);
    }

    #[test]
    fn a_peer_that_reads_in_parts_has_the_last_values_when_it_has_those_of_all_signals() {
        let mut port = port(&[4]);
        let signals = [0, 2]
            .map(|byte| Signal::new(format!("Out {byte}"), Area::Output, byte, DataType::Byte));
        let table = SignalTable::of_one_station(0, 4, signals.into());
        let farewell = port.farewell(1, &table);
        let read = |port: &mut Port, bits| {
            let frames = port.take(0..1, Nanos::ZERO);
            let mut frames = frames.expect("the line is up");
            frames.frame(0);
            let receipt = frames.receipt();
            port.sent(&receipt.bits(0, bits));
        };
        let is_done = || farewell.wait(&*Manual::new(), Nanos::ZERO);
        read(&mut port, 0..8);
        assert!(farewell.begin());
        // Not those that were read before, and not the bytes between the signals.
        read(&mut port, 16..24);
        read(&mut port, 8..16);
        assert!(!is_done());
        read(&mut port, 0..4);
        assert!(!is_done());
        read(&mut port, 4..8);
        assert!(is_done());
    }

    #[test]
    fn nobody_waits_where_nothing_is_sent() {
        let mut port = port(&[1, 0]);
        let farewell = port.farewell(1, &no_signals());
        send(&mut port, 0);
        assert!(farewell.is_due());
        port.set_may_write(0..1, false);
        for station in 0..2 {
            port.take(station..station + 1, Nanos::ZERO)
                .expect("the line is up")
                .frame(station);
        }
        assert!(!farewell.is_due(), "one is guarded, and one has no outputs");
    }
}
