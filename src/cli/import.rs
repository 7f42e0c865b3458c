//! `tickbus import TABLE`: makes a driver.cfg from a list of PLC tags.

use std::path::PathBuf;

use clap::builder::{PossibleValuesParser, TypedValueParser};

use super::progress::Progress;
use super::{Outcome, print};
use tickbus_base::toml_text::{Mistakes, PlacedMistake};
use tickbus_driver_cfg::Kinds;
use tickbus_image::signal::Addressing;
use tickbus_import::{Client, ImportOptions, Imported, condensed, import};

/// Make a driver.cfg from a list of PLC tags: name, address, type, comment.
///
/// Takes workbooks (XLSX) and CSV with semicolons, commas or tabs, with or without headings, as spreadsheets and TIA Portal
/// (XLSX, SDF, XML) write them; PLCopen XML; L5X and the tag CSV of Studio 5000; TwinCAT's `.TcPOU` and `.TcGVL`, Structured
/// Text, and the mapping export of CODESYS; and the lists of PLC4X and KEPServer, whose addresses of registers and
/// data blocks become [fieldbus.at] of a client bus. What cannot be used is reported with its place.
#[expect(
    clippy::struct_excessive_bools,
    reason = "each is a flag of the command line"
)]
#[derive(Debug, clap::Args)]
pub(super) struct Arguments {
    /// The list.
    table: PathBuf,

    /// The output file [default: standard output].
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,

    /// Overwrite an existing file.
    #[arg(long)]
    force: bool,

    /// Leave out lines with mistakes instead of refusing the table.
    #[arg(long)]
    lenient: bool,

    /// Addresses count elements, as in CODESYS and OpenPLC [default: as in the program that wrote the list, if the list
    /// shows which].
    #[arg(long)]
    iec: bool,

    /// Addresses count bytes, as in TIA Portal and TwinCAT.
    #[arg(long, conflicts_with = "iec")]
    bytes: bool,

    /// Propose `[[reply]]` sections for the inputs, by their names and comments: a first set to read and to correct.
    #[arg(long)]
    replies: bool,

    /// The client bus to which the addresses belong, if the list does not show it: %MW20 exists in Modbus and in S7.
    #[arg(long, value_name = "KIND", value_parser = clients())]
    bus: Option<Client>,
}

/// Parses the kind of a client bus.
fn clients() -> impl TypedValueParser<Value = Client> {
    const ALL: [Client; 2] = [Client::Modbus, Client::S7];
    PossibleValuesParser::new(ALL.map(Client::kind)).map(|kind| {
        let mut all = ALL.into_iter();
        all.find(|client| client.kind() == kind)
            .expect("a possible value")
    })
}

pub(super) fn run(arguments: &Arguments, kinds: &'static Kinds) -> Outcome {
    let name = arguments.table.file_name().unwrap_or_default();
    let progress = Progress::begin("import", format!("reading {}", name.to_string_lossy()));
    let imported = read(arguments, kinds);
    drop(progress);
    match imported.and_then(|imported| write(arguments, &imported).map(|()| imported)) {
        Ok(imported) => {
            let file = arguments.table.display();
            if !imported.skipped.is_empty() {
                let skipped = Mistakes::of_list(&file.to_string(), condensed(&imported.skipped));
                eprintln!("{skipped}");
            }
            for note in &imported.notes {
                eprintln!("{file}: note: {note}");
            }
            let replies = if arguments.replies {
                format!(" replies={}", imported.replies)
            } else {
                String::new()
            };
            let told = format!(
                "import: ok signals={} assigned={} skipped={}{replies}",
                imported.signals,
                imported.assigned,
                imported.skipped.len()
            );
            if arguments.out.is_some() {
                return print("import", &format!("{told}\n"));
            }
            let outcome = print("import", &imported.text);
            if outcome == Outcome::Done {
                eprintln!("{told}");
            }
            outcome
        }
        Err(mistakes) => {
            let list: Vec<PlacedMistake> = mistakes.iter().cloned().collect();
            let shown = Mistakes::of_list(mistakes.file(), condensed(&list));
            eprintln!("{shown}\nimport: failed mistakes={}", mistakes.len());
            Outcome::WrongInput
        }
    }
}

fn read(arguments: &Arguments, kinds: &'static Kinds) -> Result<Imported, Mistakes> {
    let file = arguments.table.display().to_string();
    let bytes = std::fs::read(&arguments.table).map_err(|error| {
        Mistakes::of_file(
            &file,
            format!("this file cannot be read: {error}"),
            "check the path and the name",
        )
    })?;
    let addressing = match (arguments.iec, arguments.bytes) {
        (true, _) => Some(Addressing::Elements),
        (_, true) => Some(Addressing::Bytes),
        _ => None,
    };
    import(
        &file,
        &bytes,
        ImportOptions {
            addressing,
            lenient: arguments.lenient,
            client: arguments.bus,
            replies: arguments.replies,
        },
        kinds,
    )
}

fn write(arguments: &Arguments, imported: &Imported) -> Result<(), Mistakes> {
    let Some(out) = &arguments.out else {
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
