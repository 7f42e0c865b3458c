//! What a bus sees of its driver.

use std::sync::atomic::{AtomicU8, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use crate::image::{BusEnd, Event};
use crate::time::{Clock, Nanos};

use super::{ChangeEvents, Role};

/// How a line is doing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LinkState {
    /// Not open.
    Closed,
    /// Trying to reach the peer, or waiting for it.
    Opening,
    /// The peer is there.
    Running,
    /// The line broke; it is tried again after a pause.
    Failed,
}

const STATES: [LinkState; 4] = [
    LinkState::Closed,
    LinkState::Opening,
    LinkState::Running,
    LinkState::Failed,
];

impl LinkState {
    /// The state's name, in lower case.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Closed => "closed",
            Self::Opening => "opening",
            Self::Running => "running",
            Self::Failed => "failed",
        }
    }
}

/// The state of a line, with its reason in words, as bus and driver share it.
#[derive(Clone, Debug)]
pub struct LinkStatus(Arc<Shared>);

#[derive(Debug)]
struct Shared {
    driver: String,
    state: AtomicU8,
    reason: Mutex<String>,
}

impl LinkStatus {
    /// The state of the line of the driver called `driver`, which is closed so far.
    pub fn new(driver: &str) -> Self {
        let (state, reason) = (AtomicU8::new(0), Mutex::new("not opened yet".to_owned()));
        Self(Arc::new(Shared {
            driver: driver.to_owned(),
            state,
            reason,
        }))
    }

    /// The state, without a lock.
    pub fn state(&self) -> LinkState {
        STATES[usize::from(self.0.state.load(Ordering::Relaxed)) % STATES.len()]
    }

    /// Why it is so, in words.
    pub fn reason(&self) -> String {
        self.0
            .reason
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .clone()
    }

    /// Enters a state; entering the present one with the same reason does nothing.
    pub fn enter(&self, state: LinkState, reason: &str) {
        let mut known = self.0.reason.lock().unwrap_or_else(PoisonError::into_inner);
        if self.state() == state && *known == reason {
            return;
        }
        let level = if state == LinkState::Failed {
            log::Level::Warn
        } else {
            log::Level::Info
        };
        log::log!(
            level,
            "driver \"{}\" is {}: {reason}",
            self.0.driver,
            state.name()
        );
        reason.clone_into(&mut known);
        self.0.state.store(state as u8, Ordering::Relaxed);
    }
}

/// A bus's access to the image, the clock and the state of its driver.
#[derive(Debug)]
pub struct Port {
    image: BusEnd,
    clock: Arc<dyn Clock>,
    role: Role,
    watchdog: Option<Nanos>,
    changes: Vec<ChangeEvents>,
    status: LinkStatus,
}

impl Port {
    /// A port over the bus's end of an image.
    ///
    /// When the simulation has not ticked for longer than `watchdog`, fail-safe bytes go out.
    pub fn new(
        image: BusEnd,
        clock: Arc<dyn Clock>,
        role: Role,
        watchdog: Option<Nanos>,
        status: LinkStatus,
    ) -> Self {
        Self {
            image,
            clock,
            role,
            watchdog,
            changes: Vec::new(),
            status,
        }
    }

    /// Reports every change between received frames as an event; one watcher per station.
    pub fn watch_changes(&mut self, changes: Vec<ChangeEvents>) {
        assert_eq!(changes.len(), self.stations(), "one watcher per station");
        self.changes = changes;
    }

    /// Which end of the line this is.
    pub fn role(&self) -> Role {
        self.role
    }

    /// The driver's clock, to wait on.
    pub fn clock(&self) -> &Arc<dyn Clock> {
        &self.clock
    }

    /// How many stations there are.
    pub fn stations(&self) -> usize {
        self.image.stations.len()
    }

    /// Sizes in bytes of the frames that a station sends and receives.
    pub fn sizes(&self, station: usize) -> (usize, usize) {
        let station = &self.image.stations[station];
        (station.tx_len(), station.rx_len())
    }

    /// The bytes that a station sends at `now`: latest values, no edge lost, fail-safe when the
    /// simulation has stopped. Follow with [`sent`](Self::sent) once the peer has them.
    pub fn outgoing(&mut self, station: usize, now: Nanos) -> &[u8] {
        self.image.stations[station].outgoing(now, self.watchdog)
    }

    /// The peer has what [`outgoing`](Self::outgoing) gave last.
    pub fn sent(&mut self, station: usize) {
        self.image.stations[station].sent();
    }

    /// Hands in a whole frame that arrived at `now`.
    ///
    /// # Panics
    ///
    /// When the frame has not the station's size.
    pub fn received(&mut self, station: usize, now: Nanos, bytes: &[u8]) {
        self.image.stations[station].received(now, bytes);
        if let Some(changes) = self.changes.get_mut(station) {
            changes.observe(now, bytes, &mut self.image.events);
        }
    }

    /// Says that the peer was alive at `now`.
    pub fn touch(&mut self, station: usize, now: Nanos) {
        self.image.stations[station].touch(now);
    }

    /// Reports a write of the peer, for buses whose every write matters.
    pub fn event(&mut self, event: Event) {
        self.image.events.push(event);
    }

    /// Tells how the line is doing.
    pub fn enter(&self, state: LinkState, reason: &str) {
        self.status.enter(state, reason);
    }
}
