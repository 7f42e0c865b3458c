//! Users' own PLC programs: shared objects with the C interface of the open IEC 61131-3 compiler iec2c, as
//! used by `OpenPLC` and Beremiz, and tickbus' glue (`plc/glue`).
//!
//! The program's clock is the scan's `now`; its inputs and outputs are the variables that it has located in
//! `%I` and `%Q`. A compiled program keeps its state in global variables. Therefore each [`HostedProgram`] loads a
//! private copy of the file, so that any number of instances can exist in one process.

use std::fs::{self, OpenOptions};
use std::io::{self, ErrorKind, Write as _};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};

use self::object::Machine;
use self::plan::{Plan, Settings};
use self::table::{Compiled, Declared};
use super::{Program, ProgramError, Scan, list};
use tickbus_base::Mistake;
use tickbus_base::os::Library;
use tickbus_base::time::Nanos;
use tickbus_image::signal::{Address, Addressing, Area, ByteOrder, SignalTable};

mod object;
mod plan;
mod table;

/// The largest file accepted as a program, in bytes.
const FILE_LIMIT: u64 = 256 << 20;

/// A compiled PLC program in a shared object.
///
/// The options, as text: `addressing` is the unit of the numbers in the program's addresses, `bytes` or `iec` (default:
/// as the driver.cfg, else bytes). `order` is the byte order of values for which the driver.cfg has no signal, `ABCD`
/// (big-endian, the default) to `DCBA`. `alive` names a `%I` bit that is TRUE while the machine's data are not stale.
#[derive(Debug)]
pub struct HostedProgram {
    name: String,
    compiled: Compiled,
    declared: Vec<Declared>,
    settings: Settings,
    plan: Plan,
    tick: u64,
    #[expect(dead_code, reason = "kept for its drop, after the library's")]
    copy: PrivateCopy,
}

impl HostedProgram {
    /// The program's options.
    const OPTIONS: [&'static str; 3] = ["addressing", "alive", "order"];

    /// True if `name` is the path of a file, rather than the name of a built-in program.
    pub fn is_path(name: &str) -> bool {
        let extension = Path::new(name).extension();
        let known = ["so", "dll", "dylib"];
        name.contains(['/', std::path::MAIN_SEPARATOR])
            || extension
                .is_some_and(|own| known.iter().any(|known| own.eq_ignore_ascii_case(known)))
    }

    /// Checks the options as far as possible without loading the program.
    ///
    /// # Errors
    ///
    /// The option does not exist, or does not accept the value.
    pub fn check_options(name: &str, options: &[(String, String)]) -> Result<(), ProgramError> {
        settings(options)
            .map(drop)
            .map_err(|mistake| error(name, mistake))
    }

    /// Loads the program at `path` and initialises it.
    ///
    /// # Errors
    ///
    /// The file cannot be read, cannot be loaded here, or does not contain a program; or an option is wrong.
    pub fn load(path: &Path, options: &[(String, String)]) -> Result<Self, ProgramError> {
        let name = path.display().to_string();
        Self::try_load(path, options).map_err(|mistake| error(&name, mistake))
    }

    fn try_load(path: &Path, options: &[(String, String)]) -> Result<Self, Mistake> {
        let settings = settings(options)?;
        let bytes = read(path)?;
        object::check(&bytes, Machine::own())?;
        let copy = PrivateCopy::new(&bytes, path).map_err(|(path, error)| {
            let what = format!("cannot be copied to {}: {error}", path.display());
            Mistake::new(what, TEMPORARY)
        })?;
        let library = Library::load(copy.path()).map_err(|words| not_loaded(&words, &copy))?;
        let (compiled, declared) = Compiled::begin(library)?;
        // The addressing is unknown until `fit`; with at least one of the two the plan must be possible.
        let plan = |addressing| Plan::new(&declared, &settings, addressing, None);
        let plan = plan(Addressing::Bytes)
            .or_else(|refusal| plan(Addressing::Elements).map_err(|_| refusal))?;
        Ok(Self {
            name: path.display().to_string(),
            compiled,
            declared,
            settings,
            plan,
            tick: 0,
            copy: copy.loaded(),
        })
    }
}

impl Program for HostedProgram {
    fn name(&self) -> &str {
        &self.name
    }

    fn interval(&self) -> Nanos {
        self.compiled.tick_time().unwrap_or(super::INTERVAL)
    }

    fn fit(&mut self, table: &SignalTable, addressing: Addressing) -> Result<(), ProgramError> {
        let plan = Plan::new(&self.declared, &self.settings, addressing, Some(table));
        self.plan = plan.map_err(|mistake| error(&self.name, mistake))?;
        Ok(())
    }

    fn input_bytes(&self) -> usize {
        self.plan.bytes(Area::Input)
    }

    fn output_bytes(&self) -> usize {
        self.plan.bytes(Area::Output)
    }

    fn scan(&mut self, scan: &mut Scan<'_>) {
        for input in &self.plan.inputs {
            let value = input.take(scan.inputs);
            self.compiled.write(input.variable, value);
        }
        for variable in &self.plan.alive {
            self.compiled.write(*variable, u64::from(scan.alive));
        }
        self.compiled.scan(scan.now, self.tick);
        self.tick = self.compiled.next_tick(self.tick);
        for output in &self.plan.outputs {
            output.put(self.compiled.read(output.variable), scan.outputs);
        }
    }
}

fn error(name: &str, mistake: Mistake) -> ProgramError {
    ProgramError::Unfit {
        program: name.to_owned(),
        mistake,
    }
}

fn settings(options: &[(String, String)]) -> Result<Settings, Mistake> {
    let mut settings = Settings::default();
    let bad = |option: &str, value: &str, right: String| {
        let what = format!("cannot have \"{value}\" as its option \"{option}\"");
        Err(Mistake::new(what, right))
    };
    for (option, value) in options {
        match option.as_str() {
            "addressing" => {
                settings.addressing = Some(match value.as_str() {
                    "bytes" => Addressing::Bytes,
                    "iec" => Addressing::Elements,
                    _ => return bad(option, value, "write \"bytes\" or \"iec\"".to_owned()),
                });
            }
            "order" => {
                let mut orders = ByteOrder::ALL.into_iter();
                let Some(order) = orders.find(|order| order.name() == value) else {
                    let names = ByteOrder::ALL.map(ByteOrder::name);
                    return bad(option, value, format!("write {}", list(&names, "or")));
                };
                settings.order = order;
            }
            "alive" => {
                match value.parse::<Address>() {
                    Ok(Address {
                        area: Area::Input,
                        width: tickbus_image::signal::Width::Bit,
                        ..
                    }) => {}
                    _ => {
                        return bad(
                            option,
                            value,
                            "write a bit in %I, such as %IX3.0".to_owned(),
                        );
                    }
                }
                settings.alive = Some(value.clone());
            }
            _ => {
                return Err(Mistake::new(
                    format!("has no option \"{option}\""),
                    format!("it takes {}", list(&HostedProgram::OPTIONS, "and")),
                ));
            }
        }
    }
    Ok(settings)
}

/// The contents of the file.
fn read(path: &Path) -> Result<Vec<u8>, Mistake> {
    let cannot = |error: &io::Error| match error.kind() {
        ErrorKind::NotFound => Mistake::new(
            "is not there",
            "check the path; one in a driver.cfg counts from the folder of that file",
        ),
        ErrorKind::PermissionDenied => Mistake::new("may not be read", "check its permissions"),
        _ => Mistake::new(
            format!("cannot be read: {error}"),
            "check the path and the disk",
        ),
    };
    let metadata = fs::metadata(path).map_err(|error| cannot(&error))?;
    if !metadata.is_file() {
        return Err(Mistake::new(
            "is no file",
            "name the shared object, such as ./program.so",
        ));
    }
    if metadata.len() > FILE_LIMIT {
        return Err(Mistake::new(
            format!("has {} bytes", metadata.len()),
            format!("a program has at most {FILE_LIMIT}; check the path"),
        ));
    }
    fs::read(path).map_err(|error| cannot(&error))
}

/// The remedy when the folder for temporary files cannot be used.
const TEMPORARY: &str = "tickbus loads a private copy of the program; set TMPDIR (on Windows TMP) to a folder \
    with room, from which programs may be run";

/// The refusal for a loader's message.
fn not_loaded(words: &str, copy: &PrivateCopy) -> Mistake {
    let words = words.replace(&copy.path().display().to_string(), "it");
    let right = if words.contains("undefined symbol") {
        "compile in all C files that iec2c wrote, and the glue with the same LOCATED_VARIABLES.h; functions of \
         other libraries need these to be linked"
    } else if words.contains("failed to map") || words.contains("not permitted") {
        TEMPORARY
    } else {
        "check that the libraries that it needs are there, and build it anew"
    };
    Mistake::new(format!("cannot be loaded ({words})"), right)
}

/// A copy of the program's file that is loaded only once, so that its global variables are separate, and that does not
/// change when the original file is rebuilt.
#[derive(Debug)]
struct PrivateCopy(Option<PathBuf>);

impl PrivateCopy {
    fn new(bytes: &[u8], original: &Path) -> Result<Self, (PathBuf, io::Error)> {
        static COPIES: AtomicU64 = AtomicU64::new(0);
        let folder = std::env::temp_dir();
        let name = original.file_name().unwrap_or_default().to_string_lossy();
        // Another process with the same id may have left a file of that name.
        for _ in 0..1000 {
            let number = COPIES.fetch_add(1, Ordering::Relaxed);
            let path = folder.join(format!("tickbus-{}-{number}-{name}", std::process::id()));
            let mut options = OpenOptions::new();
            options.write(true).create_new(true);
            #[cfg(unix)]
            std::os::unix::fs::OpenOptionsExt::mode(&mut options, 0o700);
            return match options.open(&path) {
                Ok(mut file) => {
                    let copy = Self(Some(path.clone()));
                    file.write_all(bytes).map_err(|error| (path, error))?;
                    Ok(copy)
                }
                Err(error) if error.kind() == ErrorKind::AlreadyExists => continue,
                Err(error) => Err((path, error)),
            };
        }
        Err((folder, ErrorKind::AlreadyExists.into()))
    }

    fn path(&self) -> &Path {
        self.0.as_deref().unwrap_or(Path::new(""))
    }

    /// The copy after loading. Where a file can be deleted while in use, it is deleted at once, so that even a killed
    /// process does not leave it behind.
    fn loaded(mut self) -> Self {
        if cfg!(unix) {
            self.remove();
        }
        self
    }

    fn remove(&mut self) {
        if let Some(path) = self.0.take()
            && let Err(error) = fs::remove_file(&path)
        {
            log::warn!("{} could not be removed: {error}", path.display());
        }
    }
}

impl Drop for PrivateCopy {
    fn drop(&mut self) {
        self.remove();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[cfg(unix)]
    #[test]
    fn the_copy_of_a_program_is_for_nobody_else() {
        use std::os::unix::fs::PermissionsExt as _;

        let copy = PrivateCopy::new(b"secret", Path::new("plc.so")).expect("a copy");
        let rights = std::fs::metadata(copy.path())
            .expect("it is there")
            .permissions();
        assert_eq!(rights.mode() & 0o077, 0);
    }

    fn refusal(path: &str, options: &[(&str, &str)]) -> String {
        let options: Vec<_> = options
            .iter()
            .map(|(key, value)| ((*key).to_owned(), (*value).to_owned()))
            .collect();
        let error = HostedProgram::load(Path::new(path), &options);
        error.expect_err("refused").to_string()
    }

    #[test]
    fn paths_are_told_from_names() {
        for path in [
            "./program.so",
            "plc/rig",
            "/opt/p.so",
            "program.so",
            "P.DLL",
            "p.dylib",
        ] {
            assert!(HostedProgram::is_path(path), "{path}");
        }
        for name in ["rig", "mirror", "my.program", "rig.cfg", ""] {
            assert!(!HostedProgram::is_path(name), "{name}");
        }
    }

    #[test]
    fn wrong_options_are_told_before_anything_is_loaded() {
        for (option, value, says) in [
            (
                "adressing",
                "iec",
                "has no option \"adressing\"; it takes \"addressing\", \"alive\" and \"order\"",
            ),
            (
                "addressing",
                "words",
                "cannot have \"words\" as its option \"addressing\"; write \"bytes\" or \"iec\"",
            ),
            (
                "order",
                "big",
                "cannot have \"big\" as its option \"order\"; write \"ABCD\", \"CDAB\", \"BADC\" or \"DCBA\"",
            ),
            (
                "alive",
                "%QX0.0",
                "cannot have \"%QX0.0\" as its option \"alive\"; write a bit in %I, such as %IX3.0",
            ),
        ] {
            assert_eq!(
                refusal("no/such/p.so", &[(option, value)]),
                format!("the PLC program \"no/such/p.so\" {says}")
            );
        }
    }

    #[test]
    fn what_is_no_program_is_told() {
        assert_eq!(
            refusal("no/such/p.so", &[]),
            "the PLC program \"no/such/p.so\" is not there; check the path; one in a driver.cfg counts from \
             the folder of that file"
        );
        assert!(refusal("./src", &[]).contains("\"./src\" is no file; "));
        let text = concat!(env!("CARGO_MANIFEST_DIR"), "/Cargo.toml");
        let words = if cfg!(windows) {
            "Cargo.toml\" cannot be loaded ("
        } else {
            "Cargo.toml\" is no shared object; build"
        };
        assert!(refusal(text, &[]).contains(words));
    }
}
