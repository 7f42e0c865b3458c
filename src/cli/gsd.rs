//! `tickbus gsd FILE`: the GSD file of a custom machine.

use std::path::PathBuf;

use serde_json::json;

use super::json::{Format, print_document};
use super::{Outcome, print};
use tickbus_base::Mistake;
use tickbus_base::toml_text::Mistakes;
use tickbus_bus_profibus as profibus;
use tickbus_driver_cfg::{Config, Kinds};

/// Print the GSD file for PROFIBUS stations that have none from a manufacturer.
#[derive(Debug, clap::Args)]
pub(super) struct Arguments {
    /// The driver.cfg of the simulated machine.
    file: PathBuf,

    /// The stations with this ident, such as 0x80E0, if there are several.
    #[arg(long, value_name = "NUMBER", value_parser = ident)]
    ident: Option<u16>,

    #[command(flatten)]
    format: Format,
}

fn ident(text: &str) -> Result<u16, String> {
    let read = match text.strip_prefix("0x") {
        Some(hex) => u16::from_str_radix(hex, 16),
        None => text.parse(),
    };
    read.map_err(|_| "write a number from 0 to 0xFFFF, such as 0x80E0".to_owned())
}

pub(super) fn run(arguments: &Arguments, kinds: &'static Kinds) -> Outcome {
    let of_file = |mistake| Mistakes::of(&arguments.file.display().to_string(), mistake);
    let made = Config::load(&arguments.file, kinds).and_then(|config| {
        let Some(options) = config.bus.downcast_ref::<profibus::Options>() else {
            return Err(of_file(Mistake::new(
                format!("the bus \"{}\" has no GSD file", config.bus.kind()),
                "name a driver.cfg with kind = \"profibus-device\"",
            )));
        };
        let made = options.gsd(&config.name, &config.table, arguments.ident);
        made.map_err(of_file)
    });
    match made {
        Ok(text) if arguments.format.is_json() => print_document("gsd", json!({ "gsd": text })),
        Ok(text) => print("gsd", &text),
        Err(mistakes) => arguments.format.refuse("gsd", &mistakes),
    }
}
