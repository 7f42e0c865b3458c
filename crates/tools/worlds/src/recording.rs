//! Judges recordings. A recording has the data that were delivered, tick by tick and in order: all of them or the first
//! part.

use std::fs::{self, File};
use std::path::Path;

use tickbus_base::os::{Lock, lock_file};

use crate::broken::{Broken, broken};
use crate::files::{Contents, FileRow, csv, vcd};
use crate::plan::{Misfortune, Plan};
use crate::random::{Random, scramble};
use crate::replay::{self, Original};
use crate::scheduler::{self, STARVED};
use crate::tape::Tape;

/// The number of ticks in a ring without the key `ring`.
const RING: usize = 4_096;

/// A line of a file is shorter than this, including the closing of the recording after it.
const LONGEST: u64 = 4_000;

/// The bytes that a signal adds to the head of a file; a file without ticks may have no head either.
const DECLARED: u64 = 120;

impl Tape {
    /// Judges that nobody else gets the file while a driver records.
    pub(crate) fn judge_lock(&self, plan: &Plan, end: usize) -> Result<(), Broken> {
        if !self.plan.is_contended {
            return Ok(());
        }
        let other = File::open(&self.path).expect("it is there");
        if lock_file(&other, Lock::Shared).ok() != Some(false) {
            return broken(
                "file",
                "another process gets the file of a recording".to_owned(),
            );
        }
        match replay::open(plan, end, &self.path, None) {
            Ok(_) => broken("file", "a file that is recorded to is replayed".to_owned()),
            Err(why) if why.to_string().contains(&self.path.display().to_string()) => Ok(()),
            Err(why) => broken("file", format!("a refusal without a file: {why}")),
        }
    }

    /// Judges the recording after the driver has closed, or after its process was killed.
    pub(crate) fn judge(&self, plan: &Plan, end: usize) -> Result<(), Broken> {
        let process = scheduler::process();
        let killed = scheduler::disk(|disk, _| disk.revive(process));
        judge_recording(plan, end, self, killed)
    }
}

/// Judges the recording of a life that has ended; `killed` is the time at which it was killed.
fn judge_recording(
    plan: &Plan,
    end: usize,
    tape: &Tape,
    killed: Option<i64>,
) -> Result<(), Broken> {
    let bytes = fs::read(&tape.path).unwrap_or_default();
    let text = String::from_utf8_lossy(&bytes);
    let what = |why: String| format!("end {end}, {} ticks: {why}", tape.rows.len());
    if bytes == tape.before && (tape.rows.is_empty() || killed.is_some()) {
        return Ok(());
    }
    if tape.rows.is_empty() && !tape.before.is_empty() {
        return broken(
            "recording",
            what("a driver that never ticked changed the file".to_owned()),
        );
    }
    let read = if tape.plan.is_csv { csv } else { vcd };
    let contents = read(&text).map_err(|why| Broken {
        promise: "recording",
        what: what(format!("the file cannot be read: {why}")),
    })?;
    let is_right = judge_rows(plan, end, tape, &contents)
        .and_then(|()| judge_extent(plan, tape, &contents, bytes.len() as u64, killed));
    if let Err(why) = is_right {
        return broken("recording", what(why));
    }
    judge_replay(plan, end, (tape, &tape.path), &contents, killed.is_none())?;
    if killed.is_some() && tape.plan.is_torn {
        return judge_torn(plan, end, tape, &text);
    }
    Ok(())
}

/// Judges that each row is the tick of its number, that rows are in order, and that missing ticks are counted.
fn judge_rows(plan: &Plan, end: usize, tape: &Tape, contents: &Contents) -> Result<(), String> {
    let places = tape.names.iter().map(|name| {
        let place = contents.names.iter().position(|known| known == name);
        place.ok_or_else(|| format!("there is no {name}"))
    });
    let places: Vec<usize> = if contents.names.is_empty() && contents.rows.is_empty() {
        return Ok(());
    } else {
        places.collect::<Result<_, _>>()?
    };
    let mut before: Option<&FileRow> = None;
    // The ring is rounded up, and holds the ticks between two looks at it.
    let may_drop = tape.plan.ring.is_some() || tape.rows.len() > RING;
    for (index, row) in contents.rows.iter().enumerate() {
        let number = row.number;
        let wrong = |why: String| Err(format!("tick {number}, which is row {index}: {why}"));
        let Some(delivered) = usize::try_from(number)
            .ok()
            .and_then(|number| tape.rows.get(number.checked_sub(1)?))
        else {
            return wrong("it was never made".to_owned());
        };
        if before.is_some_and(|before| before.number >= number) {
            return wrong("it is in the file twice".to_owned());
        }
        if row.dropped != number - 1 - index as u64 || row.dropped > 0 && !may_drop {
            return wrong(format!("{} are said to be dropped", row.dropped));
        }
        if row.status != delivered.code {
            return wrong(format!(
                "status {}, and it was {}",
                row.status, delivered.code
            ));
        }
        if plan.stations > 1
            && (row.stations.len() != plan.stations
                || row.stations.iter().max() != Some(&row.status))
        {
            return wrong(format!("stations {:?} of {}", row.stations, row.status));
        }
        for (name, (place, value)) in tape.names.iter().zip(places.iter().zip(&delivered.on_line)) {
            if row.values[*place] != *value {
                return wrong(format!(
                    "{name} is {:x}, and was {value:x}",
                    row.values[*place]
                ));
            }
        }
        let least = before.map_or(0, |before| before.time);
        let is_timely = if let Some(time) = delivered.time {
            row.time == time.max(least)
        } else {
            let first = &tape.rows[0];
            let earliest = delivered.began - first.ended;
            let latest = delivered.ended - first.began;
            (earliest..=latest).contains(&row.time) && row.time >= least
        };
        if !is_timely {
            return wrong(format!("time {} after {least}: {delivered:?}", row.time));
        }
        before = Some(row);
    }
    debug_assert!(end < 2);
    Ok(())
}

/// Judges that the file has as many ticks as it must.
fn judge_extent(
    plan: &Plan,
    tape: &Tape,
    contents: &Contents,
    length: u64,
    killed: Option<i64>,
) -> Result<(), String> {
    let last = contents.rows.last().map_or(0, |row| row.number);
    let is_all = last == tape.rows.len() as u64 || tape.plan.ring.is_some();
    if let Some(limit) = tape.plan.disk {
        let head = if last == 0 { DECLARED } else { 0 };
        let longest = LONGEST + head * tape.names.len() as u64;
        if length > limit && tape.before.len() as u64 <= limit {
            return Err(format!("{length} bytes on a disk with {limit}"));
        }
        if length + longest < limit && !is_all && killed.is_none() {
            return Err(format!(
                "it ends with tick {last}, and the disk has {limit} bytes"
            ));
        }
        if length + longest >= limit {
            return Ok(());
        }
    }
    let Some(killed) = killed else {
        if !tape.plan.is_csv && contents.end.is_none() {
            return Err("it was closed, and does not say so".to_owned());
        }
        if !is_all {
            return Err(format!("it ends with tick {last}"));
        }
        return Ok(());
    };
    // A tenth of a second may be missing, plus the time for which the writing thread had no processor.
    let suspended = plan.events.iter().map(|event| match event.what {
        Misfortune::Suspend(_, span) => span.0,
        _ => 0,
    });
    let late = plan.habits.late * 25 + plan.habits.starves * i64::from(STARVED);
    let missing = 110_000_000 + late + suspended.sum::<i64>();
    let old = tape
        .rows
        .partition_point(|row| row.ended < killed - missing);
    if last < old as u64 && tape.plan.ring.is_none() {
        return Err(format!(
            "it ends with tick {last}, and {old} were made long before the kill"
        ));
    }
    Ok(())
}

/// Replays the recording from `file`, and judges the replay.
fn judge_replay(
    plan: &Plan,
    end: usize,
    (tape, file): (&Tape, &Path),
    contents: &Contents,
    is_closed: bool,
) -> Result<(), Broken> {
    if !plan.features.replays || contents.rows.is_empty() {
        return Ok(());
    }
    let original = Original::new(plan, end, tape, contents);
    let has_gaps = contents.rows.last().is_some_and(|row| row.dropped > 0);
    original.judge_same(file, is_closed && !has_gaps)?;
    original.judge_other(file)
}

/// Judges a file after a power failure: it may end anywhere, and is read up to its last whole tick.
fn judge_torn(plan: &Plan, end: usize, tape: &Tape, text: &str) -> Result<(), Broken> {
    let random = &mut Random::new(scramble(plan.seed.number ^ 0x746F));
    let cut = random.below(text.len() as u64 + 1);
    let text = &text[..usize::try_from(cut).expect("short")];
    let kind = if tape.plan.is_csv { "csv" } else { "vcd" };
    let torn = tape.path.with_file_name(format!("torn {end}.{kind}"));
    fs::write(&torn, text).expect("a file");
    let read = if tape.plan.is_csv { csv } else { vcd };
    let contents = read(text).map_err(|why| Broken {
        promise: "recording",
        what: format!("end {end}: {cut} bytes cannot be read: {why}"),
    })?;
    judge_replay(plan, end, (tape, &torn), &contents, false)
}
