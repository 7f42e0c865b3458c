//! The sweep of a test file: its runs on all cores, the matrix, and the accepted verdicts.

use std::borrow::Cow;
use std::fmt::Write as _;
use std::io::IsTerminal as _;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, Instant};

use serde_json::{Value, json};
use tickbus_base::parallel::{cores, in_parallel};
use tickbus_testing::{
    Accepted, Case, Cell, CellMark, Judgement, Plan, Suite, Sweep, Tally, Verdict, matrix, swept,
    swept_run, verdict_hash,
};

use super::{Count, Job, record, write_file};

/// At most this many failed runs of a sweep are recorded; `--only` chooses others.
const MOST_KEPT: usize = 20;

/// One run that was made.
struct Made<'p> {
    cell: &'p Cell,
    /// The verdict; without one, why the run could not be judged.
    judgement: Result<Judgement, String>,
    ticks: u64,
    took: Duration,
}

/// A sweep that was read and whose scenario passes.
struct Work<'a> {
    suite: &'a Suite,
    plan: Arc<Plan>,
    accepted: Accepted,
    job: &'a Job<'a>,
}

/// Runs the sweep of a file, as far as it is wanted. Returns its runs as tests, and as JSON.
pub(super) fn run(
    suite: &Suite,
    sweep: &Arc<Sweep>,
    job: &Job<'_>,
    count: &mut Count,
) -> (Vec<Case>, Value) {
    job.progress
        .now(format!("running {} without a fault", suite.file));
    let rewriting = job.arguments.accept;
    let planned = suite
        .plan(sweep)
        .map_err(|refused| (refused.count(), refused.to_string()));
    let planned = planned.and_then(|plan| {
        let accepted = Accepted::load(&suite.file, &plan, rewriting);
        let accepted = accepted.map_err(|mistakes| (mistakes.len(), mistakes.to_string()));
        Ok((plan, accepted?))
    });
    match planned {
        Err((mistakes, text)) => {
            count.wrong += mistakes;
            job.report(&text);
            let verdict = Verdict::Wrong(text.lines().next().unwrap_or_default().to_owned(), text);
            let case = case("the sweep can be judged", sweep, verdict, Duration::ZERO);
            (vec![case], Value::Null)
        }
        Ok((plan, accepted)) => {
            let work = Work {
                suite,
                plan: Arc::new(plan),
                accepted,
                job,
            };
            work.run(sweep, count)
        }
    }
}

fn case(name: &str, sweep: &Sweep, verdict: Verdict, took: Duration) -> Case {
    Case {
        name: name.to_owned(),
        line: sweep.place.0,
        took,
        verdict,
        output: String::new(),
    }
}

impl Work<'_> {
    /// The runs that `--only` wants: the one with exactly this name, or all that contain the text.
    fn chosen(&self) -> Vec<&Cell> {
        let cells = &self.plan.cells;
        let only = self.job.arguments.only.as_deref().unwrap_or_default();
        if let Some(cell) = cells.iter().find(|cell| cell.name == only) {
            return vec![cell];
        }
        let all = self.suite.file.contains(only);
        let wanted = |cell: &&Cell| all || cell.name.contains(only);
        cells.iter().filter(wanted).collect()
    }

    fn run(&self, sweep: &Sweep, count: &mut Count) -> (Vec<Case>, Value) {
        let chosen = self.chosen();
        if chosen.is_empty() {
            return (Vec::new(), Value::Null);
        }
        if self.job.arguments.list {
            let (line, column) = sweep.place;
            let cases = chosen.iter().map(|cell| {
                let name = &cell.name;
                self.job
                    .tell(&format!("{}:{line}:{column}: {name}", self.suite.file));
                case(name, sweep, Verdict::Passed, Duration::ZERO)
            });
            let cases: Vec<Case> = cases.collect();
            count.passed += cases.len();
            return (cases, Value::Null);
        }
        let made = self.make(&chosen);
        count.ticks += self.plan.ticks + made.iter().map(|made| made.ticks).sum::<u64>();
        let written = self.job.arguments.accept && self.accept(&made, count);

        let mut marks = vec![None; self.plan.cells.len()];
        let (mut tally, mut kept) = (Tally::default(), 0);
        let mut cases = Vec::new();
        let mut runs = vec![None; marks.len()];
        for made in &made {
            let cell = made.cell;
            let judgement = made.judgement.as_ref().ok();
            let passes = judgement
                .is_some_and(|found| written || self.accepted.passes(&self.plan, cell, found));
            let found = (judgement, passes);
            tally.add((&self.plan, &self.accepted), cell, found);
            marks[cell.index] = Some(CellMark::of(judgement, passes));
            let wants_record = !passes && kept < MOST_KEPT || chosen.len() == 1;
            kept += usize::from(!passes);
            let (verdict, report) = self.verdict(made, passes, wants_record, count);
            let found = made.judgement.as_ref().map_err(String::as_str);
            let report = self.job.link(report.as_deref());
            runs[cell.index] = Some(swept_run(cell, found, passes, report));
            let output = judgement.map(ToString::to_string).unwrap_or_default();
            cases.push(Case {
                output,
                ..case(&cell.name, sweep, verdict, made.took)
            });
        }
        self.job.tell(&matrix(&self.plan, &marks, has_colours()));
        self.job.tell(&tally.to_string());
        if kept > MOST_KEPT && self.job.arguments.keep.is_some() {
            self.job.tell(&format!(
                "       {MOST_KEPT} of {kept} failed runs were recorded; --only records any other"
            ));
        }
        let document = self.document(&made, written);
        let file = &self.suite.file;
        let again = format!("tickbus test {} --only \"{{}}\"", word(file));
        let of_file = swept((file, &again), (&self.plan, &self.accepted), runs);
        count.swept.push(of_file);
        for made in made {
            if let Ok(judgement) = made.judgement {
                count.verdicts.push((made.cell.name.clone(), judgement));
            }
        }
        (cases, document)
    }

    /// Makes the runs, several at once.
    fn make<'p>(&self, chosen: &[&'p Cell]) -> Vec<Made<'p>> {
        let threads = match self.job.arguments.jobs {
            _ if !self.suite.is_parallel() => 1,
            None => cores(),
            Some(jobs) => usize::from(jobs.get()),
        };
        let done = AtomicUsize::new(0);
        in_parallel(threads, chosen, |cell| {
            let made = self.make_one(cell);
            let done = done.fetch_add(1, Ordering::Relaxed) + 1;
            let text = format!("{done} of {} faults done", chosen.len());
            self.job.progress.now(text);
            made
        })
    }

    fn make_one<'p>(&self, cell: &'p Cell) -> Made<'p> {
        let begun = Instant::now();
        let judged = self.suite.judge(&self.plan, cell, None);
        let took = begun.elapsed();
        let (judgement, ticks) = match judged {
            Ok(judged) => (judged.judgement, judged.ticks),
            Err(error) => (Err(error.to_string()), 0),
        };
        Made {
            cell,
            judgement,
            ticks,
            took,
        }
    }

    /// Counts a run, and reports it if it fails or is recorded. Returns the page about its recording, too.
    fn verdict(
        &self,
        made: &Made<'_>,
        passes: bool,
        wants_record: bool,
        count: &mut Count,
    ) -> (Verdict, Option<PathBuf>) {
        let (name, file) = (&made.cell.name, &self.suite.file);
        let what = match &made.judgement {
            Ok(judgement) => judgement.to_string(),
            Err(why) => format!("this run cannot be judged: {why}"),
        };
        let mut report = None;
        let mut full = what.clone();
        if !passes {
            if let Some(word) = self.accepted.verdict(&self.plan, made.cell) {
                // Writing to a string cannot fail.
                let _ = write!(full, "\n      accepted: {word}");
            }
            let (file, name) = (word(file), quoted(name));
            let _ = write!(full, "\n      again: tickbus test {file} --only {name}");
        }
        if let (Some(folder), true) = (&self.job.arguments.keep, wants_record) {
            let (kept, page) = record(self.job, (file, name), folder, (&what, None), |path| {
                self.suite
                    .judge(&self.plan, made.cell, Some(path))
                    .map(drop)
            });
            full.push_str(&kept);
            report = page;
        }
        if passes {
            count.passed += 1;
            if full != what || self.job.arguments.only.as_deref() == Some(name) {
                self.job.tell(&format!("ok    {name}\n      {full}"));
            }
            return (Verdict::Passed, report);
        }
        self.job.tell(&format!("FAIL  {name}\n      {full}"));
        if made.judgement.is_err() {
            count.wrong += 1;
            return (Verdict::Wrong(what, full), report);
        }
        count.failed += 1;
        (Verdict::Failed(what, full), report)
    }

    /// Writes the verdicts as accepted. Returns false if that is impossible.
    fn accept(&self, made: &[Made<'_>], count: &mut Count) -> bool {
        let verdicts: Option<Vec<Judgement>> = made
            .iter()
            .map(|made| made.judgement.clone().ok())
            .collect();
        // The runs that cannot be judged are reported one by one.
        let Some(verdicts) = verdicts else {
            return false;
        };
        let text = self
            .accepted
            .rewritten(&self.suite.file, &self.plan, &verdicts);
        let file = self.plan.accepted_file();
        if let Err(error) = write_file(file, &text) {
            count.wrong += 1;
            self.job.report(format!(
                "test: {}: cannot be written: {error}",
                file.display()
            ));
            return false;
        }
        self.job.tell(&format!("accepted: {}", file.display()));
        true
    }

    fn document(&self, made: &[Made<'_>], written: bool) -> Value {
        let of_run = |made: &Made<'_>| {
            let found = made.judgement.as_ref();
            let (fault, moment) = self.plan.names(made.cell);
            let passes = found
                .is_ok_and(|found| written || self.accepted.passes(&self.plan, made.cell, found));
            let after = match found {
                Ok(Judgement::Told(after)) => Some(after.to_duration().as_secs_f64()),
                _ => None,
            };
            json!({
                "name": made.cell.name,
                "fault": fault,
                "moment": moment,
                "verdict": found.map_or("wrong", Judgement::word),
                "what": found.map_or_else(Clone::clone, ToString::to_string),
                "told_after": after,
                "passed": passes,
                "accepted": self.accepted.verdict(&self.plan, made.cell),
                "why": self.accepted.why(&self.plan, made.cell),
            })
        };
        let judged = made
            .iter()
            .filter_map(|made| Some((made.cell.name.as_str(), made.judgement.as_ref().ok()?)));
        json!({
            "moments": self.plan.moment_names().collect::<Value>(),
            "hash": format!("{:016x}", verdict_hash(judged)),
            "runs": made.iter().map(of_run).collect::<Value>(),
        })
    }
}

/// A text in quotes, as a shell reads it.
fn quoted(text: &str) -> String {
    if text.contains(['"', '$', '`']) {
        format!("'{}'", text.replace('\'', "'\\''"))
    } else {
        format!("\"{text}\"")
    }
}

/// A path as one word of a command, in quotes if it needs them.
fn word(path: &str) -> Cow<'_, str> {
    let is_plain = |c: char| c.is_alphanumeric() || "._-/\\:".contains(c);
    if path.chars().all(is_plain) {
        Cow::Borrowed(path)
    } else {
        Cow::Owned(quoted(path))
    }
}

/// Returns true if stdout is a terminal that shows colours.
fn has_colours() -> bool {
    let plain = std::env::var_os("NO_COLOR").is_some_and(|value| !value.is_empty())
        || std::env::var_os("TERM").is_none_or(|terminal| terminal == "dumb");
    !plain && std::io::stdout().is_terminal()
}
