//! `tickbus import TABLE`: makes a driver.cfg from a list of PLC tags.

use std::io::Write as _;
use std::path::PathBuf;

use super::Outcome;
use crate::config::Mistakes;
use crate::import::{Imported, Reading, import};
use crate::signal::Addressing;

/// Make a driver.cfg from a list of PLC tags: name, address, type, comment.
///
/// Takes CSV with semicolons, commas or tabs, with or without headings, as tickbus, spreadsheets and the SDF export of
/// TIA Portal write it. Tags outside of %I and %Q are told and skipped.
#[derive(Debug, clap::Args)]
pub(super) struct Arguments {
    /// The table.
    table: PathBuf,

    /// Where the driver.cfg goes [default: standard output].
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,

    /// Overwrite the file if it is there.
    #[arg(long)]
    force: bool,

    /// Leave out lines with mistakes instead of refusing the table.
    #[arg(long)]
    lenient: bool,

    /// The numbers of the addresses count elements, as CODESYS has it, not bytes.
    #[arg(long)]
    iec: bool,
}

pub(super) fn run(arguments: &Arguments) -> Outcome {
    let mut stderr = std::io::stderr().lock();
    match read(arguments).and_then(|imported| write(arguments, &imported).map(|()| imported)) {
        Ok(imported) => {
            let file = arguments.table.display();
            for mistake in &imported.skipped {
                let (line, column) = mistake.place.unwrap_or((1, 1));
                let _ = writeln!(
                    stderr,
                    "{file}:{line}:{column}: {}; {}",
                    mistake.what, mistake.right
                );
            }
            let told = format!(
                "import: ok signals={} skipped={}",
                imported.signals,
                imported.skipped.len()
            );
            if arguments.out.is_some() {
                println!("{told}");
            } else {
                let _ = writeln!(stderr, "{told}");
            }
            Outcome::Done
        }
        Err(mistakes) => {
            let _ = writeln!(
                stderr,
                "{mistakes}\nimport: failed mistakes={}",
                mistakes.len()
            );
            Outcome::WrongInput
        }
    }
}

fn read(arguments: &Arguments) -> Result<Imported, Mistakes> {
    let file = arguments.table.display().to_string();
    let bytes = std::fs::read(&arguments.table).map_err(|error| {
        Mistakes::of_file(
            &file,
            format!("this file cannot be read: {error}"),
            "check the path and the name",
        )
    })?;
    let addressing = if arguments.iec {
        Addressing::Elements
    } else {
        Addressing::Bytes
    };
    import(
        &file,
        &bytes,
        Reading {
            addressing,
            lenient: arguments.lenient,
        },
    )
}

fn write(arguments: &Arguments, imported: &Imported) -> Result<(), Mistakes> {
    let Some(out) = &arguments.out else {
        // A reader that has gone away needs no report of it.
        let _ = std::io::stdout().lock().write_all(imported.text.as_bytes());
        return Ok(());
    };
    let file = out.display().to_string();
    if !arguments.force && out.symlink_metadata().is_ok() {
        return Err(Mistakes::of_file(
            &file,
            "this file is there already",
            "name another --out, or add --force",
        ));
    }
    std::fs::write(out, &imported.text).map_err(|error| {
        Mistakes::of_file(
            &file,
            format!("this file cannot be written: {error}"),
            "check the folder",
        )
    })
}
