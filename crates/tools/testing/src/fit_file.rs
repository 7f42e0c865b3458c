//! The file of a fit: which parameters of the machine are looked for, between which bounds.

use std::path::Path;

use tickbus_base::Mistake;
use tickbus_base::time::Nanos;
use tickbus_base::toml_text::{
    Mistakes, Table, Value, did_you_mean, load_text, nearest, parse_text, shown,
};
use tickbus_compare::{self as compare, Budget, Parameter, Side};
use tickbus_image::signal::Area;

use super::model::{Commands, Model};

/// The usual number of runs.
const RUNS: usize = 400;

/// The most runs of a fit.
const MOST_RUNS: i128 = 1_000_000;

const SHAPE: &str =
    "write rule = \"…\" or reply = \"…\" with a key, or fmu = \"…\", with from and to";

/// A place in the machine.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Target {
    /// The delay of a rule, in seconds.
    After(usize),
    /// The speed of a rule's ramp.
    PerSecond(usize),
    /// A key of a reply: a time in seconds, or a number.
    Reply {
        index: usize,
        key: &'static str,
        is_time: bool,
    },
    /// A variable of the FMU.
    Fmu(usize),
}

/// A file of parameters, read for one machine.
#[derive(Clone, Debug, PartialEq)]
pub struct FitFile {
    /// The parameters.
    pub parameters: Vec<Parameter>,
    /// The runs and the seed.
    pub budget: Budget,
    targets: Vec<Target>,
}

impl FitFile {
    /// Reads the file at `path` for this machine.
    ///
    /// # Errors
    ///
    /// With every mistake in the file.
    pub fn load(path: &Path, model: &Model) -> Result<Self, Mistakes> {
        let text = load_text(path)?;
        parse_text(&path.display().to_string(), &text, |root| read(root, model))
    }

    /// The machine with these commands, as a model whose parameters a fit changes.
    pub fn twin<'a>(&'a self, model: &'a Model, commands: &'a Commands) -> Twin<'a> {
        Twin {
            model,
            commands,
            targets: &self.targets,
        }
    }
}

/// A machine of a test file, driven by the commands of a recording.
#[derive(Clone, Copy, Debug)]
pub struct Twin<'a> {
    model: &'a Model,
    commands: &'a Commands,
    targets: &'a [Target],
}

impl compare::Model for Twin<'_> {
    fn simulate(&self, values: &[f64]) -> Result<Side, String> {
        let mut model = self.model.clone();
        let mut of_fmu = Vec::new();
        for (target, value) in self.targets.iter().zip(values) {
            match *target {
                #[expect(clippy::cast_possible_truncation, reason = "at most some years")]
                Target::After(rule) => {
                    model.rules[rule].after = Nanos((value * 1e9).round() as i64);
                }
                Target::PerSecond(rule) => {
                    if let Some(ramp) = &mut model.rules[rule].ramp {
                        ramp.per_second = *value;
                    }
                }
                Target::Reply { index, key, .. } => model.replies[index].set(key, *value),
                Target::Fmu(variable) => of_fmu.push((variable, *value)),
            }
        }
        model.fmu = model.fmu.map(|fmu| fmu.with(&of_fmu));
        model.side(self.commands)
    }
}

impl Model {
    /// Drives the machine with these commands; the result can be compared with the recording.
    ///
    /// # Errors
    ///
    /// As [`drive`](Self::drive).
    pub fn side(&self, commands: &Commands) -> Result<Side, String> {
        let run = self.drive(commands)?;
        let areas = vec![Some(Area::Input); run.signals().len()];
        Ok(Side::new(&self.file, run, areas))
    }
}

fn read(mut root: Table<'_>, model: &Model) -> Option<FitFile> {
    let runs = root.take("runs");
    let seed = root.take("seed");
    let parameters = root.require("parameter", "write a [[parameter]] for each");
    root.finish();
    let whole = |value: Option<Value<'_>>, range| match value {
        None => Some(None),
        Some(value) => value.whole(range).map(Some),
    };
    let runs = whole(runs, 10..=MOST_RUNS);
    let seed = whole(seed, 0..=i128::from(u32::MAX));
    let tables = parameters.map(|value| value.tables("[[parameter]]"));
    let read: Vec<_> = tables
        .into_iter()
        .flatten()
        .map(|table| parameter(table, model))
        .collect();
    let read: Option<Vec<(Parameter, Target)>> = read.into_iter().collect();
    let (parameters, targets) = read?.into_iter().unzip();
    let runs = runs?.and_then(|runs| usize::try_from(runs).ok());
    let seed = seed?.and_then(|seed| u32::try_from(seed).ok());
    Some(FitFile {
        parameters,
        budget: Budget {
            runs: runs.unwrap_or(RUNS),
            seed: seed.unwrap_or(1),
        },
        targets,
    })
}

fn parameter(mut table: Table<'_>, model: &Model) -> Option<(Parameter, Target)> {
    let [rule, reply, fmu, key] = ["rule", "reply", "fmu", "key"].map(|key| table.take(key));
    let from = table.require("from", "write the least value");
    let to = table.require("to", "write the greatest value");
    let was = table.take("start");
    table.require_one_of(&["rule", "reply", "fmu"], SHAPE);
    table.finish();
    let (name, unit, target, known) = match (&rule, &reply, &fmu) {
        (Some(rule), None, None) => of_rule(rule, key.as_ref(), model)?,
        (None, Some(reply), None) => of_reply(reply, key.as_ref(), model)?,
        (None, None, Some(fmu)) => of_fmu(fmu, key.as_ref(), model)?,
        (None, None, None) => return None,
        _ => {
            let several = [&rule, &reply, &fmu].into_iter().flatten().next_back();
            several?.wrong("a parameter is of one thing", SHAPE);
            return None;
        }
    };
    let is_time = matches!(
        target,
        Target::After(_) | Target::Reply { is_time: true, .. }
    );
    let number = |value: &Value<'_>| {
        if is_time {
            value.duration().map(|time| time.as_micros() / 1e6)
        } else {
            value.number("write a number in the parameter's unit")
        }
    };
    let (from, to_value) = (from.as_ref().and_then(number)?, to?);
    let to = number(&to_value)?;
    let least = matches!(target, Target::PerSecond(_)) && from <= 0.0;
    if to <= from || least {
        let what = format!("\"to\" is {to}, and \"from\" is {from}");
        to_value.wrong(what, "write \"from\" below \"to\", and a speed above 0");
        return None;
    }
    let was = match (&was, known) {
        (Some(value), _) => number(value)?,
        (None, Some(known)) => known,
        (None, None) => {
            let what = format!("nobody says which value \"{}\" has now", shown(&name));
            let right = "write it as start = …, or in the map of the FMU";
            to_value.wrong(what, right);
            return None;
        }
    };
    let parameter = Parameter {
        name,
        unit,
        from,
        to,
        was,
    };
    Some((parameter, target))
}

/// Name, unit, target and present value, if known.
type Known = (String, String, Target, Option<f64>);

fn of_rule(rule: &Value<'_>, key: Option<&Value<'_>>, model: &Model) -> Option<Known> {
    let name = rule.text("write the name of a [[machine.rule]] in quotes")?;
    let rules = model.rules.iter();
    let named = rules
        .enumerate()
        .filter(|(_, rule)| rule.name.as_deref() == Some(name));
    let named: Vec<usize> = named.map(|(index, _)| index).collect();
    let [index] = named[..] else {
        if !named.is_empty() {
            let what = format!("{} rules of {} are named so", named.len(), model.file);
            rule.wrong(what, "give each of them another name");
            return None;
        }
        let names = model.rules.iter().filter_map(|rule| rule.name.as_deref());
        let near = nearest(name, names);
        let right = near.map_or_else(
            || format!("add name = \"{}\" to the rule", shown(name)),
            |near| format!("did you mean \"{}\"?", shown(near)),
        );
        rule.refuse(Mistake::new(
            format!("{} has no rule \"{}\"", model.file, shown(name)),
            right,
        ));
        return None;
    };
    let known = &model.rules[index];
    let choices = [("after", true), ("per_second", false)];
    let is_time = match key {
        None => true,
        Some(key) => key.choice("keys of a rule that can be fitted", &choices)?,
    };
    if is_time {
        let now = known.after.as_micros() / 1e6;
        let name = format!("{name}: after");
        return Some((name, "s".to_owned(), Target::After(index), Some(now)));
    }
    let Some(ramp) = known.ramp else {
        let what = format!("the rule \"{}\" has no ramp", shown(name));
        rule.wrong(what, "name a rule with a ramp, or key = \"after\"");
        return None;
    };
    let signal = &model.table().signals[ramp.signal];
    let unit = format!("{}/s", signal.unit.as_deref().unwrap_or("1"));
    let name = format!("{name}: per_second");
    Some((name, unit, Target::PerSecond(index), Some(ramp.per_second)))
}

fn of_reply(reply: &Value<'_>, key: Option<&Value<'_>>, model: &Model) -> Option<Known> {
    let name = reply.text("write the name of a [[reply]] in quotes")?;
    let names: Vec<&str> = model.replies.iter().map(|one| one.name.as_str()).collect();
    let Some(index) = names.iter().position(|known| *known == name) else {
        let right = if names.is_empty() {
            "name a rule, or write a [[machine.reply]]".to_owned()
        } else {
            did_you_mean(name, "the replies", &names)
        };
        let what = format!("{} has no reply \"{}\"", model.file, shown(name));
        reply.wrong(what, right);
        return None;
    };
    let settings = model.replies[index].settings();
    let choices: Vec<_> = settings.iter().map(|one| (one.key, *one)).collect();
    let Some(key) = key else {
        let keys: Vec<&str> = settings.iter().map(|one| one.key).collect();
        reply.wrong(
            format!("no key of the reply \"{}\"", shown(name)),
            format!("add key = \"…\", one of {}", keys.join(", ")),
        );
        return None;
    };
    let known = key.choice("keys of this reply that can be fitted", &choices)?;
    let unit = if known.is_time { "s" } else { "" };
    let target = Target::Reply {
        index,
        key: known.key,
        is_time: known.is_time,
    };
    let name = format!("{name}: {}", known.key);
    Some((name, unit.to_owned(), target, Some(known.value)))
}

fn of_fmu(fmu: &Value<'_>, key: Option<&Value<'_>>, model: &Model) -> Option<Known> {
    let name = fmu.text("write the name of a variable in quotes")?;
    if let Some(key) = key {
        key.wrong("an FMU's variable has no \"key\"", "remove it");
    }
    let Some(plant) = &model.fmu else {
        let what = format!("the machine of {} is no FMU", model.file);
        fmu.wrong(what, "name a rule, or an FMU in [machine]");
        return None;
    };
    match plant.parameter(name) {
        Ok((index, unit, now)) => Some((name.to_owned(), unit, Target::Fmu(index), now)),
        Err(mistake) => {
            fmu.refuse(mistake);
            None
        }
    }
}
