//! `tickbus plugin-helper`: the process that calls a plug-in for its host.

use super::Outcome;
use tickbus_bus_plugin as plugin;

pub(super) fn run() -> Outcome {
    match plugin::serve_host() {
        Ok(()) => Outcome::Done,
        Err(error) => {
            eprintln!("plugin-helper: {error}");
            Outcome::Usage
        }
    }
}
