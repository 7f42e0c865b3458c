//! The door into the dispatcher's loop for other threads.

use std::fmt;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use tickbus_base::time::{Nanos, Stop};

use crate::dispatcher::{Dispatcher, Order, Reply};

/// Work to be done in the loop.
type Errand = Box<dyn FnOnce(&mut Dispatcher, Nanos) + Send>;

/// Lets other threads work on the dispatcher, between the turns of its loop. Clones are the same door.
#[derive(Clone)]
pub struct Door(Arc<Shared>);

struct Shared {
    stop: Stop,
    /// Checked in each turn, so that the loop takes the lock only when there is work.
    has_errands: AtomicBool,
    /// `None` when the loop has ended.
    errands: Mutex<Option<Vec<Errand>>>,
}

impl fmt::Debug for Door {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Door").finish_non_exhaustive()
    }
}

impl Door {
    /// The door of the loop that `stop` wakes and ends.
    pub fn new(stop: &Stop) -> Self {
        Self(Arc::new(Shared {
            stop: stop.clone(),
            has_errands: AtomicBool::new(false),
            errands: Mutex::new(Some(Vec::new())),
        }))
    }

    /// Runs `errand` in the loop, and wakes the loop for it. The errand gets the time and must not block. It is dropped
    /// if the loop has ended or ends first. Errands run in the order in which they were sent.
    pub fn send(&self, errand: impl FnOnce(&mut Dispatcher, Nanos) + Send + 'static) {
        let mut errands = self.errands();
        let Some(list) = errands.as_mut() else {
            return;
        };
        list.push(Box::new(errand));
        let is_first = list.len() == 1;
        self.0.has_errands.store(true, Ordering::Release);
        // The loop must not wake to find the lock taken.
        drop(errands);
        if is_first {
            self.0.stop.wake();
        }
    }

    /// Runs an operator's order.
    pub fn operate(&self, order: Order, reply: Reply) {
        self.send(move |dispatcher, _| dispatcher.operate(order, reply));
    }

    /// Runs all errands that were sent.
    pub(crate) fn serve(&self, dispatcher: &mut Dispatcher, now: Nanos) {
        if !self.0.has_errands.load(Ordering::Acquire) {
            return;
        }
        self.0.has_errands.store(false, Ordering::Relaxed);
        let errands = self.errands().as_mut().map(std::mem::take);
        for errand in errands.unwrap_or_default() {
            errand(dispatcher, now);
        }
    }

    /// Drops all errands, those sent from now on included.
    pub(crate) fn close(&self) {
        let errands = self.errands().take();
        drop(errands);
    }

    fn errands(&self) -> MutexGuard<'_, Option<Vec<Errand>>> {
        // No errand runs under the lock, so the list is intact.
        self.0
            .errands
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use std::sync::mpsc::channel;

    use super::*;
    use crate::dispatcher::Settings;
    use crate::patch::Patch;

    #[test]
    fn errands_are_done_in_order_and_dropped_behind_a_closed_door() {
        let stop = Stop::new();
        let door = Door::new(&stop);
        let mut dispatcher = Dispatcher::new(Settings::default(), Patch::new());
        let (sender, done) = channel();
        for number in 0..3 {
            let sender = sender.clone();
            door.send(move |_, now| sender.send((number, now)).expect("it is heard"));
        }
        assert!(stop.is_woken());
        door.serve(&mut dispatcher, Nanos(7));
        door.serve(&mut dispatcher, Nanos(8));
        let all: Vec<_> = done.try_iter().collect();
        assert_eq!(all, [(0, Nanos(7)), (1, Nanos(7)), (2, Nanos(7))]);
        for _ in 0..2 {
            let sender = sender.clone();
            door.send(move |_, now| sender.send((9, now)).expect("it is heard"));
            door.close();
        }
        door.serve(&mut dispatcher, Nanos(9));
        drop(sender);
        assert!(done.recv().is_err(), "dropped, and so its sender knows");
    }
}
