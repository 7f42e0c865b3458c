//! The data of a run for a report.

use tickbus_base::time::{Nanos, TimeHistogram};

/// The default number of changes that a report holds, over all signals. A page of that size opens within
/// seconds.
pub const DEFAULT_BUDGET: usize = 10_000_000;

/// Marks beyond this number are only counted.
const MOST_MARKS: usize = 10_000;

/// The type of a signal's values.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SignalKind {
    /// 0 or 1.
    Bool,
    /// A number.
    Real,
}

/// From `at` on, a signal has `value`; NaN if it is unknown.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Change {
    /// Simulation time.
    pub at: Nanos,
    /// The value; 0 or 1 for a bool.
    pub value: f64,
}

/// One signal and its changes.
#[derive(Clone, Debug)]
pub struct Signal {
    /// The name; may contain any characters.
    pub name: String,
    /// The type of the values.
    pub kind: SignalKind,
    /// The unit of the values; empty without one.
    pub unit: String,
    changes: Vec<Change>,
    seen: u64,
    edges: Option<u64>,
    resolution: Nanos,
    span: Option<(f64, f64)>,
}

impl Signal {
    /// The changes, in time order. The first is the first known value.
    pub fn changes(&self) -> &[Change] {
        &self.changes
    }

    /// The number of the signal's changes in the recording; greater than the number of changes held here once the
    /// signal was thinned.
    pub fn seen(&self) -> u64 {
        self.seen
    }

    /// The number of edges, including those that merged within a tick; `None` if they were not counted.
    pub fn edges(&self) -> Option<u64> {
        self.edges
    }

    /// Zero for a signal with all changes of the recording. A thinned one has the least, the greatest and the
    /// last value of each span of this length.
    pub fn resolution(&self) -> Nanos {
        self.resolution
    }

    /// The least and the greatest value, if known.
    pub fn range(&self) -> Option<(f64, f64)> {
        self.span
    }

    /// Adds a change, unless it changes nothing.
    fn push(&mut self, at: Nanos, value: f64) -> bool {
        if let Some(last) = self.changes.last_mut() {
            if same(last.value, value) {
                return false;
            }
            if last.at >= at {
                // Two values at the same time: the later one applies.
                last.value = value;
                self.widen(value);
                return false;
            }
        }
        self.widen(value);
        self.changes.push(Change { at, value });
        self.seen += 1;
        true
    }

    fn widen(&mut self, value: f64) {
        if value.is_nan() {
            return;
        }
        let (low, high) = self.span.unwrap_or((value, value));
        self.span = Some((low.min(value), high.max(value)));
    }

    /// Reduces the changes to less than half: for each of equal spans, only the least, the greatest and the
    /// last value remain.
    fn thin(&mut self) {
        let (Some(first), Some(last)) = (self.changes.first(), self.changes.last()) else {
            return;
        };
        let begin = first.at;
        let spans = i64::try_from(self.changes.len() / 8)
            .unwrap_or(i64::MAX)
            .max(1);
        let fair = (last.at - begin).0 / spans + 1;
        self.resolution = Nanos(fair.max(self.resolution.0.saturating_mul(2)));
        let span_of = |change: &Change| (change.at - begin).0 / self.resolution.0;
        let mut kept = Vec::with_capacity(self.changes.len() / 2);
        for span in self.changes.chunk_by(|a, b| span_of(a) == span_of(b)) {
            let by_value = |a: &&Change, b: &&Change| a.value.total_cmp(&b.value);
            let least = span.iter().min_by(by_value);
            let most = span.iter().max_by(by_value);
            let mut extremes =
                [least, most, span.last()].map(|c| *c.expect("a chunk is never empty"));
            extremes.sort_by_key(|change| change.at);
            for change in extremes {
                let is_news = kept.last().is_none_or(|last: &Change| {
                    last.at < change.at && !same(last.value, change.value)
                });
                if is_news {
                    kept.push(change);
                }
            }
        }
        self.changes = kept;
        self.changes.shrink_to_fit();
    }
}

/// True if two values look the same to a reader: NaN equals NaN.
#[expect(clippy::float_cmp, reason = "a change is any change")]
fn same(a: f64, b: f64) -> bool {
    a == b || (a.is_nan() && b.is_nan())
}

/// The kind of a mark.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum MarkKind {
    /// The line entered a state, which lasts until the next mark of this kind. The text is the state,
    /// optionally followed by ": " and a reason.
    Link,
    /// A step began, which lasts until the next mark of this kind; with an empty text no step is active.
    Step,
    /// A fault: a jam, or an injected one.
    Fault,
    /// Ticks are missing from the recording.
    Gap,
    /// Anything else worth a line.
    Note,
}

/// An event at a time, or the beginning of something longer.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Mark {
    /// When it began.
    pub at: Nanos,
    /// When it ended, where that is known.
    pub until: Option<Nanos>,
    /// The kind.
    pub kind: MarkKind,
    /// The subject, if there are several: for a line state, the station.
    pub of: String,
    /// The text.
    pub text: String,
}

/// A run: its signals with their changes, its ticks and its marks, added in time order.
///
/// The run's memory is limited by its budget of changes, however long the run: when the budget is used up, the signal
/// with the most changes is thinned.
#[derive(Debug)]
pub struct Run {
    signals: Vec<Signal>,
    marks: Vec<Mark>,
    marks_left_out: u64,
    ticks: u64,
    extent: Option<(Nanos, Nanos)>,
    last_tick: Option<Nanos>,
    intervals: TimeHistogram,
    shortest: Nanos,
    longest: Nanos,
    changes: usize,
    budget: usize,
}

impl Run {
    /// A run without signals, for at most `budget` changes in total.
    pub fn new(budget: usize) -> Self {
        Self {
            signals: Vec::new(),
            marks: Vec::new(),
            marks_left_out: 0,
            ticks: 0,
            extent: None,
            last_tick: None,
            intervals: TimeHistogram::new(),
            shortest: Nanos::MAX,
            longest: Nanos::ZERO,
            changes: 0,
            budget,
        }
    }

    /// Adds a signal and returns its number.
    pub fn add_signal(&mut self, name: &str, kind: SignalKind, unit: &str) -> usize {
        self.signals.push(Signal {
            name: name.to_owned(),
            kind,
            unit: unit.to_owned(),
            changes: Vec::new(),
            seen: 0,
            edges: None,
            resolution: Nanos::ZERO,
            span: None,
        });
        self.signals.len() - 1
    }

    /// Adds a tick.
    pub fn tick(&mut self, at: Nanos) {
        self.ticks += 1;
        self.see(at);
        if let Some(last) = self.last_tick.replace(at) {
            let interval = at - last;
            self.intervals.record(interval);
            self.shortest = self.shortest.min(interval);
            self.longest = self.longest.max(interval);
        }
    }

    /// Forgets the last tick: the next one does not follow it, because ticks between them were not recorded.
    pub fn skip(&mut self) {
        self.last_tick = None;
    }

    /// Adds a value of a signal; a time before the signal's last change is moved to it.
    ///
    /// # Panics
    ///
    /// When no signal has this number.
    pub fn change(&mut self, signal: usize, at: Nanos, value: f64) {
        self.see(at);
        if !self.signals[signal].push(at, value) {
            return;
        }
        self.changes += 1;
        // A signal with too few changes cannot be thinned.
        while self.changes > self.budget {
            let largest = self
                .signals
                .iter_mut()
                .max_by_key(|signal| signal.changes.len());
            let Some(largest) = largest.filter(|signal| signal.changes.len() >= 32) else {
                break;
            };
            let before = largest.changes.len();
            largest.thin();
            self.changes -= before - largest.changes.len();
        }
    }

    /// Turns a signal into a bool if its values were only ever 0 and 1.
    ///
    /// # Panics
    ///
    /// When no signal has this number.
    pub fn call_bool_if_it_looks_like_one(&mut self, signal: usize) {
        let signal = &mut self.signals[signal];
        let mut values = signal.changes.iter().map(|change| change.value);
        if signal.unit.is_empty()
            && signal.seen > 1
            && values.all(|value| same(value, 0.0) || same(value, 1.0))
        {
            signal.kind = SignalKind::Bool;
        }
    }

    /// Adds edges of a signal to their count.
    ///
    /// # Panics
    ///
    /// When no signal has this number.
    pub fn count_edges(&mut self, signal: usize, edges: u64) {
        *self.signals[signal].edges.get_or_insert(0) += edges;
    }

    /// Adds a mark.
    pub fn mark(&mut self, mark: Mark) {
        self.see(mark.at);
        if self.marks.len() < MOST_MARKS {
            self.marks.push(mark);
        } else {
            self.marks_left_out += 1;
        }
    }

    fn see(&mut self, at: Nanos) {
        let (first, last) = self.extent.unwrap_or((at, at));
        self.extent = Some((first.min(at), last.max(at)));
    }

    /// The signals, in the order of their addition.
    pub fn signals(&self) -> &[Signal] {
        &self.signals
    }

    /// The number of the signal with this name.
    pub fn signal(&self, name: &str) -> Option<usize> {
        self.signals.iter().position(|signal| signal.name == name)
    }

    /// The marks, in the order of their addition.
    pub fn marks(&self) -> &[Mark] {
        &self.marks
    }

    /// The number of marks that were not kept.
    pub fn marks_left_out(&self) -> u64 {
        self.marks_left_out
    }

    /// The number of ticks.
    pub fn ticks(&self) -> u64 {
        self.ticks
    }

    /// The first and last time; zero for both if nothing happened.
    pub fn extent(&self) -> (Nanos, Nanos) {
        self.extent.unwrap_or_default()
    }

    /// The times between successive ticks: their distribution, the shortest and the longest; `None` for fewer
    /// than two ticks.
    pub fn intervals(&self) -> Option<(&TimeHistogram, Nanos, Nanos)> {
        (self.intervals.count() > 0).then_some((&self.intervals, self.shortest, self.longest))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn run() -> (Run, usize) {
        let mut run = Run::new(1000);
        let signal = run.add_signal("x", SignalKind::Real, "mm");
        (run, signal)
    }

    #[test]
    fn values_that_do_not_change_are_left_out() {
        let (mut run, x) = run();
        for (at, value) in [(0, 1.0), (1, 1.0), (2, f64::NAN), (3, f64::NAN), (4, 1.0)] {
            run.change(x, Nanos(at), value);
        }
        let times: Vec<i64> = run.signals()[x].changes().iter().map(|c| c.at.0).collect();
        assert_eq!(times, [0, 2, 4]);
        assert!(run.signals()[x].changes()[1].value.is_nan());
        assert_eq!(run.signals()[x].range(), Some((1.0, 1.0)));
    }

    #[test]
    fn a_budget_that_is_used_up_thins_the_busiest_signal_and_keeps_its_peaks() {
        let (mut run, busy) = run();
        let calm = run.add_signal("calm", SignalKind::Bool, "");
        for at in 0..100_000_i32 {
            let peak = if at == 54_321 { 1e6 } else { 0.0 };
            run.change(busy, Nanos(i64::from(at)), f64::from(at % 7) + peak);
            if at % 1000 == 0 {
                run.change(calm, Nanos(i64::from(at)), f64::from(at / 1000 % 2));
            }
        }
        let [busy, calm] = run.signals() else {
            panic!("two signals")
        };
        assert!(busy.changes().len() + calm.changes().len() <= 1000);
        assert!(busy.changes().len() > 200, "{}", busy.changes().len());
        assert_eq!((busy.seen(), calm.seen()), (100_000, 100));
        assert_eq!(calm.changes().len(), 100);
        assert_eq!(calm.resolution(), Nanos::ZERO);
        assert!(busy.resolution() > Nanos::ZERO);
        let highest = busy.changes().iter().map(|c| c.value).fold(0.0, f64::max);
        assert!(highest >= 1e6, "{highest}");
        assert!(busy.changes().is_sorted_by(|a, b| a.at < b.at));
        assert_eq!(busy.changes().last().map(|c| c.at), Some(Nanos(99_999)));
    }

    #[test]
    fn a_tiny_budget_ends_and_keeps_what_cannot_be_thinned() {
        let mut run = Run::new(0);
        for number in 0..50 {
            let signal = run.add_signal(&number.to_string(), SignalKind::Real, "");
            for at in 0..100_i32 {
                run.change(signal, Nanos(i64::from(at)), f64::from(at));
            }
        }
        assert!(run.signals().iter().all(|s| s.changes().len() < 32));
    }

    #[test]
    fn the_extent_takes_in_times_before_zero() {
        let (mut run, x) = run();
        assert_eq!(run.extent(), (Nanos::ZERO, Nanos::ZERO));
        run.tick(Nanos(-5));
        assert_eq!(run.extent(), (Nanos(-5), Nanos(-5)));
        run.change(x, Nanos(-2), 1.0);
        assert_eq!(run.extent(), (Nanos(-5), Nanos(-2)));
    }

    #[test]
    fn intervals_do_not_span_what_was_not_recorded() {
        let (mut run, _) = run();
        for at in [0, 10, 20] {
            run.tick(Nanos::from_millis(at));
        }
        run.skip();
        run.tick(Nanos::from_millis(500));
        run.tick(Nanos::from_millis(512));
        let (spans, shortest, longest) = run.intervals().expect("more than one tick");
        assert_eq!(spans.count(), 3);
        assert_eq!(
            (shortest, longest),
            (Nanos::from_millis(10), Nanos::from_millis(12))
        );
    }

    #[test]
    fn marks_beyond_the_most_are_counted() {
        let (mut run, _) = run();
        for at in 0..10_005 {
            run.mark(Mark {
                at: Nanos(at),
                until: None,
                kind: MarkKind::Gap,
                of: String::new(),
                text: String::new(),
            });
        }
        assert_eq!((run.marks().len(), run.marks_left_out()), (10_000, 5));
    }
}
