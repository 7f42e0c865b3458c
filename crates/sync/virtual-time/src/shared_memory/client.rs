//! The client.

use std::io::ErrorKind;
use std::sync::atomic::Ordering::{Relaxed, SeqCst};

use tickbus_base::os::NamedMemory;
use tickbus_base::time::{Clock as _, Monotonic, Nanos, Stop};

use super::layout;
use super::mailbox::Mailbox;
use super::patience::Patience;
use crate::client::{Client, Connection, Line, client_of, closed, silent};
use crate::{Cause, Ended, Outcome, Participant, wire};

/// How long a wait sleeps before it checks that the server is alive.
const NAP: Nanos = Nanos::from_millis(50);

/// How long the server may leave a frame in the mailbox.
const PATIENCE: Nanos = Nanos::from_secs(10);

/// Runs `participant` in the run that a server on this computer offers under `name`, until its end.
///
/// # Errors
///
/// There is no server, it refuses this client, or the run was broken off.
pub fn join(name: &str, participant: &mut dyn Participant) -> Result<Outcome, Ended> {
    let client = client_of(participant)?;
    connect(name, client, &Stop::new())?.run(participant)
}

/// Takes a seat at the server of this name, and joins. When `stop` is stopped, the client leaves the run.
///
/// # Errors
///
/// There is no server, or it has no free seat.
pub fn connect(name: &str, client: Client, stop: &Stop) -> Result<Connection, Ended> {
    let lost = |reason: String| Ended::before(Cause::Lost, reason);
    let path = layout::path(name);
    let no_server = || {
        lost(format!(
            "no server offers the shared memory \"{name}\"; start it first, or correct the name"
        ))
    };
    let memory = NamedMemory::open(&path).map_err(|error| match error.kind() {
        ErrorKind::NotFound => no_server(),
        _ => lost(format!(
            "the shared memory {} cannot be opened ({error})",
            path.display()
        )),
    })?;
    let seats = layout::seats(memory.memory()).ok_or_else(no_server)?;
    let process = u64::from(std::process::id());
    let is_mine = |seat: &usize| {
        let owner = memory.memory().word(layout::owner(*seat));
        let taken = owner.compare_exchange(layout::FREE, process, SeqCst, Relaxed);
        taken.is_ok()
    };
    let seat = (0..seats).find(is_mine).ok_or_else(|| {
        lost(format!(
            "all {seats} seats at the shared memory \"{name}\" are taken"
        ))
    })?;
    let spins = memory.memory().word(layout::SPINS).load(Relaxed);
    let line = MemoryLine {
        patience: Patience::new(u32::try_from(spins).unwrap_or(0)),
        up: Mailbox::new(layout::up(seat), layout::down(seat)),
        down: Mailbox::new(layout::down(seat), layout::up(seat)),
        memory,
        seat,
        stop: stop.clone(),
        leaves: None,
        frame: Vec::new(),
    };
    Ok(Connection::join(client, line))
}

#[derive(Debug)]
struct MemoryLine {
    memory: NamedMemory,
    seat: usize,
    patience: Patience,
    up: Mailbox,
    down: Mailbox,
    stop: Stop,
    /// When `receive` gives up in any case.
    leaves: Option<Nanos>,
    frame: Vec<u8>,
}

impl MemoryLine {
    /// Wakes the server, if it sleeps.
    fn ring(&self) {
        let memory = self.memory.memory();
        if memory.word(layout::SERVER_SLEEPS).load(SeqCst) != 0 {
            memory.word(layout::BELL).fetch_add(1, SeqCst);
            memory.wake(layout::BELL);
        }
    }

    /// Waits until a frame has come, for [`NAP`] at most.
    fn nap(&mut self) {
        let memory = self.memory.memory();
        let down = self.down;
        if self.patience.look(|| down.has_frame(memory)) {
            return;
        }
        self.down.set_sleeping(memory, true);
        if !self.down.has_frame(memory) {
            let (at, seen) = self.down.bell();
            memory.wait(at, seen, NAP.to_duration());
        }
        self.down.set_sleeping(memory, false);
    }
}

impl Line for MemoryLine {
    fn send(&mut self, frame: &[u8]) {
        // The server takes each frame as soon as it looks. If it does not, this frame is lost, and `receive` finds out
        // why.
        let memory = self.memory.memory();
        let clock = Monotonic::shared();
        let until = clock.now() + PATIENCE;
        let up = self.up;
        while !up.has_room(memory) {
            if clock.now() >= until || !self.memory.is_served() {
                return;
            }
            self.ring();
            self.patience.look(|| up.has_room(memory));
        }
        self.up.post(memory, &frame[wire::HEADER..]);
        self.ring();
    }

    fn receive(&mut self, limit: Nanos) -> Result<&[u8], Ended> {
        let mut until = None;
        let mut pulse = None;
        while !self.down.has_frame(self.memory.memory()) {
            self.nap();
            if self.down.has_frame(self.memory.memory()) {
                break;
            }
            let lost = |what| Err(Ended::before(Cause::Lost, what));
            if !self.memory.is_served() && !self.down.has_frame(self.memory.memory()) {
                return lost("the server was lost: its process has ended");
            }
            if self.stop.is_stopped() {
                return Err(Ended::before(Cause::Stopped, "this client was stopped"));
            }
            let now = Monotonic::shared().now();
            if self.leaves.is_some_and(|by| now >= by) {
                return Err(closed());
            }
            let beats = self.memory.memory().word(layout::PULSE).load(Relaxed);
            if pulse.replace(beats) != Some(beats) {
                until = None;
            }
            if now >= *until.get_or_insert(now + limit - NAP) {
                return Err(silent(limit));
            }
        }
        let taken = self.down.take(self.memory.memory(), &mut self.frame);
        taken.map_err(|what| {
            let reason = format!("the server violates the protocol: it {what}");
            Ended::before(Cause::Protocol, reason)
        })?;
        Ok(&self.frame)
    }

    fn leave_within(&mut self, limit: Nanos) {
        self.leaves = Some(Monotonic::shared().now() + limit);
    }
}

impl Drop for MemoryLine {
    fn drop(&mut self) {
        let owner = self.memory.memory().word(layout::owner(self.seat));
        owner.store(layout::LEFT, SeqCst);
        self.ring();
    }
}
