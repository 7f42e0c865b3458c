//! When programs run: the tasks of the original, for the scheduler.

use std::collections::BTreeMap;

use super::duration;
use super::library::Signal;
use tickbus_base::Mistake;
use tickbus_base::toml_text::{Collector, shown};

/// The schedule of the programs, according to the configuration.
#[derive(Debug, Default)]
pub(crate) struct Plan {
    pub(crate) signals: Vec<Signal>,
    /// The signal of each program, by its name in capitals.
    pub(crate) programs: BTreeMap<String, String>,
    /// The interval of the one task, in milliseconds.
    pub(crate) cycle: u32,
}

impl Plan {
    /// The interval in milliseconds of a program, by its name in capitals, if a task runs it.
    pub(crate) fn interval(&self, program: &str) -> Option<u32> {
        let name = self.programs.get(program)?;
        let signal = self.signals.iter().find(|signal| signal.name == *name)?;
        signal.interval
    }
}

/// A word of a configuration, and its byte offset.
#[derive(Clone, Debug)]
pub(crate) struct Named {
    pub(crate) text: String,
    pub(crate) at: usize,
}

impl Named {
    /// Names ignore case.
    fn capitals(&self) -> String {
        self.text.to_uppercase()
    }
}

/// A task of the configuration.
#[derive(Debug)]
pub(crate) struct Task {
    pub(crate) name: Named,
    pub(crate) interval: Option<Named>,
    /// The position of the event that starts the task.
    pub(crate) single: Option<usize>,
    pub(crate) priority: Option<u32>,
}

/// A program that runs.
#[derive(Debug)]
pub(crate) struct Instance {
    pub(crate) task: Option<Named>,
    pub(crate) program: Named,
}

pub(crate) fn second_resource() -> Mistake {
    let right = "put all tasks and programs into one resource";
    Mistake::new("this is a second resource", right)
}

/// The schedule of the programs; reports what is impossible, and returns a remark. The configuration is at byte
/// `start`.
pub(crate) fn plan(
    start: usize,
    tasks: &[Task],
    instances: &[Instance],
    wrong: &Collector<'_>,
) -> (Plan, Option<String>) {
    let mut plan = Plan::default();
    let mut signals: BTreeMap<String, Signal> = BTreeMap::new();
    let mut shortest: Option<u32> = None;
    for task in tasks {
        if let Some(at) = task.single {
            let right = "call its programs from a cyclic task";
            wrong.report(at, "this task starts at an event", right);
        }
        let Some(stated) = &task.interval else {
            let right = "give it one, such as T#10ms";
            wrong.report(task.name.at, "this task has no interval", right);
            continue;
        };
        match duration::milliseconds(&stated.text) {
            Ok(interval) => {
                shortest = Some(shortest.map_or(interval, |shortest| shortest.min(interval)));
                let signal = Signal::of_task(&task.name.text, interval, signals.values());
                signals.insert(task.name.capitals(), signal);
            }
            Err(why) => wrong.report(
                stated.at,
                format!("the interval {} {why}", shown(&stated.text)),
                "write whole milliseconds, such as T#10ms: TIME has no more on many PLCs",
            ),
        }
    }
    plan.cycle = shortest.unwrap_or(10);
    if instances.is_empty() {
        let right = "let a task run a program";
        wrong.report(start, "no program runs here", right);
    }
    for instance in instances {
        let signal = match instance
            .task
            .as_ref()
            .map(|task| (task, signals.get(&task.capitals())))
        {
            None => Signal::of_every_step(),
            Some((_, Some(signal))) => signal.clone(),
            Some((task, None)) => {
                if !tasks
                    .iter()
                    .any(|one| one.name.capitals() == task.capitals())
                {
                    let what = format!("there is no task {}", shown(&task.text));
                    wrong.report(task.at, what, "write a TASK of that name before");
                }
                continue;
            }
        };
        if !plan.signals.contains(&signal) {
            plan.signals.push(signal.clone());
        }
        let program = &instance.program;
        let before = (plan.programs).insert(program.capitals(), signal.name.clone());
        if before.is_some_and(|before| before != signal.name) {
            wrong.report(
                program.at,
                format!("{} runs in two tasks", shown(&program.text)),
                "give each task a program of its own: its execution controller waits for one signal",
            );
        }
    }
    let note = order_note(tasks, instances);
    (plan, note)
}

/// Within one task, programs run as listed: a remark if priorities required another order.
fn order_note(tasks: &[Task], instances: &[Instance]) -> Option<String> {
    let priority = |instance: &Instance| {
        let task = instance.task.as_ref()?.capitals();
        let found = tasks.iter().find(|one| one.name.capitals() == task)?;
        found.priority
    };
    let priorities: Vec<u32> = instances.iter().filter_map(priority).collect();
    (!priorities.is_sorted()).then(|| {
        "programs of one step run in the order in which the configuration lists them; here a program of higher priority \
         stands behind one of lower priority: list it first if it must run first"
            .to_owned()
    })
}
