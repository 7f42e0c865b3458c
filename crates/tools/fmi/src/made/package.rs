//! The FMU as a file: an archive with the model description, the libraries, and driver.cfg.

use std::io::{Cursor, Write as _};
use std::path::Path;

use tickbus_base::Mistake;
use tickbus_base::toml_text::Mistakes;
use tickbus_driver_cfg::loopback::{self, Peer};
use tickbus_driver_cfg::{Config, Kinds};
use zip::ZipWriter;
use zip::write::SimpleFileOptions;

use super::description::{identifier, model_description};
use super::files::named;
use super::library::NativeLibrary;
use super::resources::token;
use crate::value::Version;

/// The result of an export.
#[derive(Debug)]
pub struct Package {
    /// The bytes of the FMU.
    pub bytes: Vec<u8>,
    /// The number of variables.
    pub variables: usize,
    /// The platforms, by their names in the FMU's version.
    pub platforms: Vec<&'static str>,
    /// Notes for the FMU's users, one line each.
    pub notes: Vec<String>,
}

/// Makes an FMU of the driver.cfg at `path`, which can name these `kinds` of bus, and of the files that it names in its
/// folder. The same files give the same bytes.
///
/// # Errors
///
/// Returns every mistake in the driver.cfg; or a file that it names cannot be packed; or the version has no name for
/// the platform of any library.
pub fn export(
    path: &Path,
    version: Version,
    libraries: &[NativeLibrary],
    kinds: &'static Kinds,
) -> Result<Package, Mistakes> {
    let file = path.display().to_string();
    let refused = |mistake: Mistake| Mistakes::of(&file, mistake);
    let config = Config::load(path, kinds)?;
    let driver_cfg = std::fs::read(path).map_err(|error| {
        refused(Mistake::new(
            format!("it cannot be read: {error}"),
            "check the file",
        ))
    })?;
    // Loading has read this path and no longer keeps it.
    let faults = Config::parse(&file, &String::from_utf8_lossy(&driver_cfg), kinds)?.fault_file;
    let faults = faults.map(|file| match file.strip_prefix(config.folder()) {
        Ok(inside) => inside.to_owned(),
        Err(_) => file,
    });
    let mut named = named(&config, faults.as_deref()).map_err(refused)?;
    let mut notes = std::mem::take(&mut named.notes);
    notes.extend(notes_on(&config));

    let mut archive = Archive(ZipWriter::new(Cursor::new(Vec::new())));
    let token = token(&driver_cfg);
    let description = model_description(&config, version, &token);
    let variables = super::Exposed::of(&config, version).variables.len();
    let packed = (|| {
        archive.add("modelDescription.xml", description.as_bytes())?;
        let mut platforms = Vec::new();
        for library in libraries {
            let Some(folder) = library.platform.folder(version) else {
                notes.push(format!(
                    "{} is left out: FMI {} has no name for {}",
                    library.origin,
                    version.number(),
                    library.platform.tuple
                ));
                continue;
            };
            let (name, ending) = (identifier(&config), library.platform.ending);
            archive.add(
                &format!("binaries/{folder}/{name}.{ending}"),
                &library.bytes,
            )?;
            platforms.push(folder);
        }
        archive.add("resources/driver.cfg", &driver_cfg)?;
        for file in &named.files {
            let bytes = std::fs::read(config.folder().join(file)).map_err(|error| {
                Mistake::new(
                    format!("{} cannot be read: {error}", file.display()),
                    "check the file, which driver.cfg names",
                )
            })?;
            let name = file.to_string_lossy().replace('\\', "/");
            archive.add(
                &format!("resources/{}", name.trim_start_matches("./")),
                &bytes,
            )?;
        }
        archive.add(
            "documentation/externalDependencies.txt",
            DEPENDENCIES.as_bytes(),
        )?;
        Ok((archive.finish()?, platforms))
    })();
    let (bytes, platforms) = packed.map_err(refused)?;
    if platforms.is_empty() {
        return Err(refused(Mistake::new(
            format!(
                "FMI {} has no name for any platform of these libraries",
                version.number()
            ),
            "export for fmi3, or name a --library for x86-64",
        )));
    }
    Ok(Package {
        bytes,
        variables,
        platforms,
        notes,
    })
}

/// The requirements for running the FMU on another computer.
const DEPENDENCIES: &str = "\
The library needs nothing but the C library of the system: on Linux glibc, at least that of the computer on which it was built.
Bus cards need the drivers of their vendors, isolated plug-ins the tickbus command on the PATH.
";

fn notes_on(config: &Config) -> Vec<String> {
    let mut notes = Vec::new();
    if !super::own::is_stepped(config) {
        notes.push(format!(
            "the bus \"{}\" runs in real time, so the parameter \"pace\" begins at 1: a step waits until the clock is there; \
             set it to 0 if the importing tool keeps to the clock",
            config.bus.kind()
        ));
    }
    if config.bus.needs_command() {
        notes.push(
            "isolated = true needs the tickbus command where the FMU runs: on the PATH, or named by TICKBUS_HELPER"
                .to_owned(),
        );
    }
    if let Some(options) = config.bus.downcast_ref::<loopback::Options>()
        && let Peer::Link(name) = &options.peer
    {
        notes.push(format!(
            "the link \"{name}\" is within this FMU alone: every FMU has a native library of its own, so no other one meets it; \
             use the bus \"socket\" between two"
        ));
    }
    if config.record.is_some() {
        notes.push(
            "[record] is the parameter \"record\" of the FMU, and begins at the current folder of the importing tool"
                .to_owned(),
        );
    }
    notes
}

/// The archive while it is being written.
struct Archive(ZipWriter<Cursor<Vec<u8>>>);

impl Archive {
    fn add(&mut self, name: &str, bytes: &[u8]) -> Result<(), Mistake> {
        // With the times of the files, two exports of the same files would differ.
        let options = SimpleFileOptions::default().unix_permissions(0o644);
        let started = self.0.start_file(name, options);
        started.map_err(|error| unwritable(&error))?;
        self.0.write_all(bytes).map_err(|error| unwritable(&error))
    }

    fn finish(self) -> Result<Vec<u8>, Mistake> {
        let written = self.0.finish().map_err(|error| unwritable(&error))?;
        Ok(written.into_inner())
    }
}

fn unwritable(error: &dyn std::fmt::Display) -> Mistake {
    Mistake::new(
        format!("the archive cannot be written: {error}"),
        "check the names of the files",
    )
}
