//! Messages of the log on stderr.

mod queue;

use std::io::{self, Write};
use std::sync::OnceLock;

use env_logger::{Builder, Target};
use log::LevelFilter;

use crate::time::Nanos;
use queue::Queue;

/// The queue before stderr, once there is one; the process has one stderr.
static QUEUE: OnceLock<Queue> = OnceLock::new();

/// Messages of one kind that are logged in any case.
const TOLD: u64 = 20;

/// Lets what is logged reach stderr, from the level that the variable `TICKBUS_LOG` names (`off`, `error`,
/// `warn`, `info`, `debug`), or else from `level` on. That is the level of tickbus' own messages; of the crates that it
/// uses warnings and errors alone are shown, unless the variable names them (`info,opcua_client=debug`). A host that has a
/// logger of its own in this process keeps it.
///
/// Whoever logs waits for nobody: a thread of the log writes to stderr, and what does not fit into its queue is
/// dropped and counted, see [`dropped_log_lines`].
pub fn log_to_stderr(level: LevelFilter) {
    let mut builder = Builder::new();
    set_levels(
        &mut builder,
        std::env::var("TICKBUS_LOG").ok().as_deref(),
        level,
    );
    // Without a thread for it the log is written as it comes.
    if QUEUE.get().is_none()
        && let Ok(queue) = Queue::start(io::stderr())
    {
        let queue = QUEUE.get_or_init(|| queue);
        builder.target(Target::Pipe(Box::new(queue.clone())));
    }
    // It fails where there is a logger already, which is then the right one.
    let _ = builder.try_init();
}

/// Waits until what was logged has reached stderr, but for no longer than `limit`: to be called before a process ends.
pub fn flush_log(limit: Nanos) {
    if let Some(queue) = QUEUE.get() {
        queue.flush_within(limit);
    }
}

/// How many lines of the log were dropped in this process, since stderr was not read as fast as they came.
pub fn dropped_log_lines() -> u64 {
    QUEUE.get().map_or(0, Queue::dropped)
}

/// Whether the log is to have a message that comes for the `times`-th time: the first 20 of its kind, then those whose
/// number is a power of two. So nothing that happens again and again can fill the log.
pub const fn is_told(times: u64) -> bool {
    times <= TOLD || times.is_power_of_two()
}

/// Whether from the `times`-th message on some of its kind are left out.
pub const fn is_told_rarely(times: u64) -> bool {
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
    // What the OPC UA crates say is about their own inside; the bus says what it means.
    builder.filter_module("opcua", LevelFilter::Off);
    if !rest.is_empty() {
        builder.parse_filters(&rest.join(","));
    }
}

/// A message is written with one call.
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
            (None, "tickbus::fieldbus", Level::Warn, true),
            (None, "tickbus::fieldbus", Level::Info, false),
            (None, "tracing::span", Level::Warn, true),
            (Some("info"), "tickbus::fieldbus", Level::Info, true),
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
