//! What a driver.cfg says to the loopback bus.

use crate::config::{Table, Value, did_you_mean, shown};
use crate::fieldbus::Role;
use crate::time::Nanos;

/// The scan interval of a hosted program that states none.
const SCAN: Nanos = Nanos::from_millis(10);

/// The longest name of a link, in characters.
const LINK_LIMIT: usize = 120;

/// The options of a program, each with the values that it takes.
type Choices = &'static [(&'static str, &'static [&'static str])];

/// The hosted programs.
const PROGRAMS: [(&str, Choices); 2] = [
    ("rig", &[("la1_code", &["msb-first", "lsb-first"])]),
    ("mirror", &[]),
];

/// When the bus runs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Mode {
    /// On a thread and a clock of its own.
    #[default]
    Free,
    /// On the tick's thread, in simulation time.
    Stepped,
}

/// Who is at the other end.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Peer {
    /// The driver that names the same link, in the other role.
    Link(String),
    /// A PLC program hosted in this process.
    Program {
        /// Its name.
        name: String,
        /// Its options, as pairs of key and value.
        options: Vec<(String, String)>,
        /// Its scan interval. Positive.
        scan: Nanos,
    },
}

/// What a driver.cfg says to the loopback bus.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Options {
    /// When the bus runs.
    pub mode: Mode,
    /// Who is at the other end.
    pub peer: Peer,
    /// Whether every change that the peer makes is reported as an event, beside the image.
    pub events: bool,
}

impl Options {
    /// Reads `mode`, `events`, and `link` or `program` with `program_options` and `scan`.
    pub(in crate::fieldbus) fn read(role: Role, mut table: Table<'_>) -> Option<Self> {
        let mode = table.take("mode");
        let events = table.take("events");
        let link = table.take("link");
        let program = table.take("program");
        let program_options = table.take("program_options");
        let scan = table.take("scan");
        table.require_one_of(
            &["program", "link"],
            "add program = \"rig\" to host a PLC program at the other end, or link = \"name\" to \
             meet the driver that names the same link",
        );
        let whole = table.is_whole();
        table.finish();

        let modes = [("free", Mode::Free), ("stepped", Mode::Stepped)];
        let mode = mode.map_or(Some(Mode::Free), |value| value.choice("modes", &modes));
        let events = events.map_or(Some(false), |value| value.boolean());
        let peer = match (link, program) {
            (Some(link), Some(_)) => {
                link.wrong(
                    "the loopback has both a \"link\" and a \"program\" at its other end",
                    "keep one of them",
                );
                None
            }
            (_, Some(program)) => read_program(&program, program_options, scan.as_ref(), role),
            (link, None) => {
                for (key, value) in [("program_options", &program_options), ("scan", &scan)] {
                    if let (Some(value), true) = (value, whole) {
                        value.wrong(
                            format!("\"{key}\" stands without \"program\""),
                            "remove it, or add program = \"rig\"",
                        );
                    }
                }
                let name = "name the link; the driver at the other end names the same";
                link?
                    .label(LINK_LIMIT, name)
                    .map(|link| Peer::Link(link.to_owned()))
            }
        };
        Some(Self {
            mode: mode?,
            peer: peer?,
            events: events?,
        })
    }
}

fn read_program(
    program: &Value<'_>,
    options: Option<Value<'_>>,
    scan: Option<&Value<'_>>,
    role: Role,
) -> Option<Peer> {
    if role == Role::Controller {
        program.wrong(
            "a hosted PLC program is the controller, and so is this driver",
            "remove role = \"controller\", or use \"link\"",
        );
    }
    let scan = scan.map_or(Some(SCAN), Value::duration);
    let text = program.text("write the name of a program in quotes, such as \"rig\"");
    let known = text.and_then(|name| PROGRAMS.iter().find(|(known, _)| *known == name));
    if let (Some(name), None) = (text, known) {
        program.wrong(
            format!("there is no program \"{}\"", shown(name)),
            did_you_mean(name, "programs", &PROGRAMS.map(|(name, _)| name)),
        );
    }
    let options = match (options, known) {
        (None, _) => Some(Vec::new()),
        (Some(value), known) => value
            .table("program_options", "write them as { option = \"value\" }")
            .and_then(|table| read_options(&table, known.map(|(_, options)| *options)?)),
    };
    let (name, _) = known?;
    Some(Peer::Program {
        name: (*name).to_owned(),
        options: options?,
        scan: scan?,
    })
}

fn read_options(table: &Table<'_>, known: Choices) -> Option<Vec<(String, String)>> {
    let mut read = Some(Vec::new());
    for (key, value) in table.all() {
        let Some((_, choices)) = known.iter().find(|(known, _)| *known == key) else {
            let names: Vec<&str> = known.iter().map(|(name, _)| *name).collect();
            value.wrong(
                format!("the program has no option \"{}\"", shown(key)),
                if names.is_empty() {
                    "remove it".to_owned()
                } else {
                    did_you_mean(key, "its options", &names)
                },
            );
            read = None;
            continue;
        };
        let choices: Vec<(&str, &str)> = choices.iter().map(|choice| (*choice, *choice)).collect();
        match (
            value.choice(&format!("values of {key}"), &choices),
            &mut read,
        ) {
            (Some(chosen), Some(read)) => read.push((key.to_owned(), chosen.to_owned())),
            _ => read = None,
        }
    }
    read
}
