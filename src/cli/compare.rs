//! `tickbus compare REAL`: the recording of a machine beside that of its model.

mod show;

use std::path::{Path, PathBuf};

use super::json::{Format, print_document};
use super::progress::Progress;
use super::report::unknown;
use super::{Outcome, print};
use tickbus_base::Mistake;
use tickbus_base::time::Nanos;
use tickbus_base::toml_text::Mistakes;
use tickbus_compare::{self as compare, Breach, Compared, Fitted, Limits, Options, Side};
use tickbus_driver_cfg::Kinds;
use tickbus_record::RecordingError;
use tickbus_report::{Contents, DEFAULT_BUDGET, write_file};
use tickbus_testing::{FitFile, Model};

/// The most missing and extra edges on the page.
const MOST_LISTED: usize = 1_000;

/// Compare the recording of a machine with that of its model: edges, curves, steps.
///
/// The other recording is --with, or is made by a model (--model) that the commands of the first one drive.
/// docs/compare.md describes what is compared, the likeness, and the files of limits and parameters.
#[derive(Debug, clap::Args)]
pub(super) struct Arguments {
    /// The recording of the real machine, VCD or CSV.
    real: PathBuf,

    /// The recording of the simulated machine, of any simulator.
    #[arg(
        long,
        value_name = "FILE",
        conflicts_with = "model",
        required_unless_present = "model"
    )]
    with: Option<PathBuf>,

    /// A test file whose machine (an FMU, rules or replies) is the model.
    #[arg(long, value_name = "FILE")]
    model: Option<PathBuf>,

    /// Look for the parameters in this file with which the model is most like the recording.
    #[arg(long, value_name = "FILE", requires = "model")]
    fit: Option<PathBuf>,

    /// A TOML file with limits; exit code 1 if one is exceeded.
    #[arg(long, value_name = "FILE")]
    limits: Option<PathBuf>,

    /// The greatest time between two edges that belong together [default: 500ms].
    #[arg(long, value_name = "TIME")]
    window: Option<Nanos>,

    /// Add this time to the simulated recording, such as 1.5s or -20ms.
    #[arg(long, value_name = "TIME", allow_hyphen_values = true, value_parser = signed)]
    shift: Option<Nanos>,

    /// Shift the simulated recording so that the first change of SIGNAL is at the same time in both.
    #[arg(long, value_name = "SIGNAL", conflicts_with = "shift")]
    align: Option<String>,

    /// The signal with the number of the current step; 0 means no step.
    #[arg(long, value_name = "SIGNAL")]
    steps: Option<String>,

    /// A signal that is not compared; may be given several times.
    #[arg(long, value_name = "SIGNAL")]
    ignore: Vec<String>,

    /// Write an HTML page with both recordings in one chart.
    #[arg(long, value_name = "FILE")]
    page: Option<PathBuf>,

    /// The largest number of value changes of each recording in memory; beyond it, the busiest signals are thinned out.
    #[arg(long, value_name = "COUNT", default_value_t = DEFAULT_BUDGET)]
    changes: usize,

    #[command(flatten)]
    format: Format,
}

/// A time with or without a sign.
fn signed(text: &str) -> Result<Nanos, String> {
    let (sign, rest) = text.strip_prefix('-').map_or((1, text), |rest| (-1, rest));
    let time: Nanos = rest.parse().map_err(|mistake| format!("{mistake}"))?;
    Ok(time.times(sign))
}

/// Why nothing was compared.
enum Refused {
    /// The mistakes in a file.
    Mistakes(Mistakes),
    /// The mistakes in recordings, and between them.
    Lines(Vec<String>),
}

impl From<Mistakes> for Refused {
    fn from(mistakes: Mistakes) -> Self {
        Self::Mistakes(mistakes)
    }
}

impl From<Vec<Mistake>> for Refused {
    fn from(mistakes: Vec<Mistake>) -> Self {
        Self::Lines(mistakes.iter().map(ToString::to_string).collect())
    }
}

impl From<RecordingError> for Refused {
    fn from(error: RecordingError) -> Self {
        error.to_string().into()
    }
}

impl From<String> for Refused {
    fn from(line: String) -> Self {
        Self::Lines(vec![line])
    }
}

/// The result of a comparison.
struct Done {
    compared: Compared,
    options: Options,
    breaches: Vec<Breach>,
    fitted: Option<(FitFile, Fitted)>,
    page: Option<PathBuf>,
}

pub(super) fn run(arguments: &Arguments, kinds: &'static Kinds) -> Outcome {
    match compared(arguments, kinds) {
        Ok(done) => {
            let written = if arguments.format.is_json() {
                print_document("compare", show::document(&done))
            } else {
                print("compare", &show::text(&done))
            };
            for breach in &done.breaches {
                eprintln!("{breach}");
            }
            if written == Outcome::Done && !done.breaches.is_empty() {
                return Outcome::WrongInput;
            }
            written
        }
        Err(Refused::Mistakes(mistakes)) => arguments.format.refuse("compare", &mistakes),
        Err(Refused::Lines(lines)) => {
            let reason = format!(
                "{}\ncompare: failed mistakes={}",
                lines.join("\n"),
                lines.len()
            );
            arguments
                .format
                .fail("compare", &reason, Outcome::WrongInput)
        }
    }
}

fn compared(arguments: &Arguments, kinds: &'static Kinds) -> Result<Done, Refused> {
    let limits = arguments.limits.as_deref().map(Limits::load).transpose()?;
    let model = arguments.model.as_deref();
    let model = model.map(|path| Model::load(path, kinds)).transpose()?;
    let fit = arguments.fit.as_deref().zip(model.as_ref());
    let fit = fit
        .map(|(path, model)| FitFile::load(path, model))
        .transpose()?;
    let progress = Progress::begin("compare", format!("reading {}", arguments.real.display()));
    let (real, mut simulated, commands) = sides(arguments, model.as_ref())?;
    let options = options(arguments, &real, &simulated)?;
    progress.now("comparing".to_owned());
    let mut fitted = None;
    let compared = match (&model, &commands, fit) {
        (Some(model), Some(commands), Some(file)) => {
            progress.now("looking for parameters".to_owned());
            let twin = file.twin(model, commands);
            let found = compare::fit(&twin, &real, &options, &file.parameters, file.budget)?;
            simulated = compare::Model::simulate(&twin, &found.values)?;
            let compared = found.compared.clone();
            fitted = Some((file, found));
            compared
        }
        _ => compare::compare(&real, &simulated, &options)?,
    };
    if let Some(page) = &arguments.page {
        write_page(page, arguments, (&real, &simulated), (&compared, &options))?;
    }
    Ok(Done {
        breaches: limits.map_or_else(Vec::new, |limits| limits.check(&compared)),
        compared,
        options,
        fitted,
        page: arguments.page.clone(),
    })
}

/// Both recordings, and the commands for a model.
type Sides = (Side, Side, Option<tickbus_testing::Commands>);

/// Reads the recordings, both at once, or lets the model make the second one.
fn sides(arguments: &Arguments, model: Option<&Model>) -> Result<Sides, Refused> {
    let table = model.map(Model::table);
    let load = |path: &Path| Side::load(path, table, arguments.changes);
    if let Some(model) = model {
        let real = load(&arguments.real)?;
        let commands = model.commands(&arguments.real)?;
        let simulated = model.side(&commands)?;
        return Ok((real, simulated, Some(commands)));
    }
    let with = arguments.with.as_deref();
    let with = with.expect("clap requires it without a model");
    let (real, simulated) = std::thread::scope(|scope| {
        let other = scope.spawn(|| load(with));
        let real = load(&arguments.real);
        (real, other.join().expect("reading does not panic"))
    });
    Ok((real?, simulated?, None))
}

fn options(arguments: &Arguments, real: &Side, simulated: &Side) -> Result<Options, Refused> {
    let window = arguments.window.unwrap_or(Options::default().window);
    let mut options = Options {
        window,
        moved: arguments.shift.unwrap_or_default(),
        steps: arguments.steps.clone(),
        ignore: arguments.ignore.clone(),
    };
    let mut mistakes = Vec::new();
    if window <= Nanos::ZERO {
        mistakes.push("--window: the window is empty; write a time above 0".to_owned());
    }
    let ignore = options.ignore.iter().map(|name| ("--ignore", name, real));
    let steps = options.steps.iter().map(|name| ("--steps", name));
    let of_both = steps.chain(arguments.align.iter().map(|name| ("--align", name)));
    let of_both =
        of_both.flat_map(|(option, name)| [real, simulated].map(|side| (option, name, side)));
    for (option, name, side) in ignore.chain(of_both) {
        if side.run.signal(name).is_none() {
            mistakes.push(unknown(option, name, &side.name, &side.run));
        }
    }
    if let (Some(name), true) = (&arguments.align, mistakes.is_empty()) {
        let first = |side: &Side| {
            let signal = side.run.signal(name)?;
            // The first entry is the initial value.
            let changes = side.run.signals()[signal].changes();
            Some(changes.get(1)?.at)
        };
        match (first(real), first(simulated)) {
            (Some(real), Some(simulated)) => options.moved = real - simulated,
            _ => mistakes.push(format!(
                "--align: \"{name}\" does not change in both recordings; name a signal that does"
            )),
        }
    }
    if mistakes.is_empty() {
        Ok(options)
    } else {
        Err(Refused::Lines(mistakes))
    }
}

fn write_page(
    page: &Path,
    arguments: &Arguments,
    (real, simulated): (&Side, &Side),
    (compared, options): (&Compared, &Options),
) -> Result<(), Refused> {
    let budget = arguments.changes.saturating_mul(2);
    let run = compare::both(real, simulated, compared, options.moved, budget);
    let tables = compare::tables(compared, MOST_LISTED);
    let source = format!(
        "{} · {} · likeness {:.4}",
        real.name, simulated.name, compared.likeness
    );
    let steps = compared.steps.as_ref();
    let contents = Contents {
        title: "Real and simulated",
        source: &source,
        run: &run,
        steps: steps.and_then(|steps| run.signal(&steps.signal)),
        faults: &[],
        statistics: None,
        texts: &[],
        tables: &tables,
    };
    let written = write_file(&contents, page);
    written.map(drop).map_err(|error| {
        let page = page.display();
        format!("{page}: the page cannot be written: {error}; choose another place").into()
    })
}
