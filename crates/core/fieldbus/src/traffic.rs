//! Octets, frames and process data on a line, counted where they pass.

use std::sync::atomic::{AtomicU64, Ordering};

use tickbus_base::statistics::{Key, Statistics};
use tickbus_base::time::Nanos;

/// The carrier of a line's octets.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Medium {
    /// TCP over IPv4 over Ethernet.
    Tcp,
    /// A serial line with characters of this length.
    Serial {
        /// The time of one character, with its start, parity and stop bits.
        character: Nanos,
    },
}

/// The most octets in one TCP segment: 1500 of an Ethernet frame without the headers of IPv4 and TCP.
const SEGMENT: usize = 1460;

/// The octets that TCP, IP and Ethernet add to each segment, without options: 20 of TCP (RFC 9293), 20 of IPv4 (RFC 791),
/// and of Ethernet (IEEE 802.3) 14 of the header, 4 of the check sequence, and 8 of preamble and start delimiter.
const OVERHEAD: u64 = 20 + 20 + 14 + 4 + 8;

/// The code of [`Medium::Tcp`]; 0 is an unknown medium, and any other code is a character's length in nanoseconds.
const TCP: u64 = u64::MAX;

/// Rates are averages over at least this time, if the line has run for that long.
const SPAN: Nanos = Nanos::from_secs(1);

/// The direction of data, as seen from this end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Way {
    /// To the peer.
    Out,
    /// From the peer.
    In,
}

/// The counters of a driver's lines. Only the bus's thread counts, and any thread reads.
#[derive(Debug)]
pub(crate) struct Traffic {
    medium: AtomicU64,
    /// One line per station; a bus with a single line counts with the first. For each line the two ways.
    lines: Box<[[Counters; 2]]>,
}

#[derive(Debug, Default)]
struct Counters {
    octets: AtomicU64,
    frames: AtomicU64,
    data: AtomicU64,
}

/// The values of [`Counters`] at one moment.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Counts {
    octets: u64,
    frames: u64,
    data: u64,
}

impl Counts {
    fn plus(self, other: Self) -> Self {
        Self {
            octets: self.octets.wrapping_add(other.octets),
            frames: self.frames.wrapping_add(other.frames),
            data: self.data.wrapping_add(other.data),
        }
    }

    /// The difference; not below zero, though an echo is deducted after it was read.
    fn since(self, before: Self) -> Self {
        Self {
            octets: self.octets.saturating_sub(before.octets),
            frames: self.frames.saturating_sub(before.frames),
            data: self.data.saturating_sub(before.data),
        }
    }

    /// The octets on the cable.
    fn on_cable(self, medium: Option<Medium>) -> u64 {
        match medium {
            Some(Medium::Tcp) => self.octets.wrapping_add(self.frames.wrapping_mul(OVERHEAD)),
            _ => self.octets,
        }
    }
}

/// Adds without the bus lock of an atomic addition, since there is one writer. A reader that finds process data counted
/// also finds the octets that carried them.
#[inline]
fn add(counter: &AtomicU64, count: u64) {
    let before = counter.load(Ordering::Relaxed);
    counter.store(before.wrapping_add(count), Ordering::Release);
}

impl Traffic {
    pub(crate) fn new(stations: usize) -> Self {
        Self {
            medium: AtomicU64::new(0),
            lines: (0..stations.max(1)).map(|_| Default::default()).collect(),
        }
    }

    pub(crate) fn carried_by(&self, medium: Medium) {
        let code = match medium {
            Medium::Tcp => TCP,
            Medium::Serial { character } => u64::try_from(character.0).unwrap_or(0),
        };
        self.medium.store(code, Ordering::Relaxed);
    }

    fn medium(&self) -> Option<Medium> {
        match self.medium.load(Ordering::Relaxed) {
            0 => None,
            TCP => Some(Medium::Tcp),
            nanos => Some(Medium::Serial {
                character: Nanos(nanos.cast_signed()),
            }),
        }
    }

    #[inline]
    fn counters(&self, line: usize, way: Way) -> Option<&Counters> {
        Some(&self.lines.get(line)?[way as usize])
    }

    /// One call of the system has moved these octets. On a serial line they are a frame if they complete one.
    #[inline]
    pub(crate) fn moved(&self, line: usize, way: Way, octets: usize, completes: bool) {
        let Some(counters) = self.counters(line, way) else {
            return;
        };
        add(&counters.octets, octets as u64);
        let frames = if self.medium.load(Ordering::Relaxed) != TCP {
            u64::from(completes)
        } else if octets <= SEGMENT {
            1
        } else {
            octets.div_ceil(SEGMENT) as u64
        };
        add(&counters.frames, frames);
    }

    /// This many frames have arrived on a serial line.
    pub(crate) fn frames_in(&self, count: u64) {
        add(&self.lines[0][Way::In as usize].frames, count);
    }

    /// These octets were read, and are no characters of the peer.
    pub(crate) fn not_from_peer(&self, octets: usize) {
        let counted = &self.lines[0][Way::In as usize].octets;
        add(counted, (octets as u64).wrapping_neg());
    }

    /// These octets of process data of a station have arrived at the peer, or from it.
    #[inline]
    pub(crate) fn data(&self, station: usize, way: Way, octets: usize) {
        if let Some(counters) = self.counters(station, way) {
            add(&counters.data, octets as u64);
        }
    }

    /// Reads the counters, the last ones that a telegram counts first.
    fn read(&self) -> Vec<[Counts; 2]> {
        let read = |counters: &Counters| Counts {
            data: counters.data.load(Ordering::Acquire),
            frames: counters.frames.load(Ordering::Acquire),
            octets: counters.octets.load(Ordering::Acquire),
        };
        self.lines
            .iter()
            .map(|line| line.each_ref().map(read))
            .collect()
    }

    /// Adds the counts, the rates, the efficiency, and the share of a serial line. A line over which no octet has passed
    /// adds nothing. `names` are those of the stations, if there are several.
    pub(crate) fn write(
        &self,
        now: Nanos,
        rates: &mut Rates,
        names: &[String],
        statistics: &mut Statistics,
    ) {
        let counts = self.read();
        let is_used = |line: &[Counts; 2]| line.iter().any(|way| way.octets > 0);
        let used: Vec<usize> = (0..counts.len())
            .filter(|at| is_used(&counts[*at]))
            .collect();
        if used.is_empty() {
            return;
        }
        let medium = self.medium();
        let before = rates.before(now, &counts);
        let sum = |lines: &[[Counts; 2]]| {
            let zero = [Counts::default(); 2];
            lines.iter().fold(zero, |[out, incoming], line| {
                [out.plus(line[0]), incoming.plus(line[1])]
            })
        };
        let mut whole = Shown {
            medium,
            statistics: &mut *statistics,
        };
        let all = 0..counts.len();
        let old = before.map(|(span, old)| (span, sum(old)));
        whole.write(sum(&counts), old, |key| Key::from(format!("line.{key}")));
        if let (Some((span, old)), Some(Medium::Serial { character })) = (old, medium) {
            let [out, incoming] = sum(&counts);
            let moved = out.since(old[0]).octets + incoming.since(old[1]).octets;
            let busy = real(moved) * real(character.0.unsigned_abs());
            whole.percent(
                "line.share_percent".into(),
                busy,
                real(span.0.unsigned_abs()),
            );
        }
        if used.len() < 2 {
            return;
        }
        for (index, first) in used.iter().enumerate() {
            // The stations up to the next line's share this one.
            let stations = *first..used.get(index + 1).copied().unwrap_or(all.end);
            let Some(name) = names.get(*first) else {
                return;
            };
            let old = before.map(|(span, old)| (span, sum(&old[stations.clone()])));
            whole.write(sum(&counts[stations]), old, |key| {
                Key::of("station", name, "").and(&format!("line.{key}"))
            });
        }
    }
}

#[expect(clippy::cast_precision_loss, reason = "figures for people")]
fn real(count: u64) -> f64 {
    count as f64
}

/// Statistics, and what the lines are.
struct Shown<'a> {
    medium: Option<Medium>,
    statistics: &'a mut Statistics,
}

impl Shown<'_> {
    /// Adds one line; `old` has the counts at the beginning of a span of time, for the rates.
    fn write(
        &mut self,
        counts: [Counts; 2],
        old: Option<(Nanos, [Counts; 2])>,
        key: impl Fn(&str) -> Key,
    ) {
        let seconds = old.map(|(span, old)| (span.as_micros() / 1e6, old));
        for (way, name) in [(Way::Out, "out"), (Way::In, "in")] {
            let count = counts[way as usize];
            self.statistics
                .count(key(&format!("octets_{name}")), count.octets);
            let recent = seconds.map(|(span, old)| (span, count.since(old[way as usize])));
            if let Some((span, recent)) = recent {
                let rate = real(recent.octets) / span;
                self.statistics
                    .number(key(&format!("octets_{name}_per_s")), rate, 1);
            }
            if self.medium.is_none() {
                continue;
            }
            self.statistics
                .count(key(&format!("frames_{name}")), count.frames);
            if let Some((span, recent)) = recent {
                let rate = real(recent.frames) / span;
                self.statistics
                    .number(key(&format!("frames_{name}_per_s")), rate, 1);
                let bits = real(recent.on_cable(self.medium)) * 8.0 / 1e3;
                self.statistics
                    .number(key(&format!("kbit_{name}_per_s")), bits / span, 1);
            }
            self.statistics
                .count(key(&format!("data_{name}")), count.data);
            let on_cable = real(count.on_cable(self.medium));
            self.percent(
                key(&format!("efficiency_{name}_percent")),
                real(count.data),
                on_cable,
            );
        }
    }

    /// Adds `part` as a percentage of `whole`, unless that is nothing.
    fn percent(&mut self, key: Key, part: f64, whole: f64) {
        if whole > 0.0 {
            self.statistics.number(key, 100.0 * part / whole, 1);
        }
    }
}

/// The counts at two earlier moments, for rates: the average since the last reading that is at least [`SPAN`] ago.
#[derive(Debug, Default)]
pub(crate) struct Rates(Option<[Sample; 2]>);

#[derive(Clone, Debug)]
struct Sample {
    at: Nanos,
    /// Empty before the first reading.
    counts: Vec<[Counts; 2]>,
}

impl Rates {
    /// The line has come up for the first time.
    pub(crate) fn begin(&mut self, now: Nanos) {
        self.0.get_or_insert_with(|| {
            let counts = Vec::new();
            let sample = Sample { at: now, counts };
            [sample.clone(), sample]
        });
    }

    /// The time since the earlier moment, and the counts at that; `None` while the line has not run yet.
    fn before(&mut self, now: Nanos, counts: &[[Counts; 2]]) -> Option<(Nanos, &[[Counts; 2]])> {
        let [older, newer] = self.0.as_mut()?;
        if now - newer.at >= SPAN {
            let sample = Sample {
                at: now,
                counts: counts.to_vec(),
            };
            *older = std::mem::replace(newer, sample);
        }
        older.counts.resize(counts.len(), Default::default());
        (now > older.at).then(|| (now - older.at, &older.counts[..]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn written(traffic: &Traffic, rates: &mut Rates, now: Nanos, names: &[&str]) -> String {
        let names: Vec<String> = names.iter().map(|name| (*name).to_owned()).collect();
        let mut statistics = Statistics::default();
        traffic.write(now, rates, &names, &mut statistics);
        statistics.to_string()
    }

    fn number(text: &str, key: &str) -> f64 {
        let line = text
            .lines()
            .find_map(|line| line.strip_prefix(key)?.strip_prefix('='));
        line.and_then(|number| number.parse().ok())
            .unwrap_or_else(|| panic!("{key} in {text}"))
    }

    /// Tables 3 and 5 of the paper on the peeling line: records of 360 octets in, and of 134 out, every 10 ms.
    #[test]
    fn efficiency_and_throughput_are_those_of_the_peeling_line() {
        let traffic = Traffic::new(1);
        traffic.carried_by(Medium::Tcp);
        let mut rates = Rates::default();
        rates.begin(Nanos::ZERO);
        for _ in 0..100 {
            traffic.moved(0, Way::In, 360, true);
            traffic.data(0, Way::In, 360);
            traffic.moved(0, Way::Out, 134, true);
            traffic.data(0, Way::Out, 134);
        }
        let text = written(&traffic, &mut rates, Nanos::from_secs(1), &[]);
        assert!(
            (number(&text, "line.efficiency_in_percent") - 84.5).abs() < 0.01,
            "{text}"
        );
        assert!(
            (number(&text, "line.efficiency_out_percent") - 67.0).abs() < 0.01,
            "{text}"
        );
        assert!(
            (number(&text, "line.kbit_in_per_s") - 340.8).abs() < 0.01,
            "{text}"
        );
        assert!(
            (number(&text, "line.kbit_out_per_s") - 160.0).abs() < 0.01,
            "{text}"
        );
        assert!(
            (number(&text, "line.frames_in_per_s") - 100.0).abs() < 0.01,
            "{text}"
        );
        assert!(text.contains("line.octets_in=36000\n"), "{text}");
        assert!(!text.contains("share"), "{text}");
    }

    #[test]
    fn a_long_write_has_several_frames() {
        let traffic = Traffic::new(1);
        traffic.carried_by(Medium::Tcp);
        for octets in [1, SEGMENT, SEGMENT + 1, 3 * SEGMENT] {
            traffic.moved(0, Way::Out, octets, true);
        }
        let text = written(&traffic, &mut Rates::default(), Nanos::ZERO, &[]);
        assert!(text.contains("line.frames_out=7\n"), "{text}");
        assert!(!text.contains("per_s"), "the line has not run: {text}");
    }

    #[test]
    fn a_serial_line_has_a_share_of_its_time() {
        let traffic = Traffic::new(1);
        // 11 bits at 19,200 bits per second.
        let character = Nanos(572_917);
        traffic.carried_by(Medium::Serial { character });
        let mut rates = Rates::default();
        rates.begin(Nanos::from_secs(5));
        // An echo is not of the peer, and half an answer is no frame.
        traffic.moved(0, Way::In, 200, false);
        traffic.not_from_peer(50);
        traffic.frames_in(2);
        traffic.moved(0, Way::Out, 10, false);
        traffic.moved(0, Way::Out, 15, true);
        traffic.data(0, Way::In, 100);
        let text = written(&traffic, &mut rates, Nanos::from_secs(6), &[]);
        assert!(
            (number(&text, "line.share_percent") - 10.0).abs() < 0.06,
            "{text}"
        );
        assert!(text.contains("line.octets_in=150\n"), "{text}");
        assert!(text.contains("line.frames_in=2\n"), "{text}");
        assert!(text.contains("line.frames_out=1\n"), "{text}");
        assert!(
            (number(&text, "line.efficiency_in_percent") - 66.7).abs() < 0.01,
            "{text}"
        );
    }

    #[test]
    fn a_rate_is_that_of_the_time_since_the_reading_before() {
        let traffic = Traffic::new(1);
        let mut rates = Rates::default();
        rates.begin(Nanos::ZERO);
        traffic.moved(0, Way::In, 1000, true);
        let mut rate = |millis: i64| {
            let text = written(&traffic, &mut rates, Nanos::from_millis(millis), &[]);
            number(&text, "line.octets_in_per_s")
        };
        assert!((rate(500) - 2000.0).abs() < 0.1, "since the line came up");
        assert!((rate(2000) - 500.0).abs() < 0.1, "still");
        assert!(
            rate(2500) < 500.0,
            "a reader that comes often has at least a second"
        );
        assert!(rate(3500) < 0.1, "nothing came since");
    }

    #[test]
    fn each_line_of_several_is_shown_with_the_data_of_its_stations() {
        let traffic = Traffic::new(3);
        traffic.carried_by(Medium::Tcp);
        traffic.moved(0, Way::Out, 34, true);
        traffic.data(0, Way::Out, 10);
        traffic.data(1, Way::Out, 24);
        let alone = written(
            &traffic,
            &mut Rates::default(),
            Nanos::ZERO,
            &["a", "b", "c"],
        );
        assert!(!alone.contains("station."), "{alone}");
        traffic.moved(2, Way::Out, 6, true);
        let text = written(
            &traffic,
            &mut Rates::default(),
            Nanos::ZERO,
            &["a", "b", "c"],
        );
        assert!(text.contains("line.octets_out=40\n"), "{text}");
        assert!(text.contains("station.a.line.octets_out=34\n"), "{text}");
        assert!(text.contains("station.a.line.data_out=34\n"), "{text}");
        assert!(text.contains("station.c.line.octets_out=6\n"), "{text}");
        assert!(!text.contains("station.b"), "{text}");
    }

    #[test]
    fn readers_beside_the_bus_find_no_data_without_their_octets() {
        const TELEGRAMS: u64 = 200_000;
        let traffic = Traffic::new(1);
        std::thread::scope(|scope| {
            for _ in 0..2 {
                scope.spawn(|| {
                    let mut last = 0;
                    while last < 8 * TELEGRAMS {
                        let [_, counts] = traffic.read()[0];
                        assert!(counts.data <= counts.octets, "{counts:?}");
                        assert!(counts.octets >= last, "{counts:?}");
                        last = counts.octets;
                    }
                });
            }
            for _ in 0..TELEGRAMS {
                traffic.moved(0, Way::In, 8, true);
                traffic.data(0, Way::In, 8);
            }
        });
    }

    #[test]
    fn a_bus_that_does_not_know_its_medium_has_octets_only_and_a_silent_line_nothing() {
        let traffic = Traffic::new(1);
        assert_eq!(
            written(&traffic, &mut Rates::default(), Nanos::ZERO, &[]),
            ""
        );
        traffic.moved(0, Way::Out, 34, true);
        let text = written(&traffic, &mut Rates::default(), Nanos::ZERO, &[]);
        assert_eq!(text, "line.octets_out=34\nline.octets_in=0\n");
    }
}
