//! A line on stderr for work that takes long, on a terminal only.

use std::io::{self, IsTerminal as _, Write as _};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::{self, JoinHandle};

use tickbus_base::time::{Clock as _, Monotonic, Nanos, Stop};

/// Work that ends sooner has no line.
const PATIENCE: Nanos = Nanos::from_secs(2);

/// How often the line is written.
const INTERVAL: Nanos = Nanos::from_millis(500);

/// Returns to the beginning of the line and erases it.
const ERASE: &str = "\r\x1b[K";

/// Cuts a text at the end of the row: a second row would not be erased.
const ONE_ROW: &str = "\x1b[?7l";

/// Ends [`ONE_ROW`].
const ROWS: &str = "\x1b[?7h";

/// The line, from the beginning of the work until this is dropped.
pub(super) struct Progress {
    line: Arc<Mutex<Line>>,
    /// The thread that writes the line; `None` if stderr is no terminal that can erase a line.
    writer: Option<(Stop, JoinHandle<()>)>,
}

#[derive(Default)]
struct Line {
    /// The work at this moment.
    text: String,
    is_shown: bool,
}

impl Line {
    fn erase(&mut self) {
        if std::mem::take(&mut self.is_shown) {
            let _ = write!(io::stderr().lock(), "{ERASE}");
        }
    }
}

impl Progress {
    /// Begins work that `text` describes, such as "reading run.vcd".
    pub(super) fn begin(title: &'static str, text: impl Into<String>) -> Self {
        let line = Arc::new(Mutex::new(Line {
            text: text.into(),
            is_shown: false,
        }));
        let is_dumb = std::env::var_os("TERM").is_none_or(|terminal| terminal == "dumb");
        let writer = (io::stderr().is_terminal() && !is_dumb).then(|| {
            let (stop, line) = (Stop::new(), Arc::clone(&line));
            let stopped = stop.clone();
            (stop, thread::spawn(move || write(title, &line, &stopped)))
        });
        Self { line, writer }
    }

    /// Describes the work that has begun now.
    pub(super) fn now(&self, text: impl Into<String>) {
        self.lock().text = text.into();
    }

    /// Runs `print`, which writes lines of its own to the terminal.
    pub(super) fn aside<R>(&self, print: impl FnOnce() -> R) -> R {
        let mut line = self.lock();
        line.erase();
        print()
    }

    fn lock(&self) -> MutexGuard<'_, Line> {
        self.line.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        if let Some((stop, thread)) = self.writer.take() {
            stop.stop();
            let _ = thread.join();
            self.lock().erase();
        }
    }
}

fn write(title: &str, line: &Mutex<Line>, stop: &Stop) {
    let clock = Monotonic::shared();
    let begun = clock.now();
    let mut next = begun + PATIENCE;
    loop {
        clock.wait_until(next, stop);
        if stop.is_stopped() {
            return;
        }
        let seconds = (clock.now() - begun).0 / Nanos::from_secs(1).0;
        let mut line = line.lock().unwrap_or_else(PoisonError::into_inner);
        let _ = write!(
            io::stderr().lock(),
            "{ERASE}{ONE_ROW}{title}: {}, {seconds} s{ROWS}",
            line.text
        );
        line.is_shown = true;
        next += INTERVAL;
    }
}
