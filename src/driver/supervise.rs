//! The thread of a free bus: runs it, and runs it again when its line broke.

use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::thread::JoinHandle;

use crate::fieldbus::{Free, LinkState, LinkStatus, Port};
use crate::time::{Clock, Nanos, Stop};

/// A bus thread; dropping it stops the bus and waits for its end.
#[derive(Debug)]
pub(super) struct BusThread {
    stop: Stop,
    thread: Option<JoinHandle<()>>,
}

impl BusThread {
    /// Starts a thread that serves `bus`, with the pauses of `reconnect` between attempts (the last
    /// one again and again).
    pub(super) fn start(
        mut bus: Box<dyn Free>,
        mut port: Port,
        reconnect: Vec<Nanos>,
        status: LinkStatus,
        name: &str,
    ) -> std::io::Result<Self> {
        let stop = Stop::new();
        let thread = std::thread::Builder::new()
            .name(format!("bus {name}"))
            .spawn({
                let stop = stop.clone();
                move || {
                    let clock = Arc::clone(port.clock());
                    serve(&mut *bus, &mut port, &*clock, &reconnect, &status, &stop);
                }
            })?;
        Ok(Self {
            stop,
            thread: Some(thread),
        })
    }
}

impl Drop for BusThread {
    fn drop(&mut self) {
        self.stop.stop();
        if let Some(thread) = self.thread.take() {
            // Its panics are caught and recorded on the thread itself.
            let _ = thread.join();
        }
    }
}

fn serve(
    bus: &mut dyn Free,
    port: &mut Port,
    clock: &dyn Clock,
    reconnect: &[Nanos],
    status: &LinkStatus,
    stop: &Stop,
) {
    let mut attempt = 0;
    while !stop.is_stopped() {
        status.enter(LinkState::Opening, "opening the line");
        let ended = match catch_unwind(AssertUnwindSafe(|| bus.run(port, stop))) {
            Ok(Ok(())) if stop.is_stopped() => break,
            Ok(Ok(())) => "the bus ended by itself".to_owned(),
            Ok(Err(error)) => error.to_string(),
            Err(panic) => {
                let text = panic_text(&*panic);
                status.enter(
                    LinkState::Failed,
                    &format!(
                        "the bus thread panicked ({text}); close the driver and open it again"
                    ),
                );
                return;
            }
        };
        if status.state() == LinkState::Running {
            attempt = 0;
        }
        let pause = reconnect[attempt.min(reconnect.len() - 1)];
        attempt += 1;
        status.enter(
            LinkState::Failed,
            &format!("{ended}; next attempt in {pause}"),
        );
        clock.wait_until(clock.now() + pause, stop);
    }
    status.enter(LinkState::Closed, "closed");
}

/// What a panic said.
pub(crate) fn panic_text(panic: &(dyn Any + Send)) -> &str {
    panic
        .downcast_ref::<&'static str>()
        .copied()
        .or_else(|| panic.downcast_ref::<String>().map(String::as_str))
        .unwrap_or("no text")
}
