//! `tickbus sync prepare FILE...`: puts a PLC program on virtual time, or undoes that.

use std::collections::BTreeSet;
use std::fs::{self, File};
use std::io::{self, Write as _};
use std::path::{Path, PathBuf};

use crate::cli::Outcome;
use tickbus_base::toml_text::Mistakes;
use tickbus_prepare::{
    Addresses, Settings, Source, is_prepared, is_xml, prepare, structured_text, undo,
};

/// Put a PLC program on virtual time, so that it runs in lock-step with a simulation; --undo takes it off again, byte for byte.
///
/// Takes the sources in Structured Text of one PLC together, or a project as PLCopen XML in Structured Text, LD and FBD. docs/virtual-time-plc.md has the steps for an engineer.
#[expect(
    clippy::struct_excessive_bools,
    reason = "each is a flag of the command line"
)]
#[derive(Debug, clap::Args)]
pub(super) struct Arguments {
    /// The sources of the program.
    #[arg(required = true, value_name = "FILE")]
    files: Vec<PathBuf>,

    /// Take out what was put in.
    #[arg(long, conflicts_with_all = ["go", "ms", "done", "go_end", "done_end", "no_clock"])]
    undo: bool,

    /// Folder for the files, which keep their names [default: beside the first FILE, "prepared", or "original" with --undo].
    #[arg(long, value_name = "DIR", conflicts_with = "in_place")]
    out: Option<PathBuf>,

    /// Write over the sources themselves.
    #[arg(long)]
    in_place: bool,

    /// Overwrite existing files.
    #[arg(long, conflicts_with = "in_place")]
    force: bool,

    /// Where the server writes the number of a step, such as %ID100 [default: a variable without an address].
    #[arg(long, value_name = "ADDRESS", value_parser = address)]
    go: Option<String>,

    /// Where the server writes the virtual time in milliseconds, such as %ID104.
    #[arg(long, value_name = "ADDRESS", value_parser = address)]
    ms: Option<String>,

    /// Where the server reads the number of the last step that was made, such as %QD100.
    #[arg(long, value_name = "ADDRESS", value_parser = address)]
    done: Option<String>,

    /// Where the server writes the number of a step once more, at the other end of what it writes: a step begins when both agree.
    #[arg(long, value_name = "ADDRESS", value_parser = address, requires = "go")]
    go_end: Option<String>,

    /// Where the server reads the number of the last step once more, at the other end of what it reads.
    #[arg(long, value_name = "ADDRESS", value_parser = address, requires = "done")]
    done_end: Option<String>,

    /// A type or function of a library that uses no clock; may be repeated.
    #[arg(long, value_name = "NAME")]
    no_clock: Vec<String>,

    /// Where a comment ends that has another one in it: at the first *), or at its own [default: whichever makes sense of the source].
    #[arg(long, value_name = "HOW")]
    comments: Option<Comments>,

    /// Write a project as PLCopen XML as one file of Structured Text, and prepare nothing: ladder and function block diagrams become statements [default --out: beside it, "text"].
    #[arg(long, conflicts_with_all = ["undo", "in_place", "go", "ms", "done", "go_end", "done_end", "no_clock", "comments"])]
    text: bool,
}

/// The reading of comments within comments.
#[derive(Clone, Copy, Debug, clap::ValueEnum)]
enum Comments {
    /// At the first *), as iec2c does without options.
    Flat,
    /// At its own *), as iec2c -n does.
    Nested,
}

/// Parses an address of 32 bits, and returns it as the program needs it.
fn address(text: &str) -> Result<String, String> {
    let capitals = text.to_ascii_uppercase();
    let rest = ["%ID", "%QD", "%MD"]
        .iter()
        .find_map(|area| capitals.strip_prefix(area));
    let is_number = |rest: &str| {
        rest.split('.')
            .all(|number| !number.is_empty() && number.bytes().all(|byte| byte.is_ascii_digit()))
    };
    match rest {
        Some(rest) if is_number(rest) => Ok(capitals),
        _ => Err("write the address of a double word, such as %ID100".to_owned()),
    }
}

pub(super) fn run(arguments: &Arguments) -> Outcome {
    let mut stderr = std::io::stderr().lock();
    match changed(arguments).and_then(|made| write(arguments, made)) {
        Ok((paths, notes)) => {
            for note in notes {
                let _ = writeln!(stderr, "note: {note}");
            }
            for path in &paths {
                println!("{}", path.display());
            }
            println!("prepare: ok files={}", paths.len());
            Outcome::Done
        }
        Err(mistakes) => {
            let count: usize = mistakes.iter().map(Mistakes::len).sum();
            for mistakes in &mistakes {
                let _ = writeln!(stderr, "{mistakes}");
            }
            let _ = writeln!(stderr, "prepare: failed mistakes={count}");
            Outcome::WrongInput
        }
    }
}

/// The resulting files, and remarks.
struct Made {
    files: Vec<Vec<u8>>,
    notes: Vec<String>,
}

fn changed(arguments: &Arguments) -> Result<Made, Vec<Mistakes>> {
    let (sources, wrong) = split(arguments.files.iter().map(|path| read(path)));
    if !wrong.is_empty() {
        return Err(wrong);
    }
    if arguments.undo {
        // Some files of a program may need no change.
        let any = sources.iter().any(is_prepared);
        let mut notes = Vec::new();
        let (files, wrong) = split(sources.iter().map(|source| {
            if !any || is_prepared(source) {
                return undo(source);
            }
            notes.push(format!("{}: there was nothing to take out", source.name));
            Ok(source.bytes.clone())
        }));
        return if wrong.is_empty() {
            Ok(Made { files, notes })
        } else {
            Err(wrong)
        };
    }
    if arguments.text {
        let (files, wrong) = split(sources.iter().map(as_text));
        let notes = Vec::new();
        return if wrong.is_empty() {
            Ok(Made { files, notes })
        } else {
            Err(wrong)
        };
    }
    let settings = Settings {
        addresses: Addresses {
            go: arguments.go.clone(),
            ms: arguments.ms.clone(),
            done: arguments.done.clone(),
            go_end: arguments.go_end.clone(),
            done_end: arguments.done_end.clone(),
        },
        no_clock: arguments.no_clock.clone(),
        comments: arguments.comments.map(|comments| match comments {
            Comments::Flat => tickbus_prepare::Comments::Flat,
            Comments::Nested => tickbus_prepare::Comments::Nested,
        }),
    };
    let made = prepare(&sources, &settings)?;
    Ok(Made {
        files: made.files,
        notes: made.notes,
    })
}

fn as_text(source: &Source) -> Result<Vec<u8>, Mistakes> {
    if is_xml(source) {
        return structured_text(source).map(String::into_bytes);
    }
    let right = "name a project as PLCopen XML, or leave --text out";
    Err(Mistakes::of_file(&source.name, "this is not XML", right))
}

fn split<T>(results: impl Iterator<Item = Result<T, Mistakes>>) -> (Vec<T>, Vec<Mistakes>) {
    let (mut found, mut wrong) = (Vec::new(), Vec::new());
    for result in results {
        match result {
            Ok(one) => found.push(one),
            Err(mistakes) => wrong.push(mistakes),
        }
    }
    (found, wrong)
}

fn read(path: &Path) -> Result<Source, Mistakes> {
    let name = path.display().to_string();
    match fs::read(path) {
        Ok(bytes) => Ok(Source { name, bytes }),
        Err(error) => Err(Mistakes::of_file(
            &name,
            format!("this file cannot be read: {error}"),
            "check the path and the name",
        )),
    }
}

/// Writes all files, or none if one of them would overwrite another file.
fn write(arguments: &Arguments, made: Made) -> Result<(Vec<PathBuf>, Vec<String>), Vec<Mistakes>> {
    let wrong = |path: &Path, what: &str, right: &str| {
        Mistakes::of_file(&path.display().to_string(), what, right)
    };
    let paths = if arguments.in_place {
        arguments.files.clone()
    } else {
        let default = match (arguments.undo, arguments.text) {
            (true, _) => "original",
            (_, true) => "text",
            _ => "prepared",
        };
        let folder = arguments.out.clone();
        let folder = folder.unwrap_or_else(|| arguments.files[0].with_file_name(default));
        let name = |path: &PathBuf| {
            let path = folder.join(path.file_name().unwrap_or_default());
            if arguments.text {
                path.with_extension("st")
            } else {
                path
            }
        };
        let paths: Vec<PathBuf> = arguments.files.iter().map(name).collect();
        let sources = arguments.files.iter().map(fs::canonicalize);
        let sources: BTreeSet<PathBuf> = sources.filter_map(Result::ok).collect();
        let mut names = BTreeSet::new();
        let refused = paths.iter().filter_map(|path| {
            let target = fs::canonicalize(path);
            if !names.insert(path) {
                let what = "two sources have this name";
                Some(wrong(
                    path,
                    what,
                    "give one another name, or add --in-place",
                ))
            } else if target.is_ok_and(|target| sources.contains(&target)) {
                let what = "this is one of the sources";
                Some(wrong(path, what, "name another --out, or add --in-place"))
            } else if !arguments.force && path.symlink_metadata().is_ok() {
                let what = "this file is there already";
                Some(wrong(path, what, "name another --out, or add --force"))
            } else {
                None
            }
        });
        let refused: Vec<Mistakes> = refused.collect();
        if !refused.is_empty() {
            return Err(refused);
        }
        fs::create_dir_all(&folder).map_err(|error| {
            let what = format!("this folder cannot be made: {error}");
            vec![wrong(&folder, &what, "name another --out")]
        })?;
        paths
    };
    replace_all(&paths, &made.files).map_err(|(path, error)| {
        let what = format!("this file cannot be written: {error}");
        vec![wrong(&path, &what, "check the folder")]
    })?;
    Ok((paths, made.notes))
}

/// Writes all files next to their targets first, and renames them when all are complete.
fn replace_all(paths: &[PathBuf], files: &[Vec<u8>]) -> Result<(), (PathBuf, io::Error)> {
    let mut parts: Vec<(PathBuf, PathBuf)> = Vec::new();
    let mut written = Ok(());
    for (path, bytes) in paths.iter().zip(files) {
        // A link stays a link: its target is replaced.
        let target = fs::canonicalize(path).unwrap_or_else(|_| path.clone());
        let mut part = target.as_os_str().to_owned();
        part.push(".part");
        let part = PathBuf::from(part);
        let result = write_part(&target, &part, bytes);
        parts.push((part, target));
        if let Err(error) = result {
            written = Err((path.clone(), error));
            break;
        }
    }
    if written.is_ok() {
        for ((part, target), path) in parts.iter().zip(paths) {
            if let Err(error) = fs::rename(part, target) {
                written = Err((path.clone(), error));
                break;
            }
        }
    }
    if written.is_err() {
        for (part, _) in &parts {
            let _ = fs::remove_file(part);
        }
    }
    written
}

/// Writes a complete file, with the permissions of the file that it will replace.
fn write_part(target: &Path, part: &Path, bytes: &[u8]) -> io::Result<()> {
    let old = fs::metadata(target).ok();
    if old.as_ref().is_some_and(fs::Metadata::is_dir) {
        return Err(io::ErrorKind::IsADirectory.into());
    }
    let mut file = File::create(part)?;
    file.write_all(bytes)?;
    file.sync_all()?;
    old.map_or(Ok(()), |old| file.set_permissions(old.permissions()))
}
