//! `tickbus import TABLE`: makes a driver.cfg from a list of PLC tags.

use std::io::Write as _;
use std::path::PathBuf;

use clap::builder::{PossibleValuesParser, TypedValueParser};

use super::Outcome;
use tickbus_base::toml_text::{Mistakes, PlacedMistake};
use tickbus_image::signal::Addressing;
use tickbus_import::{Client, ImportOptions, Imported, import};

/// Make a driver.cfg from a list of PLC tags: name, address, type, comment.
///
/// Takes workbooks (XLSX) and CSV with semicolons, commas or tabs, with or without headings, as spreadsheets and TIA Portal
/// (XLSX, SDF) write them; PLCopen XML and L5X; and the lists of PLC4X and KEPServer, whose addresses of registers and
/// data blocks become [fieldbus.at] of a client bus. What cannot be used is reported with its place.
#[derive(Debug, clap::Args)]
pub(super) struct Arguments {
    /// The list.
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

    /// The client bus whose addresses the list has, where the list alone does not tell: %MW20 can be of either.
    #[arg(long, value_name = "KIND", value_parser = clients())]
    bus: Option<Client>,
}

/// Reads the kind of a client bus.
fn clients() -> impl TypedValueParser<Value = Client> {
    const ALL: [Client; 2] = [Client::Modbus, Client::S7];
    PossibleValuesParser::new(ALL.map(Client::kind)).map(|kind| {
        let mut all = ALL.into_iter();
        all.find(|client| client.kind() == kind)
            .expect("a possible value")
    })
}

pub(super) fn run(arguments: &Arguments) -> Outcome {
    let mut stderr = std::io::stderr().lock();
    match read(arguments).and_then(|imported| write(arguments, &imported).map(|()| imported)) {
        Ok(imported) => {
            let file = arguments.table.display();
            for PlacedMistake { place, mistake } in &imported.skipped {
                let (line, column) = place.unwrap_or((1, 1));
                let _ = writeln!(stderr, "{file}:{line}:{column}: {mistake}");
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
        ImportOptions {
            addressing,
            lenient: arguments.lenient,
            client: arguments.bus,
        },
    )
}

fn write(arguments: &Arguments, imported: &Imported) -> Result<(), Mistakes> {
    let Some(out) = &arguments.out else {
        // If the reader of stdout is gone, that need not be reported.
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
