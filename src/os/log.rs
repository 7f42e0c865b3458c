//! Messages of the log on stderr.

use env_logger::{Builder, Env};

/// Lets what is logged reach stderr, from the level that the variable `TICKBUS_LOG` names (`off`, `error`,
/// `warn`, `info`, `debug`), or else from `level` on. A host that has a logger of its own in this process
/// keeps it.
pub fn log_to_stderr(level: log::LevelFilter) {
    let env = Env::new().filter_or("TICKBUS_LOG", level.as_str());
    let mut builder = Builder::from_env(env);
    // What the OPC UA crate says is about its own inside; the bus says what it means. `opcua_client=debug` and
    // the like in the variable show it all the same.
    builder.filter_module("opcua", log::LevelFilter::Off);
    // It fails where there is a logger already, which is then the right one.
    let _ = builder.try_init();
}
