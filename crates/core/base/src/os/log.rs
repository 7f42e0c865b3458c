//! Log messages on stderr.

mod lines;
mod queue;

use std::io::{self, Write};
use std::sync::OnceLock;

use env_logger::{Builder, Target};
use log::LevelFilter;

use crate::time::Nanos;
pub use lines::{collect_log, has_log, take_log};
use queue::Queue;

/// The queue before stderr; one per process, because there is one stderr.
static QUEUE: OnceLock<Queue> = OnceLock::new();

/// The number of messages of one kind that are always logged.
const TOLD: u64 = 20;

/// Sends log messages to stderr, from the level in the variable `TICKBUS_LOG` (`off`, `error`, `warn`, `info`,
/// `debug`), or else from `level` on. The level applies to tickbus' own messages; other crates show only warnings and
/// errors, unless the variable names them (`info,opcua_client=debug`). If the host already has a logger in this
/// process, that one stays.
///
/// Logging never blocks: a thread writes to stderr, and messages that do not fit into its queue are dropped
/// and counted, see [`dropped_log_lines`].
pub fn log_to_stderr(level: LevelFilter) {
    let mut builder = Builder::new();
    set_levels(
        &mut builder,
        std::env::var("TICKBUS_LOG").ok().as_deref(),
        level,
    );
    // Without that thread, messages are written directly.
    if QUEUE.get().is_none()
        && let Ok(queue) = Queue::start(io::stderr())
    {
        let queue = QUEUE.get_or_init(|| queue);
        builder.target(Target::Pipe(Box::new(queue.clone())));
    }
    // Fails if there is already a logger, which is then used.
    let _ = builder.try_init();
}

/// Waits until all messages so far have reached stderr, but at most `limit`; to be called before the process
/// ends.
pub fn flush_log(limit: Nanos) {
    if let Some(queue) = QUEUE.get() {
        queue.flush_within(limit);
    }
}

/// The number of log lines dropped in this process because stderr was not read fast enough.
pub fn dropped_log_lines() -> u64 {
    QUEUE.get().map_or(0, Queue::dropped)
}

/// True if the `times`-th message of a kind is logged: the first 20 are, then those whose number is a power of two. So
/// a recurring event cannot fill the log.
pub const fn is_told(times: u64) -> bool {
    times <= TOLD || times.is_power_of_two()
}

/// True if some messages of a kind are left out from the `times`-th on.
pub const fn is_rarely_logged(times: u64) -> bool {
    times >= TOLD
}

fn set_levels(builder: &mut Builder, variable: Option<&str>, level: LevelFilter) {
    let mut own = level;
    let mut rest = Vec::new();
    for directive in variable.unwrap_or_default().split(',') {
        match directive.trim().parse() {
            Ok(level) => own = level,
            Err(_) if directive.trim().is_empty() => {}
            Err(_) => rest.push(directive),
        }
    }
    builder.filter_level(own.min(LevelFilter::Warn));
    builder.filter_module("tickbus", own);
    // The OPC UA crates log their internals; the bus itself logs everything that matters to the user.
    builder.filter_module("opcua", LevelFilter::Off);
    if !rest.is_empty() {
        builder.parse_filters(&rest.join(","));
    }
}

/// One call is one message.
impl Write for Queue {
    fn write(&mut self, message: &[u8]) -> io::Result<usize> {
        self.push(message);
        Ok(message.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use log::{Level, Log as _, Metadata};

    use super::*;

    fn shows(variable: Option<&str>, target: &str, level: Level) -> bool {
        let mut builder = Builder::new();
        set_levels(&mut builder, variable, LevelFilter::Warn);
        let metadata = Metadata::builder().target(target).level(level).build();
        builder.build().enabled(&metadata)
    }

    #[test]
    fn a_level_is_that_of_tickbus_own_messages() {
        for (variable, target, level, shown) in [
            (None, "tickbus_fieldbus::tcp", Level::Warn, true),
            (None, "tickbus_fieldbus::tcp", Level::Info, false),
            (None, "tracing::span", Level::Warn, true),
            (Some("info"), "tickbus_fieldbus::tcp", Level::Info, true),
            (Some("info"), "tracing::span", Level::Info, false),
            (Some("info"), "tracing::span", Level::Warn, true),
            (Some("error"), "tracing::span", Level::Warn, false),
            (Some("off"), "tickbus", Level::Error, false),
            (Some("debug"), "opcua_client::session", Level::Error, false),
            (
                Some("info,opcua_client=debug"),
                "opcua_client::session",
                Level::Debug,
                true,
            ),
            (
                Some("info,opcua_client=debug"),
                "tickbus",
                Level::Debug,
                false,
            ),
            (Some("tracing=info"), "tracing::span", Level::Info, true),
            (Some("tracing=info"), "tickbus", Level::Warn, true),
        ] {
            let found = shows(variable, target, level);
            assert_eq!(found, shown, "{variable:?}: {level} of {target}");
        }
    }

    #[test]
    fn the_first_twenty_are_told_and_then_powers_of_two() {
        let told: Vec<u64> = (1..200).filter(|times| is_told(*times)).collect();
        let first: Vec<u64> = (1..=20).collect();
        assert_eq!(told[..20], first);
        assert_eq!(told[20..], [32, 64, 128]);
    }
}
