//! The machine of a test file alone: a recording's commands drive it, and what it answers becomes a run.

use std::path::Path;
use std::sync::Arc;

use tickbus_base::time::Nanos;
use tickbus_base::toml_text::{Collector, Mistakes, Table, load_text, read_text};
use tickbus_driver_cfg::{Config, Kinds};
use tickbus_fieldbus::Role;
use tickbus_fmi::foreign::Stepped;
use tickbus_image::signal::{Area, SignalTable, Slot};
use tickbus_record::{Columns, Recording, RecordingError, Rows, Tick, ValueKind};
use tickbus_reply::{Replies, Reply, Rule};
use tickbus_report::{DEFAULT_BUDGET, Run, SignalKind};

use super::machine::Stub;
use super::model_faults::ModelFaults;
use super::plant::Plant;
use super::playback::kind;
use super::sections::Reader;
use super::suite::load_config;
use super::watch::{Watch, real};

/// The machine of a test file.
#[derive(Clone, Debug)]
pub struct Model {
    /// The file's path, as messages name it.
    pub file: String,
    config: Config,
    /// The step of the file; without one the machine steps as the recording does.
    step: Option<Nanos>,
    initial: Vec<(usize, Slot)>,
    pub(super) rules: Vec<Rule>,
    pub(super) replies: Vec<Reply>,
    pub(super) fmu: Option<Plant>,
}

/// The commands of the PLC in a recording.
#[derive(Clone, Debug, Default)]
pub struct Commands {
    /// The time of each recorded tick.
    times: Vec<Nanos>,
    /// Tick, signal, and new value.
    changes: Vec<(usize, usize, Slot)>,
    /// The machine's own values in the first tick.
    first: Vec<(usize, Slot)>,
}

impl Model {
    /// Reads the machine of the test file at `path`; the driver.cfg that it names may name only these `kinds` of bus. The
    /// file needs no program and no test, and those that it has are not read.
    ///
    /// # Errors
    ///
    /// With every mistake in the file; a right file, with those in its driver.cfg.
    pub fn load(path: &Path, kinds: &'static Kinds) -> Result<Self, Mistakes> {
        let text = load_text(path)?;
        let folder = path.parent().unwrap_or_else(|| Path::new(""));
        let file = path.display().to_string();
        let mut collector = Collector::new(&file, &text);
        let mut of_config = None;
        let read = read_text(&mut collector, &text, |root| {
            read(&file, root, (folder, kinds), &mut of_config)
        });
        match (collector.finish(), of_config) {
            (Some(mistakes), _) | (None, Some(mistakes)) => Err(mistakes),
            (None, None) => Ok(read.expect("what is not read has a mistake")),
        }
    }

    /// The signals.
    pub fn table(&self) -> &SignalTable {
        &self.config.table
    }

    /// Reads the commands of the recording at `path`.
    ///
    /// # Errors
    ///
    /// The file is no recording, is damaged, or has no output of the PLC that the machine knows.
    pub fn commands(&self, path: &Path) -> Result<Commands, RecordingError> {
        let table = self.table();
        let mut recording = Recording::open(path, Some(table))?;
        let (mut inputs, mut outputs) = (Vec::new(), Vec::new());
        for (index, signal) in table.signals.iter().enumerate() {
            let found = recording
                .columns()
                .of_signal(signal)
                .map_err(|mistake| RecordingError::of_file(path, mistake.what, mistake.right))?;
            match (found, signal.area) {
                (None, _) => {}
                (Some(column), Area::Input) => inputs.push((column, index)),
                (Some(column), Area::Output) => outputs.push((column, index)),
            }
        }
        if outputs.is_empty() {
            return Err(RecordingError::of_file(
                path,
                "no output of the PLC in this recording is a signal of the machine",
                "use a recording of a driver with this signal table",
            ));
        }
        let mut commands = Commands::default();
        let mut tick = Tick::new(recording.columns());
        let mut last: Vec<Option<Slot>> = vec![None; outputs.len()];
        while recording.next(&mut tick)? {
            if commands.times.is_empty() {
                let first = inputs.iter();
                let first = first.map(|(column, index)| (*index, tick.values[*column]));
                commands.first = first.collect();
            }
            for (last, (column, index)) in last.iter_mut().zip(&outputs) {
                let value = tick.values[*column];
                if last.replace(value) != Some(value) {
                    commands.changes.push((commands.times.len(), *index, value));
                }
            }
            commands.times.push(tick.time);
        }
        Ok(commands)
    }

    /// Drives the machine with these commands from its start to their end. The run has the signals that the machine writes.
    ///
    /// # Errors
    ///
    /// Why the FMU does not begin, or not continue.
    pub fn drive(&self, commands: &Commands) -> Result<Run, String> {
        let (Some(first), Some(last)) = (commands.times.first(), commands.times.last()) else {
            return Ok(Run::new(DEFAULT_BUDGET));
        };
        let table = self.table();
        let signals = &table.signals;
        let mut slots: Vec<Slot> = signals.iter().map(|signal| signal.fail_safe).collect();
        // A reply makes its signals from the beginning; another value would be one that the machine writes over it.
        let is_made = |signal: &usize| self.replies.iter().any(|one| one.outputs.contains(signal));
        let recorded = commands.first.iter().filter(|(signal, _)| !is_made(signal));
        for (signal, value) in recorded.chain(&self.initial) {
            slots[*signal] = *value;
        }
        let fmu = self.fmu.as_ref();
        let mut fmu = fmu
            .map(|fmu| fmu.start_alone(table, &mut slots))
            .transpose()?;
        let mut watches: Vec<Watch> = slots
            .iter()
            .zip(signals)
            .map(|(slot, signal)| Watch::new(*slot, signal))
            .collect();
        let mut stub = Stub::new(&self.rules, &watches);
        let mut replies = Replies::new(&self.replies, table, &Arc::default());
        // As in a test: `set` takes a signal from its reply, whatever the value.
        if let Some(replies) = &mut replies {
            for (signal, _) in &self.initial {
                replies.borrow(*signal, true);
            }
        }
        let mut shown = Shown::new(table);
        // The first recorded tick ended one step after the begin.
        let second = commands.times.iter().find(|time| *time > first);
        let lead = second.map_or(Nanos::from_millis(1), |second| *second - *first);
        let begin = *first - self.step.unwrap_or(lead);
        let (mut now, mut tick) = (begin, 0);
        let mut changes = commands.changes.as_slice();
        let mut times = commands.times.iter();
        loop {
            let next = match self.step {
                Some(step) => Some(now + step),
                None => times.by_ref().find(|time| **time > now).copied(),
            };
            let Some(next) = next.filter(|next| next <= last) else {
                break;
            };
            // The machine learns in this tick what the PLC commanded in the ticks before.
            while let Some(((row, signal, value), rest)) = changes.split_first()
                && commands.times[*row] < next
            {
                slots[*signal] = *value;
                changes = rest;
            }
            for (watch, (slot, signal)) in watches.iter_mut().zip(slots.iter().zip(signals)) {
                watch.look(*slot, signal, tick);
            }
            if let Some(fmu) = &mut fmu {
                let stepped = fmu.step(now - begin, next - now, &mut slots);
                match stepped.map_err(|failure| format!("at {next}: {failure}"))? {
                    Stepped::Done => {}
                    Stepped::Ended => return Err(format!("the FMU has ended its run at {next}")),
                }
            }
            stub.step(next - begin, next - now, &watches, &mut slots);
            if let Some(replies) = &mut replies {
                replies.step(next - begin, &mut slots);
            }
            shown.take(next, table, &slots);
            (now, tick) = (next, tick + 1);
        }
        if let Some(fmu) = fmu {
            fmu.end().map_err(|failure| failure.to_string())?;
        }
        Ok(shown.run)
    }
}

/// The values of the machine as they are on the line.
struct Shown {
    run: Run,
    rows: Rows,
    before: Vec<Slot>,
    slots: Vec<Slot>,
    /// The numbers of the machine's signals in the run and in the table.
    own: Vec<(usize, usize)>,
}

impl Shown {
    fn new(table: &SignalTable) -> Self {
        let mut run = Run::new(DEFAULT_BUDGET);
        let own = table.signals.iter().enumerate();
        let own = own.filter(|(_, signal)| signal.area == Area::Input);
        let own = own.map(|(index, signal)| {
            let kind = match kind(signal) {
                ValueKind::Bit => SignalKind::Bool,
                _ => SignalKind::Real,
            };
            let unit = signal.unit.as_deref().unwrap_or_default();
            (run.add_signal(&signal.name, kind, unit), index)
        });
        let own = own.collect();
        Self {
            run,
            rows: Rows::sending(Columns::default(), table, Area::Input),
            before: Vec::new(),
            slots: Vec::new(),
            own,
        }
    }

    fn take(&mut self, at: Nanos, table: &SignalTable, slots: &[Slot]) {
        self.run.tick(at);
        // Most ticks change nothing.
        if self.before == slots {
            return;
        }
        self.before.clear();
        self.before.extend_from_slice(slots);
        self.slots.clone_from(&self.before);
        self.rows.put_on_the_line(&mut self.slots);
        for (number, index) in &self.own {
            let signal = &table.signals[*index];
            let value = real(kind(signal).kept(self.slots[*index]), signal);
            self.run.change(*number, at, value);
        }
    }
}

/// Reads the file; mistakes in files that it names go to `of_config`.
fn read(
    file: &str,
    mut root: Table<'_>,
    (folder, kinds): (&Path, &'static Kinds),
    of_config: &mut Option<Mistakes>,
) -> Option<Model> {
    let right = "write the path of the driver.cfg, as seen from this file";
    let config = root.require("config", format!("add config = \"driver.cfg\": {right}"));
    let step = root.take("step");
    let machine = root.require("machine", "describe the machine: an FMU, rules or replies");
    // A test file has more tables, which a model does not need.
    root.finish_open();
    let step = match step {
        None => None,
        Some(value) => Some(value.duration()?),
    };
    let config = config.and_then(|value| load_config(&value, right, (folder, kinds), of_config));
    let mut config = config?;
    config.role = Role::Device;
    let reader = Reader {
        table: &config.table,
        role: config.role,
        step: step.unwrap_or(Nanos::from_millis(1)),
        folder,
        config: &config,
        model: ModelFaults::None,
        counted: None,
    };
    let machine = machine?.table("[machine]", "write a [machine] table")?;
    for (_, value) in machine.all().filter(|(key, _)| *key == "recording") {
        value.wrong(
            "a recording answers nothing: it is no model",
            "name an FMU or write rules; compare two recordings with --with",
        );
    }
    let mut machine = reader.machine(machine);
    if let Some(mistakes) = machine.elsewhere.take() {
        *of_config = Some(mistakes);
    }
    if of_config.is_some() {
        return None;
    }
    Some(Model {
        file: file.to_owned(),
        replies: machine.replies.unwrap_or_else(|| config.replies.clone()),
        config,
        step,
        initial: machine.initial,
        rules: machine.rules,
        fmu: machine.fmu,
    })
}
