//! Reading test files.

use std::collections::HashMap;
use std::path::Path;
use std::sync::Arc;

use tickbus_base::time::Nanos;
use tickbus_base::toml_text::{Collector, Mistakes, Table, Value, load_text, read_text, shown};
use tickbus_driver_cfg::loopback::{self, Mode, Peer};
use tickbus_driver_cfg::{Config, Kinds};
use tickbus_fieldbus::{Events, Role};
use tickbus_image::signal::Slot;
use tickbus_plc as plc;
use tickbus_reply::Rule;

use super::block::{self, BlockKeys, Counted, Coverage};
use super::model_faults::ModelFaults;
use super::plant::Plant;
use super::playback::MachineRecording;
use super::sections::{Machine, Reader};
use super::sweep::{Scenario, Sweep};
use super::test::Test;

/// The default step of a test file.
const STEP: Nanos = Nanos::from_millis(1);

/// One test file, read and checked.
#[derive(Clone, Debug)]
pub struct Suite {
    /// The file's path, as messages name it.
    pub file: String,
    /// The file's tests. Empty only in a file with a sweep.
    pub tests: Vec<Test>,
    /// The file's sweep.
    pub sweep: Option<Arc<Sweep>>,
    pub(super) bench: Bench,
}

/// The wishes of a command line beside the test files.
#[derive(Clone, Debug, Default)]
pub struct Wanted {
    /// True if the branches of a block are counted in all runs.
    pub counts: bool,
    /// The PLC program to be tested, in the place of the one that a file names.
    pub program: Option<Peer>,
}

/// The parts that all tests of a file share.
#[derive(Clone, Debug)]
pub(super) struct Bench {
    pub(super) config: Arc<Config>,
    pub(super) step: Nanos,
    pub(super) initial: Vec<(usize, Slot)>,
    pub(super) rules: Vec<Rule>,
    pub(super) tape: Option<MachineRecording>,
    pub(super) fmu: Option<Plant>,
    /// The branches of the block under test, if they are counted.
    pub(super) counted: Option<Arc<Counted>>,
}

impl Suite {
    /// Reads the test file at `path`, and the driver.cfg that it names, which may name only these `kinds` of bus.
    ///
    /// # Errors
    ///
    /// With every mistake in the test file; if there are none, with those in its driver.cfg.
    pub fn load(path: &Path, kinds: &'static Kinds) -> Result<Self, Mistakes> {
        Self::load_as(path, kinds, &Wanted::default())
    }

    /// As [`load`](Self::load), with what the command line asks for.
    ///
    /// # Errors
    ///
    /// As [`load`](Self::load).
    pub fn load_as(path: &Path, kinds: &'static Kinds, wanted: &Wanted) -> Result<Self, Mistakes> {
        let text = load_text(path)?;
        let folder = path.parent().unwrap_or_else(|| Path::new(""));
        Self::parse(&path.display().to_string(), &text, (folder, kinds), wanted)
    }

    /// The branches of the block that the runs so far have taken; `None` if nothing is counted.
    pub fn coverage(&self) -> Option<Coverage> {
        self.bench
            .counted
            .as_ref()
            .map(|counted| counted.coverage())
    }

    /// Reads the text of a test file; its paths are relative to `folder`.
    fn parse(
        file: &str,
        text: &str,
        (folder, kinds): (&Path, &'static Kinds),
        wanted: &Wanted,
    ) -> Result<Self, Mistakes> {
        let mut collector = Collector::new(file, text);
        let mut of_config = None;
        let read = read_text(&mut collector, text, |root| {
            read(root, (folder, kinds), wanted, &mut of_config)
        });
        match (collector.finish(), of_config) {
            (Some(mistakes), _) | (None, Some(mistakes)) => Err(mistakes),
            (None, None) => {
                let (bench, tests, sweep) = read.expect("what is not read has a mistake");
                Ok(Self {
                    file: file.to_owned(),
                    tests,
                    sweep: sweep.map(Arc::new),
                    bench,
                })
            }
        }
    }
}

/// Reads the file; mistakes in its driver.cfg, or in a file that its machine needs, go to `of_config`.
fn read(
    mut root: Table<'_>,
    (folder, kinds): (&Path, &'static Kinds),
    wanted: &Wanted,
    of_config: &mut Option<Mistakes>,
) -> Option<(Bench, Vec<Test>, Option<Sweep>)> {
    let right = "write the path of the driver.cfg, as seen from this file";
    let config = root.take("config");
    let block = BlockKeys::take(&mut root);
    if block.block().is_none() {
        root.require("config", format!("add config = \"driver.cfg\": {right}"));
    }
    let program = root.take("program");
    let options = root.take("program_options");
    let scan = root.take("scan");
    let step = root.take("step");
    let machine = root.take("machine");
    let tests = root.take("test");
    let sweep = root.take("sweep");
    let either = "write a [[test]] with name and steps for each test";
    root.require_one_of(&["test", "sweep"], either);
    block.check_beside(&[
        ("config", config.as_ref()),
        ("program", program.as_ref()),
        ("program_options", options.as_ref()),
        ("scan", scan.as_ref()),
    ]);
    if let (None, None, true) = (&program, block.block(), root.is_whole()) {
        for (key, value) in [("program_options", &options), ("scan", &scan)] {
            if let Some(value) = value {
                let what = format!("\"{key}\" stands without \"program\"");
                value.wrong(what, "add program = \"…\", or remove it");
            }
        }
    }
    root.finish();
    if let (Some(value), Some(_)) = (block.block(), &wanted.program) {
        value.wrong(
            "a block has its own program, and the command line names another one",
            "leave --program out for this file",
        );
    }

    let usual = block.block().map_or(STEP, |_| block::STEP);
    let step = step.map_or(Some(usual), |value| value.duration());
    if let (Some(value), Some(step)) = (block.block(), step) {
        let ready = block.read((folder, kinds), step, wanted.counts, of_config)?;
        let config = on_simulation_time(ready.config, value, folder, Some(ready.peer))?;
        let sections = (machine, tests, sweep);
        let (mut bench, tests, sweep) =
            read_sections(sections, config, step, folder, ready.counted, of_config)?;
        bench.initial = [ready.initial, bench.initial].concat();
        return Some((bench, tests, sweep));
    }
    let peer = match &program {
        _ if wanted.program.is_some() => Some(wanted.program.clone()),
        None => Some(None),
        // The driver.cfg may be in a different folder from this file.
        Some(program) => {
            let peer = Peer::hosted(program, options, scan.as_ref(), kinds.programs());
            peer.map(|peer| Some(peer.seen_from(folder)))
        }
    };
    let config = config.and_then(|value| {
        let config = load_config(&value, right, (folder, kinds), of_config)?;
        on_simulation_time(config, &value, folder, peer?)
    });
    let sections = (machine, tests, sweep);
    read_sections(sections, config?, step?, folder, None, of_config)
}

/// Reads the machine, the tests and the sweep, before the signals of `config`.
fn read_sections(
    (machine, tests, sweep): (Option<Value<'_>>, Option<Value<'_>>, Option<Value<'_>>),
    config: Config,
    step: Nanos,
    folder: &Path,
    counted: Option<Arc<Counted>>,
    of_config: &mut Option<Mistakes>,
) -> Option<(Bench, Vec<Test>, Option<Sweep>)> {
    let reader = Reader {
        table: &config.table,
        role: config.role,
        step,
        folder,
        config: &config,
        model: ModelFaults::None,
        counted: counted.as_deref(),
    };
    let mut machine = match machine {
        None => Machine::default(),
        Some(value) => reader.machine(value.table("[machine]", "write a [machine] table")?),
    };
    if let Some(mistakes) = machine.elsewhere.take() {
        *of_config = Some(mistakes);
    }
    let reader = Reader {
        model: machine
            .fmu
            .as_ref()
            .map_or(ModelFaults::None, ModelFaults::Fmu),
        ..reader
    };
    let tables = tests.map(|value| value.tables("[[test]]"));
    let tables = tables.unwrap_or_default();
    check_twins(&tables);
    let tests: Vec<Option<Test>> = tables.into_iter().map(|table| reader.test(table)).collect();
    let sweep = match sweep {
        None => Some(None),
        Some(value) => {
            let table = value.table("[sweep]", "write one [sweep] table");
            table
                .and_then(|table| reader.sweep(table, Scenario::Here(&tests)))
                .map(Some)
        }
    };
    let tests: Option<Vec<Test>> = tests.into_iter().collect();
    let (tests, sweep) = (tests?, sweep?);
    if of_config.is_some() {
        return None;
    }
    let mut config = config;
    if let Some(replies) = machine.replies {
        config.replies = replies;
    }
    let bench = Bench {
        config: Arc::new(config),
        step,
        initial: machine.initial,
        rules: machine.rules,
        tape: machine.tape,
        fmu: machine.fmu,
        counted,
    };
    Some((bench, tests, sweep))
}

pub(super) fn load_config(
    value: &Value<'_>,
    right: &str,
    (folder, kinds): (&Path, &'static Kinds),
    of_config: &mut Option<Mistakes>,
) -> Option<Config> {
    let name = value.text(right)?;
    match Config::load(&folder.join(name), kinds) {
        Ok(config) if config.role == Role::Observer => {
            value.wrong(
                format!(
                    "{} is an observer's driver.cfg, which only looks at a PLC",
                    shown(name)
                ),
                right,
            );
            None
        }
        Ok(config) => Some(config),
        Err(mistakes) => {
            match mistakes.iter().next() {
                Some(mistake) if mistake.place.is_none() => {
                    value.wrong(format!("{}: {}", shown(name), mistake.mistake.what), right);
                }
                _ => *of_config = Some(mistakes),
            }
            None
        }
    }
}

/// Puts the PLC program at the other end of the line, and runs the line in simulation time.
fn on_simulation_time(
    mut config: Config,
    value: &Value<'_>,
    folder: &Path,
    peer: Option<Peer>,
) -> Option<Config> {
    if let Some(mut peer) = peer {
        // A program's path is relative to this file, and not to the driver.cfg.
        if let Peer::Program { name, .. } = &mut peer
            && plc::HostedProgram::is_path(name)
            && let Ok(file) = std::path::absolute(folder.join(&*name))
        {
            *name = file.to_string_lossy().into_owned();
        }
        config.role = Role::Device;
        let line = loopback::Options {
            mode: Mode::Stepped,
            peer,
        };
        config.bus = line.into();
        config.events = Events::None;
        return Some(config);
    }
    if let Some(options) = config.bus.downcast_mut::<loopback::Options>()
        && let Peer::Program { .. } = &options.peer
    {
        options.mode = Mode::Stepped;
        return Some(config);
    }
    value.wrong(
        "this driver.cfg has no PLC program at the other end of its bus",
        "name the one to be tested: program = \"…\", or --program on the command line",
    );
    None
}

/// Reports duplicate names, so that reports can tell tests apart.
fn check_twins(tables: &[Table<'_>]) {
    let mut first: HashMap<&str, Value<'_>> = HashMap::new();
    for table in tables {
        let Some((_, value)) = table.all().find(|(key, _)| *key == "name") else {
            continue;
        };
        match value.as_text().map(|name| (name, first.get(name))) {
            Some((name, Some(earlier))) => value.wrong(
                format!(
                    "the name \"{}\" is that of the test on line {}",
                    shown(name),
                    earlier.line()
                ),
                "give each test a name of its own",
            ),
            Some((name, None)) => {
                first.insert(name, value);
            }
            None => {}
        }
    }
}
