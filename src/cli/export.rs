//! `tickbus export FILE --for EDITOR`: writes the PLC's half of a driver.cfg, or an FMU of the whole.

use std::fs;
use std::io::Write as _;
use std::path::{Path, PathBuf};

use clap::builder::{PossibleValuesParser, TypedValueParser};

use super::Outcome;
use tickbus_base::Mistake;
use tickbus_driver_cfg::{Config, Kinds};
use tickbus_export::{Export, Target, export};
use tickbus_fmi::{Version, made};

/// Export a driver.cfg for the PLC: source files for its editor, and a symbol table. For fmi2 and fmi3, write an FMU:
/// the driver for simulators that import co-simulation models.
///
/// docs/which-bus.md says which bus suits which PLC, and how to set it up; docs/fmi.md describes FMUs.
#[derive(Debug, clap::Args)]
pub(super) struct Arguments {
    /// The driver.cfg of the simulated machine.
    file: PathBuf,

    /// The PLC editor, or the version of FMI.
    #[arg(long = "for", value_name = "EDITOR", value_parser = formats())]
    format: Format,

    /// The folder for the files [default: beside FILE, named after it and the editor]; for an FMU, the file.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,

    /// For an FMU: the native library to include, once for each platform [default: the one beside this command, or in
    /// the jar there].
    #[arg(long, value_name = "FILE")]
    library: Vec<PathBuf>,

    /// Overwrite existing files.
    #[arg(long)]
    force: bool,
}

/// The formats that a driver.cfg can be exported to.
#[derive(Clone, Copy, Debug)]
enum Format {
    /// The PLC's half, for a PLC editor.
    Sources(Target),
    /// An FMU.
    Fmu(Version),
}

impl Format {
    fn all() -> impl Iterator<Item = Self> {
        let sources = Target::ALL.map(Self::Sources);
        sources.into_iter().chain(Version::ALL.map(Self::Fmu))
    }

    const fn name(self) -> &'static str {
        match self {
            Self::Sources(target) => target.name(),
            Self::Fmu(version) => version.name(),
        }
    }
}

/// Parses the name of an editor or of a version of FMI.
fn formats() -> impl TypedValueParser<Value = Format> {
    PossibleValuesParser::new(Format::all().map(Format::name)).map(|name| {
        let mut all = Format::all();
        all.find(|format| format.name() == name)
            .expect("a possible value")
    })
}

pub(super) fn run(arguments: &Arguments, kinds: &'static Kinds) -> Outcome {
    match arguments.format {
        Format::Sources(target) => run_sources(arguments, target, kinds),
        Format::Fmu(version) => run_fmu(arguments, version, kinds),
    }
}

fn run_fmu(arguments: &Arguments, version: Version, kinds: &'static Kinds) -> Outcome {
    let written = make_fmu(arguments, version, kinds);
    let mut stderr = std::io::stderr().lock();
    match written {
        Ok((file, package)) => {
            for note in &package.notes {
                let _ = writeln!(stderr, "note: {note}");
            }
            println!("{}", file.display());
            println!(
                "export: ok for={} files=1 variables={} platforms={}",
                version.name(),
                package.variables,
                package.platforms.join(",")
            );
            Outcome::Done
        }
        Err((text, mistakes)) => {
            let _ = writeln!(stderr, "{text}\nexport: failed mistakes={mistakes}");
            Outcome::WrongInput
        }
    }
}

/// Writes an FMU. Returns the mistakes as a text, and their number.
fn make_fmu(
    arguments: &Arguments,
    version: Version,
    kinds: &'static Kinds,
) -> Result<(PathBuf, made::Package), (String, usize)> {
    let one = |mistake: Mistake| (mistake.to_string(), 1);
    // First the mistakes that the user can see, then the parts that this computer lacks.
    let config = Config::load(&arguments.file, kinds)
        .map_err(|mistakes| (mistakes.to_string(), mistakes.len()))?;
    // The FMU's library has these kinds, not those that a custom program adds.
    let kinds = &crate::KINDS;
    let kind = config.bus.kind();
    if !kinds.names().contains(&kind) {
        return Err(one(Mistake::new(
            format!("an FMU has no bus of kind \"{kind}\", which is one of this program alone"),
            "export a driver.cfg with a bus of tickbus",
        )));
    }
    let own = std::env::current_exe().ok();
    let beside = own.as_deref().and_then(Path::parent);
    let libraries = made::find_libraries(&arguments.library, beside).map_err(one)?;
    let package = made::export(&arguments.file, version, &libraries, kinds)
        .map_err(|mistakes| (mistakes.to_string(), mistakes.len()))?;
    let file = arguments
        .out
        .clone()
        .unwrap_or_else(|| folder_beside(arguments).with_extension("fmu"));
    let path = file.display();
    if file.extension().is_none_or(|ending| ending != "fmu") {
        return Err(one(Mistake::new(
            format!("{path}: importing tools look for files ending in .fmu"),
            format!("write --out {path}.fmu"),
        )));
    }
    if file.symlink_metadata().is_ok() && !arguments.force {
        return Err(one(Mistake::new(
            format!("{path}: this file is there already"),
            "name another --out, or add --force",
        )));
    }
    // Completely or not at all: an importing tool may be watching the folder.
    let part = file.with_extension("fmu.part");
    let written = fs::write(&part, &package.bytes).and_then(|()| fs::rename(&part, &file));
    written.map_err(|error| {
        one(Mistake::new(
            format!("{path}: this file cannot be written: {error}"),
            "check the folder",
        ))
    })?;
    Ok((file, package))
}

fn run_sources(arguments: &Arguments, target: Target, kinds: &'static Kinds) -> Outcome {
    if !arguments.library.is_empty() {
        eprintln!(
            "--library is for fmi2 and fmi3; leave it out for {}",
            target.name()
        );
        return Outcome::Usage;
    }
    let made = Config::load(&arguments.file, kinds).and_then(|config| export(&config, target));
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
                target.name(),
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
        .with_file_name(format!("{stem}-{}", arguments.format.name()))
}

/// Writes all files, or none if one of them would overwrite another file.
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
