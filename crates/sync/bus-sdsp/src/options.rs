//! The bus's section of a driver.cfg.

use std::collections::BTreeMap;
use std::num::NonZeroU32;

use tickbus_base::Mistake;
use tickbus_base::time::Nanos;
use tickbus_base::toml_text::{Key, Shape, Table, Value};
use tickbus_fieldbus::{At, BusSetup, Role};
use tickbus_image::signal::{Signal, SignalTable};
use tickbus_net::Address;
use tickbus_virtual_time::{Declaration, Meeting};

use super::Variables;

/// The longest name of a client, in characters.
const NAME_LIMIT: usize = 120;

/// How long the server may be silent. While it waits for clients or is paused, it sends a message every second.
const TIMEOUT: Nanos = Nanos::from_secs(60);

/// The value of `step` for a simulation whose ticks are of any length.
const TICK: &str = "tick";

/// The keys of the bus, for the schema of a driver.cfg.
pub(crate) const KEYS: &[Key] = &[
    Key::new(
        "address",
        Shape::Any(&[Shape::ADDRESS, Shape::Pattern("unix:[^\\s].*")]),
        "Where the server listens: a host and a port, or a Unix socket",
    ),
    Key::new(
        "shared_memory",
        Shape::Pattern("[A-Za-z0-9_-]{1,40}"),
        "The name under which a server on this computer offers shared memory",
    ),
    Key::new(
        "client",
        Shape::Label(NAME_LIMIT),
        "A unique name in the run; the driver's name by default",
    ),
    Key::new(
        "multiple",
        Shape::Whole(1, u32::MAX as i128),
        "The steps of the server in one step of this end; 1 by default",
    ),
    Key::new(
        "step",
        Shape::Any(&[Shape::Duration, Shape::Choice(&[TICK])]),
        "Instead of \"multiple\": the virtual time of one step of this end; \"tick\": each tick of the simulation is one",
    ),
    Key::new(
        "timeout",
        Shape::Duration,
        "How long the server may be silent, and may take to appear",
    )
    .or("\"60s\""),
];

/// Those of which a file has one.
pub(crate) const MEETINGS: [&str; 2] = ["address", "shared_memory"];

/// The options of the bus `sdsp`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Options {
    /// The meeting place of the server and its clients.
    pub meeting: Meeting,
    /// The name in the run, if stated.
    pub client: Option<String>,
    /// The client's period.
    pub every: Every,
    /// How long the server may be silent.
    pub timeout: Nanos,
    /// Variables with their own name, by signal: `[fieldbus.at]`.
    pub at: BTreeMap<String, String>,
}

/// The period of a client's steps.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Every {
    /// This many steps of the server.
    Steps(NonZeroU32),
    /// This virtual time: at least the server's step.
    Time(Nanos),
    /// The ticks of the simulation: each is a step, the first of the server's at or after its time.
    Tick,
}

impl Options {
    /// Reads the keys of the bus. `moved` says that the address will be replaced.
    pub fn read(moved: bool, table: &mut Table<'_>) -> Option<Self> {
        let address = table.take("address");
        let memory = table.take("shared_memory");
        let client = table.take("client");
        let multiple = table.take("multiple");
        let step = table.take("step");
        let timeout = table.take("timeout");
        if !moved {
            let right = "say where the server listens, such as address = \"127.0.0.1:20060\", or by which name it \
                         offers shared memory on this computer, shared_memory = \"cell\"";
            table.require_one_of(&MEETINGS, right);
        }
        let meeting = match (address, memory) {
            (Some(_), Some(both)) => {
                both.wrong(
                    "\"shared_memory\" stands beside \"address\"",
                    "keep the one by which the server is met",
                );
                None
            }
            (Some(address), None) => read_address(&address, moved),
            (None, Some(name)) => Meeting::read_name(&name).map(Meeting::SharedMemory),
            // A dummy, replaced later.
            (None, None) => moved.then(|| Meeting::Tcp(Address::local(0))),
        };
        let client = client.map_or(Some(None), |value| {
            let right = "give this client a name that no other one of the run has";
            value
                .label(NAME_LIMIT, right)
                .map(|name| Some(name.to_owned()))
        });
        let timeout = timeout.map_or(Some(TIMEOUT), |value| value.duration());
        let every = match (multiple, step) {
            (Some(multiple), Some(_)) => {
                multiple.wrong(
                    "both a \"multiple\" and a \"step\" say how often this client has a step",
                    "keep one of them",
                );
                None
            }
            (Some(multiple), None) => (multiple.whole(1..=u32::MAX.into()))
                .and_then(|multiple| u32::try_from(multiple).ok()?.try_into().ok())
                .map(Every::Steps),
            (None, Some(step)) if step.as_text() == Some(TICK) => Some(Every::Tick),
            (None, Some(step)) => step.duration().map(Every::Time),
            (None, None) => Some(Every::Steps(NonZeroU32::MIN)),
        };
        Some(Self {
            meeting: meeting?,
            client: client?,
            every: every?,
            timeout: timeout?,
            at: BTreeMap::new(),
        })
    }

    /// Replaces the address.
    pub(super) fn set_address(&mut self, address: &str) -> Result<(), Mistake> {
        let meeting: Meeting = address.parse()?;
        meeting.check_dialled()?;
        self.meeting = meeting;
        Ok(())
    }

    /// Takes the lines of `[fieldbus.at]`: the names of variables.
    pub(super) fn place_signals(&mut self, lines: &[At<'_>], table: &SignalTable) {
        for line in lines {
            let signal = &table.signals[line.signal];
            let mut alone = Declaration::new("x");
            alone.reads = vec![line.text.to_owned()];
            if let Err(mistake) = alone.check() {
                line.refuse(mistake);
            }
            self.at.insert(signal.name.clone(), line.text.to_owned());
        }
        for line in lines {
            let signal = &table.signals[line.signal];
            let mut others = table.signals.iter().enumerate();
            let same = others.find(|(index, other)| {
                *index != line.signal
                    && other.area == signal.area
                    && self.variable(other, table) == line.text
            });
            if let Some((_, other)) = same {
                line.wrong(
                    format!(
                        "the variable \"{}\" is that of the signal \"{}\", too",
                        line.text, other.name
                    ),
                    "give each signal a variable of its own",
                );
            }
        }
    }

    /// The name of a signal's variable.
    pub fn variable(&self, signal: &Signal, table: &SignalTable) -> String {
        let stations = &table.stations;
        match self.at.get(&signal.name) {
            Some(name) => name.clone(),
            None if stations.len() == 1 => signal.name.clone(),
            None => format!("{}.{}", stations[signal.station].name, signal.name),
        }
    }

    /// The variables of an end: those that it writes, and those that it reads.
    pub(super) fn variables(&self, role: Role, table: &SignalTable) -> (Variables, Variables) {
        let (writes, reads) = role.areas();
        let of = |area| Variables::new(table, area, |signal| Some(self.variable(signal, table)));
        (of(writes), of(reads))
    }

    /// The declaration of this end.
    ///
    /// # Errors
    ///
    /// The names break a rule.
    pub(super) fn declaration(
        &self,
        setup: &BusSetup<'_>,
        writes: &Variables,
        reads: &Variables,
    ) -> Result<Declaration, Mistake> {
        let name = match (&self.client, setup.role) {
            (Some(client), _) => client.clone(),
            (None, Role::Device | Role::Observer) => setup.name.to_owned(),
            // One driver.cfg may serve both ends.
            (None, Role::Controller) => format!("{} PLC", setup.name),
        };
        let mut declaration = Declaration::new(name);
        match (self.every, setup.hosted) {
            (_, Some(hosted)) => declaration.interval = Some(hosted.interval),
            (Every::Time(interval), None) => declaration.interval = Some(interval),
            (Every::Steps(multiple), None) => declaration.multiple = multiple,
            (Every::Tick, None) => {}
        }
        declaration.writes = writes.iter().cloned().collect();
        declaration.reads = reads.iter().map(|variable| variable.name.clone()).collect();
        declaration.check()?;
        Ok(declaration)
    }
}

fn read_address(value: &Value<'_>, moved: bool) -> Option<Meeting> {
    let meeting = Meeting::read(value)?;
    if !moved && let Err(mistake) = meeting.check_dialled() {
        value.refuse(mistake);
    }
    Some(meeting)
}
