//! The dispatcher between both ends: a separate process, which suffers misfortunes as well.

use std::cell::{Cell, RefCell};
use std::rc::Rc;

use tickbus_base::time::{Clock as _, Nanos, Stop};
use tickbus_dispatcher::tcp::{Hosting, Listener};
use tickbus_dispatcher::{Dispatcher, OnLoss, Patch, Pin, Settings};
use tickbus_net::Address;

use crate::broken::Broken;
use crate::clock::SimulatedClock;
use crate::config::{NAMES, PORT};
use crate::delivery::Delivery;
use crate::judge::{Known, Seen, Writer, held, promise, slack};
use crate::network::{self, Network};
use crate::plan::{BETWEEN, FAIL_SAFE, Misfortune, Plan};
use crate::scheduler;
use crate::stamp::Stamp;

/// The time within which a dispatcher has to end.
const LONGEST_END: Nanos = Nanos::from_secs(2);

/// The dispatcher of a world, from life to life.
#[derive(Default)]
pub(crate) struct Laboratory {
    process: Cell<usize>,
    /// The processes that each end has had.
    clients: [RefCell<Vec<usize>>; 2],
    stop: RefCell<Stop>,
    is_running: Cell<bool>,
    /// True if the dispatcher was killed or closed, and another one follows.
    is_ending: Cell<bool>,
    /// True if no further dispatcher is to begin.
    is_over: Cell<bool>,
}

impl Laboratory {
    /// Registers `process` as a new life of an end.
    pub(crate) fn joins(&self, end: usize, process: usize) {
        self.clients[end].borrow_mut().push(process);
    }

    /// Starts a dispatcher.
    pub(crate) fn begin(self: &Rc<Self>, plan: &Plan) {
        if self.is_over.get() {
            return;
        }
        let process = scheduler::new_process();
        let (stop, patch) = (Stop::new(), patch(plan));
        let on_loss = if plan.laboratory.holds {
            OnLoss::Hold
        } else {
            OnLoss::FailSafe
        };
        let settings = Settings {
            on_loss,
            ..Settings::default()
        };
        self.process.set(process);
        self.is_running.set(true);
        self.is_ending.set(false);
        *self.stop.borrow_mut() = stop.clone();
        let laboratory = Rc::clone(self);
        scheduler::spawn(process, move || {
            serve(settings, patch, &stop);
            laboratory.is_running.set(false);
        });
    }

    /// Applies a misfortune to the dispatcher; `what` has its duration.
    pub(crate) fn befall(self: &Rc<Self>, plan: &Plan, what: Misfortune) {
        if !self.is_running.get() || self.is_ending.get() {
            return;
        }
        let process = self.process.get();
        let span = match what {
            Misfortune::Suspend(_, span) => return scheduler::suspend_process(process, span),
            Misfortune::Kill(_, span) => {
                scheduler::network(|network, _, now| network.kill(process, now));
                span
            }
            Misfortune::Close(_, span) => span,
            _ => return,
        };
        self.is_ending.set(true);
        self.stop.borrow().stop();
        let (laboratory, plan) = (Rc::clone(self), plan.clone());
        scheduler::spawn(0, move || {
            scheduler::sleep_until(|| !laboratory.is_running.get());
            scheduler::sleep(span);
            laboratory.begin(&plan);
        });
    }

    /// Ends the dispatcher.
    ///
    /// # Errors
    ///
    /// The dispatcher does not end in time.
    pub(crate) fn end(&self) -> Result<(), Broken> {
        self.is_over.set(true);
        self.stop.borrow().stop();
        let asked = scheduler::now();
        scheduler::sleep_until(|| !self.is_running.get() || scheduler::now() - asked > LONGEST_END);
        if self.is_running.get() {
            return Err(Broken {
                promise: "close",
                what: format!("the dispatcher has not ended within {LONGEST_END}"),
            });
        }
        Ok(())
    }

    /// Returns what the dispatcher knew of the other end when it sent what `end` had heard by `heard`. The other end is
    /// `writer`, and `valid_since` has the time at which each of its lives was first not stale. `deliveries` are those
    /// that `end` has read.
    pub(crate) fn known(
        &self,
        plan: &Plan,
        network: &Network,
        (writer, valid_since): (&Writer, &[i64]),
        (end, heard): (usize, i64),
        deliveries: &[Delivery],
    ) -> Option<Known> {
        let before = deliveries.partition_point(|delivery| delivery.at <= heard - 1_000_000);
        let answers = &deliveries[before.checked_sub(1)?..];
        let writers = self.clients[1 - end].borrow();
        // The life of the writer that sent a delivery, from 1.
        let life = |delivery: &Delivery| {
            let life = writers.iter().position(|from| *from == delivery.from)?;
            Some(life as u64 + 1)
        };
        let first = answers.first()?;
        let mut silent = i64::MAX;
        // The deliveries that had reached the dispatcher before an answer. Earlier answers have no more, so one walk
        // back serves all.
        let mut arrived: &[Delivery] = &[];
        let mut later: Option<&Delivery> = None;
        for answer in answers.iter().rev() {
            if later.is_none_or(|later| later.from != answer.from || later.at < answer.at) {
                let all = network.deliveries.get(&answer.from);
                arrived = all.map_or(&[], |all| all);
            }
            later = Some(answer);
            // The dispatcher may read while it writes the answer.
            let is_newest =
                |delivery: &Delivery| delivery.at <= answer.at && life(delivery).is_some();
            let newest = arrived.iter().rposition(is_newest);
            arrived = &arrived[..newest.map_or(0, |newest| newest + 1)];
            if let Some(newest) = arrived.last() {
                silent = silent.min(answer.sent - newest.at);
            }
        }
        // The lines of a life do not prove that the last ticks of the previous life have come. That life may have
        // closed without a further cycle, and a dispatcher that holds keeps its values. Nor do lines count that a life
        // sends before it has been heard: they may be a request to join that is refused.
        let has_joined = |at: i64, life: u64| {
            let life = usize::try_from(life - 1).ok();
            let since = life.and_then(|life| valid_since.get(life));
            since.is_some_and(|since| *since <= at)
        };
        let slack = slack(plan);
        let limit = first.sent - slack - held(plan) - waited(plan, first.sent, slack);
        let unread = slack + plan.waits_for_pulses();
        let came = arrived.iter().rev().filter(|delivery| delivery.at <= limit);
        let mut least = came.filter_map(|delivery| {
            let life = life(delivery).filter(|life| has_joined(delivery.sent, *life))?;
            let newest = writer.newest_at(delivery.sent - unread)?;
            (newest.0 == life).then_some(newest)
        });
        Some(Known {
            least: least.next(),
            silent,
        })
    }
}

/// The time that data read by the dispatcher may have waited, in ns. Right after a suspension the dispatcher reads them
/// in several turns, and forwards in each what it has read.
fn waited(plan: &Plan, sent: i64, slack: i64) -> i64 {
    let spans = plan.events.iter().map(|event| match event.what {
        Misfortune::Suspend(BETWEEN, span) => {
            let over = scheduler::BEGIN + (event.at + span).0;
            if (over..over + slack).contains(&sent) {
                span.0
            } else {
                0
            }
        }
        _ => 0,
    });
    spans.sum()
}

/// Judges that a source is lost if it has been silent for longer than it promised: none of its values count any more,
/// unless the dispatcher holds.
pub(crate) fn judge_silence(plan: &Plan, known: Known, seen: &Seen<'_>) -> Result<(), Broken> {
    let allowed = promise(plan) * 2 + slack(plan) + held(plan);
    match seen.stations.iter().find(|shown| shown.stamp != FAIL_SAFE) {
        Some(shown) if known.silent > allowed && !plan.laboratory.holds => Err(Broken {
            promise: "left on",
            what: format!(
                "{:?}, when the dispatcher had not heard its writer for {} ns",
                Stamp::of(shown.stamp),
                known.silent
            ),
        }),
        _ => Ok(()),
    }
}

fn serve(settings: Settings, patch: Patch, stop: &Stop) {
    let clock = SimulatedClock;
    let listener = Listener::bind_in(&Address::local(PORT), clock.simulation());
    let Some(listener) = network::unless_killed(listener) else {
        return;
    };
    let mut dispatcher = Dispatcher::new(settings, patch);
    let hosting = Hosting {
        clock: &clock,
        stop,
        door: None,
        patch_file: None,
        news: &mut |news| log::info!("dispatcher: {news}"),
    };
    listener
        .run(&mut dispatcher, hosting)
        .expect("a simulation can wait");
}

/// The patch that connects each output of an end to the input of the same number at the other; empty if the ends
/// request their connections.
fn patch(plan: &Plan) -> Patch {
    let mut patch = Patch::new();
    if plan.laboratory.is_asked {
        return patch;
    }
    for end in 0..2 {
        for (input, output) in plan.cables() {
            let pin = |client: usize, channel: &str| {
                let text = format!("{}:{channel}", NAMES[client].0);
                Pin::parse(&text).expect("a pin")
            };
            patch.connect(pin(1 - end, &input), pin(end, &output));
        }
    }
    patch
}
