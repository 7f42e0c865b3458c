//! All replies of a machine, tick by tick.

use std::collections::BTreeSet;
use std::sync::Arc;

use tickbus_base::time::Nanos;
use tickbus_base::toml_text::shown;
use tickbus_fieldbus::faults::{FaultBoard, Note};
use tickbus_image::signal::{SignalTable, Slot};

use super::awake::Awake;
use super::behaviour::{Behaviour, Reply, reads_tick_before};
use super::io::{Io, Made, Writer, seconds};

/// The replies of one machine. Its tick calls [`step`](Self::step) when the simulation has handed its values over, and
/// before faults change them: so a fault changes a reply's signal as it changes any other.
///
/// A simulation that writes the signal of a reply wins, and the driver logs it once. A simulation that hands all values
/// over at every tick also hands over those that it does not know: a value that is the reply's own, the signal's
/// fail-safe value or zero is not the simulation's.
#[derive(Debug)]
pub struct Replies {
    behaviours: Box<[Behaviour]>,
    pub(crate) awake: Awake,
    /// By index of the signal.
    made: Box<[Made]>,
    /// The signals of replies that rules, integrators, tracks and drives read or make: they have them at the beginning of a
    /// tick, whatever a simulation that does not write them has handed over.
    kept: Box<[usize]>,
    board: Arc<FaultBoard>,
    /// The shortest time that a reply states, and the place of the note about longer ticks; `None` once it is marked.
    shortest: Option<(Nanos, usize)>,
    /// The number of ticks in a row that were longer than that.
    long_ticks: u32,
    /// The time of the last tick.
    time: Option<Nanos>,
    /// The time of the last tick since the first one; never goes back.
    now: Nanos,
}

impl Replies {
    /// Creates the replies in their initial state, for the signals of `table`; `None` if there are no replies. What the
    /// driver has to log about them goes to `board`.
    pub fn new(replies: &[Reply], table: &SignalTable, board: &Arc<FaultBoard>) -> Option<Self> {
        if replies.is_empty() {
            return None;
        }
        let made = table.signals.iter().map(|signal| Made {
            rest: signal.fail_safe,
            ours: signal.fail_safe,
            writer: Writer::Reply,
            note: u32::MAX,
        });
        let mut made: Box<[Made]> = made.collect();
        let mut notes = Vec::new();
        let outputs = replies.iter().flat_map(|reply| &reply.outputs);
        for (note, signal) in (0..).zip(outputs) {
            made[*signal].note = note;
            notes.push(Note::overruled(&table.signals[*signal].name));
        }
        let times = replies
            .iter()
            .filter_map(|reply| Some((reply.shortest?, &reply.name)));
        let shortest = times.min().map(|(time, name)| {
            notes.push(Note::new(format!(
                "ticks are longer than {time}, a time of the reply \"{}\": a reply is made once in each tick",
                shown(name)
            )));
            (time, notes.len() - 1)
        });
        let rules = replies.iter().filter(|reply| reads_tick_before(reply.kind));
        let of_rules = rules.flat_map(|rule| rule.inputs.iter().chain(&rule.outputs).copied());
        let kept: BTreeSet<usize> = of_rules
            .filter(|signal| made[*signal].note != u32::MAX)
            .collect();
        let mut watchers = vec![Vec::new(); made.len()];
        for (place, reply) in replies.iter().enumerate() {
            for signal in reply.inputs.iter().chain(&reply.outputs) {
                watchers[*signal].push(place);
            }
        }
        board.prepare_notes(replies.len(), notes);
        Some(Self {
            behaviours: replies
                .iter()
                .map(|reply| reply.behaviour.clone())
                .collect(),
            awake: Awake::new(replies.len(), watchers),
            made,
            kept: kept.into_iter().collect(),
            board: Arc::clone(board),
            shortest,
            long_ticks: 0,
            time: None,
            now: Nanos::ZERO,
        })
    }

    /// Makes the signals of a tick at `time`, from what the slots have. A second call at the same time makes the same
    /// signals again, but for noise. If time jumps back, replies go on where they are.
    pub fn step(&mut self, time: Nanos, slots: &mut [Slot]) {
        let before = self.time.replace(time).unwrap_or(time);
        let passed = (time - before).max(Nanos::ZERO);
        self.note_long_ticks(passed);
        self.now += passed;
        let now = self.now;
        let mut io = Io {
            slots,
            made: &mut self.made,
            board: &self.board,
            awake: &mut self.awake,
            now,
            passed,
            seconds: seconds(passed),
        };
        for signal in &self.kept {
            io.keep(*signal);
        }
        io.awake.begin(now, io.slots);
        for (word, behaviours) in self.behaviours.chunks_mut(64).enumerate() {
            let (mut bits, mut staying) = (io.awake.take(word), 0);
            while bits != 0 {
                let place = bits.trailing_zeros() as usize;
                bits &= bits - 1;
                io.awake.begin_reply(64 * word + place);
                let next = behaviours[place].step(&mut io);
                if next <= now {
                    staying |= 1 << place;
                } else if next < Nanos::MAX {
                    io.awake.rest_until(64 * word + place, next);
                }
                // The reply may have woken others.
                bits |= io.awake.take(word);
            }
            io.awake.stay(word, staying);
        }
        io.awake.end(io.slots);
    }

    /// Notes ticks that are longer than a time of a reply; a single one is only late.
    fn note_long_ticks(&mut self, passed: Nanos) {
        const IN_A_ROW: u32 = 10;
        let Some((shortest, note)) = self.shortest else {
            return;
        };
        if passed <= shortest {
            self.long_ticks = 0;
            return;
        }
        self.long_ticks += 1;
        if self.long_ticks == IN_A_ROW {
            self.shortest = None;
            self.board.mark(note);
        }
    }

    /// Lets replies win over what writes their signals: for a program in the place of the simulation.
    #[must_use]
    pub fn over_all(mut self) -> Self {
        for made in &mut self.made {
            made.writer = Writer::Always;
        }
        self
    }

    /// Lets the caller write a signal for a while, as a test does that forces it: no reply writes the signal until
    /// the caller gives it back.
    pub fn borrow(&mut self, signal: usize, borrowed: bool) {
        self.awake.wake_all();
        let made = &mut self.made[signal];
        made.writer = match (borrowed, made.writer) {
            (_, Writer::Simulation) => Writer::Simulation,
            (true, _) => Writer::Borrowed,
            (false, _) => Writer::Returned,
        };
    }
}
