//! A dispatcher without sockets, and clients that send and receive lines.

pub(crate) mod hosts;

use std::net::SocketAddr;

use tickbus_base::time::Nanos;
use tickbus_dispatcher::{Dispatcher, Patch, Settings};

/// A dispatcher in which the patch is saved after every call, without a file.
pub(crate) struct Lab {
    pub(crate) dispatcher: Dispatcher,
    pub(crate) now: Nanos,
    pub(crate) next_port: u16,
}

impl Lab {
    pub(crate) fn new() -> Self {
        Self::with(Settings::default(), Patch::new())
    }

    pub(crate) fn with(settings: Settings, patch: Patch) -> Self {
        Self {
            dispatcher: Dispatcher::new(settings, patch),
            now: Nanos::ZERO,
            next_port: 3330,
        }
    }

    pub(crate) fn connect(&mut self) -> usize {
        let peer = SocketAddr::from(([192, 168, 0, 20], self.next_port));
        self.next_port += 1;
        self.dispatcher
            .connected(self.now, peer)
            .expect("there is room")
    }

    /// A client that has identified itself, and has read the answers.
    pub(crate) fn join(&mut self, identification: &str) -> usize {
        let seat = self.connect();
        let heard = self.ask(seat, identification);
        assert!(
            !heard.iter().any(|line| line.starts_with("ERR")),
            "{heard:?}"
        );
        seat
    }

    /// Sends a line.
    pub(crate) fn say(&mut self, seat: usize, line: &str) {
        self.send(seat, format!("{line}\r\n").as_bytes());
    }

    pub(crate) fn send(&mut self, seat: usize, bytes: &[u8]) {
        self.dispatcher.arrived(self.now, seat, bytes);
        self.settle();
    }

    pub(crate) fn wait(&mut self, span: Nanos) {
        self.now += span;
        self.settle();
    }

    pub(crate) fn settle(&mut self) {
        loop {
            self.dispatcher.tick(self.now);
            if self.dispatcher.unsaved().is_some() {
                self.dispatcher.saved(&Ok(()));
            }
            if self.dispatcher.deadline() > self.now {
                break;
            }
        }
    }

    /// Sends a line, and returns the lines that its client receives then.
    pub(crate) fn ask(&mut self, seat: usize, line: &str) -> Vec<String> {
        self.say(seat, line);
        self.hear(seat)
    }

    /// All lines for a client.
    pub(crate) fn hear(&mut self, seat: usize) -> Vec<String> {
        let mut all = Vec::new();
        loop {
            let bytes = self.dispatcher.to_write(seat).to_vec();
            if bytes.is_empty() {
                break;
            }
            self.dispatcher.wrote(seat, bytes.len());
            all.extend(bytes);
            self.settle();
        }
        let text = String::from_utf8(all).expect("it is text");
        assert!(text.is_empty() || text.ends_with("\r\n"), "{text}");
        text.split_terminator("\r\n").map(str::to_owned).collect()
    }
}
