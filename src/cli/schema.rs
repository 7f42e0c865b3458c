//! `tickbus schema`: the JSON schema of driver.cfg, for editors.

use super::{Outcome, print};
use tickbus_driver_cfg::Kinds;

/// Print the JSON schema of driver.cfg, with which editors complete and check the file.
///
/// docs/driver-cfg.md describes how editors use it. A schema cannot express every rule: `tickbus check` has the last word.
#[derive(Debug, clap::Args)]
pub(super) struct Arguments {}

pub(super) fn run(_arguments: &Arguments, kinds: &'static Kinds) -> Outcome {
    print("schema", &format!("{:#}\n", tickbus_schema::schema(kinds)))
}
