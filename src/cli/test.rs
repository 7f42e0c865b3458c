//! `tickbus test DIR`: runs the tests of PLC programs in a folder.

mod sweep;

use std::collections::HashSet;
use std::fs::{self, File};
use std::io::{self, Write as _};
use std::num::NonZeroU16;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};
use std::time::Instant;

use serde_json::{Value, json};

use super::Outcome;
use super::json::{Format, print_document};
use super::progress::Progress;
use tickbus_base::toml_text::{Mistakes, load_text};
use tickbus_driver::DriverError;
use tickbus_driver_cfg::Kinds;
use tickbus_driver_cfg::loopback::Peer;
use tickbus_plc::ProgramError;
use tickbus_report::{RunStatistics, Sweeps, Swept, link, page_beside, write_sweeps_file};
use tickbus_testing::{
    Case, Coverage, Group, Judgement, Suite, Test, Verdict, Wanted, build_program, junit_xml,
    verdict_hash,
};

/// Run tests of PLC programs from TOML files, on simulation time.
///
/// Each *.toml in DIR and its subfolders with a config or a [[test]] is a test file; docs/testing.md describes them.
/// A file with a [sweep] also runs its scenario with each fault at each moment; docs/sweeps.md describes that. Exit code 0 when all tests pass, 1 when one fails or a file is wrong.
#[derive(Debug, clap::Args)]
pub(super) struct Arguments {
    /// Folders with test files, or test files.
    #[arg(required = true, value_name = "DIR")]
    paths: Vec<PathBuf>,

    /// Write the results as `JUnit` XML, for a CI server.
    #[arg(long, value_name = "FILE")]
    junit: Option<PathBuf>,

    /// Write a recording of each failed test, as VCD, and a report about it to DIR; of a sweep those of 20 runs.
    #[arg(long, value_name = "DIR")]
    keep: Option<PathBuf>,

    /// Write the matrices of the sweeps to FILE, as an HTML page whose cells open what --keep has kept.
    #[arg(long, value_name = "FILE")]
    page: Option<PathBuf>,

    /// Run only tests whose name or file name contains this text; of a sweep the one run with this name, if there is one.
    #[arg(long, value_name = "TEXT")]
    only: Option<String>,

    /// Test this PLC program in the place of the one that the files name: a built-in one, a shared object, or Structured Text
    /// (*.st), which iec2c and a C compiler build first.
    #[arg(long, value_name = "PROGRAM")]
    program: Option<String>,

    /// List the tests without running them.
    #[arg(long)]
    list: bool,

    /// Accept all verdicts of the sweeps: write them to accepted.toml beside the test file.
    #[arg(long, conflicts_with_all = ["only", "list"])]
    accept: bool,

    /// Print which branches of a block (block = "...") the tests and the sweep have not taken.
    #[arg(long, conflicts_with = "list")]
    coverage: bool,

    /// Make this many runs of a sweep at once; by default as many as there are cores.
    #[arg(long, value_name = "N")]
    jobs: Option<NonZeroU16>,

    #[command(flatten)]
    format: Format,
}

/// Why a program of the command line cannot be tested.
enum Unusable {
    /// There is no such program.
    Name(ProgramError),
    /// The source of the program is wrong.
    File(Mistakes),
}

impl Arguments {
    /// The arguments that test `program` by the files in a folder.
    pub(super) fn of_program(folder: PathBuf, program: &str, format: Format) -> Self {
        Self {
            paths: vec![folder],
            junit: None,
            keep: None,
            page: None,
            only: None,
            program: Some(program.to_owned()),
            list: false,
            accept: false,
            coverage: false,
            jobs: None,
            format,
        }
    }

    /// Returns what the tests are asked for, with the program, which is built if it is a text.
    fn wanted(&self, kinds: &'static Kinds) -> Result<Wanted, Unusable> {
        let program = self.program.as_deref().map(|name| {
            let file = Path::new(name);
            if !file
                .extension()
                .is_some_and(|ending| ending.eq_ignore_ascii_case("st"))
            {
                return Peer::named(name, kinds.programs()).map_err(Unusable::Name);
            }
            let object = build_program(file).map_err(Unusable::File)?;
            let object = object.to_string_lossy();
            Peer::named(&object, kinds.programs()).map_err(Unusable::Name)
        });
        Ok(Wanted {
            counts: self.coverage,
            program: program.transpose()?,
        })
    }
}

/// The longest name of a recording, in characters, and in bytes; file systems allow 255.
const LONGEST_NAME: usize = 120;
const MOST_BYTES: usize = 200;

/// The number of tests for each result.
#[derive(Default)]
struct Count {
    passed: usize,
    failed: usize,
    wrong: usize,
    ticks: u64,
    /// The verdicts of the sweeps, in the order of their lists.
    verdicts: Vec<(String, Judgement)>,
    /// Their matrices.
    swept: Vec<Swept>,
}

impl Count {
    /// The hash over all verdicts.
    fn hash(&self) -> String {
        let verdicts = self.verdicts.iter();
        let pairs = verdicts.map(|(name, found)| (name.as_str(), found));
        format!("{:016x}", verdict_hash(pairs))
    }
}

/// The results of a file beside its tests.
#[derive(Default)]
struct Details {
    /// The sweep, as JSON.
    sweep: Value,
    /// The branches of the block, if they are counted.
    coverage: Option<Coverage>,
}

/// The data that each file of a run needs.
struct Job<'a> {
    arguments: &'a Arguments,
    kinds: &'static Kinds,
    wanted: Wanted,
    progress: Progress,
    /// The names of the recordings so far, in small letters: some file systems do not distinguish them.
    kept: Mutex<HashSet<String>>,
}

impl Job<'_> {
    /// The address of a report as seen from the page of the sweeps.
    fn link(&self, report: Option<&Path>) -> Option<String> {
        link(self.arguments.page.as_deref()?, report?)
    }

    /// Removes the results of an earlier run, which would be taken for those of this run if it is interrupted.
    fn clear(&self) -> Result<(), String> {
        let arguments = self.arguments;
        for path in [&arguments.junit, &arguments.page].into_iter().flatten() {
            clear(path)
                .map_err(|error| format!("test: {}: cannot be written: {error}", path.display()))?;
        }
        Ok(())
    }

    /// Writes the results to the files that the command line names.
    fn write(&self, groups: &[Group], count: &mut Count) {
        let mut failed = Vec::new();
        if let Some(path) = &self.arguments.junit {
            let written = write_file(path, &junit_xml(groups));
            failed.extend(written.err().map(|error| (path, error)));
        }
        if let Some(path) = &self.arguments.page {
            if count.swept.is_empty() && count.wrong == 0 {
                self.report("test: no run of a [sweep] was made, so --page has nothing to show");
                count.wrong += 1;
            } else if !count.swept.is_empty() {
                let sweeps = Sweeps {
                    title: match &count.swept[..] {
                        [one] => format!("Sweep of {}", one.file),
                        several => format!("Sweeps of {} files", several.len()),
                    },
                    hash: count.hash(),
                    files: std::mem::take(&mut count.swept),
                };
                let written = write_sweeps_file(&sweeps, path);
                failed.extend(written.err().map(|error| (path, error)));
            }
        }
        for (path, error) in failed {
            count.wrong += 1;
            self.report(format!(
                "test: {}: cannot be written: {error}",
                path.display()
            ));
        }
    }

    /// A file name, without ending, that all file systems allow and that no earlier recording of this run has.
    fn recording_name(&self, name: &str) -> String {
        let allowed = |c: char| match c {
            '/' | '\\' | ':' | '*' | '?' | '"' | '<' | '>' | '|' => '_',
            c => c,
        };
        let mut name: String = name.chars().map(allowed).take(LONGEST_NAME).collect();
        while name.len() > MOST_BYTES {
            name.pop();
        }
        let mut kept = self.kept.lock().unwrap_or_else(PoisonError::into_inner);
        let mut numbered = name.clone();
        for number in 2.. {
            if kept.insert(numbered.to_lowercase()) {
                break;
            }
            numbered = format!("{name} {number}");
        }
        numbered
    }

    /// Prints a line on stdout, unless a JSON document will say the same. The tests continue even if the reader is gone
    /// (`| head`).
    fn tell(&self, line: &str) {
        if !self.arguments.format.is_json() {
            let print = || writeln!(io::stdout().lock(), "{line}");
            let _ = self.progress.aside(print);
        }
    }

    /// Prints a mistake on stderr.
    fn report(&self, mistake: impl std::fmt::Display) {
        self.progress.aside(|| eprintln!("{mistake}"));
    }
}

pub(super) fn run(arguments: &Arguments, kinds: &'static Kinds) -> Outcome {
    let mut files = Vec::new();
    for path in &arguments.paths {
        if let Err(error) = collect(path, &mut files) {
            let path = path.display();
            let reason =
                format!("test: {path}: {error}; name a folder with test files, or a test file");
            return arguments.format.fail("test", &reason, Outcome::WrongInput);
        }
    }
    if files.is_empty() {
        let paths: Vec<String> = arguments
            .paths
            .iter()
            .map(|path| path.display().to_string())
            .collect();
        let reason = format!(
            "test: there is no *.toml with tests in {}; docs/testing.md tells what a test file looks like",
            paths.join(", ")
        );
        return arguments.format.fail("test", &reason, Outcome::WrongInput);
    }
    let wanted = match arguments.wanted(kinds) {
        Ok(wanted) => wanted,
        Err(Unusable::File(mistakes)) => return arguments.format.refuse("test", &mistakes),
        Err(Unusable::Name(error)) => {
            let reason = format!("test: --program: {error}");
            return arguments.format.fail("test", &reason, Outcome::Usage);
        }
    };
    let mut count = Count::default();
    let job = Job {
        arguments,
        kinds,
        wanted,
        progress: Progress::begin("test", "reading the tests"),
        kept: Mutex::default(),
    };
    if !arguments.list
        && let Err(reason) = job.clear()
    {
        return arguments.format.fail("test", &reason, Outcome::WrongInput);
    }
    let (groups, details): (Vec<Group>, Vec<Details>) = files
        .iter()
        .map(|file| run_file(file, &job, &mut count))
        .unzip();
    if !arguments.list {
        job.write(&groups, &mut count);
    }
    conclude(&job, (&groups, &details), &count)
}

fn conclude(job: &Job<'_>, results: (&[Group], &[Details]), count: &Count) -> Outcome {
    let arguments = job.arguments;
    let Count {
        passed,
        failed,
        wrong,
        ticks,
        verdicts,
        ..
    } = count;
    let green = failed + wrong == 0 && (*passed > 0 || arguments.list);
    if let (Some(only), 0) = (&arguments.only, passed + failed + wrong) {
        eprintln!("test: no test has \"{only}\" in its name; --list lists them");
    }
    let mut blocks: Vec<Coverage> = Vec::new();
    for found in results.1.iter().filter_map(|one| one.coverage.as_ref()) {
        if !blocks.iter_mut().any(|block| block.add(found)) {
            blocks.push(found.clone());
        }
    }
    if blocks.is_empty() && arguments.coverage && *wrong == 0 {
        eprintln!("test: --coverage counts the branches of a block, and no file here tests one");
    }
    for block in &blocks {
        job.tell(&block.line());
    }
    let mut printed = Outcome::Done;
    if arguments.format.is_json() {
        let document = document(arguments, results, count, green);
        printed = job.progress.aside(|| print_document("test", document));
    }
    if !arguments.list {
        let hash = if verdicts.is_empty() {
            String::new()
        } else {
            format!(" hash={}", count.hash())
        };
        job.tell(&format!(
            "test: {} passed={passed} failed={failed} wrong={wrong} ticks={ticks}{hash}",
            if green { "ok" } else { "failed" }
        ));
    }
    if green { printed } else { Outcome::WrongInput }
}

/// Returns the results as a JSON document.
fn document(
    arguments: &Arguments,
    (groups, details): (&[Group], &[Details]),
    count: &Count,
    green: bool,
) -> Value {
    let of_case = |case: &Case| {
        let (verdict, what, details) = match &case.verdict {
            Verdict::Passed if arguments.list => (None, None, None),
            Verdict::Passed => (Some("passed"), None, None),
            Verdict::Failed(what, full) => (Some("failed"), Some(what), Some(full)),
            Verdict::Wrong(what, full) => (Some("wrong"), Some(what), Some(full)),
        };
        json!({
            "name": case.name,
            "line": case.line,
            "verdict": verdict,
            "what": what,
            "details": details,
            "seconds": case.took.as_secs_f64(),
        })
    };
    let files = groups.iter().zip(details).map(|(group, details)| {
        let tests: Value = group.cases.iter().map(of_case).collect();
        let coverage = details.coverage.as_ref().map(of_coverage);
        json!({ "file": group.name, "tests": tests, "sweep": details.sweep, "coverage": coverage })
    });
    json!({
        "ok": green,
        "passed": if arguments.list { 0 } else { count.passed },
        "failed": count.failed,
        "wrong": count.wrong,
        "ticks": count.ticks,
        "files": files.collect::<Value>(),
    })
}

fn of_coverage(coverage: &Coverage) -> Value {
    let branches = coverage
        .branches
        .iter()
        .map(|branch| json!({ "line": branch.line, "label": branch.label, "taken": branch.taken }));
    json!({
        "block": coverage.block,
        "file": coverage.file,
        "taken": coverage.taken(),
        "branches": branches.collect::<Value>(),
    })
}

/// Returns the case of a test that is listed and does not run: its verdict does not count.
fn listed(test: &Test) -> Case {
    Case {
        name: test.name.clone(),
        line: test.place.0,
        took: std::time::Duration::ZERO,
        verdict: Verdict::Passed,
        output: String::new(),
    }
}

/// Collects the test files at `path`, sorted by name.
fn collect(path: &Path, files: &mut Vec<PathBuf>) -> io::Result<()> {
    if !path.is_dir() {
        // Reading the file later shows whether it exists and can be read.
        files.push(path.to_owned());
        return Ok(());
    }
    let entries: io::Result<Vec<_>> = fs::read_dir(path)?.collect();
    let mut entries: Vec<PathBuf> = entries?.into_iter().map(|entry| entry.path()).collect();
    entries.sort();
    for entry in entries {
        // Links are not followed, since they may lead back up. Their targets can be named on the command line.
        if entry.is_dir() && !entry.is_symlink() {
            collect(&entry, files)?;
        } else if entry.extension().is_some_and(|ending| ending == "toml") && is_test_file(&entry) {
            files.push(entry);
        }
    }
    Ok(())
}

/// Returns true if a file in a folder is a test file: it has a driver.cfg, a block or a test. Other TOML files, such as
/// Cargo.toml, can be in the same folder.
fn is_test_file(path: &Path) -> bool {
    let Ok(text) = load_text(path) else {
        // Running the file reports why.
        return true;
    };
    text.lines().map(str::trim_start).any(|line| {
        let header = line.strip_prefix("[[").map(str::trim_start);
        let has = |key| {
            let rest = line.strip_prefix(key).map(str::trim_start);
            rest.is_some_and(|rest| rest.starts_with('='))
        };
        header.is_some_and(|rest| rest.starts_with("test")) || has("config") || has("block")
    })
}

/// Runs the tests of a file, and its sweep.
fn run_file(file: &Path, job: &Job<'_>, count: &mut Count) -> (Group, Details) {
    let arguments = job.arguments;
    let name = file.display().to_string();
    let suite = match Suite::load_as(file, job.kinds, &job.wanted) {
        Ok(suite) => suite,
        Err(mistakes) => {
            count.wrong += mistakes.len();
            job.report(&mistakes);
            let cases = vec![wrong_file(&mistakes)];
            return (Group { name, cases }, Details::default());
        }
    };
    let wanted = |test: &&Test| {
        let only = arguments.only.as_deref().unwrap_or_default();
        test.name.contains(only) || name.contains(only)
    };
    let mut cases = Vec::new();
    for test in suite.tests.iter().filter(wanted) {
        if arguments.list {
            job.tell(&format!(
                "{name}:{}:{}: {}",
                test.place.0, test.place.1, test.name
            ));
            count.passed += 1;
            cases.push(listed(test));
        } else {
            cases.push(run_test(&suite, test, job, count));
        }
    }
    let mut details = Details::default();
    if let Some(sweep) = &suite.sweep {
        let (runs, document) = sweep::run(&suite, sweep, job, count);
        cases.extend(runs);
        details.sweep = document;
    }
    details.coverage = suite.coverage();
    (Group { name, cases }, details)
}

/// Describes a file that cannot be read, in the form that a CI server shows.
fn wrong_file(mistakes: &Mistakes) -> Case {
    let first = mistakes.iter().next();
    let line = first.and_then(|found| found.place);
    Case {
        name: "the test file is right".to_owned(),
        line: line.map_or(1, |(line, _)| line),
        took: std::time::Duration::ZERO,
        verdict: Verdict::Wrong(
            first
                .map(|found| found.mistake.what.clone())
                .unwrap_or_default(),
            mistakes.to_string(),
        ),
        output: String::new(),
    }
}

fn run_test(suite: &Suite, test: &Test, job: &Job<'_>, count: &mut Count) -> Case {
    let done = count.passed + count.failed + count.wrong;
    job.progress
        .now(format!("{done} tests done, running \"{}\"", test.name));
    let begun = Instant::now();
    let ran = suite.run(test, None);
    let took = begun.elapsed();
    let mut output = String::new();
    let verdict = match ran {
        Err(error) => {
            count.wrong += 1;
            job.report(&error);
            Verdict::Wrong(error.to_string(), error.to_string())
        }
        Ok(ran) => {
            count.ticks += ran.ticks;
            output = format!("ticks={} simulation_time={}s", ran.ticks, ran.seconds());
            for line in RunStatistics::read(&ran.statistics).time() {
                output.push('\n');
                output.push_str(&line);
            }
            match ran.failure {
                None => {
                    count.passed += 1;
                    job.tell(&format!("ok    {} ({} ticks)", test.name, ran.ticks));
                    Verdict::Passed
                }
                Some(failure) => {
                    count.failed += 1;
                    let (line, column) = failure.place;
                    let mut full = format!("{}:{line}:{column}: {}", suite.file, failure.what);
                    let hint = failure.hint.iter().map(|hint| format!("hint: {hint}"));
                    for more in hint.chain(failure.more) {
                        full.push_str("\n      ");
                        full.push_str(&more);
                    }
                    if let Some(folder) = &job.arguments.keep {
                        let names = (suite.file.as_str(), test.name.as_str());
                        let texts = (full.as_str(), Some(ran.statistics.as_str()));
                        let (kept, _) = record(job, names, folder, texts, |path| {
                            suite.run(test, Some(path)).map(drop)
                        });
                        full.push_str(&kept);
                    }
                    job.tell(&format!("FAIL  {}\n      {full}", test.name));
                    Verdict::Failed(failure.what, full)
                }
            }
        }
    };
    Case {
        name: test.name.clone(),
        line: test.place.0,
        took,
        verdict,
        output,
    }
}

/// Runs a failed test of a file again with a recorder. Tests are deterministic, so it fails in the same way, and its
/// statistics are those of the first run. Returns the paths of the recording and of its page as text, and the page.
fn record(
    job: &Job<'_>,
    (file, test): (&str, &str),
    folder: &Path,
    (failure, statistics): (&str, Option<&str>),
    run: impl FnOnce(&Path) -> Result<(), DriverError>,
) -> (String, Option<PathBuf>) {
    let stem = Path::new(file).file_stem().unwrap_or_default();
    let name = job.recording_name(&format!("{} - {test}", stem.to_string_lossy()));
    let file = std::path::absolute(folder.join(format!("{name}.vcd")));
    let recorded = file.and_then(|file| {
        fs::create_dir_all(folder)?;
        run(&file).map_err(io::Error::other)?;
        Ok(file)
    });
    let file = match recorded {
        Ok(file) => file,
        Err(error) => return (format!("\n      it could not be recorded: {error}"), None),
    };
    let texts = [("What failed".to_owned(), failure.to_owned())];
    let page = page_beside(&file, test, statistics, &texts);
    let told = match &page {
        Ok(page) => page.display().to_string(),
        Err(error) => error.clone(),
    };
    let text = format!(
        "\n      recording: {}\n      report: {told}",
        file.display()
    );
    (text, page.ok())
}

/// Removes a file, and fails if it could not be written later. What is not a plain file, such as a pipe, stays.
fn clear(path: &Path) -> io::Result<()> {
    if let Some(folder) = path.parent() {
        fs::create_dir_all(folder)?;
    }
    if fs::symlink_metadata(path).is_ok_and(|found| !found.is_file() && !found.is_dir()) {
        return Ok(());
    }
    File::create(path)?;
    fs::remove_file(path)
}

fn write_file(path: &Path, text: &str) -> io::Result<()> {
    if let Some(folder) = path.parent() {
        fs::create_dir_all(folder)?;
    }
    fs::write(path, text)
}
