//! `tickbus report RECORDING`: makes an HTML page about a run.

use std::fs;
use std::path::{Path, PathBuf};

use serde_json::{Value, json};

use super::json::{Format, print_document};
use super::progress::Progress;
use super::{Outcome, print};
use tickbus_base::toml_text::nearest;
use tickbus_record::Recording;
use tickbus_report as report;
use tickbus_report::{Contents, DEFAULT_BUDGET, Run, RunStatistics};

/// Make an HTML page from a recording: chart, steps, faults, states of the line, distributions.
///
/// The page is a single file without external resources; any browser of 2023 or later shows it.
#[derive(Debug, clap::Args)]
pub(super) struct Arguments {
    /// The recording, VCD or CSV.
    recording: PathBuf,

    /// The output file [default: beside the recording, with the ending .html].
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,

    /// The page's heading [default: the driver's name, or the recording's].
    #[arg(long, value_name = "TEXT")]
    title: Option<String>,

    /// The signal with the number of the current step; 0 means no step.
    #[arg(long, value_name = "SIGNAL")]
    steps: Option<String>,

    /// A signal that is on during a fault; may be given several times.
    #[arg(long = "fault", value_name = "SIGNAL")]
    faults: Vec<String>,

    /// A file with statistics, as a driver or `tickbus plc --stats` writes them; other lines are ignored.
    #[arg(long, value_name = "FILE")]
    stats: Option<PathBuf>,

    /// A text file to include, such as a demo's report; may be given several times.
    #[arg(long = "text", value_name = "FILE")]
    texts: Vec<PathBuf>,

    /// The largest number of value changes in the page; beyond it, the busiest signals are thinned out.
    #[arg(long, value_name = "COUNT", default_value_t = DEFAULT_BUDGET)]
    changes: usize,

    #[command(flatten)]
    format: Format,
}

pub(super) fn run(arguments: &Arguments) -> Outcome {
    match make(arguments) {
        Ok(made) if arguments.format.is_json() => print_document("report", made.document()),
        Ok(made) => print("report", &format!("report: ok {}\n", made.line())),
        Err(mistakes) => {
            for mistake in &mistakes {
                eprintln!("{mistake}");
            }
            eprintln!("report: failed mistakes={}", mistakes.len());
            if arguments.format.is_json() {
                let list = mistakes.iter().map(|what| json!({ "what": what }));
                print_document(
                    "report",
                    json!({ "ok": false, "mistakes": list.collect::<Value>() }),
                );
            }
            Outcome::WrongInput
        }
    }
}

/// The page that was made.
struct Made {
    signals: usize,
    ticks: u64,
    bytes: u64,
    file: PathBuf,
}

impl Made {
    fn line(&self) -> String {
        let Self {
            signals,
            ticks,
            bytes,
            file,
        } = self;
        format!(
            "signals={signals} ticks={ticks} bytes={bytes} file={}",
            file.display()
        )
    }

    fn document(&self) -> Value {
        json!({
            "signals": self.signals,
            "ticks": self.ticks,
            "bytes": self.bytes,
            "file": self.file.display().to_string(),
        })
    }
}

/// The data that the page shows in addition to the recording.
struct Beside {
    statistics: Option<RunStatistics>,
    /// Each text with its file name.
    texts: Vec<(String, String)>,
}

impl Beside {
    fn read(arguments: &Arguments, mistakes: &mut Vec<String>) -> Self {
        let mut text = |path: &Path| {
            let bytes = fs::read(path).map_err(|error| {
                let path = path.display();
                mistakes.push(format!(
                    "{path}: this text cannot be read: {error}; check the path"
                ));
            });
            bytes
                .ok()
                .map(|bytes| String::from_utf8_lossy(&bytes).into_owned())
        };
        let statistics = arguments.stats.as_deref().and_then(&mut text);
        let statistics = statistics.map(|text| RunStatistics::read(&text));
        let texts = arguments.texts.iter();
        let texts = texts
            .filter_map(|path| Some((file_name(path), text(path)?)))
            .collect();
        if let (Some(statistics), Some(path)) = (&statistics, &arguments.stats)
            && statistics.is_empty()
        {
            let path = path.display();
            mistakes.push(format!(
                "{path}: there are no statistics in it; lines with key=value are expected"
            ));
        }
        Self { statistics, texts }
    }
}

/// Makes the page and describes it, or returns all mistakes.
fn make(arguments: &Arguments) -> Result<Made, Vec<String>> {
    let mut mistakes = Vec::new();
    let beside = Beside::read(arguments, &mut mistakes);
    let mut recording = match Recording::open(&arguments.recording, None) {
        Ok(recording) => recording,
        Err(error) => {
            mistakes.push(error.to_string());
            return Err(mistakes);
        }
    };
    let name = file_name(&arguments.recording);
    let progress = Progress::begin("report", format!("reading {name}"));
    let (run, error) = report::read(&mut recording, arguments.changes);
    drop(progress);
    let mut number = |option: &str, name: &String| {
        let found = run.signal(name);
        if found.is_none() {
            mistakes.push(unknown(option, name, "the recording", &run));
        }
        found
    };
    let steps = arguments
        .steps
        .as_ref()
        .and_then(|name| number("--steps", name));
    let faults = arguments
        .faults
        .iter()
        .filter_map(|name| number("--fault", name));
    let faults: Vec<usize> = faults.collect();
    let columns = recording.columns();
    let file = name;
    let names = [arguments.title.as_ref(), Some(&columns.driver), Some(&file)];
    let title = names.into_iter().flatten().find(|name| !name.is_empty());
    let ending = recording.ending();
    let parts = [&file, &columns.role, &ending].map(String::as_str);
    let parts = parts.into_iter().filter(|part| !part.is_empty());
    let contents = Contents {
        title: title.unwrap_or(&file),
        source: &parts.collect::<Vec<_>>().join(" · "),
        run: &run,
        steps,
        faults: &faults,
        statistics: beside.statistics.as_ref(),
        texts: &beside.texts,
        tables: &[],
    };
    let mut made = None;
    // A recording is worth a page up to a damaged place; mistakes on the command line are not.
    if mistakes.is_empty() {
        let beside = || arguments.recording.with_extension("html");
        let out = arguments.out.clone().unwrap_or_else(beside);
        let file = out.display();
        match report::write_file(&contents, &out) {
            Ok(bytes) => {
                made = Some(Made {
                    signals: run.signals().len(),
                    ticks: run.ticks(),
                    bytes,
                    file: out.clone(),
                });
            }
            Err(error) => mistakes.push(format!(
                "{file}: the page cannot be written: {error}; choose another place with --out"
            )),
        }
    }
    mistakes.extend(error.map(|error| error.to_string()));
    match made {
        Some(made) if mistakes.is_empty() => Ok(made),
        _ => Err(mistakes),
    }
}

fn file_name(path: &Path) -> String {
    path.file_name()
        .unwrap_or(path.as_os_str())
        .to_string_lossy()
        .into_owned()
}

/// That the recording with this title has no signal `name`.
pub(super) fn unknown(option: &str, name: &str, title: &str, run: &Run) -> String {
    let names = run.signals().iter().map(|signal| &*signal.name);
    let right = nearest(name, names).map_or_else(
        || "tickbus check lists the names of a driver.cfg".to_owned(),
        |near| format!("did you mean \"{near}\"?"),
    );
    format!("{option}: {title} has no signal \"{name}\"; {right}")
}
