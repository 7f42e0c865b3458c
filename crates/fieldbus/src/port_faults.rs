//! A port's injected line faults.

use std::sync::Arc;

use crate::faults::{FaultBoard, LineFaults, Shape};
use tickbus_base::time::Nanos;
use tickbus_image::{BusEnd, BusStation};

use super::{Cause, LinkState, LinkStatus};

/// The injected faults of a port: without any, nothing is allocated.
#[derive(Debug, Default)]
pub(super) struct Troubles {
    board: Arc<FaultBoard>,
    /// The board's change counter when it was last read.
    seen: u64,
    wires: Option<Box<LineFaults>>,
    /// A frame per station, for handing in what was held back.
    frames: Vec<Box<[u8]>>,
    /// While a fault holds the line down: the bus's own state of the line.
    beneath: Option<Beneath>,
}

/// The state that a bus reports while a fault hides it.
#[derive(Debug)]
struct Beneath {
    state: LinkState,
    cause: Cause,
    reason: String,
}

impl Troubles {
    /// The faults on `board`.
    pub(super) fn of(board: Arc<FaultBoard>) -> Self {
        Self {
            board,
            ..Self::default()
        }
    }

    /// Whether there is anything to do.
    #[inline]
    pub(super) fn any(&self) -> bool {
        self.wires.is_some() || self.board.news() != self.seen
    }

    /// The line with its faults; `None` while there are none.
    #[inline]
    pub(super) fn wires(&mut self) -> Option<&mut LineFaults> {
        self.wires.as_deref_mut()
    }

    /// Reads the board: adopts new faults, logs, and updates the state of the line.
    pub(super) fn look(&mut self, now: Nanos, image: &BusEnd, status: &LinkStatus) {
        let news = self.board.news();
        if news == self.seen {
            return;
        }
        self.seen = news;
        self.board.tell(status.driver());
        for fault in self.board.take_line_faults() {
            let wires = self.wires.get_or_insert_with(|| {
                let shapes = image.stations.iter().map(shape);
                Box::new(LineFaults::new(Arc::clone(&self.board), shapes))
            });
            wires.adopt(fault);
            let sizes = image.stations.iter().map(BusStation::rx_len);
            self.frames = sizes.map(|size| vec![0; size].into()).collect();
        }
        let Some(wires) = &mut self.wires else {
            return;
        };
        wires.look();
        let active = wires.active();
        status.injected(active);
        let is_down = wires.is_down();
        match (is_down, self.beneath.take()) {
            (true, beneath) => {
                self.beneath = Some(beneath.unwrap_or_else(|| {
                    let link = status.link();
                    if link.state == LinkState::Stale {
                        // Staleness is decided by the clock, not by the bus.
                        Beneath {
                            state: LinkState::Running,
                            cause: Cause::Running,
                            reason: status.running_reason(),
                        }
                    } else {
                        Beneath {
                            state: link.state,
                            cause: link.cause,
                            reason: link.reason,
                        }
                    }
                }));
                let reason = format!("the link is down by injected fault: {active}");
                status.enter(now, LinkState::Failed, Cause::Injected, &reason);
            }
            (false, Some(beneath)) => {
                let Beneath {
                    state,
                    cause,
                    reason,
                } = beneath;
                if state == LinkState::Running {
                    status.running(now, &reason);
                } else {
                    status.enter(now, state, cause, &reason);
                }
            }
            (false, None) => {}
        }
    }

    /// Stores what the bus reports about its line while a fault hides it.
    pub(super) fn hides(
        &mut self,
        now: Nanos,
        (state, cause, reason): (LinkState, Cause, &str),
        status: &LinkStatus,
    ) -> bool {
        let (Some(beneath), Some(wires)) = (&mut self.beneath, &self.wires) else {
            return false;
        };
        if (beneath.state, beneath.cause) != (state, cause) || beneath.reason != reason {
            *beneath = Beneath {
                state,
                cause,
                reason: reason.to_owned(),
            };
            // The supervisor may have reported a failure in the meantime.
            say_down(now, wires.active(), status);
        }
        true
    }

    /// Decides at random whether the next outgoing frames are lost.
    pub(super) fn decides_to_lose_a_cycle(&mut self) -> bool {
        self.wires().is_some_and(LineFaults::loses_cycle)
    }

    /// When the next held frame is due.
    pub(super) fn due(&self) -> Nanos {
        self.wires.as_ref().map_or(Nanos::MAX, |wires| wires.due())
    }

    /// Copies the next frame that is due.
    pub(super) fn release(&mut self, station: usize, now: Nanos, frame: &mut [u8]) -> bool {
        self.wires()
            .is_some_and(|wires| wires.release(station, now, frame))
    }

    pub(super) fn take_frame(&mut self, station: usize) -> Box<[u8]> {
        self.frames
            .get_mut(station)
            .map(std::mem::take)
            .unwrap_or_default()
    }

    pub(super) fn put_frame(&mut self, station: usize, frame: Box<[u8]>) {
        if let Some(place) = self.frames.get_mut(station) {
            *place = frame;
        }
    }
}

fn say_down(now: Nanos, active: &str, status: &LinkStatus) {
    let reason = format!("the link is down by injected fault: {active}");
    status.enter(now, LinkState::Failed, Cause::Injected, &reason);
}

fn shape(station: &BusStation) -> Shape {
    let mut latched = vec![0; station.tx_len()];
    for bit in station.tx_latched() {
        latched[bit.byte] |= bit.mask;
    }
    Shape {
        last_sent: station.last_outgoing().into(),
        latched: latched.into(),
        rx_len: station.rx_len(),
    }
}
