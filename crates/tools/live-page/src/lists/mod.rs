//! The lists of signals and the stored sets of one driver, in a file beside its driver.cfg.
//!
//! The file is read at each request and never kept: people edit it as well, and the page shows what it has now.

mod edit;
mod file;

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use serde_json::json;
use tickbus_base::toml_text::{did_you_mean, shown};
use tickbus_image::signal::Signal;
use tickbus_web::Refused;

use crate::on_disk::{OnDisk, Unwritten};
use crate::value::parse;
use edit::Entry;
use file::{Contents, read};

/// The largest request that changes a list, in bytes.
pub(crate) const LARGEST: usize = 1 << 20;

/// A named list of signals, as in the file and in a request.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
struct List {
    name: String,
    /// The signals at the top, in their order.
    pins: Vec<String>,
    group: String,
    order: String,
    /// The format of values, by signal.
    formats: BTreeMap<String, String>,
}

/// Values of several signals that are forced together.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
struct Set {
    name: String,
    /// Signals with their values, as they are forced.
    values: Vec<(String, String)>,
}

/// A change of one list or set: the value that the page knows, and the new value; `null` means that the list or set does
/// not exist.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Replace<T> {
    was: Option<T>,
    is: Option<T>,
}

/// The file of a driver, and the signals that its lists can have.
#[derive(Debug)]
pub(crate) struct Beside {
    pub(crate) path: PathBuf,
    pub(crate) signals: Vec<Signal>,
}

/// The file as JSON.
pub(crate) fn document(Beside { path, signals }: &Beside) -> String {
    let file = name_of(path);
    let opened = OnDisk::open(path);
    let (contents, mistakes) = match &opened {
        Ok(disk) => read(&file, disk.text()),
        Err(why) => (Contents::default(), vec![without_folder(path, why)]),
    };
    let told = told(&contents, signals);
    let Contents { lists, sets, .. } = contents;
    json!({ "file": file, "lists": lists, "sets": sets, "told": told, "mistakes": mistakes })
        .to_string()
}

/// Carries out a change of a `list` or a `set`.
pub(crate) fn change(beside: &Beside, what: &str, body: &str) -> Result<(), Refused> {
    match what {
        "list" => replace::<List>(beside, body),
        "set" => replace::<Set>(beside, body),
        _ => Err(refused(
            404,
            "there is no such part of the file; PUT /lists/ID/list or /lists/ID/set",
        )),
    }
}

fn replace<T>(Beside { path, signals }: &Beside, body: &str) -> Result<(), Refused>
where
    T: Entry + for<'de> Deserialize<'de>,
{
    let file = name_of(path);
    let change: Replace<T> = serde_json::from_str(body).map_err(|error| {
        refused(
            400,
            format!("the request is no change of a list ({error}); send {{\"was\": …, \"is\": …}}"),
        )
    })?;
    if let Some(is) = &change.is {
        is.check(signals)
            .map_err(|text| Refused { status: 400, text })?;
    }
    let mut disk = OnDisk::open(path).map_err(|why| unsaved(path, &why))?;
    let (contents, mistakes) = read(&file, disk.text());
    if let Some(first) = mistakes.first() {
        let text = format!("{first}; nothing is saved until that is corrected, by hand");
        return Err(Refused { status: 409, text });
    }
    let name = [&change.was, &change.is].into_iter().flatten().next();
    let name = name.map(|entry| entry.name().to_owned());
    let name = name.ok_or_else(|| refused(400, "neither \"was\" nor \"is\" has a list"))?;
    let found = T::all(&contents).iter().find(|entry| entry.name() == name);
    if found != change.was.as_ref() {
        let name = shown(&name);
        let text = if change.was.is_none() {
            format!("{file} has a \"{name}\" already, which is not overwritten; take another name")
        } else {
            format!(
                "\"{name}\" has been changed in {file} meanwhile, and is not overwritten; look at it, and make your \
                 change again"
            )
        };
        return Err(Refused { status: 409, text });
    }
    let text = edit::replaced(disk.text(), &name, change.is.as_ref())
        .map_err(|why| unsaved(path, &why))?;
    // The reader has all rules of names and values.
    if let (_, mistakes) = read(&file, &text)
        && let Some(first) = mistakes.into_iter().next()
    {
        let (_, what) = first.split_once(": ").unwrap_or(("", &first));
        return Err(refused(400, what));
    }
    match disk.write(&text) {
        Ok(()) => Ok(()),
        Err(Unwritten::Changed(_)) => Err(refused(
            409,
            format!("{file} has just been changed by another program; make your change again"),
        )),
        Err(Unwritten::Refused(why)) => Err(unsaved(path, &why)),
    }
}

fn refused(status: u16, text: impl Into<String>) -> Refused {
    let text = text.into();
    Refused { status, text }
}

/// The file is as it was.
fn unsaved(path: &Path, why: &str) -> Refused {
    let (file, why) = (name_of(path), without_folder(path, why));
    let text = format!("{file} is not saved, and is as it was: {why}");
    Refused { status: 409, text }
}

/// A text about the file without its folder, which is of no use to somebody at another computer.
fn without_folder(path: &Path, why: &str) -> String {
    // Texts of the system have the path that it found.
    let found = fs::canonicalize(path).unwrap_or_else(|_| path.to_owned());
    let why = why.replace(&*found.to_string_lossy(), &name_of(&found));
    why.replace(&*path.to_string_lossy(), &name_of(path))
}

fn name_of(path: &Path) -> String {
    let name = path.file_name().unwrap_or_default();
    name.to_string_lossy().into_owned()
}

/// The signals in the file that the driver does not have, and the values that do not fit.
fn told(contents: &Contents, signals: &[Signal]) -> Vec<String> {
    let names: Vec<&str> = signals.iter().map(|signal| signal.name.as_str()).collect();
    let mut told = Vec::new();
    for (line, owner, name) in &contents.places {
        if !names.contains(&name.as_str()) {
            let right = did_you_mean(name, "signals", &names);
            let name = shown(name);
            told.push(format!(
                "line {line}: {owner} has \"{name}\", and there is no such signal; {right}"
            ));
        }
    }
    for set in &contents.sets {
        for (name, value) in &set.values {
            let signal = signals.iter().find(|signal| signal.name == *name);
            if let Some(Err(why)) = signal.map(|signal| parse(value, signal)) {
                told.push(format!("the set \"{}\": {why}", shown(&set.name)));
            }
        }
    }
    told
}

#[cfg(test)]
mod tests;
