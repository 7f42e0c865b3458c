//! The program "reaction": measures how long the machine's end takes to respond.

use std::fmt::Write as _;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use tickbus_base::statistics::Statistics;
use tickbus_base::time::{Nanos, TimeHistogram};
use tickbus_image::signal::{Address, Addressing, Area, Width};
use tickbus_plc::{Program, ProgramError, Report, Scan};

/// Repeatedly toggles one `%Q` bit, waits until one `%I` bit follows, and measures the time from the scan
/// that makes the edge to the scan that sees the response.
///
/// The other end must copy the `%Q` bit to the `%I` bit, as `tickbus mirror` does. The pauses between edges
/// vary, so that the measurement does not synchronise with the machine's ticks.
#[derive(Debug)]
pub struct Reaction {
    output: Bit,
    input: Bit,
    timeout: Nanos,
    pause: Nanos,
    state: State,
    random: u32,
    result: Arc<Result>,
}

/// A bit of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Bit {
    byte: usize,
    mask: u8,
}

#[derive(Clone, Copy, Debug)]
enum State {
    /// There is no peer, or an edge was not answered: responses are ignored until the level has been constant
    /// for `timeout`.
    Settling { since: Option<Nanos> },
    /// Waits until the next edge is due.
    Pausing { until: Nanos },
    /// Waits for the response.
    Waiting { since: Nanos, cycle: u64 },
}

/// The measurements, shared with the host.
#[derive(Debug)]
struct Result {
    count: u64,
    /// The machine's tick, if known.
    tick: Option<Nanos>,
    measured: Mutex<Measured>,
}

#[derive(Debug, Default)]
struct Measured {
    spans: TimeHistogram,
    /// Bus cycles from edge to response; each counts as a microsecond.
    cycles: TimeHistogram,
    /// Edges without a response in time.
    lost: u64,
    /// Edges lost in a row.
    lost_in_row: u64,
}

/// After this many lost edges in a row the measurement gives up.
const GIVE_UP: u64 = 5;

impl Reaction {
    /// The name in [`program`](super::program).
    pub const NAME: &'static str = "reaction";

    /// The program's options.
    const OPTIONS: [&'static str; 6] = ["output", "input", "count", "timeout", "pause", "tick"];

    /// A measurement with its options as text: `output` (default `%QX0.0`) and `input` (`%IX0.0`), `count` of
    /// edges (1000), `timeout` of a response (1s), longest `pause` between two edges (10ms), and the
    /// machine's `tick`, which gives the result in ticks as well.
    ///
    /// # Errors
    ///
    /// The option does not exist, or does not accept the value.
    pub fn from_options(options: &[(String, String)]) -> std::result::Result<Self, ProgramError> {
        let mut output = bit("output", "%QX0.0", Area::Output)?;
        let mut input = bit("input", "%IX0.0", Area::Input)?;
        let (mut count, mut tick) = (1000, None);
        let (mut timeout, mut pause) = (Nanos::from_secs(1), Nanos::from_millis(10));
        for (option, value) in options {
            match option.as_str() {
                "output" => output = bit("output", value, Area::Output)?,
                "input" => input = bit("input", value, Area::Input)?,
                "count" => {
                    count = value
                        .parse()
                        .ok()
                        .filter(|count| *count > 0)
                        .ok_or_else(|| malformed("count", value, "write a number above zero"))?;
                }
                "timeout" => timeout = span("timeout", value)?,
                "pause" => pause = span("pause", value)?,
                "tick" => tick = Some(span("tick", value)?),
                _ => {
                    return Err(ProgramError::UnknownOption {
                        program: Self::NAME,
                        option: option.clone(),
                        known: &Self::OPTIONS,
                    });
                }
            }
        }
        Ok(Self {
            output,
            input,
            timeout,
            pause,
            state: State::Settling { since: None },
            random: 1,
            result: Arc::new(Result {
                count,
                tick,
                measured: Mutex::default(),
            }),
        })
    }

    /// When the next edge is due: after at least half the pause.
    fn next_edge(&mut self, now: Nanos) -> State {
        // The quick generator of Numerical Recipes is random enough for this.
        self.random = self
            .random
            .wrapping_mul(1_664_525)
            .wrapping_add(1_013_904_223);
        let half = self.pause.0 / 2;
        let more = half.saturating_mul(i64::from(self.random >> 16)) >> 16;
        State::Pausing {
            until: now + Nanos(half + more),
        }
    }
}

fn malformed(option: &'static str, value: &str, right: &str) -> ProgramError {
    ProgramError::BadValue {
        program: Reaction::NAME,
        option,
        value: value.to_owned(),
        right: right.to_owned(),
    }
}

fn span(option: &'static str, value: &str) -> std::result::Result<Nanos, ProgramError> {
    let span = value.parse().ok().filter(|span| *span > Nanos::ZERO);
    span.ok_or_else(|| malformed(option, value, "write a duration such as \"10ms\""))
}

fn bit(option: &'static str, value: &str, area: Area) -> std::result::Result<Bit, ProgramError> {
    let right = match area {
        Area::Input => "write the address of a bit such as %IX0.0",
        Area::Output => "write the address of a bit such as %QX0.0",
    };
    let found = Address::parse(value, Addressing::Bytes).ok();
    let found = found.filter(|found| (found.area, found.width) == (area, Width::Bit));
    let found = found.ok_or_else(|| malformed(option, value, right))?;
    Ok(Bit {
        byte: found.byte,
        mask: 1 << found.bit,
    })
}

impl Bit {
    fn get(self, frame: &[u8]) -> bool {
        frame
            .get(self.byte)
            .is_some_and(|byte| byte & self.mask != 0)
    }

    fn toggle(self, frame: &mut [u8]) {
        if let Some(byte) = frame.get_mut(self.byte) {
            *byte ^= self.mask;
        }
    }
}

impl Program for Reaction {
    fn name(&self) -> &str {
        Self::NAME
    }

    fn interval(&self) -> Nanos {
        Nanos::from_micros(100)
    }

    fn input_bytes(&self) -> usize {
        self.input.byte + 1
    }

    fn output_bytes(&self) -> usize {
        self.output.byte + 1
    }

    fn scan(&mut self, scan: &mut Scan<'_>) {
        let now = scan.now;
        let answered = self.input.get(scan.inputs) == self.output.get(scan.outputs);
        self.state = match self.state {
            _ if !scan.alive => State::Settling { since: None },
            State::Settling { since: None } => State::Settling { since: Some(now) },
            State::Settling { since: Some(since) } if answered && now - since >= self.pause => {
                self.next_edge(now)
            }
            State::Settling { since: Some(since) } if now - since >= self.timeout => {
                self.result.lose();
                State::Settling { since: Some(now) }
            }
            State::Pausing { until } if now >= until && !self.result.is_done() => {
                self.output.toggle(scan.outputs);
                State::Waiting {
                    since: now,
                    cycle: scan.cycle,
                }
            }
            State::Waiting { since, cycle } if answered => {
                self.result.answer(now - since, scan.cycle - cycle);
                self.next_edge(now)
            }
            State::Waiting { since, .. } if now - since >= self.timeout => {
                self.result.lose();
                State::Settling { since: Some(now) }
            }
            same => same,
        };
    }

    fn report(&self) -> Option<Arc<dyn Report>> {
        Some(Arc::clone(&self.result) as _)
    }
}

impl Result {
    fn lock(&self) -> MutexGuard<'_, Measured> {
        // A histogram is consistent after every change, so a poisoned lock is safe to use.
        self.measured.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn answer(&self, span: Nanos, cycles: u64) {
        let mut measured = self.lock();
        measured.spans.record(span);
        let cycles = Nanos::from_micros(i64::try_from(cycles).unwrap_or(i64::MAX));
        measured.cycles.record(cycles);
        measured.lost_in_row = 0;
    }

    fn lose(&self) {
        let mut measured = self.lock();
        measured.lost += 1;
        measured.lost_in_row += 1;
    }
}

impl Report for Result {
    fn write(&self, statistics: &mut Statistics) {
        let measured = self.lock();
        statistics.distribution("reaction", &measured.spans);
        let micro = Nanos::from_micros(1);
        statistics.distribution_in("reaction.cycles", &measured.cycles, micro, "");
        if let Some(tick) = self.tick {
            statistics.distribution_in("reaction.ticks", &measured.spans, tick, "");
        }
        statistics.count("reaction.lost", measured.lost);
    }

    fn summary(&self) -> String {
        let measured = self.lock();
        let (spans, cycles) = (&measured.spans, &measured.cycles);
        let mut text = format!(
            "reaction of the other end: {} edges answered, {} lost\n",
            spans.count(),
            measured.lost
        );
        if spans.count() > 0 {
            text.push_str(&spans.chart());
            let mut row = |unit: &str, value: &dyn Fn(f64) -> f64| {
                let _ = writeln!(
                    text,
                    "  {unit:<10} p50 {:>8.1}   p99 {:>8.1}   max {:>8.1}",
                    value(0.5),
                    value(0.99),
                    value(1.0)
                );
            };
            row("us", &|share| spans.quantile(share).as_micros());
            row("bus cycles", &|share| cycles.quantile(share).as_micros());
            if let Some(tick) = self.tick {
                row("ticks", &|share| {
                    spans.quantile(share).as_micros() / tick.as_micros()
                });
            }
        }
        text
    }

    fn is_done(&self) -> bool {
        let measured = self.lock();
        measured.spans.count() >= self.count || measured.lost_in_row >= GIVE_UP
    }

    fn failure(&self) -> Option<String> {
        let measured = self.lock();
        if measured.lost_in_row >= GIVE_UP {
            return Some(format!(
                "{} edges in a row were not answered; the other end must bring the output bit back on the \
                 input bit, as `tickbus mirror` does",
                measured.lost_in_row
            ));
        }
        (measured.spans.count() == 0).then(|| {
            "no edge was answered; the other end must run, and bring the output bit back on the input bit, as \
             `tickbus mirror` does"
                .to_owned()
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn program(options: &[(&str, &str)]) -> Reaction {
        let options: Vec<_> = options
            .iter()
            .map(|(key, value)| ((*key).to_owned(), (*value).to_owned()))
            .collect();
        Reaction::from_options(&options).expect("right options")
    }

    /// Scans every 100 us with a machine that responds after `delay`, until done or for a minute.
    fn measure(program: &mut Reaction, delay: Option<Nanos>) -> Arc<dyn Report> {
        let report = program.report().expect("it reports");
        let (mut inputs, mut outputs) = ([0_u8; 2], [0_u8; 2]);
        let mut changed = Nanos::ZERO;
        for scan in 0..600_000_u32 {
            if report.is_done() {
                break;
            }
            let now = Nanos::from_micros(100 * i64::from(scan));
            if delay.is_some_and(|delay| now - changed >= delay) {
                inputs = outputs;
            }
            let before = outputs;
            program.scan(&mut Scan {
                now,
                alive: scan > 10,
                cycle: u64::from(scan / 10),
                inputs: &inputs,
                outputs: &mut outputs,
            });
            if outputs != before {
                changed = now;
            }
        }
        report
    }

    #[test]
    fn the_time_from_edge_to_answer_is_measured() {
        let mut program = program(&[
            ("output", "%QX1.3"),
            ("input", "%IX1.3"),
            ("count", "100"),
            ("tick", "2ms"),
        ]);
        let report = measure(&mut program, Some(Nanos::from_millis(3)));
        assert!(report.is_done() && report.failure().is_none());
        let mut statistics = Statistics::default();
        report.write(&mut statistics);
        let text = statistics.to_string();
        assert!(
            text.starts_with("reaction.count=100\nreaction.p50_us=30"),
            "{text}"
        );
        assert!(text.contains("reaction.cycles.p50=3.0\n"), "{text}");
        assert!(text.contains("reaction.ticks.p50=1.5\n"), "{text}");
        assert!(text.ends_with("reaction.lost=0\n"), "{text}");
        assert!(report.summary().contains("100 edges answered, 0 lost"));
    }

    #[test]
    fn a_machine_that_never_answers_ends_it() {
        let report = measure(&mut program(&[]), None);
        assert!(report.is_done());
        assert!(
            report
                .failure()
                .expect("it failed")
                .contains("tickbus mirror")
        );
    }

    #[test]
    fn a_measurement_of_nothing_has_failed() {
        let report = program(&[]).report().expect("it reports");
        assert!(!report.is_done());
        let failure = report.failure().expect("it failed");
        assert!(failure.contains("no edge was answered"), "{failure}");
    }

    #[test]
    fn options_that_make_no_sense_are_refused() {
        for (option, value) in [
            ("output", "%IX0.0"),
            ("output", "%QW0"),
            ("input", "first"),
            ("count", "0"),
            ("timeout", "soon"),
        ] {
            let options = [(option.to_owned(), value.to_owned())];
            let error = Reaction::from_options(&options).expect_err("refused");
            assert!(error.to_string().contains("; write "), "{error}");
        }
    }
}
