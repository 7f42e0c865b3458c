//! The options of the loopback bus in a driver.cfg.

use std::path::{Path, PathBuf};

use tickbus_base::time::Nanos;
use tickbus_base::toml_text::{Key, Shape, Table, Value, did_you_mean, names, shown};
use tickbus_fieldbus::loopback::{CYCLE, FreeLoopback, SteppedLoopback};
use tickbus_fieldbus::{Bus, BusOptions, BusSetup, NamedFile, OpenError, Role};
use tickbus_image::signal::SignalTable;
use tickbus_plc::{HostedProgram, INTERVAL, ProgramError, Programs};
use tickbus_record as record;

use crate::kind_keys::KindKeys;

/// The name of the kind in a driver.cfg.
pub const NAME: &str = "loopback";

/// The longest name of a link, in characters.
const LINK_LIMIT: usize = 120;

/// How the bus is clocked.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Mode {
    /// Clocked by its own thread.
    #[default]
    Free,
    /// Clocked by the ticking thread, in simulation time.
    Stepped,
}

impl Mode {
    /// The modes, by their names in a driver.cfg.
    pub const NAMES: [(&str, Self); 2] = [("free", Self::Free), ("stepped", Self::Stepped)];
}

/// The other end of the loopback.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Peer {
    /// The driver that names the same link, in the other role.
    Link(String),
    /// A PLC program hosted in this process.
    Program {
        /// The program's name, or its path relative to the folder of the driver.cfg.
        name: String,
        /// The program's options as key-value pairs.
        options: Vec<(String, String)>,
        /// The scan interval; `None` leaves it to the program. Positive.
        scan: Option<Nanos>,
    },
    /// The recording in this file, relative to the folder of the driver.cfg: the values that the recorded peer sent
    /// drive this end.
    Replay(PathBuf),
}

/// The keys of the loopback in `[fieldbus]`.
const KEYS: &[Key] = &[
    Key::new(
        "mode",
        Shape::Choice(&names(&Mode::NAMES)),
        "\"free\": bus and program run on threads of their own; \"stepped\": on the tick's thread, on simulation time",
    ),
    Key::new(
        "link",
        Shape::Label(LINK_LIMIT),
        "The name of the link: two drivers with one link and different roles meet there",
    ),
    Key::new(
        "program",
        Shape::Text,
        "The PLC program at the other end: a built-in one, or the path of your own, \"./program.so\"",
    ),
    Key::new(
        "replay",
        record::FILE_SHAPE,
        "A recording whose peer drives this end",
    ),
    Key::new(
        "program_options",
        Shape::Map(&Shape::Any(&[Shape::Text, Shape::Number])),
        "The options of the program",
    ),
    Key::new(
        "scan",
        Shape::Duration,
        "The scan interval of the program; 10ms for a built-in one",
    ),
];

/// Those of which a loopback has one.
const ONE_OF: [&str; 3] = ["program", "link", "replay"];

/// The keys as those of a kind.
pub(super) const KIND_KEYS: KindKeys = KindKeys {
    name: NAME,
    learns_of_writes: false,
    can_observe: false,
    browses: false,
    keys: &[KEYS],
    one_of: &ONE_OF,
    station_keys: &[],
};

/// The options of the loopback bus.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Options {
    /// How the bus is clocked.
    pub mode: Mode,
    /// The other end.
    pub peer: Peer,
}

impl Options {
    /// Reads `mode`, and one of `link`, `replay` and `program`; `program` comes with `program_options` and `scan`.
    pub fn read(role: Role, table: &mut Table<'_>, programs: &Programs) -> Option<Self> {
        let mode = table.take("mode");
        // `[fieldbus]` reads this key; taking it here puts it in its place in the list of keys that a message shows.
        table.take("events");
        let link = table.take("link");
        let program = table.take("program");
        let replay = table.take("replay");
        let program_options = table.take("program_options");
        let scan = table.take("scan");
        table.require_one_of(
            &ONE_OF,
            "add program = \"rig\" to host a PLC program at the other end, link = \"name\" to \
             meet the driver that names the same link, or replay = \"run.vcd\" to replay a recording",
        );
        let whole = table.is_whole();

        let stated = mode
            .as_ref()
            .map(|value| value.choice("modes", &Mode::NAMES));
        if let (Some(mode), Some(Some(Mode::Free)), true) = (&mode, stated, replay.is_some()) {
            mode.wrong(
                "a recording is replayed tick by tick, on simulation time",
                "write mode = \"stepped\", or leave \"mode\" out",
            );
        }
        // A recording can only be replayed in stepped mode.
        let mode = stated.unwrap_or(Some(if replay.is_some() {
            Mode::Stepped
        } else {
            Mode::Free
        }));
        if program.is_none() {
            for (key, value) in [("program_options", &program_options), ("scan", &scan)] {
                if let (Some(value), true) = (value, whole) {
                    value.wrong(
                        format!("\"{key}\" stands without \"program\""),
                        "remove it, or add program = \"rig\"",
                    );
                }
            }
        }
        let peers = [("link", &link), ("program", &program), ("replay", &replay)];
        let peers: Vec<_> = peers
            .into_iter()
            .filter_map(|(key, value)| Some((key, value.as_ref()?)))
            .collect();
        let peer = match peers[..] {
            [(first, value), (second, _), ..] => {
                value.wrong(
                    format!(
                        "the loopback has both a \"{first}\" and a \"{second}\" at its other end"
                    ),
                    "keep one of them",
                );
                None
            }
            [("program", program)] => {
                read_program(program, program_options, scan.as_ref(), (role, programs))
            }
            [("replay", replay)] => record::file_of(replay).map(|(file, _)| Peer::Replay(file)),
            [(_, link)] => {
                let name = "name the link; the driver at the other end names the same";
                link.label(LINK_LIMIT, name)
                    .map(|link| Peer::Link(link.to_owned()))
            }
            [] => None,
        };
        Some(Self {
            mode: mode?,
            peer: peer?,
        })
    }
}

impl BusOptions for Options {
    fn summary(&self, _role: Role, _table: &SignalTable) -> Vec<String> {
        let mode = match self.mode {
            Mode::Free => "free-running",
            Mode::Stepped => "stepped by the simulation",
        };
        let mut parts = vec![mode.to_owned()];
        match &self.peer {
            Peer::Link(name) => parts.push(format!("link \"{name}\"")),
            Peer::Replay(file) => parts.push(format!("replays \"{}\"", file.display())),
            Peer::Program {
                name,
                options,
                scan,
            } => {
                parts.push(format!("hosts the PLC program \"{name}\""));
                parts.push(
                    scan.map_or("scan as compiled".to_owned(), |scan| format!("scan {scan}")),
                );
                parts.extend(options.iter().map(|(key, value)| format!("{key} {value}")));
            }
        }
        parts
    }

    fn files(&self) -> Vec<NamedFile> {
        match &self.peer {
            Peer::Program { name, .. } if HostedProgram::is_path(name) => {
                vec![NamedFile::Plain(name.into())]
            }
            Peer::Replay(file) => vec![NamedFile::Plain(file.clone())],
            Peer::Program { .. } | Peer::Link(_) => Vec::new(),
        }
    }

    /// Opens one end of a named link. Hosted programs and replayed recordings are started by the driver.
    fn open(&self, setup: &BusSetup<'_>) -> Result<Bus, OpenError> {
        match (&self.peer, self.mode) {
            (Peer::Link(name), Mode::Free) => {
                let cycle = setup.cycle.unwrap_or(CYCLE);
                Ok(Bus::Free(Box::new(FreeLoopback::named(name, cycle))))
            }
            (Peer::Link(name), Mode::Stepped) => {
                Ok(Bus::Stepped(Box::new(SteppedLoopback::named(name))))
            }
            _ => Err(OpenError::Unsupported(
                "nobody hosts the other end of this loopback; open it as a driver".to_owned(),
            )),
        }
    }

    fn cycle(&self) -> Option<Nanos> {
        Some(CYCLE)
    }

    fn is_in_process(&self) -> bool {
        true
    }

    fn is_stepped(&self) -> bool {
        self.mode == Mode::Stepped || matches!(self.peer, Peer::Replay(_))
    }
}

impl Peer {
    /// Reads the options of a hosted program, which is one of `programs`, for a machine at this end.
    pub fn hosted(
        program: &Value<'_>,
        options: Option<Value<'_>>,
        scan: Option<&Value<'_>>,
        programs: &Programs,
    ) -> Option<Self> {
        read_program(program, options, scan, (Role::Device, programs))
    }

    /// Returns the program that a command line names: a built-in one, or the path of a user's own as seen from the current
    /// folder.
    ///
    /// # Errors
    ///
    /// There is no such program, or the path cannot be made absolute.
    pub fn named(name: &str, programs: &Programs) -> Result<Self, ProgramError> {
        programs.check(name, &[])?;
        let is_path = HostedProgram::is_path(name);
        let peer = Self::Program {
            name: name.to_owned(),
            options: Vec::new(),
            scan: (!is_path).then_some(INTERVAL),
        };
        Ok(peer.seen_from(Path::new("")))
    }

    /// Returns the same program for a text in `folder` instead of the folder of the driver.cfg: the path of a user's
    /// own program is relative to `folder`.
    #[must_use]
    pub fn seen_from(mut self, folder: &Path) -> Self {
        if let Self::Program { name, .. } = &mut self
            && HostedProgram::is_path(name)
            && let Ok(path) = std::path::absolute(folder.join(&*name))
        {
            *name = path.to_string_lossy().into_owned();
        }
        self
    }
}

fn read_program(
    program: &Value<'_>,
    options: Option<Value<'_>>,
    scan: Option<&Value<'_>>,
    (role, programs): (Role, &Programs),
) -> Option<Peer> {
    if role == Role::Controller {
        program.wrong(
            "a hosted PLC program is the controller, and so is this driver",
            "remove role = \"controller\", or use \"link\"",
        );
    }
    let text = program.text("write the name of a program in quotes, such as \"rig\"");
    let known = text.filter(|name| programs.names().contains(name) || HostedProgram::is_path(name));
    let scan = match scan {
        Some(scan) => scan.duration().map(Some),
        // A user's own program has its interval compiled in.
        None if known.is_some_and(HostedProgram::is_path) => Some(None),
        None => Some(Some(INTERVAL)),
    };
    if let (Some(name), None) = (text, known) {
        program.wrong(
            format!("there is no program \"{}\"", shown(name)),
            did_you_mean(name, "programs", programs.names()),
        );
    }
    let options = match options {
        None => Some(Vec::new()),
        Some(value) => value
            .table("program_options", "write them as { option = \"value\" }")
            .and_then(|table| read_options(&table, known?, programs)),
    };
    Some(Peer::Program {
        name: known?.to_owned(),
        options: options?,
        scan: scan?,
    })
}

/// Reads the options of the program called `name`; the program checks each of them.
fn read_options(
    table: &Table<'_>,
    name: &str,
    programs: &Programs,
) -> Option<Vec<(String, String)>> {
    let mut read = Some(Vec::new());
    for (key, value) in table.all() {
        // Numbers need no quotes.
        let text = value
            .as_text()
            .map_or_else(|| value.written(), str::to_owned);
        let text = if text.is_empty() {
            value
                .text("write the option's value in quotes")
                .map(str::to_owned)
        } else {
            Some(text)
        };
        let option = text.map(|text| (key.to_owned(), text));
        let made = option
            .as_ref()
            .map(|option| programs.check(name, std::slice::from_ref(option)));
        if let Some(Err(error)) = &made {
            value.refuse(error.mistake());
        }
        match (option, made, &mut read) {
            (Some(option), Some(Ok(())), Some(read)) => read.push(option),
            _ => read = None,
        }
    }
    read
}
