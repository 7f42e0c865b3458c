//! `tickbus run MODEL.fmu --config FILE`: a foreign FMU as the machine, or as the PLC.

use std::io::{self, Write as _};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::Outcome;
use super::host::{ToldFaults, is_news, never_ran, recording, span};
use tickbus_base::time::{Clock, Monotonic, Nanos, Stop};
use tickbus_driver::{Code, Driver};
use tickbus_driver_cfg::{CommandLineEnd, Config, Kinds};
use tickbus_fieldbus::faults::Effect;
use tickbus_fieldbus::{Link, Role};
use tickbus_fmi::RealTime;
use tickbus_fmi::foreign::{Join, Machine, MachineOptions, Map, Stepped, Unpacked};
use tickbus_fmi::made::is_stepped;
use tickbus_image::signal::Slot;

/// The interval at which the command checks its line.
const LOOK: Nanos = Nanos::from_millis(20);

/// The time that a run has to end after a Ctrl-C, before another Ctrl-C ends the process.
const PATIENCE: Nanos = Nanos::from_secs(1);

/// The step if neither the command line nor the FMU names one.
const STEP: Nanos = Nanos::from_millis(10);

/// The most unjoined signals and variables that are listed.
const LISTED: usize = 20;

/// Run an FMU (FMI 2.0 or 3.0, co-simulation) as the machine on a bus, or as the PLC.
///
/// Variables and signals of the same name are connected; --map connects others. docs/fmi.md has the details.
#[derive(Debug, clap::Args)]
pub(super) struct Arguments {
    /// The FMU.
    #[arg(value_name = "MODEL.fmu")]
    model: PathBuf,

    /// The driver.cfg of the line; without a role, the same file serves both ends.
    #[arg(long, value_name = "FILE")]
    config: PathBuf,

    /// A TOML file with parameters, and with the variables whose names differ from those of their signals.
    #[arg(long, value_name = "FILE")]
    map: Option<PathBuf>,

    /// The FMU's role on the bus.
    #[arg(long, value_enum, default_value = "machine")]
    role: FmuRole,

    /// Simulation time of one step [default: as the FMU proposes, or 10ms].
    #[arg(long, value_name = "TIME", value_parser = span)]
    step: Option<Nanos>,

    /// Seconds of simulation in one second of real time; 0 is as fast as possible [default: 1; 0 on a stepped bus].
    #[arg(long, value_name = "NUMBER", value_parser = pace)]
    pace: Option<f64>,

    /// Stop after this simulation time [default: at Ctrl-C].
    #[arg(long, value_name = "TIME", value_parser = span)]
    duration: Option<Nanos>,

    /// Relative tolerance of the FMU's solver [default: as the FMU proposes].
    #[arg(long, value_name = "NUMBER", value_parser = tolerance)]
    tolerance: Option<f64>,

    /// Run the FMU in a separate process, so that a crash of it does not end this one.
    #[arg(long)]
    isolated: bool,

    /// Use this address instead of the one in FILE.
    #[arg(long, value_name = "HOST:PORT")]
    address: Option<String>,

    /// Inject the faults in the `[[fault]]` sections of this file.
    #[arg(long, value_name = "FILE")]
    faults: Option<PathBuf>,

    /// Record every step to this file: a name ending in .vcd or .csv.
    #[arg(long, value_name = "FILE")]
    record: Option<PathBuf>,

    /// Print statistics at the end.
    #[arg(long)]
    stats: bool,
}

/// The FMU's role on the bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
enum FmuRole {
    /// Writes %I and reads %Q.
    Machine,
    /// Reads %I and writes %Q.
    Plc,
}

fn pace(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(pace) if pace.is_finite() && pace >= 0.0 => Ok(pace),
        _ => Err("write a number: 1 for real time, 0 for as fast as possible".to_owned()),
    }
}

fn tolerance(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(tolerance) if tolerance.is_finite() && tolerance > 0.0 => Ok(tolerance),
        _ => Err("write a number above 0, such as 1e-6".to_owned()),
    }
}

/// Says why the command ends early: all lines, and the outcome.
struct Refused(String, Outcome);

fn wrong(text: impl std::fmt::Display) -> Refused {
    Refused(text.to_string(), Outcome::WrongInput)
}

pub(super) fn run(arguments: &Arguments, kinds: &'static Kinds) -> Outcome {
    match try_run(arguments, kinds) {
        Ok(outcome) => outcome,
        Err(Refused(text, outcome)) => {
            let mistakes = text.lines().count();
            eprintln!("{text}\nrun: failed mistakes={mistakes}");
            outcome
        }
    }
}

fn try_run(arguments: &Arguments, kinds: &'static Kinds) -> Result<Outcome, Refused> {
    let config = configured(arguments, kinds)?;
    let mut fmu = Unpacked::open(&arguments.model).map_err(wrong)?;
    let map = match &arguments.map {
        None => Map::default(),
        Some(file) => Map::load(file, &mut fmu.model, &config).map_err(wrong)?,
    };
    let join = Join::of(&config, &fmu.model, &map)
        .map_err(|mistake| wrong(format!("{}: {mistake}", fmu.file)))?;
    for fault in &config.faults {
        if let Effect::Model(value) = fault.effect {
            let checked = fmu.model.check_fault(&fault.name, value);
            let told = |mistake| format!("{}: the fault \"{}\": {mistake}", fmu.file, fault.name);
            checked.map_err(|mistake| wrong(told(mistake)))?;
        }
    }
    let stop = Stop::new();
    catch_interrupts(&stop, fmu.folder())?;
    let step = arguments.step.or(proposed(fmu.model.step)).unwrap_or(STEP);
    if let Some(duration) = arguments.duration.filter(|duration| *duration < step) {
        return Err(wrong(format!(
            "--duration {duration} is shorter than one step of {step}; give it a longer one, or shorter steps (--step)"
        )));
    }
    let default = if is_stepped(&config) { 0.0 } else { 1.0 };
    let pace = arguments.pace.unwrap_or(default);
    say(&told(&fmu, &join, step, pace));
    let table = config.table.clone();
    let clock = Monotonic::shared();
    let mut driver = Driver::open(config, Arc::clone(&clock) as _).map_err(|error| {
        let outcome = if error.is_wrong_input() {
            Outcome::WrongInput
        } else {
            Outcome::BusFailed
        };
        Refused(error.to_string(), outcome)
    })?;
    let declared = driver.declare_model_faults(fmu.model.fault_names());
    declared.map_err(|mistake| wrong(format!("{}: {mistake}", fmu.file)))?;
    let mut slots = driver.initial_slots();
    let options = MachineOptions {
        isolated: arguments.isolated,
        tolerance: arguments.tolerance,
        duration: arguments.duration,
    };
    let machine = Machine::open(&fmu, &join, &table, options, &mut slots);
    let machine = machine.map_err(|failure| Refused(failure.to_string(), Outcome::BusFailed))?;
    let line = Line {
        driver,
        slots,
        told: None,
        faults: ToldFaults::default(),
        looked: Nanos::ZERO - LOOK,
    };
    let times = Times {
        step,
        pace,
        end: arguments.duration,
    };
    Ok(tick(line, machine, times, arguments.stats, &*clock, &stop))
}

/// Lets Ctrl-C stop the run. A later Ctrl-C ends this process, since an FMU may hang in a step for ever. `folder`
/// contains the unpacked FMU.
fn catch_interrupts(stop: &Stop, folder: &Path) -> Result<(), Refused> {
    let (stop, folder) = (stop.clone(), folder.to_owned());
    let clock = Monotonic::shared();
    let mut last_chance = None;
    let caught = ctrlc::set_handler(move || {
        stop.stop();
        let now = clock.now();
        if now < *last_chance.get_or_insert(now + PATIENCE) {
            return;
        }
        // Nothing can be done if the folder stays.
        let _ = std::fs::remove_dir_all(&folder);
        eprintln!(
            "run: interrupted again, while the FMU or the line did not come back; a recording may lack its end"
        );
        std::process::exit(3);
    });
    caught.map_err(|error| {
        Refused(
            format!("Ctrl-C cannot be caught: {error}"),
            Outcome::BusFailed,
        )
    })
}

/// Returns the driver.cfg for this command's end.
fn configured(arguments: &Arguments, kinds: &'static Kinds) -> Result<Config, Refused> {
    let mut config = match arguments.role {
        FmuRole::Machine => {
            let config = Config::load(&arguments.config, kinds).map_err(wrong)?;
            let other = match config.role {
                Role::Device => None,
                Role::Controller => Some(
                    "role = \"controller\" is the PLC's end; remove it, or run the FMU with --role plc",
                ),
                Role::Observer => Some(
                    "role = \"observer\" only looks at a PLC; run the FMU with the machine's driver.cfg",
                ),
            };
            if let Some(why) = other {
                return Err(wrong(format!("{}: {why}", arguments.config.display())));
            }
            config
        }
        FmuRole::Plc => {
            let asked = CommandLineEnd {
                role: Role::Controller,
                moved: arguments.address.is_some(),
            };
            let mut config =
                Config::load_as(&arguments.config, Some(asked), kinds).map_err(wrong)?;
            // The [record] table belongs to the simulation, which may run at the other end of the same line.
            config.record = None;
            config
        }
    };
    if let Some(address) = &arguments.address {
        let set = config.bus.set_address(address);
        set.map_err(|error| {
            wrong(format!(
                "--address: {error} (the bus is \"{}\")",
                config.bus.kind()
            ))
        })?;
    }
    if let Some(file) = &arguments.faults {
        config.add_faults(file).map_err(wrong)?;
    }
    if let Some(file) = &arguments.record {
        let options = recording(file).map_err(|error| wrong(format!("--record: {error}")))?;
        config.record = Some(options);
    }
    Ok(config)
}

/// Returns the step that an FMU proposes.
#[expect(clippy::cast_possible_truncation, reason = "it saturates")]
fn proposed(seconds: Option<f64>) -> Option<Nanos> {
    let step = Nanos((seconds? * 1e9).round() as i64);
    (step > Nanos::ZERO).then_some(step)
}

/// Describes the joined and the unjoined signals and variables.
fn told(fmu: &Unpacked, join: &Join, step: Nanos, pace: f64) -> String {
    let model = &fmu.model;
    let pace = match pace {
        0.0 => "as fast as possible".to_owned(),
        pace => format!("pace {pace}"),
    };
    let mut lines = vec![format!(
        "\"{}\", FMI {}: {} and {} joined, steps of {step}, {pace}",
        model.name,
        model.version.number(),
        counted(join.inputs.len(), "input"),
        counted(join.outputs.len(), "output")
    )];
    let left = join.left.iter().take(LISTED);
    lines.extend(left.map(|left| format!("not joined: {}", left.0)));
    if join.left.len() > LISTED {
        lines.push(format!("not joined: {} more", join.left.len() - LISTED));
    }
    if model.needs_tool {
        lines.push("this FMU needs the tool that has made it, on this computer".to_owned());
    }
    format!("run: {}\n", lines.join("\nrun: "))
}

/// Returns `1 input` or `2 inputs`.
fn counted(count: usize, what: &str) -> String {
    format!("{count} {what}{}", if count == 1 { "" } else { "s" })
}

/// Prints a text. The line keeps running even if the reader of stdout is gone (`| head`).
fn say(text: &str) {
    let mut out = io::stdout().lock();
    let _ = out.write_all(text.as_bytes()).and_then(|()| out.flush());
}

/// The settings for the passing of time.
#[derive(Clone, Copy)]
struct Times {
    step: Nanos,
    pace: f64,
    end: Option<Nanos>,
}

/// The driver, and the state that was last reported.
struct Line {
    driver: Driver,
    slots: Vec<Slot>,
    told: Option<Link>,
    faults: ToldFaults,
    looked: Nanos,
}

impl Line {
    /// Reports changes, at most once per [`LOOK`].
    fn look(&mut self, now: Nanos) {
        if now < self.looked + LOOK {
            return;
        }
        self.looked = now;
        let link = self.driver.link();
        let mut text = String::new();
        if is_news(self.told.as_ref(), &link) {
            text = format!("run: {}: {}\n", link.state.name(), link.reason);
            self.told = Some(link);
        }
        let faults = self.driver.injected_faults();
        self.faults.tell("run", faults, &mut text);
        if !text.is_empty() {
            say(&text);
        }
    }
}

/// Ticks until the end of the duration, of the FMU or of a run on virtual time, until a failure, or until stopped.
fn tick(
    mut line: Line,
    mut machine: Machine,
    times: Times,
    stats: bool,
    clock: &dyn Clock,
    stop: &Stop,
) -> Outcome {
    let Times { step, pace, end } = times;
    let (mut time, mut ticks, mut stale) = (Nanos::ZERO, 0_u64, 0_u64);
    let mut real_time = RealTime::new(pace);
    let mut failure = None;
    let mut by_itself = false;
    while !stop.is_stopped() && !by_itself && end.is_none_or(|end| time + step <= end) {
        // As in a test: the machine moves first, then the PLC sees the result.
        match machine.step(time, step, &mut line.slots) {
            Ok(stepped) => by_itself = stepped == Stepped::Ended,
            Err(why) => {
                failure = Some(why.to_string());
                break;
            }
        }
        time += step;
        let done = line.driver.exchange(time, &mut line.slots);
        if line.driver.is_over() && done.code.code() >= 0 {
            // The run on virtual time had no further step.
            time = time - step;
            break;
        }
        ticks += 1;
        stale += u64::from(done.code == Code::Stale);
        if done.code.code() < 0 {
            let reason = line.driver.link().reason;
            failure = Some(format!("the line failed: {reason}"));
            break;
        }
        if let Err(why) = machine.take_faults(&mut line.driver) {
            failure = Some(why.to_string());
            break;
        }
        let now = clock.now();
        line.look(now);
        let was_late = real_time.lost() > Nanos::ZERO;
        let due = real_time.due(time, now);
        if real_time.lost() > Nanos::ZERO && !was_late {
            say(&format!(
                "run: at {time} the simulation is {} behind the clock, and does not catch up; the last line has the sum\n",
                real_time.lost().rounded()
            ));
        }
        if let Some(due) = due {
            while clock.now() < due && !stop.is_stopped() {
                clock.wait_until(due, stop);
            }
        }
    }
    // Report what happened in the last steps.
    line.looked = Nanos::ZERO - LOOK;
    line.look(clock.now());
    let ended = machine.end();
    let unmet = || {
        let driver = &line.driver;
        driver.has_only_failed().then(|| never_ran(&driver.link()))
    };
    let failure = failure
        .or(ended.err().map(|why| why.to_string()))
        .or_else(unmet);
    let statistics = stats.then(|| line.driver.statistics());
    let hash = line.driver.fact("sdsp.hash");
    let hash = hash.map_or_else(String::new, |hash| format!(" hash={hash}"));
    line.driver.end_tick(&line.slots);
    line.driver.close();
    let lost = real_time.lost();
    if let Some(statistics) = statistics {
        say(&format!("{statistics}run.lost={lost}\n\n"));
    }
    if by_itself {
        say(&format!(
            "run: the FMU has ended its simulation at {time}\n"
        ));
    }
    let lost = match lost {
        Nanos::ZERO => String::new(),
        lost => format!(" lost={}", lost.rounded()),
    };
    match &failure {
        None => say(&format!(
            "run: ok ticks={ticks} time={time} stale={stale}{lost}{hash}
"
        )),
        Some(why) => say(&format!(
            "run: failed ticks={ticks} time={time}{lost} reason={why}\n"
        )),
    }
    if failure.is_some() {
        Outcome::BusFailed
    } else {
        Outcome::Done
    }
}
