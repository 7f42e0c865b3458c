//! `tickbus new FOLDER`: a folder that runs.

use std::env::consts::{DLL_PREFIX, DLL_SUFFIX, EXE_SUFFIX};
use std::fs;
use std::io::{self, BufRead as _, IsTerminal as _, Write as _};
use std::path::{Path, PathBuf};

use clap::builder::{PossibleValuesParser, TypedValueParser};

use super::Outcome;
use super::lab::{address, say};
use tickbus_base::toml_text::nearest;
use tickbus_driver_cfg::{Config, Kinds};
use tickbus_image::signal::Addressing;
use tickbus_import::{ImportOptions, import};
use tickbus_net::Address;
use tickbus_starter::{Answers, Language, NewFile, Plc, plan};

/// Make a folder that runs: a driver.cfg, a simulator to fill in, the PLC's half, a test, and a README with the commands.
///
/// What the options do not say is asked on a terminal. The machine is a tank with a valve, or has the signals of a list of tags.
#[derive(Debug, clap::Args)]
pub(super) struct Arguments {
    /// The folder, which must be new or empty.
    folder: PathBuf,

    /// The name of the machine [default: that of the folder].
    #[arg(long)]
    name: Option<String>,

    /// The PLC.
    #[arg(long, value_parser = named(&Plc::ALL, Plc::name))]
    plc: Option<Plc>,

    /// Where the machine listens [default: 127.0.0.1 and the port of the PLC's bus].
    #[arg(long, value_name = "HOST:PORT", value_parser = address)]
    address: Option<Address>,

    /// The language of the simulator.
    #[arg(long, value_parser = named(&Language::ALL, Language::name))]
    simulator: Option<Language>,

    /// A list of tags as `tickbus import` reads it, whose signals the machine gets.
    #[arg(long, value_name = "FILE")]
    tags: Option<PathBuf>,
}

/// Parses one of these by its name.
fn named<T: Copy + Send + Sync + 'static>(
    all: &'static [T],
    name: fn(T) -> &'static str,
) -> impl TypedValueParser<Value = T> {
    PossibleValuesParser::new(all.iter().map(move |each| name(*each))).map(move |text| {
        let found = all.iter().find(|each| name(**each) == text);
        *found.expect("a possible value")
    })
}

pub(super) fn run(arguments: &Arguments, kinds: &'static Kinds) -> Outcome {
    match make(arguments, kinds) {
        Ok(count) => {
            say(
                "new",
                &format!("ok folder={} files={count}", arguments.folder.display()),
            );
            Outcome::Done
        }
        Err((why, outcome)) => {
            eprintln!("{why}\nnew: failed");
            outcome
        }
    }
}

type Failure = (String, Outcome);

fn wrong(why: impl Into<String>) -> Failure {
    (why.into(), Outcome::WrongInput)
}

/// Returns the number of files.
fn make(arguments: &Arguments, kinds: &'static Kinds) -> Result<usize, Failure> {
    let folder = &arguments.folder;
    is_free(folder)?;
    let answers = ask(arguments, kinds)?;
    let files = plan(&answers, kinds).map_err(|mistakes| match &answers.signals {
        Some(_) => {
            let tags = arguments.tags.as_deref().unwrap_or(folder).display();
            let plc = answers.plc.about();
            wrong(format!("{tags}: the signals do not fit {plc}:\n{mistakes}"))
        }
        // Such as a name with a control character.
        None => wrong(format!("the answers do not fit:\n{mistakes}")),
    })?;
    for file in &files {
        write(folder, file).map_err(|error| {
            let path = folder.join(&file.path);
            wrong(format!("{}: cannot be written: {error}", path.display()))
        })?;
    }
    let readme = files
        .last()
        .map(|file| file.text.as_str())
        .unwrap_or_default();
    for line in readme.lines().filter_map(|line| line.strip_prefix("- ")) {
        say("new", line);
    }
    Ok(files.len())
}

fn is_free(folder: &Path) -> Result<(), Failure> {
    let shown = folder.display();
    match fs::read_dir(folder).map(|mut entries| entries.next().is_none()) {
        Ok(true) => Ok(()),
        Ok(false) => Err(wrong(format!(
            "{shown}: this folder has files; name a new one, nothing is overwritten"
        ))),
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(()),
        Err(error) => Err(wrong(format!(
            "{shown}: this is no folder for new files: {error}"
        ))),
    }
}

fn write(folder: &Path, file: &NewFile) -> io::Result<()> {
    let path = folder.join(&file.path);
    if let Some(parent) = path.parent() {
        fs::create_dir_all(parent)?;
    }
    fs::File::create_new(path)?.write_all(file.text.as_bytes())
}

/// The answers: from the options, and the others from the terminal.
fn ask(arguments: &Arguments, kinds: &'static Kinds) -> Result<Answers, Failure> {
    let is_asked = io::stdin().is_terminal() && io::stderr().is_terminal();
    let missing = |option: &str| {
        let why = format!("new: --{option} is missing, and there is no terminal to ask on");
        (why, Outcome::Usage)
    };
    // One that is there may have another name in the command, such as `.`.
    let of_folder =
        fs::canonicalize(&arguments.folder).unwrap_or_else(|_| arguments.folder.clone());
    let usual = of_folder.file_name().map_or_else(
        || "Machine".into(),
        |name| name.to_string_lossy().into_owned(),
    );
    let name = match &arguments.name {
        Some(name) => name.clone(),
        None if is_asked => line(&format!("Name of the machine [{usual}]"))?.unwrap_or(usual),
        None => usual,
    };
    let plc = match arguments.plc {
        Some(plc) => plc,
        None if is_asked => choose("Which PLC?", &Plc::ALL, Plc::name, Plc::about)?,
        None => return Err(missing("plc")),
    };
    let address = match (&arguments.address, plc.port()) {
        (_, None) => None,
        (Some(address), Some(_)) => Some(address.clone()),
        (None, Some(port)) => {
            let usual = Address::local(port);
            Some(if is_asked { listen(&usual)? } else { usual })
        }
    };
    let language = match arguments.simulator {
        Some(language) => language,
        None if is_asked => choose(
            "In which language is the simulator?",
            &Language::ALL,
            Language::name,
            Language::about,
        )?,
        None => return Err(missing("simulator")),
    };
    let list = match &arguments.tags {
        Some(tags) => Some(signals(tags, kinds)?),
        None if is_asked && arguments.plc.is_none() => ask_list(kinds)?,
        None => None,
    };
    let counts_elements = list.as_ref().is_some_and(|(_, counts)| *counts);
    let signals = list.map(|(signals, _)| signals);
    let (command, jar, c) = places();
    Ok(Answers {
        name,
        plc,
        address,
        language,
        signals,
        counts_elements,
        command,
        python: interpreter(),
        jar,
        c,
    })
}

/// The `[[signal]]` sections of a list of tags, and whether the numbers of their addresses count elements.
fn signals(tags: &Path, kinds: &'static Kinds) -> Result<(String, bool), Failure> {
    let shown = tags.display().to_string();
    let bytes = fs::read(tags);
    let bytes =
        bytes.map_err(|error| wrong(format!("{shown}: this file cannot be read: {error}")))?;
    let reading = ImportOptions::default();
    let imported = import(&shown, &bytes, reading, kinds);
    let imported = imported.map_err(|mistakes| wrong(mistakes.to_string()))?;
    let start = imported
        .text
        .find("[[signal]]")
        .unwrap_or(imported.text.len());
    let config = Config::parse(&shown, &imported.text, kinds);
    let config = config.map_err(|mistakes| wrong(mistakes.to_string()))?;
    let counts_elements = config.addressing == Addressing::Elements;
    Ok((format!("\n{}", &imported.text[start..]), counts_elements))
}

/// One line from the terminal; `None` if it is empty.
fn line(question: &str) -> Result<Option<String>, Failure> {
    eprint!("{question}: ");
    let mut text = String::new();
    let read = io::stdin().lock().read_line(&mut text);
    if read.map_err(|error| wrong(error.to_string()))? == 0 {
        return Err(wrong(
            "\nnew: the terminal was closed before the last answer",
        ));
    }
    let text = text.trim();
    Ok((!text.is_empty()).then(|| text.to_owned()))
}

fn choose<T: Copy>(
    question: &str,
    all: &[T],
    name: fn(T) -> &'static str,
    about: fn(T) -> &'static str,
) -> Result<T, Failure> {
    for (index, each) in all.iter().enumerate() {
        eprintln!("  {}  {:<10} {}", index + 1, name(*each), about(*each));
    }
    loop {
        let Some(answer) = line(question)? else {
            continue;
        };
        let by_number = answer.parse::<usize>().ok();
        let by_number = by_number.and_then(|number| all.get(number.checked_sub(1)?));
        let found = by_number.or_else(|| all.iter().find(|each| name(**each) == answer));
        if let Some(found) = found {
            return Ok(*found);
        }
        let near = nearest(&answer, all.iter().map(|each| name(*each)));
        let near = near.map(|near| format!("; did you mean {near}?"));
        eprintln!("  \"{answer}\" is none of them{}", near.unwrap_or_default());
    }
}

/// The signals of a list that is named on the terminal; a wrong answer must not cost those before it.
fn ask_list(kinds: &'static Kinds) -> Result<Option<(String, bool)>, Failure> {
    loop {
        let question = "List of tags, as the PLC's editor exports it [none: a tank with a valve]";
        let Some(tags) = line(question)? else {
            return Ok(None);
        };
        match signals(Path::new(&tags), kinds) {
            Ok(list) => return Ok(Some(list)),
            Err((why, _)) => eprintln!("  {why}"),
        }
    }
}

fn listen(usual: &Address) -> Result<Address, Failure> {
    loop {
        let Some(answer) = line(&format!("Where does the machine listen? [{usual}]"))? else {
            return Ok(usual.clone());
        };
        match address(&answer) {
            Ok(address) => return Ok(address),
            Err(why) => eprintln!("  {why}"),
        }
    }
}

/// The interpreter beside this command, where pip has put both; otherwise the one on the path.
fn interpreter() -> String {
    let name = if cfg!(windows) { "python" } else { "python3" };
    let beside = super::own_program().with_file_name(format!("{name}{EXE_SUFFIX}"));
    // Without a folder it would be a file here.
    let is_there = beside.is_absolute() && beside.is_file();
    if is_there {
        beside.display().to_string()
    } else {
        name.to_owned()
    }
}

/// How this command is called; the jar for Java; the folders of the header and of the library for C.
fn places() -> (String, Option<String>, Option<(String, String)>) {
    let own = super::own_program();
    let folder = own.parent().unwrap_or(Path::new("")).to_owned();
    let version = env!("CARGO_PKG_VERSION");
    // Of a build, and of a zip.
    let jars = [
        folder.join(format!("../../java/tickbus/target/tickbus-{version}.jar")),
        folder.join(format!("device-drivers-{version}.jar")),
    ];
    let whole = |path: &PathBuf| {
        fs::canonicalize(path)
            .ok()
            .map(|path| path.display().to_string())
    };
    let jar = jars.iter().find_map(whole);
    let include = whole(&folder.join("../../include"));
    let library = folder.join(format!("{DLL_PREFIX}tickbus{DLL_SUFFIX}"));
    let library = library.exists().then(|| folder.display().to_string());
    (own.display().to_string(), jar, include.zip(library))
}
