//! The recorder: takes ticks from the ticking thread, and writes them on its own thread.

use std::fs::File;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, OnceLock, PoisonError};

use super::columns::{Columns, Tick};
use super::csv::CsvSink;
use super::file::{Out, SimulatedFile, Target};
use super::history::History;
use super::places::FileClaim;
use super::rows::Rows;
use super::sink::Sink;
use super::vcd::VcdSink;
use super::{Format, Options, options};
use tickbus_base::statistics::Statistics;
use tickbus_base::thread::Thread;
use tickbus_base::time::{Clock, Nanos, Stop};
use tickbus_image::signal::Slot;
use tickbus_image::{RowReader, RowWriter, row_ring};

/// How often the thread polls the ring. The tick makes no system calls, so it cannot wake the thread.
const LOOK: Nanos = Nanos::from_millis(5);

/// Every this many polls, everything is written to the file: a killed process loses at most a tenth of a
/// second.
const LOOKS_PER_FLUSH: u32 = 20;

/// The size of a write, in bytes.
const CHUNK: usize = 64 << 10;

/// How long closing waits for a file that accepts no data.
const CLOSE_TIMEOUT: Nanos = Nanos::from_secs(5);

/// Words of a tick in the ring before the statuses of the stations: number, time, status.
const HEAD: usize = 3;

impl Format {
    /// A sink for files of this format.
    pub(super) fn sink(self, columns: Columns) -> Box<dyn Sink> {
        match self {
            Self::Vcd => Box::new(VcdSink::new(columns)),
            Self::Csv => Box::new(CsvSink(columns)),
        }
    }
}

/// Counters of a recorder; readable from any thread.
#[derive(Debug, Default)]
pub struct RecorderCounters {
    /// `None` for a recording in memory alone.
    file: Option<PathBuf>,
    /// Ticks that were written.
    ticks: AtomicU64,
    /// Ticks dropped because the ring was full.
    dropped: AtomicU64,
    /// Ticks whose time was before that of the previous tick.
    backwards: AtomicU64,
    /// Recording has ended.
    ended: AtomicBool,
    /// The error that ended it, if any.
    error: Mutex<Option<String>>,
}

impl RecorderCounters {
    /// Why the recording ended before it was closed, if so.
    pub fn error(&self) -> Option<String> {
        self.lock_error().clone()
    }

    /// Adds the counters.
    pub fn write(&self, statistics: &mut Statistics) {
        let Some(file) = &self.file else {
            return;
        };
        let count = |count: &AtomicU64| count.load(Ordering::Relaxed);
        statistics.text("record.file", &file.display().to_string());
        statistics.count("record.ticks", count(&self.ticks));
        statistics.count("record.dropped", count(&self.dropped));
        let backwards = count(&self.backwards);
        if backwards > 0 {
            statistics.count("record.backwards", backwards);
        }
        if let Some(error) = self.error() {
            statistics.text("record.error", &error);
        }
    }

    /// The file, or what takes its place, for the log.
    fn name(&self) -> String {
        let file = self.file.as_ref();
        file.map_or_else(
            || "the recording in memory".to_owned(),
            |file| file.display().to_string(),
        )
    }

    fn lock_error(&self) -> MutexGuard<'_, Option<String>> {
        // A string is consistent after every change, so a poisoned lock is safe to use.
        self.error.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Wakes the side of the ring that waits.
#[derive(Debug, Default)]
struct Bell {
    state: Mutex<BellState>,
    /// There is something for the recording thread to do.
    work: Condvar,
    /// There is room in the ring, or there never will be.
    room: Condvar,
    /// Wakes the recording thread of a simulation.
    token: Stop,
}

#[derive(Debug, Default)]
struct BellState {
    stop: bool,
    rung: bool,
}

impl Bell {
    fn lock(&self) -> MutexGuard<'_, BellState> {
        // Two booleans are valid in any combination, even after a panic.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn ring(&self) {
        self.lock().rung = true;
        self.work.notify_one();
        self.token.wake();
    }

    /// Ends the recording.
    fn stop(&self) {
        self.lock().stop = true;
        self.work.notify_one();
        self.token.stop();
    }

    /// Lets the recording thread wait for work, or for [`LOOK`]. Outside a simulation that is real time, even if the
    /// driver's clock stands still.
    fn wait(&self, clock: &dyn Clock) {
        if clock.simulation().is_some() {
            clock.wait_until(clock.now() + LOOK, &self.token);
            self.lock().rung = false;
            return;
        }
        let mut state = self.lock();
        if !state.stop && !state.rung {
            let waited = self.work.wait_timeout(state, LOOK.to_duration());
            state = waited.unwrap_or_else(PoisonError::into_inner).0;
        }
        state.rung = false;
    }
}

/// Records the ticks of one driver; dropping it ends the recording.
///
/// The tick's call, [`record`](Self::record), allocates nothing, and on a free bus it takes no lock and makes no system
/// call.
#[derive(Debug)]
pub struct Recorder {
    ring: RowWriter,
    /// Allocated once, refilled at every tick.
    head: Vec<u64>,
    slots: usize,
    lossless: bool,
    scans: Arc<RecorderCounters>,
    history: Arc<OnceLock<Arc<History>>>,
    bell: Arc<Bell>,
    pub(super) close_timeout: Nanos,
    clock: Arc<dyn Clock>,
    /// `None` once it has ended.
    thread: Option<Thread>,
}

/// Why a recording cannot start.
#[derive(Debug, thiserror::Error)]
pub enum RecorderError {
    /// A problem with the file; another file, or a later attempt, may work.
    #[error("{0}")]
    File(String),
    /// The system refused a thread.
    #[error(
        "the system refused a thread for the recording: {0}; close other programs or raise the limit"
    )]
    Thread(std::io::Error),
}

/// True if `path` is a named pipe: opening one would block until someone reads from it.
#[cfg(unix)]
fn is_pipe(path: &Path) -> bool {
    use std::os::unix::fs::FileTypeExt as _;

    std::fs::metadata(path).is_ok_and(|metadata| metadata.file_type().is_fifo())
}

/// No file blocks on opening here.
#[cfg(not(unix))]
fn is_pipe(_path: &Path) -> bool {
    false
}

/// Opens the file at `path`, once it is certain that nothing else uses it.
fn open(path: &Path) -> Result<(File, Option<FileClaim>), RecorderError> {
    let shown = path.display();
    if is_pipe(path) {
        return Err(RecorderError::File(format!(
            "{shown}: this is a pipe, and a recording is a file; name a file in [record]"
        )));
    }
    let opened = FileClaim::to_write(path).map_err(|error| {
        RecorderError::File(format!(
            "{shown}: the recording cannot be made: {error}; check the folder and its permissions"
        ))
    })?;
    opened.map_err(|why| {
        RecorderError::File(format!("{shown}: {why}; name another file in [record]"))
    })
}

impl Recorder {
    /// Claims the file at `path` without changing it, as [`start`](Self::start) does: finds out early if it could.
    ///
    /// # Errors
    ///
    /// The file cannot be created, or is in use; the text says what to do.
    pub fn claim(path: &Path) -> Result<Option<FileClaim>, RecorderError> {
        open(path).map(|(_, claim)| claim)
    }

    /// Opens the file that `options` name, relative to `folder`, and starts the thread that writes to it. The first
    /// tick overwrites the file.
    ///
    /// If the ring is full, a `lossless` recorder makes the tick wait until there is room; any other drops
    /// the tick and counts it.
    ///
    /// # Errors
    ///
    /// The file cannot be created or is in use, or the system refused a thread; the text says what to do.
    pub fn start(
        options: &Options,
        folder: &Path,
        rows: Rows,
        lossless: bool,
        clock: &Arc<dyn Clock>,
    ) -> Result<Self, RecorderError> {
        let path = folder.join(&options.file);
        let (file, place) = open(&path)?;
        let columns = &rows.columns;
        let words = HEAD + columns.stations.len() + columns.columns.len();
        let ticks = options.ticks(words);
        let target: Box<dyn Target> = match clock.simulation() {
            None => Box::new(file),
            Some(_) => Box::new(SimulatedFile {
                file,
                path: path.clone(),
                clock: Arc::clone(clock),
            }),
        };
        let format = options.format;
        Self::over(target, format, rows, ticks, lossless, (path, place), clock)
            .map_err(RecorderError::Thread)
    }

    /// Starts a recording that only feeds `history`, without a file.
    ///
    /// # Errors
    ///
    /// The system refused a thread.
    pub fn in_memory(
        history: Arc<History>,
        rows: Rows,
        lossless: bool,
        clock: &Arc<dyn Clock>,
    ) -> Result<Self, RecorderError> {
        let columns = &rows.columns;
        let words = HEAD + columns.stations.len() + columns.columns.len();
        let recorder = Self::spawn(None, rows, options::usual_ticks(words), lossless, clock);
        let recorder = recorder.map_err(RecorderError::Thread)?;
        recorder.remember(history);
        Ok(recorder)
    }

    /// Feeds `history` as well, from the next look at the ring on. A recorder feeds one history at most: a second one
    /// gets nothing.
    pub fn remember(&self, history: Arc<History>) {
        // The first one stays.
        let _ = self.history.set(history);
    }

    /// The history that it feeds.
    pub fn history(&self) -> Option<&Arc<History>> {
        self.history.get()
    }

    /// Like [`start`](Self::start), for any target.
    pub(super) fn over(
        target: Box<dyn Target>,
        format: Format,
        rows: Rows,
        ticks: usize,
        lossless: bool,
        (path, place): (PathBuf, Option<FileClaim>),
        clock: &Arc<dyn Clock>,
    ) -> std::io::Result<Self> {
        let written = Written {
            sink: format.sink(rows.columns.clone()),
            has_begun: false,
            out: Out::new(target),
            place,
        };
        Self::spawn(Some((path, written)), rows, ticks, lossless, clock)
    }

    /// Starts the thread; without a file, for a history alone.
    fn spawn(
        file: Option<(PathBuf, Written)>,
        rows: Rows,
        ticks: usize,
        lossless: bool,
        clock: &Arc<dyn Clock>,
    ) -> std::io::Result<Self> {
        let columns = &rows.columns;
        let head = HEAD + columns.stations.len();
        let slots = columns.columns.len();
        let (ring, reader) = row_ring(ticks, head + slots);
        let bell = Arc::new(Bell::default());
        let (path, file) = file.unzip();
        let scans = Arc::new(RecorderCounters {
            file: path,
            ..RecorderCounters::default()
        });
        let history = Arc::<OnceLock<Arc<History>>>::default();
        let mut writing = Writing {
            ring: reader,
            words: vec![0; head + slots].into(),
            tick: Tick::new(columns),
            kinds: columns.columns.iter().map(|column| column.kind).collect(),
            rows,
            file,
            history: Arc::clone(&history),
            before: None,
            scans: Arc::clone(&scans),
            bell: Arc::clone(&bell),
            clock: Arc::clone(clock),
        };
        let thread = Thread::spawn(&**clock, "record", move || writing.run())?;
        Ok(Self {
            ring,
            head: Vec::with_capacity(head),
            slots,
            lossless,
            scans,
            history,
            bell,
            close_timeout: CLOSE_TIMEOUT,
            clock: Arc::clone(clock),
            thread: Some(thread),
        })
    }

    /// Records one tick: its number, simulation time and status, the status of each station if there are
    /// several, and its slots.
    ///
    /// # Panics
    ///
    /// When there are fewer slots than columns.
    #[inline]
    pub fn record(
        &mut self,
        number: u64,
        time: Nanos,
        status: i32,
        stations: impl Iterator<Item = i32>,
        slots: &[Slot],
    ) {
        if self.scans.ended.load(Ordering::Relaxed) {
            return;
        }
        let word = |status: i32| i64::from(status).cast_unsigned();
        self.head.clear();
        self.head
            .extend([number, time.0.cast_unsigned(), word(status)]);
        // Never more than was allocated.
        let room = self.head.capacity() - self.head.len();
        self.head.extend(stations.map(word).take(room));
        let slots = &slots[..self.slots];
        if self.lossless && self.ring.is_full() {
            self.wait_for_room();
        }
        if !self.ring.push(&self.head, slots) {
            self.scans.dropped.fetch_add(1, Ordering::Relaxed);
        } else if self.lossless && self.ring.is_half_full() {
            self.bell.ring();
        }
    }

    #[cold]
    fn wait_for_room(&mut self) {
        self.bell.ring();
        let mut has_room = || !self.ring.is_full() || self.scans.ended.load(Ordering::Acquire);
        if let Some(simulation) = self.clock.simulation() {
            while !simulation.wait_for(LOOK, &mut has_room) {}
            return;
        }
        let mut state = self.bell.lock();
        while !has_room() {
            let waited = self.bell.room.wait_timeout(state, LOOK.to_duration());
            state = waited.unwrap_or_else(PoisonError::into_inner).0;
        }
    }

    /// The counters.
    pub fn counters(&self) -> &Arc<RecorderCounters> {
        &self.scans
    }
}

impl Drop for Recorder {
    fn drop(&mut self) {
        self.bell.stop();
        let Some(thread) = self.thread.take() else {
            return;
        };
        let written = || self.scans.ticks.load(Ordering::Relaxed);
        let mut before = written();
        while !thread.ends_within(&*self.clock, self.close_timeout) {
            let ticks = written();
            if ticks == before {
                log::error!(
                    "{}: the file has taken nothing for {}, and the thread that records is left behind; the \
                     recording may lack its end, see whether its disc answers",
                    self.scans.name(),
                    self.close_timeout
                );
                return;
            }
            before = ticks;
        }
        if !thread.join() {
            log::error!("{}: the recording panicked", self.scans.name());
        }
    }
}

/// A file that is being written.
struct Written {
    sink: Box<dyn Sink>,
    /// The file has the beginning of this recording, or will have it with the next flush.
    has_begun: bool,
    out: Out,
    place: Option<FileClaim>,
}

impl Written {
    /// Begins the file.
    fn begin(&mut self) -> std::io::Result<()> {
        if let Some(place) = &self.place {
            place.truncate()?;
        }
        self.sink.header(self.out.buffer());
        self.out.whole(0);
        self.has_begun = true;
        Ok(())
    }

    /// Ends the file of a run that had these ticks.
    fn end(&mut self, ticks: u64, dropped: u64) -> std::io::Result<()> {
        if !self.has_begun {
            // A run without a tick keeps the recording of an earlier one.
            if self.place.as_ref().is_some_and(|place| !place.is_empty()) {
                return Ok(());
            }
            self.begin()?;
        }
        let note = format!("ticks={ticks} dropped={dropped}");
        self.sink.end(&note, self.out.buffer());
        self.out.whole(ticks);
        self.out.flush()
    }
}

/// The thread's half of a recorder.
struct Writing {
    ring: RowReader,
    words: Box<[u64]>,
    tick: Tick,
    kinds: Box<[super::ValueKind]>,
    rows: Rows,
    /// `None` without a file, or once it takes no more.
    file: Option<Written>,
    history: Arc<OnceLock<Arc<History>>>,
    /// Number and time of the previous tick.
    before: Option<(u64, Nanos)>,
    scans: Arc<RecorderCounters>,
    bell: Arc<Bell>,
    clock: Arc<dyn Clock>,
}

impl Writing {
    fn run(&mut self) {
        // After this thread has ended, for any reason, no tick may wait for it.
        let (scans, bell) = (Arc::clone(&self.scans), Arc::clone(&self.bell));
        let _end = Ended { scans, bell };
        while let Err(error) = self.write() {
            self.give_up_file(&error);
            // A history goes on without the file.
            if self.history.get().is_none() {
                return;
            }
        }
    }

    /// Ends the file because of an error.
    fn give_up_file(&mut self, error: &std::io::Error) {
        let Some(mut file) = self.file.take() else {
            return;
        };
        let ticks = file.out.ticks();
        let why = format!("the recording ended with tick {ticks} of the file: {error}");
        self.scans.ticks.store(ticks, Ordering::Relaxed);
        // There may be room for a short comment even if there was none for a tick.
        if file.out.has_begun() {
            file.sink.end(&why, file.out.buffer());
            file.out.whole(ticks);
            let _ = file.out.flush();
        }
        log::error!(
            "{}: {why}; the run goes on without it; free some space and open the driver again",
            self.scans.name()
        );
        *self.scans.lock_error() = Some(why);
    }

    fn write(&mut self) -> std::io::Result<()> {
        let mut looks = 0;
        loop {
            let stopped = self.bell.lock().stop;
            self.drain()?;
            looks += 1;
            if stopped {
                break;
            }
            if looks % LOOKS_PER_FLUSH == 0
                && let Some(file) = &mut self.file
            {
                file.out.flush()?;
            }
            self.bell.wait(&*self.clock);
        }
        let ticks = self.scans.ticks.load(Ordering::Relaxed);
        let dropped = self.scans.dropped.load(Ordering::Relaxed);
        match &mut self.file {
            Some(file) => file.end(ticks, dropped),
            None => Ok(()),
        }
    }

    /// Writes everything that the ring holds.
    fn drain(&mut self) -> std::io::Result<()> {
        while self.ring.take(&mut self.words) {
            self.unpack();
            if let Some(history) = self.history.get() {
                history.push(&self.tick);
            }
            let Some(file) = &mut self.file else {
                continue;
            };
            if !file.has_begun {
                file.begin()?;
            }
            file.sink.tick(&self.tick, file.out.buffer());
            let ticks = self.scans.ticks.fetch_add(1, Ordering::Relaxed) + 1;
            file.out.whole(ticks);
            if file.out.pending() >= CHUNK {
                self.bell.room.notify_one();
                file.out.flush()?;
            }
        }
        self.bell.room.notify_one();
        Ok(())
    }

    /// Decodes the words of a tick.
    fn unpack(&mut self) {
        #[expect(clippy::cast_possible_truncation, reason = "made from an i32")]
        let status = |word: u64| word.cast_signed() as i32;
        let tick = &mut self.tick;
        let (head, slots) = self.words.split_at(HEAD + tick.stations.len());
        tick.number = head[0];
        tick.time = Nanos(head[1].cast_signed());
        tick.status = status(head[2]);
        for (place, word) in tick.stations.iter_mut().zip(&head[HEAD..]) {
            *place = status(*word);
        }
        for (value, word) in tick.values.iter_mut().zip(slots) {
            *value = Slot(*word);
        }
        self.rows.put_on_the_line(&mut tick.values);
        for (value, kind) in tick.values.iter_mut().zip(&self.kinds) {
            *value = kind.kept(*value);
        }
        let first = (tick.number.saturating_sub(1), Nanos::ZERO);
        let (number, time) = self.before.unwrap_or(first);
        let gap = tick.number.saturating_sub(number).saturating_sub(1);
        if gap > 0 && tick.dropped == 0 {
            log::warn!(
                "{}: ticks are dropped, since they come faster than they can be written; the recording has \
                 gaps, record.dropped counts them; write a larger ring in [record]",
                self.scans.name()
            );
        }
        tick.dropped += gap;
        // Time in VCD cannot run backwards.
        if tick.time < time {
            if self.scans.backwards.fetch_add(1, Ordering::Relaxed) == 0 {
                log::warn!(
                    "{}: simulation time went back from {time} to {} in tick {}; the recording has it at \
                     {time}",
                    self.scans.name(),
                    tick.time,
                    tick.number
                );
            }
            tick.time = time;
        }
        self.before = Some((tick.number, tick.time));
    }
}

/// Reports on drop that the recording has ended.
struct Ended {
    scans: Arc<RecorderCounters>,
    bell: Arc<Bell>,
}

impl Drop for Ended {
    fn drop(&mut self) {
        self.scans.ended.store(true, Ordering::Release);
        self.bell.room.notify_one();
    }
}
