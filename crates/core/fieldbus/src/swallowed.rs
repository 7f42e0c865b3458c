//! Reports swallowed changes: in the statistics, and once per signal in the log.

use std::fmt;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError};

use tickbus_base::statistics::{Key, Statistics};
use tickbus_base::time::Nanos;
use tickbus_image::Swallowed;
use tickbus_image::signal::{Area, DataType, SignalTable};

use crate::Role;

/// The fewest ticks of a look from which their length is known.
const TICKS: u64 = 10;

/// How often a bus looks for signals to log.
pub(crate) const LOOK: Nanos = Nanos::from_secs(1);

/// The most signals that are logged one by one.
const MOST: usize = 20;

/// The steps between two frames that one side takes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Steps {
    /// The name: "bus cycles", "scans", "ticks".
    pub name: &'static str,
    /// How long each takes, if that is known.
    pub span: Option<Nanos>,
}

impl fmt::Display for Steps {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name)?;
        self.span.map_or(Ok(()), |span| write!(f, " of {span}"))
    }
}

/// The signals of a driver whose values changed and changed back between two frames that the other side took.
#[derive(Clone, Debug)]
pub struct SwallowedSignals {
    /// The counters of this line. The driver's next line, after a reset, has its own.
    counts: Swallowed,
    shared: Arc<Shared>,
}

#[derive(Debug)]
struct Shared {
    driver: String,
    table: SignalTable,
    role: Role,
    /// The steps of the peer, and of this end.
    steps: [Steps; 2],
    /// How often the PLC program at the other end is scanned, if this process scans it, and the steps in which it takes
    /// frames.
    scan: OnceLock<(Nanos, Steps)>,
    /// True once the log has the length of the ticks.
    has_told_ticks: AtomicBool,
    /// The line that is reported.
    current: Mutex<Current>,
}

#[derive(Debug)]
struct Current {
    counts: Swallowed,
    /// Which signals the log has.
    logged: Vec<bool>,
}

impl Current {
    fn new(counts: Swallowed, signals: usize) -> Self {
        Self {
            counts,
            logged: vec![false; signals],
        }
    }
}

impl SwallowedSignals {
    /// Counts from zero the changes of these signals. `steps` are those in which the peer takes frames, and this
    /// end.
    pub fn new(driver: &str, table: &SignalTable, role: Role, steps: [Steps; 2]) -> Self {
        let signals = table.signals.len();
        let counts = Swallowed::new(signals);
        Self {
            shared: Arc::new(Shared {
                driver: driver.to_owned(),
                table: table.clone(),
                role,
                steps,
                scan: OnceLock::new(),
                has_told_ticks: AtomicBool::new(false),
                current: Mutex::new(Current::new(counts.clone(), signals)),
            }),
            counts,
        }
    }

    /// Counters from zero for the next line of the driver, which are reported once it [begins](Self::begin): until then
    /// the present line counts on.
    #[must_use]
    pub fn of_next_line(&self) -> Self {
        Self {
            counts: Swallowed::new(self.shared.table.signals.len()),
            shared: Arc::clone(&self.shared),
        }
    }

    /// Reports this line from now on, and logs its signals again.
    pub fn begin(&self) {
        *self.current() = Current::new(self.counts.clone(), self.shared.table.signals.len());
    }

    fn current(&self) -> MutexGuard<'_, Current> {
        let current = self.shared.current.lock();
        current.unwrap_or_else(PoisonError::into_inner)
    }

    /// The peer is a PLC program that this process scans so often, over a bus with this cycle if there is one: nothing
    /// shorter than either reaches it.
    pub fn scanned_every(&self, scan: Nanos, cycle: Option<Nanos>) {
        let slower = cycle.filter(|cycle| *cycle > scan);
        let steps = Steps {
            name: slower.map_or("scans", |_| "bus cycles"),
            span: slower.or(Some(scan)),
        };
        let _ = self.shared.scan.set((scan, steps));
    }

    /// The counters of this line, per signal of the table.
    pub fn counts(&self) -> &Swallowed {
        &self.counts
    }

    /// Adds this end's role, that it never writes if it observes, the numbers of both directions, of each station if there are several, and of each signal
    /// that has any.
    pub fn write(&self, statistics: &mut Statistics) {
        let table = &self.shared.table;
        let mut sums = vec![[0; 2]; table.stations.len()];
        let found: Vec<(usize, u64)> = self.current().counts.iter().collect();
        statistics.text("role", self.shared.role.name());
        if self.shared.role == Role::Observer {
            statistics.text("writes", "never");
        }
        for (signal, count) in &found {
            let signal = &table.signals[*signal];
            let area = signal.plc_address().area;
            sums[signal.station][usize::from(area == Area::Output)] += count;
        }
        let sum = |direction: usize| sums.iter().map(|sums| sums[direction]).sum();
        statistics.count("swallowed_inputs", sum(0));
        statistics.count("swallowed_outputs", sum(1));
        if sums.len() > 1 {
            for (station, [inputs, outputs]) in table.stations.iter().zip(&sums) {
                let key = |tail| Key::of("station", &station.name, tail);
                statistics.count(key("swallowed_inputs"), *inputs);
                statistics.count(key("swallowed_outputs"), *outputs);
            }
        }
        for (signal, count) in found {
            let name = &table.signals[signal].name;
            statistics.count(Key::of("swallowed", name, ""), count);
        }
    }

    /// Logs each signal that has swallowed changes and is not in the log yet, with what to do.
    pub fn log(&self) {
        // Written after the lock is released, so that no thread waits for a slow reader of the log.
        for line in self.news() {
            log::warn!("driver \"{}\": {line}", self.shared.driver);
        }
    }

    /// A sentence for each signal that has swallowed changes, with the signal's index: how often, between which steps,
    /// and what to do. Allocates nothing if there are none.
    pub fn sentences(&self) -> Vec<(usize, String)> {
        let current = self.current();
        let counts = current.counts.iter();
        counts
            .map(|(signal, count)| (signal, self.line(signal, count)))
            .collect()
    }

    /// Logs once if a simulation's ticks are longer than the scans of its peer: `seen` are the number of ticks since the
    /// last call, and the shortest time between two of them. Only the scans of a program in this process are known.
    pub(crate) fn log_ticks(&self, seen: (u64, Nanos)) {
        if let Some(line) = self.long_ticks(seen)
            && !self.shared.has_told_ticks.swap(true, Ordering::Relaxed)
        {
            log::warn!("driver \"{}\": {line}", self.shared.driver);
        }
    }

    fn long_ticks(&self, (ticks, shortest): (u64, Nanos)) -> Option<String> {
        let (scan, _) = *self.shared.scan.get()?;
        // A tenth is no more than the pace of a busy computer.
        let is_long = ticks >= TICKS && shortest > scan + Nanos(scan.0 / 10);
        let shortest = shortest.rounded();
        is_long.then(|| {
            format!(
                "the simulation ticks every {shortest} or more rarely, and the PLC scans every {scan}: outputs that \
                 are on for one scan are missed, and answers come late; tick at least every {scan}, or set latch for \
                 the signals that pulse"
            )
        })
    }

    /// The steps in which the peer, or this end, takes frames.
    fn steps(&self, is_sent: bool) -> Steps {
        match self.shared.scan.get() {
            Some((_, steps)) if is_sent => *steps,
            _ => self.shared.steps[usize::from(!is_sent)],
        }
    }

    fn news(&self) -> Vec<String> {
        let mut current = self.current();
        let Current { counts, logged } = &mut *current;
        let before = logged.iter().filter(|is_logged| **is_logged).count();
        let mut news = Vec::new();
        for (signal, count) in counts.iter() {
            if std::mem::replace(&mut logged[signal], true) {
                continue;
            }
            match (before + news.len()).cmp(&MOST) {
                std::cmp::Ordering::Less => news.push(self.line(signal, count)),
                std::cmp::Ordering::Equal => news.push(
                    "changes of further signals were swallowed as well: the statistics list them all, \
                     as swallowed.<signal>"
                        .to_owned(),
                ),
                std::cmp::Ordering::Greater => break,
            }
        }
        news
    }

    /// The log's line about a signal: the fact and the cure.
    fn line(&self, signal: usize, count: u64) -> String {
        let Shared { table, role, .. } = &*self.shared;
        let signal = &table.signals[signal];
        let (written, _) = role.areas();
        let is_sent = signal.area == written;
        let reader = match (signal.area, role) {
            (_, Role::Observer) => "the observer",
            (Area::Input, _) => "the PLC",
            (Area::Output, _) => "the machine",
        };
        let times = if count == 1 {
            "once".to_owned()
        } else {
            format!("{count} times")
        };
        let cure = match (signal.data_type, is_sent) {
            (DataType::Bool, true) => "set latch = \"rising\" for it, or tick slower",
            (DataType::Bool, false) => "set latch = \"rising\" for it, or tick faster",
            (_, true) => "hold each value for longer, or tick slower",
            (_, false) => "tick faster",
        };
        format!(
            "\"{}\" changed and changed back {times} between two {}; {reader} saw none of it: {cure} \
             (count_swallowed = false turns this message off)",
            signal.name,
            self.steps(is_sent),
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tickbus_image::signal::{Signal, Station};
    use tickbus_image::{DirectStream, counted_signals};

    fn table(signals: usize) -> SignalTable {
        let station = |name: &str| Station {
            name: name.to_owned(),
            input_bytes: 8,
            output_bytes: 1,
            observed_bytes: 0,
        };
        let inputs = (0..signals).map(|place| Signal {
            bit: (place % 8).to_le_bytes()[0],
            ..Signal::new(
                format!("In {place}"),
                Area::Input,
                place / 8,
                DataType::Bool,
            )
        });
        let output = Signal {
            station: 1,
            ..Signal::new("Out", Area::Output, 0, DataType::Bool)
        };
        SignalTable {
            stations: vec![station("A"), station("B")],
            signals: inputs.chain([output]).collect(),
            structures: Vec::new(),
        }
    }

    /// All signals of a station and area go on and off this many times, and nobody sees it.
    fn pulse(of: &SwallowedSignals, station: usize, area: Area, times: usize) {
        let counted = counted_signals(&of.shared.table, station, area);
        let stream = DirectStream::new(vec![0; 8].into(), Box::default());
        let mut stream = stream.with_counted(&counted, of.counts());
        stream.read(Nanos::ZERO);
        for level in [0xff, 0].repeat(times) {
            stream.write(|bytes| bytes.fill(level));
        }
    }

    #[test]
    fn a_signal_is_logged_once_with_the_cure_and_many_signals_do_not_fill_the_log() {
        let steps = [
            ("bus cycles", Some(Nanos::from_millis(10))),
            ("ticks", None),
        ]
        .map(|(name, span)| Steps { name, span });
        let of = SwallowedSignals::new("x", &table(2), Role::Device, steps);
        assert!(of.news().is_empty());
        pulse(&of, 0, Area::Input, 242);
        pulse(&of, 1, Area::Output, 1);
        assert_eq!(
            of.news(),
            [
                "\"In 0\" changed and changed back 242 times between two bus cycles of 10ms; the PLC saw none of \
                 it: set latch = \"rising\" for it, or tick slower (count_swallowed = false turns this message off)",
                "\"In 1\" changed and changed back 242 times between two bus cycles of 10ms; the PLC saw none of \
                 it: set latch = \"rising\" for it, or tick slower (count_swallowed = false turns this message off)",
                "\"Out\" changed and changed back once between two ticks; the machine saw none of it: set \
                 latch = \"rising\" for it, or tick faster (count_swallowed = false turns this message off)",
            ]
        );
        pulse(&of, 0, Area::Input, 1);
        assert!(of.news().is_empty(), "once is enough");
        let mut statistics = Statistics::default();
        of.write(&mut statistics);
        assert_eq!(
            statistics.to_string(),
            "role=device\nswallowed_inputs=486\nswallowed_outputs=1\nstation.A.swallowed_inputs=486\n\
             station.A.swallowed_outputs=0\nstation.B.swallowed_inputs=0\nstation.B.swallowed_outputs=1\n\
             swallowed.In 0=243\nswallowed.In 1=243\nswallowed.Out=1\n"
        );
        of.scanned_every(Nanos::from_millis(20), Some(Nanos::from_millis(10)));
        assert_eq!(of.steps(true).to_string(), "scans of 20ms");
        for (ticks, millis, is_long) in [(9, 50, false), (10, 22, false), (10, 50, true)] {
            let line = of.long_ticks((ticks, Nanos::from_millis(millis)));
            assert_eq!(line.is_some(), is_long, "{line:?}");
        }
        // A reset: the next line has counters of its own, and the log names its signals again.
        let next = of.of_next_line();
        pulse(&next, 0, Area::Input, 1);
        assert_eq!(
            of.sentences().len(),
            3,
            "the present line is still reported"
        );
        next.begin();
        pulse(&of, 0, Area::Input, 5);
        let sentence = |place: usize| {
            format!(
                "\"In {place}\" changed and changed back once between two scans of 20ms; the PLC saw none of it: set \
                 latch = \"rising\" for it, or tick slower (count_swallowed = false turns this message off)"
            )
        };
        assert_eq!(of.sentences(), [(0, sentence(0)), (1, sentence(1))]);
        assert_eq!(of.news(), [sentence(0), sentence(1)]);
        let many = SwallowedSignals::new("x", &table(60), Role::Controller, steps);
        many.scanned_every(Nanos::from_millis(20), Some(Nanos::from_millis(50)));
        assert_eq!(many.steps(true).to_string(), "bus cycles of 50ms");
        pulse(&many, 0, Area::Input, 1);
        let news = many.news();
        assert_eq!(news.len(), MOST + 1);
        assert!(
            news[0].contains("once between two ticks; the PLC saw none"),
            "{}",
            news[0]
        );
        assert!(news[MOST].starts_with("changes of further signals"));
        pulse(&many, 1, Area::Output, 1);
        assert!(many.news().is_empty());
    }
}
