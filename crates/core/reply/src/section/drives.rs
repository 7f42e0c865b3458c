//! The `[[drive]]` sections of a driver.cfg, whose signals are known.

use tickbus_axis::profidrive::{Profidrive, Setup, Telegram, Word};
use tickbus_axis::section::drives::signal_name;
use tickbus_base::toml_text::Value;

use super::Scope;
use super::reader::Reader;
use crate::behaviour::{Behaviour, Reply};
use crate::drive::Driven;
use crate::signal::{Form, Input, Output};

/// The kind of the reply of a drive.
const fn kind(telegram: Telegram) -> &'static str {
    match telegram {
        Telegram::Speed => "drive, telegram 1",
        Telegram::LongSpeed => "drive, telegram 2",
        Telegram::Encoder => "drive, telegram 3",
        Telegram::Servo => "drive, telegram 5",
        Telegram::Positioner => "drive, telegram 111",
    }
}

/// A `[[drive]]` whose signals are in the table.
#[derive(Debug)]
pub struct Drive<'a> {
    /// The name.
    pub name: String,
    /// The properties of the drive.
    pub setup: Setup,
    /// The conditions of a fault and of a warning.
    pub conditions: [Option<Value<'a>>; 2],
}

/// The drives of a machine as replies; mistakes in their conditions are reported.
pub fn drives(all: &[Drive<'_>], scope: Scope<'_>) -> Vec<Reply> {
    let replies = all.iter().filter_map(|own| reply(own, scope));
    replies.collect()
}

fn reply(own: &Drive<'_>, scope: Scope<'_>) -> Option<Reply> {
    let mut inputs = Vec::new();
    let [fault, warning] = ["fault", "warning"]
        .into_iter()
        .zip(&own.conditions)
        .map(|(key, value)| {
            let Some(value) = value else {
                return Some(None);
            };
            let reader = Reader::new(vec![(key, value.clone())], scope);
            let levels = reader.levels(key)??;
            inputs.extend(reader.finish().0);
            Some(Some(levels))
        })
        .collect::<Vec<_>>()
        .try_into()
        .ok()?;
    let position = |word: &Word| {
        let signal = scope.table.position(&signal_name(&own.name, *word))?;
        Some((*word, signal, Form::of(&scope.table.signals[signal])))
    };
    let [commands, feedback] = own.setup.telegram.words().map(|words| {
        let found = words.iter().map(position);
        found.collect::<Option<Vec<_>>>()
    });
    let (commands, feedback) = (commands?, feedback?);
    inputs.extend(commands.iter().map(|(_, signal, _)| *signal));
    inputs.sort_unstable();
    inputs.dedup();
    let words = commands.into_iter();
    let words = words.map(|(word, signal, form)| (word, Input { signal, form }));
    let outputs = feedback.iter().map(|(_, signal, _)| *signal).collect();
    let told = feedback
        .into_iter()
        .map(|(word, signal, form)| Some((word, Output::new(signal, form)?)));
    let driven = Driven {
        drive: Profidrive::new(own.setup.clone()),
        words: words.collect(),
        told: told.collect::<Option<_>>()?,
        fault: fault?,
        warning: warning?,
    };
    Some(Reply {
        name: own.name.clone(),
        kind: kind(own.setup.telegram),
        inputs,
        outputs,
        shortest: None,
        behaviour: Behaviour::Drive(Box::new(driven)),
    })
}
