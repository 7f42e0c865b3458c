//! A drive on a telegram of PROFIdrive.

use tickbus_axis::profidrive::{Measured, Profidrive, Word, Words};
use tickbus_base::time::Nanos;

use super::io::Io;
use super::levels::Levels;
use super::signal::{Input, Output};

/// A drive with its signals.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Driven {
    pub(crate) drive: Profidrive,
    pub(crate) words: Box<[(Word, Input)]>,
    pub(crate) told: Box<[(Word, Output)]>,
    pub(crate) fault: Option<Levels>,
    pub(crate) warning: Option<Levels>,
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
