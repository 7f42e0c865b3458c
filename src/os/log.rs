//! Messages of the log on stderr.

use env_logger::{Builder, Env};

/// Lets what is logged reach stderr, from the level that the variable `TICKBUS_LOG` names (`off`, `error`,
/// `warn`, `info`, `debug`), or else from `level` on. A host that has a logger of its own in this process
/// keeps it.
pub fn log_to_stderr(level: log::LevelFilter) {
    let env = Env::new().filter_or("TICKBUS_LOG", level.as_str());
    // It fails where there is a logger already, which is then the right one.
    let _ = Builder::from_env(env).try_init();
}
