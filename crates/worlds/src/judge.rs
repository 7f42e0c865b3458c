//! Who judges a world: what each end wrote and when, and what the other end may therefore see.
//!
//! Every value that is written says by whom and in which tick it was written, or follows from one that does. So what is seen
//! can be judged without a look into the drivers.

use std::fmt;

use crate::network::Delivery;
use crate::plan::{Bus, FAIL_SAFE, Misfortune, Plan};
use crate::random::scramble;
use crate::scheduler::STARVED;

/// A promise that was broken.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Broken {
    /// Its short name.
    pub promise: &'static str,
    /// What was seen, and what would have been right.
    pub what: String,
}

impl fmt::Display for Broken {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.promise, self.what)
    }
}

/// What a stamp says: the writer's life, its station, and its tick.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Stamp {
    pub(crate) life: u64,
    pub(crate) area: u64,
    pub(crate) station: u64,
    pub(crate) tick: u64,
}

impl Stamp {
    pub(crate) fn number(self) -> u64 {
        self.life << 48 | self.area << 44 | self.station << 40 | self.tick
    }

    pub(crate) fn of(number: u64) -> Self {
        Self {
            life: number >> 48,
            area: number >> 44 & 0xF,
            station: number >> 40 & 0xF,
            tick: number & 0xFF_FFFF_FFFF,
        }
    }
}

/// The values beside a stamp, which follow from it.
pub(crate) fn level(stamp: u64) -> bool {
    scramble(stamp) & 1 == 1
}

pub(crate) fn whole(stamp: u64) -> i16 {
    let [one, other, ..] = scramble(stamp).to_be_bytes();
    i16::from_be_bytes([one, other])
}

/// In halves, so that it passes the scale and 32 bits unharmed.
pub(crate) fn real(stamp: u64) -> f64 {
    let [_, _, one, other, ..] = scramble(stamp).to_be_bytes();
    f64::from(i16::from_be_bytes([one, other])) / 2.0
}

/// A tick of a writer: its number, and when its call returned.
#[derive(Clone, Copy, Debug)]
struct Written {
    life: u64,
    tick: u64,
    ended: i64,
}

/// What one end has written.
#[derive(Debug, Default)]
pub(crate) struct Writer {
    written: Vec<Written>,
    /// When pulses were written, to all stations at once.
    pub(crate) pulses: Vec<i64>,
}

impl Writer {
    /// A tick begins.
    pub(crate) fn begin(&mut self, life: u64, tick: u64) {
        self.written.push(Written {
            life,
            tick,
            ended: i64::MAX,
        });
    }

    /// It ends.
    pub(crate) fn end(&mut self, now: i64) {
        if let Some(written) = self.written.last_mut() {
            written.ended = now;
        }
    }

    /// The newest that was whole at a time.
    fn newest_at(&self, time: i64) -> Option<(u64, u64)> {
        let after = self
            .written
            .partition_point(|written| written.ended <= time);
        let written = self.written.get(after.checked_sub(1)?)?;
        Some((written.life, written.tick))
    }

    fn has_begun(&self, life: u64, tick: u64) -> bool {
        let newest = self.written.last();
        newest.is_some_and(|newest| (life, tick) <= (newest.life, newest.tick))
    }

    /// When its last tick before `now` ended.
    fn last_ended(&self, now: i64) -> Option<i64> {
        let after = self.written.partition_point(|written| written.ended <= now);
        Some(self.written.get(after.checked_sub(1)?)?.ended)
    }

    /// When the tick after the one that was written ended.
    fn is_ticking(&self) -> bool {
        self.written
            .last()
            .is_some_and(|written| written.ended == i64::MAX)
    }
}

/// What a station shows in one tick.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Shown {
    pub(crate) stamp: u64,
    pub(crate) level: bool,
    pub(crate) edges: u64,
    pub(crate) numbers: Option<(f64, f64)>,
}

impl Shown {
    /// Whether the values beside the stamp belong to it. Connections that are asked for come one by one, and a signal without one
    /// has its fail-safe value.
    fn follows(&self, plan: &Plan) -> bool {
        let is_asked = plan.laboratory.is_asked;
        let (whole, real) = (f64::from(whole(self.stamp)), real(self.stamp));
        let is = |value: f64, right: f64, fail_safe: f64| {
            value == right || is_asked && value == fail_safe
        };
        let level = level(self.stamp);
        (self.level == level || is_asked && !self.level)
            && self
                .numbers
                .is_none_or(|(one, other)| is(one, whole, -7.0) && is(other, real, 2.5))
    }
}

/// A tick as its end got it.
#[derive(Debug)]
pub(crate) struct Seen<'a> {
    pub(crate) began: i64,
    pub(crate) is_stale: bool,
    pub(crate) is_fresh: bool,
    pub(crate) age: i64,
    pub(crate) sequence: u64,
    pub(crate) stations: &'a [Shown],
    pub(crate) deliveries: &'a [Delivery],
    /// Through a dispatcher.
    pub(crate) known: Option<Known>,
}

/// What who stands between both ends knew of a writer when it sent what a reader has heard.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Known {
    /// When the writer had sent the newest of what has to be seen; `None` if there is nothing.
    pub(crate) until: Option<i64>,
    /// For how long nothing had come from the writer, in ns.
    pub(crate) silent: i64,
}

/// What one end has seen.
#[derive(Debug, Default)]
pub(crate) struct Reader {
    newest: Vec<(u64, u64)>,
    sequence: u64,
    /// When rising edges were seen, per station.
    pub(crate) edges: Vec<Vec<(i64, u64)>>,
    /// When it was last not stale, and what it saw then.
    pub(crate) last_valid: Option<(i64, Option<(u64, u64)>)>,
    /// When it was first not stale.
    pub(crate) first_valid: Option<i64>,
    /// The times at which it was stale.
    pub(crate) stale: Vec<i64>,
}

fn broken(promise: &'static str, what: String) -> Result<(), Broken> {
    Err(Broken { promise, what })
}

/// What the line adds to the age of what arrives on it, in ns: cycles of both ends, and threads that run late.
pub(crate) fn slack(plan: &Plan) -> i64 {
    let cycles = plan.cycle.0 * 4;
    let late = plan.habits.late * 6
        + if plan.habits.preempts > 0 {
            3_000_000
        } else {
            0
        };
    cycles + late + plan.round_trip() + 1_000_000
}

/// How long what was taken to be sent may be on its way, beyond what the network takes.
pub(crate) fn held(plan: &Plan) -> i64 {
    let spans = plan.events.iter().map(|event| match event.what {
        Misfortune::Hold(span) => span.0,
        // A thread that has taken what to send may lose the processor before it sends that.
        Misfortune::Suspend(_, span) if plan.habits.preempts > 0 || plan.bus.asks() => span.0,
        _ => 0,
    });
    spans.sum::<i64>() + plan.habits.starves * i64::from(STARVED)
}

impl Reader {
    /// A new driver looks: it knows nothing of what the one before it saw.
    pub(crate) fn begin(&mut self, stations: usize) {
        self.newest = vec![(0, 0); stations];
        self.sequence = 0;
    }

    /// Judges what a tick of the end that reads `area` shows of what `writer` wrote.
    pub(crate) fn judge(
        &mut self,
        plan: &Plan,
        area: u64,
        writer: &Writer,
        seen: &Seen<'_>,
    ) -> Result<(), Broken> {
        let now = seen.began;
        // Behind a dispatcher, a source that is lost leaves fail-safe values as well.
        let is_lost = plan.bus == Bus::Dispatcher
            && (seen.stations.iter()).all(|shown| shown.stamp == FAIL_SAFE);
        if seen.is_stale || is_lost {
            self.stale.push(now);
        }
        if !seen.is_stale && seen.age > plan.max_age.0 {
            broken("stale", format!("age {} ns, and not stale", seen.age))?;
        }
        if seen.is_fresh && seen.sequence <= self.sequence {
            broken("fresh", "without a new cycle".to_owned())?;
        }
        if !seen.is_stale {
            self.sequence = seen.sequence;
        }
        let mut first = None;
        for (station, shown) in seen.stations.iter().enumerate() {
            self.judge_station(plan, (area, station), writer, seen, *shown)?;
            let stamp = (shown.stamp != FAIL_SAFE).then(|| {
                let Stamp { life, tick, .. } = Stamp::of(shown.stamp);
                (life, tick)
            });
            // All of them travel in one message.
            match first {
                None => first = Some(stamp),
                Some(first) if first != stamp => broken(
                    "torn",
                    format!("station 0 has {first:?}, station {station} {stamp:?}"),
                )?,
                Some(_) => {}
            }
            if shown.edges > 0 {
                self.edges
                    .resize(self.edges.len().max(station + 1), Vec::new());
                self.edges[station].push((now, shown.edges));
            }
        }
        if !seen.is_stale {
            self.last_valid = Some((now, first.flatten()));
            self.first_valid.get_or_insert(now);
        }
        Self::judge_age(plan, seen)
    }

    fn judge_station(
        &mut self,
        plan: &Plan,
        (area, station): (u64, usize),
        writer: &Writer,
        seen: &Seen<'_>,
        shown: Shown,
    ) -> Result<(), Broken> {
        let now = seen.began;
        if shown.stamp == FAIL_SAFE {
            let is_right =
                !shown.level && shown.numbers.is_none_or(|numbers| numbers == (-7.0, 2.5));
            // Connections that are asked for come one by one.
            if !is_right && !plan.laboratory.is_asked {
                broken("fail-safe", format!("station {station} shows {shown:?}"))?;
            }
            if seen.is_stale && shown.edges > 0 {
                broken(
                    "stale edges",
                    format!("station {station} has {}", shown.edges),
                )?;
            }
            return Ok(());
        }
        if seen.is_stale {
            broken("stale values", format!("station {station} shows {shown:?}"))?;
        }
        let stamp = Stamp::of(shown.stamp);
        let Stamp { life, tick, .. } = stamp;
        if stamp.area != area || stamp.station != station as u64 || !writer.has_begun(life, tick) {
            broken(
                "invented",
                format!("station {station} shows {stamp:?}, which nobody wrote"),
            )?;
        }
        let is_right = shown.follows(plan);
        if !is_right {
            broken(
                "torn",
                format!("station {station} shows {shown:?} in the tick of {stamp:?}"),
            )?;
        }
        let newest = &mut self.newest[station];
        if (life, tick) < *newest {
            broken(
                "order",
                format!("station {station} shows {stamp:?} after {newest:?}"),
            )?;
        }
        *newest = (life, tick);
        // Old data as young: the peer had written something newer before it sent what made the age so small.
        let slack = slack(plan) + if plan.bus.asks() { held(plan) } else { 0 };
        let heard = now - seen.age;
        let sent = match plan.bus {
            Bus::Loopback => Some(heard),
            Bus::Dispatcher => seen.known.and_then(|known| known.until),
            _ => {
                let before = seen
                    .deliveries
                    .partition_point(|delivery| delivery.at <= heard - 1_000_000);
                before
                    .checked_sub(1)
                    .map(|index| seen.deliveries[index].sent)
            }
        };
        if let Some(sent) = sent
            && let Some(least) = writer.newest_at(sent - slack)
            && (life, tick) < least
        {
            broken(
                "old as young",
                format!(
                    "at {now} station {station} shows {stamp:?} with age {}; {least:?} was there when its peer sent",
                    seen.age
                ),
            )?;
        }
        Ok(())
    }

    /// The age that is told is at least the true one.
    fn judge_age(plan: &Plan, seen: &Seen<'_>) -> Result<(), Broken> {
        if seen.is_stale || plan.bus == Bus::Loopback {
            return Ok(());
        }
        // A tick that loses the processor behind its look at the clock may see what came meanwhile: that is younger.
        let Some(last) = seen.deliveries.last() else {
            return broken("age", format!("{} ns, though nothing has come", seen.age));
        };
        // As docs/ARCHITECTURE.md has it: half of max_age, or 2 ms.
        let allowed = (plan.max_age.0 / 2).max(2_000_000) + slack(plan);
        let truth = seen.began - last.at;
        if truth > seen.age + allowed {
            return broken(
                "age",
                format!(
                    "told {} ns, and the last bytes came {truth} ns ago",
                    seen.age
                ),
            );
        }
        Ok(())
    }

    /// While a writer does not tick, its watchdog trips: nothing of it may count any more.
    pub(crate) fn judge_watchdog(
        plan: &Plan,
        limit: i64,
        writer: &Writer,
        seen: &Seen<'_>,
    ) -> Result<(), Broken> {
        let now = seen.began;
        let Some(last) = writer.last_ended(now) else {
            return Ok(());
        };
        // A dispatcher that holds the values of a source that is gone does as it was told.
        let holds = plan.laboratory.holds && !plan.events.is_empty();
        if holds || writer.is_ticking() || now - last <= limit + plan.max_age.0 + slack(plan) + held(plan) {
            return Ok(());
        }
        for (station, shown) in seen.stations.iter().enumerate() {
            if shown.stamp != FAIL_SAFE {
                broken(
                    "left on",
                    format!(
                        "station {station} shows {:?}, {} ns after its writer's last tick",
                        Stamp::of(shown.stamp),
                        now - last
                    ),
                )?;
            }
        }
        Ok(())
    }

    /// A controller that has closed leaves its fail-safe values behind, unless it was to hold.
    pub(crate) fn judge_farewell(plan: &Plan, left: i64, seen: &Seen<'_>) -> Result<(), Broken> {
        let holds = plan.ends[1].holds_at_close || plan.habits.starves > 0;
        if holds || seen.is_stale || seen.began <= left + slack(plan) {
            return Ok(());
        }
        match seen.stations.iter().find(|shown| shown.stamp != FAIL_SAFE) {
            Some(shown) => broken(
                "left on",
                format!("{:?} after its controller closed", Stamp::of(shown.stamp)),
            ),
            None => Ok(()),
        }
    }

    /// Whether the newest of what `writer` wrote `slack` before `now` has arrived.
    pub(crate) fn judge_liveness(
        &self,
        plan: &Plan,
        writer: &Writer,
        now: i64,
    ) -> Result<(), Broken> {
        let slack = slack(plan) + plan.max_age.0;
        let least = writer.newest_at(now - slack);
        match self.last_valid {
            Some((at, seen)) if now - at <= slack && seen >= least => Ok(()),
            seen => broken(
                "liveness",
                format!(
                    "at {now} the last valid values were {seen:?}, and {least:?} should be there"
                ),
            ),
        }
    }
}
