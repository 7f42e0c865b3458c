//! The files that `tickbus new` writes: a folder that runs, from a few answers.
//!
//! [`plan`] is a function of the [`Answers`] alone: it returns the files, and writes none.

mod answers;
mod simulator;

#[cfg(test)]
mod tests;

use std::fmt::Write as _;
use std::path::PathBuf;

use tickbus_base::toml_text::Mistakes;
use tickbus_driver_cfg::{Config, Kinds};
use tickbus_export::export;
use tickbus_image::signal::{Area, DataType, Signal};

pub use answers::{Answers, Language, Plc};
use simulator::simulator;

/// A file of the new folder.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct NewFile {
    /// The path within the folder.
    pub path: PathBuf,
    /// The text.
    pub text: String,
}

/// Returns the files of the folder, the README last. The driver.cfg may name only these `kinds` of bus.
///
/// # Errors
///
/// The signals of the imported list do not fit the PLC: with every mistake.
pub fn plan(answers: &Answers, kinds: &'static Kinds) -> Result<Vec<NewFile>, Mistakes> {
    let cfg = driver_cfg(answers);
    let config = Config::parse("driver.cfg", &cfg, kinds)?;
    let signals = &config.table.signals;
    let is_tank = answers.signals.is_none();
    let mut files = vec![file("driver.cfg", cfg.clone())];
    let simulator = simulator(answers.language, &answers.name, signals, is_tank);
    if let Some((name, text)) = &simulator {
        files.push(file(name, text.clone()));
    }
    if let Some(target) = answers.plc.target() {
        let exported = export(&config, target)?;
        for each in exported.files {
            files.push(file(&format!("plc/{}", each.name), each.text));
        }
    }
    if let Some(text) = test(signals, is_tank) {
        files.push(file("tests/first.toml", text));
    }
    let has_test = files
        .last()
        .is_some_and(|file| file.path.starts_with("tests"));
    let has_plc = answers.plc.target().is_some();
    files.push(file("README.md", readme(answers, has_plc, has_test)));
    Ok(files)
}

fn file(path: &str, text: String) -> NewFile {
    NewFile {
        path: path.into(),
        text,
    }
}

fn driver_cfg(answers: &Answers) -> String {
    let name = &answers.name;
    let mut text = format!(
        "# The signals of {}, and the bus to its PLC. `tickbus check driver.cfg` lists all mistakes.\n\
         # %I is an input of the PLC, which the machine writes; %Q an output, which it reads.\n\n\
         [driver]\nid   = 1\nname = {}\n{}\n[fieldbus]\nkind    = \"{}\"\n",
        name.replace(|letter: char| letter.is_control(), " "),
        quoted(name),
        if answers.counts_elements {
            "addressing = \"iec\"             # as in the list: %IW1 is the second word\n"
        } else {
            ""
        },
        answers.plc.kind(),
    );
    // Writing to a text cannot fail.
    let _ = match (&answers.address, answers.plc) {
        (Some(address), _) => writeln!(
            text,
            "address = \"{address}\"    # where this end listens; \"0.0.0.0:PORT\" for a PLC on another computer"
        ),
        (None, _) => writeln!(
            text,
            "program = \"mirror\"    # in the place of a PLC: copies each byte of %I to %Q"
        ),
    };
    if answers.plc == Plc::OpcUa {
        text += "anonymous = true                # everybody may log in; docs/opcua.md has users and certificates\n";
    }
    match &answers.signals {
        Some(signals) => text += signals,
        None => text += include_str!("texts/tank.cfg"),
    }
    if answers.language == Language::Replies && answers.signals.is_none() {
        text += include_str!("texts/tank-replies.cfg");
    }
    text
}

/// A text of TOML.
fn quoted(text: &str) -> String {
    let mut quoted = String::from('"');
    for letter in text.chars() {
        match letter {
            '"' | '\\' => quoted.extend(['\\', letter]),
            letter if letter.is_control() => {
                let _ = write!(quoted, "\\u{:04X}", u32::from(letter));
            }
            letter => quoted.push(letter),
        }
    }
    quoted + "\""
}

/// A first test of the PLC's program; `None` for a list without an input.
fn test(signals: &[Signal], is_tank: bool) -> Option<String> {
    if is_tank {
        return Some(include_str!("texts/tank.toml").to_owned());
    }
    let mut inputs = signals.iter().filter(|signal| signal.area == Area::Input);
    let first = inputs.clone().next()?;
    let bit = inputs.find(|signal| signal.data_type == DataType::Bool);
    let input = bit.unwrap_or(first);
    let name = input.name.replace(['"', '\\'], "'");
    // Only the changes of bits are counted without being asked for.
    let (on, off, title, expect) = if bit.is_some() {
        let title = format!("no change is swallowed while {name} switches");
        ("true", "false", title, ", expect = \"nothing swallowed\"")
    } else {
        (
            "1",
            "0",
            format!("the program runs while {name} changes"),
            "",
        )
    };
    let text = include_str!("texts/tags.toml")
        .replace("{{on}}", on)
        .replace("{{off}}", off)
        .replace("{{expect}}", expect)
        .replace("{{input-key}}", &quoted(&input.name))
        .replace("{{title}}", &title);
    Some(text)
}

fn readme(answers: &Answers, has_plc: bool, has_test: bool) -> String {
    let command = word(&answers.command);
    let place = if answers.plc == Plc::None {
        "with a small program in the place of its PLC".to_owned()
    } else {
        format!("for {}", answers.plc.about())
    };
    let name = answers
        .name
        .replace(|letter: char| letter.is_control(), " ");
    let mut text = format!("# {name}\n\nA simulated machine, {place}.\n\n");
    let mut say = |line: String, does: &str| {
        // Writing to a text cannot fail.
        let _ = writeln!(text, "- `{line}`: {does}");
    };
    say(
        format!("{command} check driver.cfg"),
        "the signals, or every mistake in the file",
    );
    say(runs(answers), "the machine");
    if answers.plc != Plc::None {
        say(
            format!("{command} plc mirror --config driver.cfg"),
            "in a second terminal, a PLC to try it with",
        );
    }
    if has_test {
        say(
            format!("{command} test tests"),
            "tests of the PLC's program",
        );
    }
    say(
        format!("{command} studio driver.cfg"),
        "signals and line in a browser",
    );
    text += "\nPaths are those of the computer that made this folder.\n";
    if has_plc {
        text += "The PLC's half is in `plc`, with the steps in its text.\n";
    }
    text
}

/// The command that runs the machine.
fn runs(answers: &Answers) -> String {
    match answers.language {
        Language::Java => {
            let jar = answers.jar.as_deref().unwrap_or("tickbus-0.1.0.jar");
            format!("java -cp {} Machine.java", word(jar))
        }
        Language::Python => format!("{} machine.py", word(&answers.python)),
        Language::C => {
            let (include, library) = answers
                .c
                .clone()
                .unwrap_or_else(|| (".".into(), ".".into()));
            let (include, library) = (word(&include), word(&library));
            format!(
                "cc -I {include} machine.c -L {library} -ltickbus -Wl,-rpath,{library} -o machine && ./machine"
            )
        }
        Language::Replies => format!(
            "{} mirror driver.cfg --replies --page",
            word(&answers.command)
        ),
    }
}

/// A path as one word of a command line.
fn word(path: &str) -> String {
    if path.contains(|letter: char| letter.is_whitespace() || "\"'$&;()".contains(letter)) {
        format!("'{}'", path.replace('\'', "'\\''"))
    } else {
        path.to_owned()
    }
}
