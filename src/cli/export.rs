//! `tickbus export FILE --for EDITOR`: writes the PLC's half of a driver.cfg.

use std::fs;
use std::io::Write as _;
use std::path::{Path, PathBuf};

use clap::builder::{PossibleValuesParser, TypedValueParser};

use super::Outcome;
use tickbus_driver_cfg::Config;
use tickbus_export::{Export, Target, export};

/// Write the PLC's half of a driver.cfg: sources for the editor of the PLC, and a symbol table.
///
/// docs/which-bus.md tells which bus suits which PLC, and what is to be set there.
#[derive(Debug, clap::Args)]
pub(super) struct Arguments {
    /// The driver.cfg of the simulated machine.
    file: PathBuf,

    /// The editor that the sources are for.
    #[arg(long = "for", value_name = "EDITOR", value_parser = targets())]
    target: Target,

    /// Folder for the files [default: beside FILE, called like it and the editor].
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,

    /// Overwrite files that are there.
    #[arg(long)]
    force: bool,
}

/// Reads the name of an editor.
fn targets() -> impl TypedValueParser<Value = Target> {
    PossibleValuesParser::new(Target::ALL.map(Target::name)).map(|name| {
        let mut all = Target::ALL.into_iter();
        all.find(|target| target.name() == name)
            .expect("a possible value")
    })
}

pub(super) fn run(arguments: &Arguments) -> Outcome {
    let made = Config::load(&arguments.file).and_then(|config| export(&config, arguments.target));
    let mut stderr = std::io::stderr().lock();
    let made = match made {
        Ok(made) => made,
        Err(mistakes) => {
            let _ = writeln!(
                stderr,
                "{mistakes}\nexport: failed mistakes={}",
                mistakes.len()
            );
            return Outcome::WrongInput;
        }
    };
    let folder = arguments
        .out
        .clone()
        .unwrap_or_else(|| folder_beside(arguments));
    match write(&made, &folder, arguments.force) {
        Ok(()) => {
            for note in &made.notes {
                let _ = writeln!(stderr, "note: {note}");
            }
            for file in &made.files {
                println!("{}", folder.join(&file.name).display());
            }
            println!(
                "export: ok for={} files={}",
                arguments.target.name(),
                made.files.len()
            );
            Outcome::Done
        }
        Err(mistakes) => {
            for mistake in &mistakes {
                let _ = writeln!(stderr, "{mistake}");
            }
            let _ = writeln!(stderr, "export: failed mistakes={}", mistakes.len());
            Outcome::WrongInput
        }
    }
}

fn folder_beside(arguments: &Arguments) -> PathBuf {
    let stem = arguments
        .file
        .file_stem()
        .unwrap_or_default()
        .to_string_lossy();
    arguments
        .file
        .with_file_name(format!("{stem}-{}", arguments.target.name()))
}

/// Writes all files, or none if any of them would overwrite another one.
fn write(made: &Export, folder: &Path, force: bool) -> Result<(), Vec<String>> {
    let paths: Vec<PathBuf> = made
        .files
        .iter()
        .map(|file| folder.join(&file.name))
        .collect();
    if !force {
        let there: Vec<String> = paths
            .iter()
            .filter(|path| path.symlink_metadata().is_ok())
            .map(|path| {
                format!(
                    "{}: this file is there already; name another --out, or add --force",
                    path.display()
                )
            })
            .collect();
        if !there.is_empty() {
            return Err(there);
        }
    }
    fs::create_dir_all(folder).map_err(|error| {
        vec![format!(
            "{}: this folder cannot be made: {error}; name another --out",
            folder.display()
        )]
    })?;
    for (path, file) in paths.iter().zip(&made.files) {
        fs::write(path, &file.text).map_err(|error| {
            vec![format!(
                "{}: this file cannot be written: {error}; check the folder",
                path.display()
            )]
        })?;
    }
    Ok(())
}
