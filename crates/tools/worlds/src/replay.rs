//! Replays a recording, and judges its ticks. Ticks at the recorded times show the same again; ticks at other times
//! show what docs/recording.md describes.

use std::fs;
use std::ops::Range;
use std::path::Path;

use tickbus_base::time::Nanos;
use tickbus_driver::{Driver, DriverError};
use tickbus_image::signal::Slot;

use crate::broken::{Broken, broken};
use crate::clock::SimulatedClock;
use crate::files::{Contents, FileRow, area_of, is_count};
use crate::known;
use crate::plan::Plan;
use crate::random::{Random, scramble};
use crate::tape::Tape;

/// The statuses of ticks.
const FRESH: i32 = 0;
const UNCHANGED: i32 = 1;
const STALE: i32 = 2;

/// A recording that is to be replayed.
pub(crate) struct Original<'a> {
    plan: &'a Plan,
    end: usize,
    tape: &'a Tape,
    contents: &'a Contents,
    /// The slots that the end reads.
    reads: Vec<Column>,
}

/// A slot, and its place in a recording.
struct Column {
    slot: usize,
    place: usize,
    is_count: bool,
    /// True if rising edges of several ticks are shown in one.
    is_latched: bool,
}

/// Opens a driver that replays `file`, and records the replay to `again`, if given.
pub(crate) fn open(
    plan: &Plan,
    end: usize,
    file: &Path,
    again: Option<&Path>,
) -> Result<Driver, DriverError> {
    let shown = file.display();
    let again = again.map_or(String::new(), |again| {
        format!("[record]\nfile = \"{}\"\n", again.display())
    });
    let role = ["device", "controller"][end];
    let text = format!(
        "[driver]\nid = 9\nname = \"{role}\"\n[fieldbus]\nrole = \"{role}\"\nkind = \"loopback\"\nreplay = \"{shown}\"\n\
         max_age = \"{}\"\n{again}{}",
        plan.max_age,
        plan.signal_sections(end, false)
    );
    Driver::open(known::parse("driver.cfg", text), SimulatedClock::shared())
}

impl<'a> Original<'a> {
    pub(crate) fn new(plan: &'a Plan, end: usize, tape: &'a Tape, contents: &'a Contents) -> Self {
        let own = writes(end);
        let read = tape.names.iter().enumerate();
        let read = read.filter(|(_, name)| area_of(name) != own);
        let reads = read.map(|(slot, name)| {
            let place = contents.names.iter().position(|known| known == name);
            let is_count = is_count(name);
            Column {
                slot,
                place: place.expect("the recording was judged"),
                is_count,
                is_latched: name.starts_with("pulse") && !is_count,
            }
        });
        Self {
            reads: reads.collect(),
            plan,
            end,
            tape,
            contents,
        }
    }
}

/// The area that an end writes.
fn writes(end: usize) -> char {
    ['I', 'Q'][end]
}

impl Original<'_> {
    fn rows(&self) -> &[FileRow] {
        &self.contents.rows
    }

    /// The rows of each time.
    fn groups(&self) -> Vec<Range<usize>> {
        let rows = self.rows();
        let mut groups: Vec<Range<usize>> = Vec::new();
        for index in 0..rows.len() {
            match groups.last_mut() {
                Some(group) if rows[group.start].time == rows[index].time => group.end += 1,
                _ => groups.push(index..index + 1),
            }
        }
        groups
    }

    /// The status of several rows that fall into one tick.
    fn status(&self, group: &Range<usize>) -> i32 {
        let rows = &self.rows()[group.clone()];
        let last = rows.last().expect("it has rows");
        let of = |statuses: &dyn Fn(&FileRow) -> i32| match statuses(last) {
            STALE => STALE,
            _ if rows.iter().any(|row| statuses(row) == FRESH) => FRESH,
            _ => UNCHANGED,
        };
        if last.stations.is_empty() {
            return of(&|row| row.status);
        }
        let stations = 0..last.stations.len();
        let all = stations.map(|station| of(&|row: &FileRow| row.stations[station]));
        all.max().unwrap_or(FRESH)
    }

    /// Judges the slots of a tick. `group` are the rows that are due in it, if any, and `last` is the newest row that
    /// is due.
    fn judge_slots(
        &self,
        slots: &[Slot],
        (group, last): (&Range<usize>, usize),
        shaped: &mut usize,
    ) -> Result<(), String> {
        let rows = self.rows();
        // A latched level differs where the edges of several ticks are shown at once, and in the tick after that. Edges
        // that are due in a stale tick are shown when data count again.
        if group.len() > 1 {
            *shaped = 2;
        }
        let is_shaped = *shaped > 0;
        if rows[last].status != STALE {
            *shaped = shaped.saturating_sub(1);
        }
        for column in &self.reads {
            let seen = slots[column.slot].0;
            let expected = if column.is_count {
                let counts = rows[group.clone()].iter();
                let counts = counts.map(|row| f64::from_bits(row.values[column.place]));
                let count = counts.fold(0.0, |all, count| all + count);
                count.to_bits()
            } else {
                rows[last].values[column.place]
            };
            if seen != expected && !(column.is_latched && is_shaped) {
                let name = &self.tape.names[column.slot];
                return Err(format!("{name} is {seen:x}, and was {expected:x}"));
            }
        }
        Ok(())
    }

    /// Copies the values that this end wrote in a row, but none that it read.
    fn written(&self, row: usize, slots: &mut [Slot]) {
        let tick = usize::try_from(self.rows()[row].number).expect("small") - 1;
        let values = &self.tape.rows[tick].values;
        let own = writes(self.end);
        for ((slot, name), value) in slots.iter_mut().zip(&self.tape.names).zip(values) {
            if area_of(name) == own {
                *slot = Slot(*value);
            }
        }
    }

    /// Judges that ticks at the recorded times show the same again.
    pub(crate) fn judge_same(&self, file: &Path, is_whole: bool) -> Result<(), Broken> {
        // The recording of the other end may be judged at the same time.
        let name = file.file_name().unwrap_or_default().to_string_lossy();
        let again = file.with_file_name(format!("again {name}"));
        let mut driver = match open(self.plan, self.end, file, Some(&again)) {
            Ok(driver) => driver,
            Err(why) => return broken("replay", format!("a recording that does not open: {why}")),
        };
        let mut slots = driver.initial_slots();
        let groups = self.groups();
        let mut shaped = 0;
        for group in &groups {
            let row = &self.rows()[group.end - 1];
            let time = Nanos(row.time);
            let found = if self.plan.ends[self.end].halves {
                let found = driver.receive(time, &mut slots);
                self.written(group.end - 1, &mut slots);
                driver.send(&mut slots);
                found
            } else {
                self.written(group.end - 1, &mut slots);
                driver.exchange(time, &mut slots)
            };
            let expected = self.status(group);
            let number = row.number;
            if found.code.code() != expected {
                return broken(
                    "replay",
                    format!("tick {number} is {}, and was {expected}", found.code),
                );
            }
            if (found.age > self.plan.max_age) != (expected == STALE) {
                return broken(
                    "replay",
                    format!("tick {number}, {expected}, has age {}", found.age),
                );
            }
            if let Err(why) = self.judge_slots(&slots, (group, group.end - 1), &mut shaped) {
                return broken("replay", format!("tick {number}: {why}"));
            }
        }
        let figures = driver.statistics();
        let figure = |key: &str| {
            let lines = figures.lines().filter_map(|line| line.split_once('='));
            let mut values = lines.filter(|(known, _)| *known == key);
            values
                .next()
                .and_then(|(_, value)| value.parse::<usize>().ok())
        };
        for (key, right) in [
            ("replay.differences", 0),
            ("replay.ticks", self.rows().len()),
            ("replay.compared", groups.len()),
            ("replay.ended", 1),
        ] {
            if figure(key) != Some(right) {
                return broken(
                    "replay",
                    format!("{key} is {:?}, and should be {right}", figure(key)),
                );
            }
        }
        self.judge_end(&mut driver, &mut slots)?;
        driver.close();
        if is_whole && groups.len() == self.rows().len() {
            judge_again(file, &again)?;
        }
        Ok(())
    }

    /// Judges that data become stale after the end of the recording.
    fn judge_end(&self, driver: &mut Driver, slots: &mut [Slot]) -> Result<(), Broken> {
        let Some(last) = self.rows().last() else {
            return Ok(());
        };
        let time = Nanos(last.time) + self.plan.max_age + Nanos(1);
        let found = driver.exchange(time, slots);
        if found.code.code() != STALE || found.age <= self.plan.max_age {
            return broken(
                "replay",
                format!("behind its end it is {} of age {}", found.code, found.age),
            );
        }
        Ok(())
    }

    /// Judges ticks at other times: they show the last row that is due, and the edges of all rows that have become due.
    pub(crate) fn judge_other(&self, file: &Path) -> Result<(), Broken> {
        let mut driver = match open(self.plan, self.end, file, None) {
            Ok(driver) => driver,
            Err(why) => return broken("replay", format!("a recording that does not open: {why}")),
        };
        let random = &mut Random::new(scramble(self.plan.seed.number ^ 0x7265));
        let mut slots = driver.initial_slots();
        let rows = self.rows();
        let span = rows[rows.len() - 1].time - rows[0].time;
        let step = (span / i64::try_from(rows.len()).expect("small")).max(1);
        let (mut time, mut next, mut shaped) = (rows[0].time, 0, 0);
        while next < rows.len() {
            let due = rows[next..].iter().take_while(|row| row.time <= time);
            let group = next..next + due.count();
            next = group.end;
            let found = driver.exchange(Nanos(time), &mut slots);
            let last = next - 1;
            let expected = match group.is_empty() {
                false => self.status(&group),
                true if rows[last].status == STALE => STALE,
                true => UNCHANGED,
            };
            let number = rows[last].number;
            if found.code.code() != expected {
                return broken(
                    "replay",
                    format!(
                        "at {time}, after tick {number}, it is {}, and not {expected}",
                        found.code
                    ),
                );
            }
            if let Err(why) = self.judge_slots(&slots, (&group, last), &mut shaped) {
                return broken("replay", format!("at {time}, after tick {number}: {why}"));
            }
            time += random.within(1, step * 3);
        }
        driver.close();
        Ok(())
    }
}

/// Judges that the recording of a replay equals the recording, except for the tick after its end.
fn judge_again(file: &Path, again: &Path) -> Result<(), Broken> {
    let (one, other) = (fs::read(file), fs::read(again));
    let (one, other) = (one.unwrap_or_default(), other.unwrap_or_default());
    // A closed VCD file ends with a comment.
    let text = String::from_utf8_lossy(&one);
    let end = text.find("$comment end").unwrap_or(text.len());
    if !other.starts_with(&one[..end]) {
        return broken("replay", "the recording of a replay is another".to_owned());
    }
    Ok(())
}
