//! Building a wrapped block with `plc/build`, once for each content.

use std::env;
use std::fs;
use std::hash::Hasher as _;
use std::io;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::atomic::{AtomicU32, Ordering};

use siphasher::sip::SipHasher24;

/// The script and the glue of this tickbus.
const FILES: [(&str, &str); 3] = [
    ("build", include_str!("plc/build")),
    ("glue/tickbus_plc.c", include_str!("plc/tickbus_plc.c")),
    ("glue/tickbus_plc.h", include_str!("plc/tickbus_plc.h")),
];

/// The options of `plc/build`, with the lines of the source for messages of the C compiler.
const IEC2C_OPTIONS: &str = "-f -l -p -r -R -a -O l";

/// The environment variables that `plc/build` reads.
const VARIABLES: [&str; 5] = ["IEC2C", "IEC2C_LIB", "IEC2C_OPTIONS", "CC", "CFLAGS"];

/// Why a block was not built.
pub(super) enum Unbuilt {
    /// Mistakes in the program: line, column if known, and the compiler's words.
    Mistakes(Vec<(usize, usize, String)>),
    /// Another reason, such as a compiler that is not installed.
    Reason(String),
}

impl From<io::Error> for Unbuilt {
    fn from(error: io::Error) -> Self {
        Self::Reason(format!("the block cannot be built: {error}"))
    }
}

/// The shared object of a program: from the cache, or built into it.
pub(super) fn built(name: &str, text: &str) -> Result<PathBuf, Unbuilt> {
    static NUMBER: AtomicU32 = AtomicU32::new(0);
    let folder = cache().join(format!("{:016x}", key(text)));
    let object = folder.join(format!("{name}.so"));
    if object.is_file() {
        return Ok(object);
    }
    // Several processes can build the same block, and each renames a whole file.
    let number = NUMBER.fetch_add(1, Ordering::Relaxed);
    let work = folder.join(format!("{}-{number}", std::process::id()));
    let made = made(&work, name, text).and_then(|made| {
        fs::rename(made, &object)?;
        Ok(object)
    });
    let _ = fs::remove_dir_all(&work);
    if made.is_err() {
        // Only an empty folder is removed.
        let _ = fs::remove_dir(&folder);
    }
    made
}

fn made(work: &Path, name: &str, text: &str) -> Result<PathBuf, Unbuilt> {
    fs::create_dir_all(work.join("glue"))?;
    for (file, content) in FILES {
        fs::write(work.join(file), content)?;
    }
    let (source, object) = (work.join(format!("{name}.st")), work.join("program.so"));
    fs::write(&source, text)?;
    let mut command = Command::new("bash");
    command.arg(work.join("build")).args([&source, &object]);
    if env::var_os("IEC2C_OPTIONS").is_none() {
        command.env("IEC2C_OPTIONS", IEC2C_OPTIONS);
    }
    let output = command.output().map_err(|error| {
        Unbuilt::Reason(format!(
            "bash cannot be started: {error}; it runs the compilers"
        ))
    })?;
    if output.status.success() {
        return Ok(object);
    }
    let words = String::from_utf8_lossy(&output.stderr);
    let source = source.display().to_string();
    let mistakes: Vec<_> = words
        .lines()
        .filter_map(|line| mistake(line, &source))
        .collect();
    if !mistakes.is_empty() {
        return Err(Unbuilt::Mistakes(mistakes));
    }
    let own = words
        .lines()
        .find_map(|line| line.strip_prefix("plc/build: "));
    let reason = match own {
        Some(reason) if !reason.ends_with("was not compiled") => reason.to_owned(),
        _ => {
            // A name of the source can disturb iec2c's library, whose lines say nothing to the user.
            let mut lines = words.lines();
            let first = lines.find(|line| line.contains("undefined ") || line.contains("error: "));
            format!(
                "the block cannot be built: {}",
                first.unwrap_or(words.trim())
            )
        }
    };
    Err(Unbuilt::Reason(reason))
}

/// Reads `FILE:12-5..12-9: error: words` of `iec2c`, and `FILE:12:5: error: words` of a C compiler.
fn mistake(line: &str, source: &str) -> Option<(usize, usize, String)> {
    let rest = line.strip_prefix(source)?.strip_prefix(':')?;
    let (_, words) = rest.split_once("error: ")?;
    let mut numbers = rest.split(|c: char| !c.is_ascii_digit());
    let line = numbers.next()?.parse().ok()?;
    let column = numbers.next().and_then(|column| column.parse().ok());
    Some((
        line,
        column.unwrap_or(1),
        words.trim_end_matches(['.', ' ']).to_owned(),
    ))
}

/// A number for the program and everything that it is built with.
fn key(text: &str) -> u64 {
    let mut hasher = SipHasher24::new();
    let mut add = |part: &[u8]| {
        hasher.write_u64(part.len() as u64);
        hasher.write(part);
    };
    add(text.as_bytes());
    for (_, content) in FILES {
        add(content.as_bytes());
    }
    for variable in VARIABLES {
        let value = env::var_os(variable).unwrap_or_default();
        add(value.as_encoded_bytes());
    }
    // Another compiler under the same name has another size or time.
    if let Some(file) = compiler().and_then(|file| fs::metadata(file).ok()) {
        add(format!("{} {:?}", file.len(), file.modified().ok()).as_bytes());
    }
    hasher.finish()
}

fn compiler() -> Option<PathBuf> {
    let named = PathBuf::from(env::var_os("IEC2C").unwrap_or_else(|| "iec2c".into()));
    if named.components().count() > 1 {
        return Some(named);
    }
    let path = env::var_os("PATH")?;
    let mut files = env::split_paths(&path).map(|folder| folder.join(&named));
    files.find(|file| file.is_file())
}

/// The user's folder for files that can be made again.
fn cache() -> PathBuf {
    let stated = |name| env::var_os(name).filter(|value| !value.is_empty());
    let folder = stated("XDG_CACHE_HOME").map(PathBuf::from);
    let folder = folder.or_else(|| stated("HOME").map(|home| Path::new(&home).join(".cache")));
    folder
        .unwrap_or_else(env::temp_dir)
        .join("tickbus")
        .join("blocks")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_messages_of_both_compilers_are_read() {
        for (line, read) in [
            (
                "/c/B.st:12-5..12-9: error: invalid statement in function block body",
                Some((12, 5, "invalid statement in function block body")),
            ),
            (
                "/c/B.st:7:3: fatal error: no such file",
                Some((7, 3, "no such file")),
            ),
            (
                "/c/B.st:7:3: warning: an error: maybe",
                Some((7, 3, "maybe")),
            ),
            ("In section: FUNCTION_BLOCK", None),
            ("/c/POUS.c:7:3: error: x", None),
        ] {
            let found = mistake(line, "/c/B.st");
            let read = read.map(|(line, column, words)| (line, column, words.to_owned()));
            assert_eq!(found, read, "{line}");
        }
    }
}
