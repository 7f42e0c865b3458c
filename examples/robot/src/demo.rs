//! The demo: runs all experiments, and writes the page.

use std::fs::File;
use std::io::{self, BufWriter};
use std::path::Path;
use std::process::{Command, Stdio};
use std::thread;

use tickbus_base::time::{Clock as _, Monotonic, Nanos, Stop};
use tickbus_net::Address;
use tickbus_robot::experiment::{Experiment, Kind, verdict};
use tickbus_robot::load::Load;
use tickbus_robot::metrics::Run;
use tickbus_robot::page::{self, Picture};
use tickbus_robot::participants::STEPS;
use tickbus_robot::random::Random;
use tickbus_robot::shear::{self, Link};
use tickbus_robot::{free_wheeling, lock_step, wall_clock};
use tickbus_virtual_time::{Meeting, Outcome};

/// The intervals of the model's OPC link, in milliseconds.
const MODEL_UPDATES: [i64; 3] = [10, 50, 100];
/// The intervals of the link on the wall clock, in milliseconds.
const WALL_UPDATES: [i64; 2] = [10, 50];
/// The intervals at which the shear's PLC samples, in milliseconds.
const SHEAR_UPDATES: [i64; 2] = [50, 100];
/// The interval shown in the pictures, in milliseconds.
const SHOWN: i64 = 50;

/// Runs everything, and returns the figures of the last line.
pub(crate) fn run(file: &Path, runs: u32) -> Result<String, String> {
    let load = Load::on_all_processors();
    let mut experiments = vec![
        in_lock_step("in one process, loaded computer", runs, in_process)?,
        in_lock_step("over TCP, loaded computer", runs, |plc_first| {
            in_processes(Meeting::Tcp(Address::local(0)), plc_first)
        })?,
    ];
    drop(load);
    if cfg!(unix) {
        let name = format!("robot-{}", std::process::id());
        let run = |plc_first| in_processes(Meeting::SharedMemory(name.clone()), plc_first);
        experiments.push(in_lock_step("through shared memory", runs, run)?);
    }
    for update in MODEL_UPDATES {
        experiments.push(told(model(update, runs)));
    }
    for update in WALL_UPDATES {
        experiments.push(told(on_wall_clock(update, runs)));
    }
    write_page(&experiments, file)
        .map_err(|error| format!("{} cannot be written: {error}", file.display()))?;
    verdict(&experiments)?;
    let missed = cut_sheets()?;
    let errors = experiments.iter().filter_map(|of| {
        let name = match of.kind {
            Kind::LockStep => return None,
            Kind::Model(update) => format!("model_{update}"),
            Kind::WallClock(update) => format!("wall_clock_{update}"),
        };
        Some(format!(" {name}_e_mm={:.1}", of.metrics.error))
    });
    let lock_step = &experiments[0];
    Ok(format!(
        "lock_step_runs={} steps={STEPS} hash={} e_mm={:.7} d_mm={}{} shear_missed={missed} page={}",
        experiments.iter().map(|of| of.hashes.len()).sum::<usize>(),
        lock_step.hashes[0],
        lock_step.metrics.error,
        lock_step.metrics.difference,
        errors.collect::<String>(),
        file.display()
    ))
}

/// Lets the shear cut in lock-step and free-wheeling, all at once since they mostly wait. Returns how many pulses of its
/// sensors were missed.
fn cut_sheets() -> Result<u64, String> {
    let free = SHEAR_UPDATES.map(Link::FreeWheeling);
    let links = [Link::LockStep].into_iter().chain(free);
    let outcomes = thread::scope(|scope| {
        let runs: Vec<_> = links
            .map(|link| (link, scope.spawn(move || cut_sheet(link))))
            .collect();
        let runs = runs
            .into_iter()
            .map(|(link, run)| (link, run.join().expect("a run does not panic")));
        runs.collect::<Vec<_>>()
    });
    let mut missed = 0;
    for (link, outcome) in outcomes {
        let outcome = outcome?;
        let name = match link {
            Link::LockStep => "lock-step".to_owned(),
            Link::FreeWheeling(cycle) => format!("free-wheeling, sampled every {cycle} ms"),
        };
        println!(
            "demo-robot: shear, {name}: {} marks, {} cuts, {} pulses of sensors missed",
            outcome.marks,
            outcome.cuts,
            outcome.missed()
        );
        for sentence in &outcome.named {
            println!("demo-robot:   {sentence}");
        }
        if (link == Link::LockStep) != (outcome.missed() == 0) {
            return Err(format!(
                "the shear, {name}, missed {} pulses",
                outcome.missed()
            ));
        }
        missed += outcome.missed();
    }
    Ok(missed)
}

fn cut_sheet(link: Link) -> Result<shear::Outcome, String> {
    let (clock, stop) = (Monotonic::shared(), Stop::new());
    let begun = clock.now();
    let pause = |time: Nanos| {
        if link != Link::LockStep {
            clock.wait_until(begun + time, &stop);
        }
    };
    shear::run(link, Monotonic::shared(), pause)
}

/// Prints the result of an experiment at once, as all of them together take a while.
fn told(experiment: Experiment) -> Experiment {
    let metrics = experiment.metrics;
    println!(
        "demo-robot: {}: {} runs, E {:.3} mm, D {:.1} mm, G {:.1} mm",
        experiment.name,
        experiment.runs.len(),
        metrics.error,
        metrics.difference,
        metrics.deviation
    );
    experiment
}

/// Runs in lock-step, with the clients in random order: `one` receives true if the PLC is first.
fn in_lock_step(
    name: &str,
    runs: u32,
    one: impl Fn(bool) -> Result<(Run, Outcome), String>,
) -> Result<Experiment, String> {
    let mut random = Random::new(1);
    let mut all = Vec::new();
    let mut hashes = Vec::new();
    for _ in 0..runs {
        let (run, outcome) = one(random.unit() < 0.5)?;
        all.push(run);
        hashes.push(outcome.hash.to_string());
    }
    let experiment = Experiment::new(format!("lock-step, {name}"), Kind::LockStep, all);
    Ok(told(Experiment {
        hashes,
        ..experiment
    }))
}

fn in_process(plc_first: bool) -> Result<(Run, Outcome), String> {
    lock_step::in_process(plc_first).map_err(|ended| ended.to_string())
}

/// Runs plant and PLC as separate processes.
fn in_processes(at: Meeting, plc_first: bool) -> Result<(Run, Outcome), String> {
    let start = |name: &str, server: &Meeting| {
        let mut command = Command::new(std::env::current_exe()?);
        match server {
            Meeting::Tcp(_) | Meeting::Unix(_) => {
                command.args([name, "--server", &server.to_string()])
            }
            Meeting::SharedMemory(memory) => command.args([name, "--shared-memory", memory]),
        };
        if name == "plant" {
            command.arg("--positions");
        }
        command.stdout(Stdio::piped()).spawn()
    };
    let clients = |server: &Meeting| {
        let mut names = ["plant", "plc"];
        if plc_first {
            names.reverse();
        }
        let [first, second] = names.map(|name| start(name, server));
        let [plc, plant] = if plc_first {
            [first, second]
        } else {
            [second, first]
        };
        let plant = plant?.wait_with_output()?;
        plc?.wait_with_output()?;
        Ok(plant.stdout)
    };
    let (printed, outcome) = lock_step::served(at, clients).map_err(|ended| ended.to_string())?;
    let printed =
        printed.map_err(|error: io::Error| format!("the clients cannot be started: {error}"))?;
    let run = positions(&printed).ok_or("the plant printed something else than positions")?;
    Ok((run, outcome))
}

/// Reads the positions that the plant printed before its last line.
fn positions(printed: &[u8]) -> Option<Run> {
    let text = std::str::from_utf8(printed).ok()?;
    let position = |line: &str| {
        let (x, z) = line.split_once(' ')?;
        Some([x.parse().ok()?, z.parse().ok()?])
    };
    text.lines().take(STEPS).map(position).collect()
}

fn model(update: i64, runs: u32) -> Experiment {
    let runs =
        (1..=runs).map(|seed| free_wheeling::run(seed.into(), Nanos::from_millis(update), STEPS));
    let name = format!("free-wheeling, model, OPC every {update} ms");
    Experiment::new(name, Kind::Model(update), runs.collect())
}

/// Makes all runs at once, since they mostly wait.
fn on_wall_clock(update: i64, runs: u32) -> Experiment {
    let clock = Monotonic::shared();
    let runs = thread::scope(|scope| {
        let one = || wall_clock::run(&*clock, Nanos::from_millis(update), STEPS);
        let runs: Vec<_> = (0..runs).map(|_| scope.spawn(one)).collect();
        let runs = runs
            .into_iter()
            .map(|run| run.join().expect("a run does not panic"));
        runs.collect()
    });
    let name = format!("free-wheeling, wall clock, OPC every {update} ms");
    Experiment::new(name, Kind::WallClock(update), runs)
}

fn write_page(experiments: &[Experiment], file: &Path) -> io::Result<()> {
    let of = |kind| {
        experiments
            .iter()
            .find(|of| of.kind == kind)
            .expect("it was run")
    };
    let pictures = [
        Picture {
            heading: "In lock-step",
            of: of(Kind::LockStep),
            caption: "PLC and simulation share a virtual time, on a computer whose processors are all busy.",
        },
        Picture {
            heading: "Free-wheeling, a model",
            of: of(Kind::Model(SHOWN)),
            caption: "Frames of about 5 ms, one in a hundred held up; OPC every 50 ms. Each run has its seed.",
        },
        Picture {
            heading: "Free-wheeling, on this computer",
            of: of(Kind::WallClock(SHOWN)),
            caption: "PLC, simulation and OPC are threads that sleep; OPC every 50 ms.",
        },
    ];
    let mut out = BufWriter::new(File::create(file)?);
    page::write(&pictures, experiments, &mut out)?;
    out.into_inner()
        .map_err(io::IntoInnerError::into_error)?
        .sync_all()
}
