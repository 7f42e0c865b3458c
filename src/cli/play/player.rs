//! The program that plays a recording.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use tickbus_base::statistics::Statistics;
use tickbus_base::time::Nanos;
use tickbus_base::toml_text::shown;
use tickbus_image::signal::{Area, Plan, SignalTable, Slot};
use tickbus_plc::{Program, Report, Scan};
use tickbus_record::{Columns, Recording, RecordingError, Tape};

/// The end of the recording.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum AtEnd {
    /// The program is done one scan later.
    End,
    /// The last values stay.
    Hold,
    /// The recording begins again one scan later.
    Again,
}

/// A program whose outputs are the recorded `%I` of one station.
pub(super) struct Player {
    file: PathBuf,
    table: Arc<SignalTable>,
    plan: Plan,
    slots: Vec<Slot>,
    /// Column and signal of each value that is played.
    played: Vec<(usize, usize)>,
    tape: Tape,
    at_end: AtEnd,
    is_first: bool,
    /// True for the first station, whose ticks count, and whose PLC all stations wait for.
    leads: bool,
    played_so_far: Arc<Played>,
}

/// The signals that only the recording, or only the driver.cfg has, for people.
#[derive(Debug, Default)]
pub(super) struct Unknown {
    file: PathBuf,
    not_recorded: Vec<String>,
    not_declared: Vec<String>,
}

impl Unknown {
    fn new(file: &Path, table: &SignalTable, columns: &Columns) -> Self {
        let inputs = table.signals.iter().filter(|it| it.area == Area::Input);
        let missing = inputs.filter(|it| columns.position(&it.name, false).is_none());
        // A CSV file does not say which end wrote a signal.
        let recorded = columns.columns.iter().filter(|column| {
            !column.is_edges && column.address.is_none_or(|it| it.area == Area::Input)
        });
        let others = recorded.filter(|column| table.position(&column.name).is_none());
        Self {
            file: file.to_owned(),
            not_recorded: missing.map(|signal| signal.name.clone()).collect(),
            not_declared: others.map(|column| column.name.clone()).collect(),
        }
    }

    /// One line for each list that is not empty.
    pub(super) fn lines(&self) -> Vec<String> {
        let names = |names: &[String]| {
            let names: Vec<String> = names
                .iter()
                .map(|name| format!("\"{}\"", shown(name)))
                .collect();
            names.join(", ")
        };
        let file = self.file.display();
        let lists = [
            (
                &self.not_recorded,
                format!("{file} does not have, and the fail-safe value is played"),
            ),
            (
                &self.not_declared,
                format!("{file} has, and the driver.cfg does not"),
            ),
        ];
        let lists = lists.into_iter().filter(|(list, _)| !list.is_empty());
        lists
            .map(|(list, what)| format!("{what}: {}", names(list)))
            .collect()
    }
}

impl Player {
    /// Opens the recording at `file` for the first station of `table`.
    ///
    /// # Errors
    ///
    /// The recording cannot be read, has no tick, or no `%I` of the table, or has one of another kind.
    pub(super) fn open(
        file: &Path,
        table: &Arc<SignalTable>,
        at_end: AtEnd,
        waits: bool,
    ) -> Result<(Self, Unknown), RecordingError> {
        let tape = start(file, table)?;
        let columns = tape.recording().columns();
        let unknown = Unknown::new(file, table, columns);
        let mut played = 0;
        for signal in table.signals.iter().filter(|it| it.area == Area::Input) {
            let column = columns
                .of_signal(signal)
                .map_err(|mistake| RecordingError::of_file(file, mistake.what, mistake.right))?;
            played += usize::from(column.is_some());
        }
        let wrong = |what: &str| {
            RecordingError::of_file(
                file,
                what,
                "play a recording of a driver with these signals",
            )
        };
        if played == 0 {
            return Err(wrong("this recording has no %I of this driver.cfg"));
        }
        if !tape.has_more() {
            return Err(wrong(&format!(
                "this recording has no tick: {}",
                tape.recording().ending()
            )));
        }
        let so_far = Arc::new(Played {
            waits: AtomicBool::new(waits),
            ..Played::default()
        });
        let player = Self::of_station(0, file, table, (tape, at_end, so_far));
        Ok((player, unknown))
    }

    fn of_station(
        station: usize,
        file: &Path,
        table: &Arc<SignalTable>,
        (tape, at_end, played_so_far): (Tape, AtEnd, Arc<Played>),
    ) -> Self {
        let columns = tape.recording().columns();
        let signals = table.signals.iter().enumerate();
        let inputs = signals.filter(|(_, it)| (it.station, it.area) == (station, Area::Input));
        let played = inputs
            .filter_map(|(index, it)| Some((columns.position(&it.name, false)?, index)))
            .collect();
        Self {
            file: file.to_owned(),
            plan: Plan::new(table, station, Area::Input),
            slots: table
                .signals
                .iter()
                .map(|signal| signal.fail_safe)
                .collect(),
            played,
            tape,
            at_end,
            is_first: true,
            leads: station == 0,
            played_so_far,
            table: Arc::clone(table),
        }
    }

    /// Takes the recorded ticks that are due; returns true if there are any.
    fn advance(&mut self, now: Nanos) -> bool {
        let mut taken = 0;
        while self.tape.take(now) {
            taken += 1;
        }
        if self.leads && taken > 0 {
            self.played_so_far.ticks.fetch_add(taken, Ordering::Relaxed);
            let hidden = taken - 1;
            self.played_so_far
                .hidden
                .fetch_add(hidden, Ordering::Relaxed);
        }
        taken > 0
    }

    /// Ends or restarts the recording, in the scan after that of its last values.
    fn end(&mut self) {
        let ending = match (self.tape.broken(), self.at_end) {
            (Some(broken), _) => Err(broken.to_string()),
            (None, AtEnd::Hold) => return,
            (None, AtEnd::End) => {
                let recording = self.tape.recording();
                Ok(recording.is_cut().then(|| recording.ending()))
            }
            (None, AtEnd::Again) => match start(&self.file, &self.table) {
                Ok(tape) => {
                    self.tape = tape;
                    let passes = u64::from(self.leads);
                    self.played_so_far
                        .passes
                        .fetch_add(passes, Ordering::Relaxed);
                    return;
                }
                Err(error) => Err(error.to_string()),
            },
        };
        self.played_so_far.set(ending);
    }
}

fn start(file: &Path, table: &SignalTable) -> Result<Tape, RecordingError> {
    Tape::start(Recording::open(file, Some(table))?)
}

impl Program for Player {
    fn name(&self) -> &'static str {
        "recording"
    }

    fn input_bytes(&self) -> usize {
        0
    }

    fn output_bytes(&self) -> usize {
        0
    }

    fn for_another_station(&self, station: usize) -> Option<Box<dyn Program>> {
        let tape = start(&self.file, &self.table).ok()?;
        let own = (tape, self.at_end, Arc::clone(&self.played_so_far));
        Some(Box::new(Self::of_station(
            station,
            &self.file,
            &self.table,
            own,
        )))
    }

    fn scan(&mut self, scan: &mut Scan<'_>) {
        if self.leads && scan.alive {
            self.played_so_far.waits.store(false, Ordering::Relaxed);
        }
        let mut is_new = std::mem::take(&mut self.is_first);
        if !self.played_so_far.waits.load(Ordering::Relaxed) {
            if self.tape.has_begun() && !self.tape.has_more() {
                self.end();
            }
            if self.advance(scan.now) {
                let values = &self.tape.present().values;
                for (column, signal) in &self.played {
                    self.slots[*signal] = values[*column];
                }
                is_new = true;
            }
        }
        if is_new {
            self.plan.encode(&self.slots, scan.outputs);
        }
    }

    /// A scan may wait for the disk.
    fn can_hang(&self) -> bool {
        false
    }

    fn report(&self) -> Option<Arc<dyn Report>> {
        Some(Arc::clone(&self.played_so_far) as _)
    }
}

/// The counts of all stations so far, and how the recording ended.
#[derive(Debug, Default)]
struct Played {
    /// True until the PLC is there, if the recording waits for it.
    waits: AtomicBool,
    ticks: AtomicU64,
    /// Ticks that no scan has shown, because the next one was due in the same scan.
    hidden: AtomicU64,
    /// How often the recording has begun again.
    passes: AtomicU64,
    is_done: AtomicBool,
    ending: Mutex<Option<Ending>>,
}

/// How the recording ended: at its last whole tick, with a note if something followed, or why it is damaged.
type Ending = Result<Option<String>, String>;

impl Played {
    /// Ends the run; the first ending counts.
    fn set(&self, ending: Ending) {
        let mut known = self.ending.lock().unwrap_or_else(PoisonError::into_inner);
        known.get_or_insert(ending);
        self.is_done.store(true, Ordering::Release);
    }

    fn ending(&self) -> Option<Ending> {
        let ending = self.ending.lock();
        ending.unwrap_or_else(PoisonError::into_inner).clone()
    }
}

impl Report for Played {
    fn write(&self, statistics: &mut Statistics) {
        statistics.count("play.ticks", self.ticks.load(Ordering::Relaxed));
        statistics.count("play.hidden_ticks", self.hidden.load(Ordering::Relaxed));
        statistics.count("play.passes", self.passes.load(Ordering::Relaxed));
    }

    fn summary(&self) -> String {
        let mut text = format!("played {} ticks", self.ticks.load(Ordering::Relaxed));
        // Writing to a string cannot fail.
        let _ = match self.hidden.load(Ordering::Relaxed) {
            0 => Ok(()),
            hidden => write!(
                text,
                "; {hidden} not sent, because a later one was due in the same --tick"
            ),
        };
        if let Some(Ok(Some(note))) = self.ending() {
            let _ = write!(text, "; {note}");
        }
        text + "\n"
    }

    fn is_done(&self) -> bool {
        self.is_done.load(Ordering::Acquire)
    }

    fn failure(&self) -> Option<String> {
        self.ending()?.err()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tickbus_image::signal::{DataType, Signal};

    fn table() -> Arc<SignalTable> {
        let mut table = SignalTable::of_one_station(
            2,
            1,
            vec![
                Signal::new("first", Area::Input, 0, DataType::Byte),
                Signal {
                    fail_safe: Slot::from_real(9.0),
                    ..Signal::new("absent", Area::Input, 1, DataType::Byte)
                },
                Signal::new("answer", Area::Output, 0, DataType::Byte),
                Signal {
                    station: 1,
                    ..Signal::new("second", Area::Input, 0, DataType::Byte)
                },
            ],
        );
        table.stations.push(table.stations[0].clone());
        Arc::new(table)
    }

    const HEAD: &str = "bus.tick,bus.time_ns,bus.status,bus.dropped,first,second,answer\n";

    fn player(folder: &Path, rows: &str, at_end: AtEnd, waits: bool) -> Player {
        let file = folder.join("run.csv");
        std::fs::write(&file, format!("{HEAD}{rows}")).expect("written");
        let (player, _) = Player::open(&file, &table(), at_end, waits).expect("a recording");
        player
    }

    fn scanned(program: &mut dyn Program, now: i64, alive: bool, outputs: &mut [u8]) -> [u8; 2] {
        program.scan(&mut Scan {
            now: Nanos(now),
            alive,
            cycle: 0,
            inputs: &[],
            outputs,
        });
        [outputs[0], outputs[1]]
    }

    const ROWS: &str = "1,100,0,0,1,11,0\n2,110,0,0,2,12,0\n3,130,0,0,3,13,0\n";

    #[test]
    fn each_tick_is_played_when_its_time_has_come_and_the_end_one_scan_later() {
        let folder = tempfile::tempdir().expect("a folder");
        let mut player = player(folder.path(), ROWS, AtEnd::End, false);
        let (report, mut outputs) = (player.report().expect("it has one"), [0; 2]);
        for (now, first, is_done) in [
            (5000, 1, false),
            (5009, 1, false),
            (5010, 2, false),
            (5029, 2, false),
            (5031, 3, false),
            (5032, 3, true),
        ] {
            assert_eq!(scanned(&mut player, now, true, &mut outputs), [first, 9]);
            assert_eq!(report.is_done(), is_done, "{now}");
        }
        assert_eq!(report.summary(), "played 3 ticks\n");
        assert_eq!(report.failure(), None);
    }

    #[test]
    fn a_loop_begins_again_in_the_scan_after_the_last_tick_and_waits_once() {
        let folder = tempfile::tempdir().expect("a folder");
        let mut player = player(folder.path(), ROWS, AtEnd::Again, true);
        let mut outputs = [0; 2];
        assert_eq!(scanned(&mut player, 0, false, &mut outputs), [0, 9]);
        for (now, alive, first) in [
            (10, true, 1),
            (20, false, 2),
            (40, false, 3),
            (41, false, 1),
            (51, false, 2),
            (71, false, 3),
            (72, false, 1),
        ] {
            assert_eq!(scanned(&mut player, now, alive, &mut outputs), [first, 9]);
        }
    }

    #[test]
    fn a_further_station_plays_its_own_signals_at_the_same_time_as_the_first() {
        let folder = tempfile::tempdir().expect("a folder");
        let mut player = player(folder.path(), ROWS, AtEnd::Hold, true);
        let mut other = player.for_another_station(1).expect("it serves several");
        let (mut outputs, mut of_other) = ([0; 2], [0; 2]);
        for (now, alive, first, second) in [
            (0, [false, true], 0, 0),
            (10, [true, false], 1, 11),
            (20, [false, true], 2, 12),
            (40, [false, false], 3, 13),
            (90, [true, true], 3, 13),
        ] {
            let seen = scanned(&mut player, now, alive[0], &mut outputs);
            assert_eq!(seen, [first, 9]);
            let seen = scanned(&mut *other, now, alive[1], &mut of_other);
            assert_eq!(seen, [second, 0]);
        }
        let report = player.report().expect("it has one");
        assert_eq!(report.summary(), "played 3 ticks\n");
    }

    #[test]
    fn ticks_that_fall_into_one_scan_are_told() {
        let folder = tempfile::tempdir().expect("a folder");
        let mut player = player(folder.path(), ROWS, AtEnd::Hold, false);
        let report = player.report().expect("it has one");
        let mut outputs = [0; 2];
        for (now, first) in [(0, 1), (30, 3)] {
            assert_eq!(scanned(&mut player, now, true, &mut outputs), [first, 9]);
        }
        let told = "played 3 ticks; 1 not sent, because a later one was due in the same --tick\n";
        assert_eq!(report.summary(), told);
    }

    #[test]
    fn a_damaged_recording_is_played_up_to_the_damage() {
        let folder = tempfile::tempdir().expect("a folder");
        let rows = "1,100,0,0,1,11,0\n2,110,0,0,2,12,0\nnothing\n";
        let mut player = player(folder.path(), rows, AtEnd::Again, false);
        let (report, mut outputs) = (player.report().expect("it has one"), [0; 2]);
        for (now, first) in [(0, 1), (10, 2), (20, 2)] {
            assert_eq!(scanned(&mut player, now, true, &mut outputs), [first, 9]);
        }
        let failure = report.failure().expect("it is damaged");
        assert!(failure.contains("run.csv:4: "), "{failure}");
    }
}
