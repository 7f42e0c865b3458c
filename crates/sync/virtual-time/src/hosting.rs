//! The connection between a server on its own thread and the rest of the process.

use std::fmt;
use std::sync::{Arc, Mutex, PoisonError};

use tickbus_base::time::{Clock, Nanos, Stop};

use crate::saved_run;
use crate::server::{Control, Saved, Server};
use crate::view::RunView;
use crate::wire::{self, FromClient};

/// Controls a server from other threads. Clones control the same server.
#[derive(Clone, Debug, Default)]
pub struct Controls {
    asked: Arc<Mutex<Asked>>,
    stop: Stop,
}

/// The requests to the server, and the last copy of the run.
#[derive(Debug, Default)]
struct Asked {
    controls: Vec<Control>,
    wants_view: bool,
    view: Option<RunView>,
    unsaved: Option<String>,
}

impl Controls {
    /// Controls of a server that also stops when `stop` does.
    pub fn new(stop: &Stop) -> Self {
        let asked = Arc::default();
        let stop = stop.clone();
        Self { asked, stop }
    }

    /// Sends the server a request; the server acts within some 20 ms.
    pub fn send(&self, control: Control) {
        self.lock().controls.push(control);
        self.stop.wake();
    }

    /// Requests a copy of the run, for [`take_view`](Self::take_view); the server makes it within some 20 ms, but no
    /// longer once the run has ended.
    pub fn ask_view(&self) {
        let is_new = !std::mem::replace(&mut self.lock().wants_view, true);
        if is_new {
            self.stop.wake();
        }
    }

    /// The requested copy, if it is ready. The first caller takes it.
    pub fn take_view(&self) -> Option<RunView> {
        self.lock().view.take()
    }

    /// Why the run was not saved, if that was the last result of saving.
    pub fn unsaved(&self) -> Option<String> {
        self.lock().unsaved.clone()
    }

    fn lock(&self) -> std::sync::MutexGuard<'_, Asked> {
        // Every single change leaves the data consistent.
        self.asked.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The token that wakes the server's thread.
    pub(crate) const fn stop(&self) -> &Stop {
        &self.stop
    }

    /// Passes the requests on.
    pub(crate) fn apply(&self, now: Nanos, server: &mut Server<'_>) {
        // A hook may send a request, too.
        let (controls, wants_view) = {
            let mut asked = self.lock();
            let wants_view = std::mem::take(&mut asked.wants_view);
            (std::mem::take(&mut asked.controls), wants_view)
        };
        for control in controls {
            server.control(now, control);
        }
        if self.stop.is_stopped() {
            server.control(now, Control::Stop);
        }
        if wants_view {
            let view = server.view(now);
            self.lock().view = view;
        }
    }
}

/// The environment of a server, besides its settings.
pub struct Hosting<'h> {
    /// The wall clock, for pacing and for patience.
    pub clock: &'h dyn Clock,
    /// The controls for other threads.
    pub controls: &'h Controls,
    /// Takes a line for people about every event: a client joins or is refused and why, or the run starts.
    pub news: &'h mut dyn FnMut(&str),
}

impl fmt::Debug for Hosting<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Hosting").finish_non_exhaustive()
    }
}

/// Writes runs that were just saved to their file.
pub(crate) fn keep(server: &mut Server<'_>, hosting: &mut Hosting<'_>) {
    while let Some(saved) = server.take_saved() {
        keep_one(server, hosting, saved);
    }
}

fn keep_one(server: &Server<'_>, hosting: &mut Hosting<'_>, saved: Saved) {
    let written = saved.and_then(|(step, content)| match server.saved_to() {
        Some(file) => match saved_run::write(file, &content) {
            Ok(()) => Ok(format!("saved after step {} in {}", step, file.display())),
            Err(error) => Err(format!("{}: {error}", file.display())),
        },
        None => Err("there is no file for it".to_owned()),
    });
    let line = match &written {
        Ok(line) => line.clone(),
        Err(why) => format!("not saved: {why}"),
    };
    hosting.controls.lock().unsaved = written.err();
    (hosting.news)(&line);
}

/// Passes a frame of the client at `seat`, without its header, to the server.
pub fn hear(server: &mut Server<'_>, now: Nanos, seat: usize, frame: &[u8]) {
    match wire::from_client(frame) {
        Ok(FromClient::Done {
            sequence,
            next,
            writes,
        }) => server.done_until(now, seat, (sequence, next), writes.iter()),
        Ok(FromClient::Join {
            declaration,
            version,
        }) => {
            if version >= 2 {
                server.keep_informed(seat);
            }
            if version >= wire::DIRECT {
                server.can_meet(seat);
            }
            if version >= wire::STATE {
                server.can_save(seat);
            }
            server.join(now, seat, declaration);
        }
        Ok(FromClient::Saved { sequence, state }) => server.has_saved(now, seat, sequence, state),
        Ok(FromClient::GiveUp(reason)) => server.gave_up(seat, reason),
        Ok(FromClient::At { token, address }) => server.is_at(now, seat, token, address),
        Ok(FromClient::Met { token, reason }) => server.has_met(now, seat, token, reason),
        Err(why) => server.violated(seat, &why),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Declaration, Logic, Settings, StartCondition};

    #[test]
    fn a_hook_may_send_a_control_while_one_is_applied() {
        let controls = Controls::default();
        let from_hook = controls.clone();
        let logic = Logic::new().on_time(move |_| {
            from_hook.send(Control::Pause);
            Ok(())
        });
        let start = StartCondition::Count(1);
        let settings = Settings {
            paused: true,
            ..Settings::new(Nanos::from_millis(1), start)
        };
        let now = Nanos::ZERO;
        let mut server = Server::new(settings, logic, now).expect("right settings");
        let seat = server.connected(now);
        server.join(now, seat, Declaration::new("a"));
        assert!(server.poll().is_some());
        server.done(now, seat, 0, [].into_iter());
        controls.send(Control::Run);
        controls.apply(now, &mut server);
        assert!(!server.is_paused(), "what the hook asks for comes next");
        controls.apply(now, &mut server);
        assert!(server.is_paused());
    }
}
