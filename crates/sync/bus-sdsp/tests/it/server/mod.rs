//! A server of virtual time on a separate thread.
#![allow(dead_code, unreachable_pub, reason = "each test uses a part of it")]

use std::sync::mpsc;
use std::thread::{self, JoinHandle};

use tickbus_base::time::Monotonic;
use tickbus_net::Address;
use tickbus_virtual_time::{Controls, Ended, Hosting, Logic, Outcome, Settings, tcp};

/// A server on a separate thread.
pub struct Server {
    pub port: u16,
    pub controls: Controls,
    news: mpsc::Receiver<String>,
    thread: JoinHandle<Result<Outcome, Ended>>,
}

impl Server {
    /// Over TCP, on a free port.
    pub fn start(settings: Settings) -> Self {
        let listener = tcp::Listener::bind(&Address::local(0)).expect("a free port");
        let port = listener.address().port();
        Self::run(port, move |hosting| {
            listener.run(settings, Logic::new(), hosting)
        })
    }

    /// In shared memory of this name.
    #[cfg(unix)]
    pub fn in_memory(name: &str, settings: Settings) -> Self {
        let listener = tickbus_virtual_time::shared_memory::Listener::bind(name, &settings);
        let listener = listener.expect("a name of this test alone");
        Self::run(0, move |hosting| {
            listener.run(settings, Logic::new(), hosting)
        })
    }

    fn run(
        port: u16,
        serve: impl FnOnce(Hosting<'_>) -> Result<Outcome, Ended> + Send + 'static,
    ) -> Self {
        let (controls, (tell, news)) = (Controls::default(), mpsc::channel());
        let thread = thread::spawn({
            let controls = controls.clone();
            move || {
                serve(Hosting {
                    clock: &*Monotonic::shared(),
                    controls: &controls,
                    // Most tests do not listen.
                    news: &mut |line| drop(tell.send(line.to_owned())),
                })
            }
        });
        Self {
            port,
            controls,
            news,
            thread,
        }
    }

    /// Waits until the server reports this.
    pub fn says(&self, part: &str) {
        while !self.news.recv().expect(part).contains(part) {}
    }

    pub fn end(self) -> Result<Outcome, Ended> {
        self.thread.join().expect("no panic")
    }
}
