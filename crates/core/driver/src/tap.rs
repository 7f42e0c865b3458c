//! The tap: another thread looks at a driver and injects faults into it, and the tick never waits for that thread.
//!
//! At its end, the tick checks one word. If something is wanted, the tick hands over one copy of its state through a
//! triple buffer, and takes over the orders: faults that the other thread has prepared. Memory is neither allocated nor
//! freed here.

use std::sync::Arc;
use std::sync::atomic::{AtomicU8, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, TryRecvError, TrySendError, sync_channel};

use tickbus_base::Mistake;
use tickbus_fieldbus::faults::{Faults, Prepared, Retired};
use tickbus_image::{Reader, Writer, triple_buffer};

use super::view::View;

/// Requests a copy of the values.
const VALUES: u8 = 1;
/// Requests copies of the distributions as well.
const TIMES: u8 = 2;
/// Signals that orders are waiting.
const ORDERS: u8 = 4;

/// The most orders that can wait.
const ORDERS_LIMIT: usize = 256;

/// An order for the end of a tick.
#[derive(Debug)]
#[expect(
    clippy::large_enum_variant,
    reason = "a box would have to be freed by the tick"
)]
enum Order {
    Inject(Prepared),
    End(u32),
    Batch(Box<Batch>),
}

/// A request that faults begin, and others end, in the same tick.
#[derive(Debug)]
struct Batch {
    begin: Vec<Prepared>,
    end: Vec<u32>,
    /// Those that the new ones replace on the list, with room for all.
    retired: Vec<Retired>,
}

/// Memory that only the other thread can free.
#[derive(Debug)]
#[expect(
    clippy::large_enum_variant,
    reason = "a box would have to be allocated by the tick"
)]
enum Waste {
    Fault(#[expect(dead_code, reason = "kept for its drop")] Retired),
    Batch(#[expect(dead_code, reason = "kept for its drop")] Box<Batch>),
}

/// The requests to a tick.
#[derive(Clone, Copy, Debug)]
pub(super) struct Wanted(u8);

impl Wanted {
    pub(super) const fn values(self) -> bool {
        self.0 & VALUES != 0
    }

    pub(super) const fn times(self) -> bool {
        self.0 & TIMES != 0
    }

    pub(super) const fn orders(self) -> bool {
        self.0 & ORDERS != 0
    }
}

/// The tick's end.
#[derive(Debug)]
pub(super) struct Tap {
    wanted: Arc<AtomicU8>,
    views: Writer<View>,
    orders: Receiver<Order>,
    /// The way back for memory that only the other thread can free.
    retired: SyncSender<Waste>,
}

/// The other end.
#[derive(Debug)]
pub(super) struct Handle {
    wanted: Arc<AtomicU8>,
    views: Reader<View>,
    orders: SyncSender<Order>,
    retired: Receiver<Waste>,
}

/// Creates both ends; `initial` is visible before the first tick.
pub(super) fn tap(initial: &View) -> (Tap, Handle) {
    let wanted = Arc::<AtomicU8>::default();
    let (writer, reader) = triple_buffer(initial);
    let (send, orders) = sync_channel(ORDERS_LIMIT);
    // An order retires at most one fault or one batch, and the sender of orders empties this queue first.
    let (retired, take) = sync_channel(2 * ORDERS_LIMIT);
    let tap = Tap {
        wanted: Arc::clone(&wanted),
        views: writer,
        orders,
        retired,
    };
    let handle = Handle {
        wanted,
        views: reader,
        orders: send,
        retired: take,
    };
    (tap, handle)
}

impl Tap {
    /// Returns true if anything is wanted.
    #[inline]
    pub(super) fn is_wanted(&self) -> bool {
        self.wanted.load(Ordering::Relaxed) != 0
    }

    /// Returns the requests, and clears them.
    pub(super) fn take_wanted(&self) -> Wanted {
        Wanted(self.wanted.swap(0, Ordering::Acquire))
    }

    /// Hands over a copy, which `fill` builds on top of an older one.
    pub(super) fn show(&mut self, fill: impl FnOnce(&mut View)) {
        self.views.with_buffer(fill);
        self.views.publish();
    }

    /// Carries out the orders.
    pub(super) fn obey(&mut self, faults: &mut Faults) {
        // No sender ever waits, so receiving wakes nobody.
        loop {
            match self.orders.try_recv() {
                Ok(Order::Inject(prepared)) => {
                    if let Some(retired) = faults.adopt(prepared) {
                        // There is room, see above; without room the fault is freed here.
                        let _ = self.retired.try_send(Waste::Fault(retired));
                    }
                }
                Ok(Order::End(id)) => drop(faults.end(id)),
                Ok(Order::Batch(mut batch)) => {
                    let Batch {
                        begin,
                        end,
                        retired,
                    } = &mut *batch;
                    retired.extend(begin.drain(..).filter_map(|fault| faults.adopt(fault)));
                    for id in end {
                        faults.end(*id);
                    }
                    // As above.
                    let _ = self.retired.try_send(Waste::Batch(batch));
                }
                Err(TryRecvError::Empty | TryRecvError::Disconnected) => return,
            }
        }
    }
}

impl Handle {
    /// Asks for a copy at the end of the next tick.
    pub(super) fn ask(&self, with_times: bool) {
        let wanted = if with_times { VALUES | TIMES } else { VALUES };
        self.wanted.fetch_or(wanted, Ordering::Release);
    }

    /// Takes over the newest copy, if there is a new one.
    pub(super) fn update(&mut self) -> bool {
        self.views.update()
    }

    pub(super) fn with<R>(&self, read: impl FnOnce(&View) -> R) -> R {
        self.views.with(read)
    }

    /// Hands a fault over to the next tick.
    pub(super) fn inject(&self, fault: Prepared) -> Result<(), Mistake> {
        self.order(Order::Inject(fault)).map_err(|(order, why)| {
            if let Order::Inject(fault) = order {
                fault.cancel();
            }
            why
        })
    }

    /// Lets faults begin in the same tick, and others end in it.
    pub(super) fn replace(&self, begin: Vec<Prepared>, end: Vec<u32>) -> Result<(), Mistake> {
        let batch = Batch {
            retired: Vec::with_capacity(begin.len()),
            begin,
            end,
        };
        self.order(Order::Batch(Box::new(batch)))
            .map_err(|(order, why)| {
                if let Order::Batch(batch) = order {
                    batch.begin.into_iter().for_each(Prepared::cancel);
                }
                why
            })
    }

    /// Lets the next tick end a fault.
    pub(super) fn end(&self, id: u32) -> Result<(), Mistake> {
        self.order(Order::End(id)).map_err(|(_, why)| why)
    }

    #[expect(clippy::result_large_err, reason = "what was not sent is given back")]
    fn order(&self, order: Order) -> Result<(), (Order, Mistake)> {
        self.retired.try_iter().for_each(drop);
        self.orders.try_send(order).map_err(|error| match error {
            TrySendError::Full(order) => {
                let what = "the simulation has taken over none of the last orders";
                (order, Mistake::new(what, "let it tick"))
            }
            TrySendError::Disconnected(order) => {
                (order, Mistake::new("the driver is closed", "open it again"))
            }
        })?;
        self.wanted.fetch_or(ORDERS, Ordering::Release);
        Ok(())
    }
}
