//! The server: one thread for all seats.

use std::io;
use std::sync::atomic::Ordering::{Acquire, Relaxed, SeqCst};

use tickbus_base::os::{NamedMemory, ProcessWatch};
use tickbus_base::time::Nanos;

use super::layout;
use super::mailbox::Mailbox;
use super::patience::Patience;
use crate::hosting::{Hosting, hear, keep};
use crate::local::Locals;
use crate::server::ToClient;
use crate::{
    Cause, Ended, Exchange, Logic, Outcome, Participant, Settings, StartCondition, server, wire,
};

/// How often to do everything else while steps follow each other.
const ROUND: Nanos = Nanos::from_millis(10);

/// How often to check that the processes are alive.
const PULSE: Nanos = Nanos::from_millis(50);

/// The time for a client to read the end of the run.
const FAREWELL: Nanos = Nanos::from_secs(1);

/// Seats for clients that come too late, so that they learn why they cannot take part.
const SPARE: usize = 8;

/// A server that waits for its clients in shared memory.
#[derive(Debug)]
pub struct Listener {
    memory: NamedMemory,
    seats: usize,
    spins: u32,
}

impl Listener {
    /// Offers shared memory under `name`, of letters, digits, hyphens and underscores, for a run with these settings.
    ///
    /// # Errors
    ///
    /// [`io::ErrorKind::AddrInUse`] if another process offers that name; or the system has no such memory.
    pub fn bind(name: &str, settings: &Settings) -> io::Result<Self> {
        let clients = match &settings.start {
            StartCondition::Names(names) => names.len(),
            StartCondition::Count(count) => (*count).min(server::MOST_CLIENTS),
        };
        let seats = clients + SPARE;
        let memory = NamedMemory::serve(&layout::path(name), layout::bytes(seats))?;
        let spins = Patience::spins(clients + 1);
        let word = |at: usize, value: u64| memory.memory().word(at).store(value, SeqCst);
        word(layout::SEATS, seats as u64);
        word(layout::SPINS, spins.into());
        word(layout::MAGIC, layout::READY);
        Ok(Self {
            memory,
            seats,
            spins,
        })
    }

    /// Waits for the clients and runs until the end.
    ///
    /// # Errors
    ///
    /// Why there was no run, or why it was broken off.
    pub fn run(
        self,
        settings: Settings,
        logic: Logic<'_>,
        hosting: Hosting<'_>,
    ) -> Result<Outcome, Ended> {
        self.run_with(settings, logic, hosting, Vec::new())
    }

    /// Like [`run`](Self::run), with `locals` as clients on the server's own thread. They run while the others do,
    /// without messages.
    ///
    /// # Errors
    ///
    /// The same as for [`run`](Self::run).
    pub fn run_with(
        self,
        settings: Settings,
        logic: Logic<'_>,
        hosting: Hosting<'_>,
        locals: Vec<&mut dyn Participant>,
    ) -> Result<Outcome, Ended> {
        let now = hosting.clock.now();
        // Clients through shared memory cannot meet; the server is no detour for them.
        let settings = match settings.exchange {
            Exchange::Direct => Settings {
                exchange: Exchange::ByServer { rejoin: None },
                ..settings
            },
            Exchange::ByServer { .. } => settings,
        };
        let mut server = server::Server::new(settings, logic, now)
            .map_err(|mistake| Ended::before(Cause::Configuration, mistake.to_string()))?;
        let locals = Locals::join(&mut server, now, locals);
        let mut host = Host {
            server,
            hosting,
            locals,
            memory: self.memory,
            patience: Patience::new(self.spins),
            seats: (0..self.seats).map(Seat::new).collect(),
            by_seat: Vec::new(),
            frame: Vec::new(),
            looked: now,
            felt: now,
        };
        host.run()
    }
}

struct Host<'l, 'h, 'p> {
    server: server::Server<'l>,
    hosting: Hosting<'h>,
    locals: Locals<'p>,
    memory: NamedMemory,
    patience: Patience,
    /// The seats of the memory.
    seats: Vec<Seat>,
    /// The memory's seats by the server's seats.
    by_seat: Vec<usize>,
    frame: Vec<u8>,
    /// When everything was last checked.
    looked: Nanos,
    /// When the processes were last checked for life.
    felt: Nanos,
}

struct Seat {
    at: usize,
    up: Mailbox,
    down: Mailbox,
    /// The server's seat of the client that is here.
    client: Option<usize>,
    watch: Option<ProcessWatch>,
    /// A frame without room so far, and the time when the server gives up.
    waiting: Option<(Vec<u8>, Nanos)>,
    is_taken: bool,
}

impl Seat {
    const fn new(at: usize) -> Self {
        Self {
            at,
            up: Mailbox::new(layout::up(at), layout::down(at)),
            down: Mailbox::new(layout::down(at), layout::up(at)),
            client: None,
            watch: None,
            waiting: None,
            is_taken: false,
        }
    }

    /// Posts a frame that has room, and wakes the client if it sleeps.
    fn post(&mut self, memory: &NamedMemory, frame: &[u8]) {
        let memory = memory.memory();
        self.down.post(memory, frame);
        if self.down.is_reader_sleeping(memory) {
            memory.wake(self.down.bell().0);
        }
    }
}

impl Host<'_, '_, '_> {
    fn run(&mut self) -> Result<Outcome, Ended> {
        loop {
            let now = self.hosting.clock.now();
            self.send(now);
            let is_waiting = self.seats.iter().any(|seat| seat.waiting.is_some());
            if !is_waiting && let Some(outcome) = self.server.outcome() {
                let outcome = outcome.clone();
                self.say_farewell(now);
                return outcome;
            }
            if now - self.looked >= ROUND {
                self.look_after_all(now);
                continue;
            }
            if self.locals.run(&mut self.server, now) {
                self.server.sent(self.hosting.clock.now());
                continue;
            }
            if let Some(seat) = self.server.awaited() {
                let at = self.by_seat[seat];
                let (up, memory) = (self.seats[at].up, self.memory.memory());
                if self.patience.look(|| up.has_frame(memory)) {
                    self.hear(at);
                    continue;
                }
                self.sleep(now + ROUND, Some(at));
            } else {
                self.sleep(self.server.deadline().min(now + ROUND), None);
            }
            // There is time for everything now.
            self.looked = Nanos(i64::MIN);
        }
    }

    /// Sends all messages.
    fn send(&mut self, now: Nanos) {
        let mut has_asked = false;
        keep(&mut self.server, &mut self.hosting);
        loop {
            while let Some(line) = self.server.news() {
                (self.hosting.news)(&line);
            }
            let Some((client, message)) = self.server.poll() else {
                break;
            };
            if matches!(message, ToClient::Waiting(_)) {
                // Clients watch the pulse instead: a mailbox has room for one frame.
                continue;
            }
            has_asked |= !matches!(message, ToClient::End(_));
            if self.locals.take(client, &message) {
                continue;
            }
            let seat = &mut self.seats[self.by_seat[client]];
            self.frame.clear();
            wire::to_client(&mut self.frame, &message);
            if matches!(message, ToClient::End(_)) {
                seat.client = None;
            }
            let frame = &self.frame[wire::HEADER..];
            if seat.waiting.is_none() && seat.down.has_room(self.memory.memory()) {
                seat.post(&self.memory, frame);
            } else {
                // Only the end of the run can come before the client has taken the previous message.
                seat.waiting = Some((frame.to_vec(), now + FAREWELL));
            }
        }
        if has_asked {
            self.server.sent(self.hosting.clock.now());
        }
    }

    /// Passes a client's frame on.
    fn hear(&mut self, at: usize) {
        let seat = &mut self.seats[at];
        let Some(client) = seat.client else {
            return;
        };
        match seat.up.take(self.memory.memory(), &mut self.frame) {
            Ok(()) => hear(
                &mut self.server,
                self.hosting.clock.now(),
                client,
                &self.frame,
            ),
            Err(why) => self.server.violated(client, &why),
        }
    }

    /// Sleeps until a client rings, for some time at most; does not sleep if the client at `awaited` has posted.
    fn sleep(&self, until: Nanos, awaited: Option<usize>) {
        let memory = self.memory.memory();
        let seen = memory.word(layout::BELL).load(Acquire);
        memory.word(layout::SERVER_SLEEPS).store(1, SeqCst);
        // Clients that posted before the sign was set did not ring.
        let has_come = |seat: &Seat| {
            let owner = memory.word(layout::owner(seat.at)).load(SeqCst);
            (owner != layout::FREE) != seat.is_taken
                || owner == layout::LEFT
                || (seat.client.is_some() && seat.up.has_frame(memory))
        };
        let is_there = match awaited {
            Some(at) => has_come(&self.seats[at]),
            None => self.seats.iter().any(has_come),
        };
        if !is_there {
            let span = until - self.hosting.clock.now();
            memory.wait(layout::BELL, seen, span.to_duration());
        }
        memory.word(layout::SERVER_SLEEPS).store(0, SeqCst);
    }

    /// Checks everything: all seats, controls, time.
    fn look_after_all(&mut self, now: Nanos) {
        let feels = now - self.felt >= PULSE;
        if feels {
            self.felt = now;
        }
        self.looked = now;
        let pulse = self.memory.memory().word(layout::PULSE);
        pulse.fetch_add(1, Relaxed);
        for at in 0..self.seats.len() {
            self.look_after(at, now, feels);
        }
        self.hosting.controls.apply(now, &mut self.server);
        self.server.tick(now);
    }

    fn look_after(&mut self, at: usize, now: Nanos, feels: bool) {
        let memory = self.memory.memory();
        let owner = memory.word(layout::owner(at)).load(SeqCst);
        let seat = &mut self.seats[at];
        if !seat.is_taken {
            if owner == layout::FREE {
                return;
            }
            seat.is_taken = true;
            seat.watch = u32::try_from(owner).ok().and_then(ProcessWatch::of);
            let client = self.server.connected(now);
            if client >= self.by_seat.len() {
                self.by_seat.resize(client + 1, usize::MAX);
            }
            self.by_seat[client] = at;
            seat.client = Some(client);
        }
        let waiting = seat.waiting.take();
        if let Some((frame, until)) = waiting {
            if seat.down.has_room(memory) {
                seat.post(&self.memory, &frame);
            } else if now < until {
                seat.waiting = Some((frame, until));
            }
        }
        // One frame per turn: a client that posts without end, or posts invalid frames, holds up nobody.
        if self.seats[at].client.is_some() && self.seats[at].up.has_frame(self.memory.memory()) {
            self.hear(at);
        }
        let seat = &mut self.seats[at];
        let has_left = owner == layout::LEFT;
        let has_ended = feels && seat.watch.as_ref().is_none_or(ProcessWatch::has_ended);
        if !has_left && !has_ended {
            return;
        }
        if let Some(client) = seat.client.take() {
            let reason = if has_left {
                "it left its seat"
            } else {
                "its process has ended"
            };
            self.server.lost(client, reason);
        }
        let memory = self.memory.memory();
        seat.waiting = None;
        seat.watch = None;
        seat.is_taken = false;
        seat.up.clear(memory);
        seat.down.clear(memory);
        memory.word(layout::owner(at)).store(layout::FREE, SeqCst);
    }

    /// Lets the clients take the last frames.
    fn say_farewell(&mut self, begun: Nanos) {
        let until = begun + FAREWELL;
        loop {
            let now = self.hosting.clock.now();
            self.look_after_all(now);
            let memory = self.memory.memory();
            let has_read = |seat: &Seat| !seat.is_taken || seat.down.has_room(memory);
            if self.seats.iter().all(has_read) || now >= until {
                return;
            }
            self.patience.look(|| self.seats.iter().all(has_read));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Controls;
    use crate::server::Control;
    use tickbus_base::time::Monotonic;

    #[test]
    fn a_process_that_posts_what_is_no_frame_holds_nobody_up() {
        let name = format!("test-no-frame-{}", std::process::id());
        let settings = Settings::new(Nanos::from_millis(1), StartCondition::Count(1));
        let listener = Listener::bind(&name, &settings).expect("a free name");
        let memory = NamedMemory::open(&layout::path(&name)).expect("it is served");
        let word = |at: usize, value: u64| memory.memory().word(at).store(value, SeqCst);
        // One empty frame, and two frames at once.
        for (seat, posted) in [(0, 1), (1, 2)] {
            word(layout::up(seat), posted);
            word(layout::owner(seat), std::process::id().into());
        }
        let controls = Controls::default();
        let mut refused = 0;
        let hosting = Hosting {
            clock: &*Monotonic::shared(),
            controls: &controls,
            news: &mut |line| {
                assert!(line.contains("what is no frame"), "{line}");
                refused += 1;
                if refused == 2 {
                    controls.send(Control::Stop);
                }
            },
        };
        let ended = listener.run(settings, Logic::new(), hosting);
        assert_eq!(ended.expect_err("it is stopped").cause, Cause::Stopped);
    }
}
