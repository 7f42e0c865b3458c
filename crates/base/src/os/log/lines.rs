//! Log messages for a host that has a log of its own.

use std::collections::VecDeque;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};

use env_logger::{Builder, Target};
use log::{Level, LevelFilter};

/// The most lines that wait. Older ones give way to newer ones, and are counted.
const MOST: usize = 1000;

/// What waits to be taken.
static WAITING: Mutex<Waiting> = Mutex::new(Waiting {
    lines: VecDeque::new(),
    lost: 0,
});

/// Whether anything waits: asked far more often than anything happens.
static ANY: AtomicBool = AtomicBool::new(false);

struct Waiting {
    lines: VecDeque<(Level, String)>,
    lost: u64,
}

fn waiting() -> MutexGuard<'static, Waiting> {
    // The queue is whole after every single change.
    WAITING.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Keeps log messages for [`take_log`], from the level `info` on, or from that in the variable `TICKBUS_LOG`. If this process
/// has a logger already, that one stays, and nothing is kept.
pub fn collect_log() {
    let mut builder = Builder::new();
    let variable = std::env::var("TICKBUS_LOG").ok();
    super::set_levels(&mut builder, variable.as_deref(), LevelFilter::Info);
    builder.format(|_, record| {
        let mut waiting = waiting();
        if waiting.lines.len() == MOST {
            waiting.lines.pop_front();
            waiting.lost += 1;
        }
        let line = (record.level(), record.args().to_string());
        waiting.lines.push_back(line);
        ANY.store(true, Ordering::Release);
        Ok(())
    });
    builder.target(Target::Pipe(Box::new(std::io::sink())));
    let _ = builder.try_init();
}

/// Whether there are lines for [`take_log`]; this costs next to nothing.
#[inline]
pub fn has_log() -> bool {
    ANY.load(Ordering::Relaxed)
}

/// Takes all messages that wait, oldest first.
pub fn take_log() -> Vec<(Level, String)> {
    let mut waiting = waiting();
    ANY.store(false, Ordering::Release);
    let lost = std::mem::take(&mut waiting.lost);
    let mut lines: Vec<_> = waiting.lines.drain(..).collect();
    if lost > 0 {
        let told = format!("{lost} lines of the log were dropped, since nobody took them");
        lines.insert(0, (Level::Warn, told));
    }
    lines
}
