//! Log messages for a host with its own log.

use std::collections::VecDeque;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};

use env_logger::{Builder, Target};
use log::{Level, LevelFilter};

/// The most waiting lines. Newer lines displace older ones, which are counted.
const MOST: usize = 1000;

/// The waiting lines.
static WAITING: Mutex<Waiting> = Mutex::new(Waiting {
    lines: VecDeque::new(),
    lost: 0,
});

/// True if lines are waiting: checked far more often than lines arrive.
static ANY: AtomicBool = AtomicBool::new(false);

struct Waiting {
    lines: VecDeque<(Level, String)>,
    lost: u64,
}

fn waiting() -> MutexGuard<'static, Waiting> {
    // The queue is consistent after every single change.
    WAITING.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Keeps log messages for [`take_log`], from the level `info` on, or from the level in the variable `TICKBUS_LOG`. If
/// this process already has a logger, that one stays, and no messages are kept.
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

/// True if there are lines for [`take_log`]; costs almost nothing.
#[inline]
pub fn has_log() -> bool {
    ANY.load(Ordering::Relaxed)
}

/// Takes all waiting messages, oldest first.
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
