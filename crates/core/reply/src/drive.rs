//! A drive on a telegram of PROFIdrive: a `[[drive]]` of a driver.cfg.

use tickbus_axis::profidrive::{Measured, Profidrive, Setup, Word, Words};
use tickbus_axis::section::drives;
use tickbus_base::time::Nanos;
use tickbus_base::toml_text::Value;

use super::behaviour::{Behaviour, Reply};
use super::io::Io;
use super::levels::Levels;
use super::section::{Scope, conditions};
use super::signal::{Form, Input, Output};

/// The kind of the replies of drives.
const KIND: &str = "drive";

/// A drive with its signals.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Driven {
    drive: Profidrive,
    words: Box<[(Word, Input)]>,
    told: Box<[(Word, Output)]>,
    fault: Option<Levels>,
    warning: Option<Levels>,
}

impl Driven {
    pub(crate) fn step(&mut self, io: &mut Io<'_>) -> Nanos {
        let mut words = Words::default();
        for (word, input) in &self.words {
            words.set(*word, input.value(io.slots));
        }
        // The simulation has the speed and the position that it writes itself.
        let own = |all: [Word; 2]| {
            let mut told = self.told.iter();
            let (_, output) = told.find(|(word, _)| all.contains(word))?;
            let is_own = io.is_of_simulation(*output);
            is_own.then(|| output.form.real(io.slots[output.signal()]))
        };
        let holds =
            |levels: &Option<Levels>| levels.as_ref().is_some_and(|levels| levels.hold(io.slots));
        let measured = Measured {
            speed: own([Word::NistA, Word::NistB]),
            position: own([Word::XistA; 2]),
            fault: holds(&self.fault),
            warning: holds(&self.warning),
        };
        let told = self.drive.step(io.seconds, &words, &measured);
        for (word, output) in &self.told {
            io.put(*output, told.get(*word));
        }
        io.next_tick_if(self.drive.moves())
    }
}

/// A `[[drive]]` whose signals are in the table.
#[derive(Debug)]
pub struct Drive<'a> {
    /// The name.
    pub name: String,
    /// What the drive is.
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
            let (levels, read) = conditions(key, value, scope)?;
            inputs.extend(read);
            Some(Some(levels))
        })
        .collect::<Vec<_>>()
        .try_into()
        .ok()?;
    let position = |word: &Word| {
        let signal = scope
            .table
            .position(&drives::signal_name(&own.name, *word))?;
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
        kind: KIND,
        inputs,
        outputs,
        shortest: None,
        behaviour: Behaviour::Drive(Box::new(driven)),
    })
}
