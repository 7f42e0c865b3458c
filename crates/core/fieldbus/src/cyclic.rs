//! The bus cycles of a vendor's library that sends and receives in one call.

use tickbus_base::time::{Nanos, Pace, Stop};

use super::{BusError, Port, Receipt};

/// A call that returns later than this after its time-out counts as slow: a busy system may delay any thread up to this
/// long.
const LATENESS: Nanos = Nanos::from_millis(10);

/// The outcome of an exchange.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Exchanged {
    /// The exchange moved data, or not.
    Data {
        /// The peer has the bytes of this exchange.
        is_taken: bool,
        /// A new whole image has arrived.
        is_fresh: bool,
        /// The peer gave any sign of life.
        is_alive: bool,
    },
    /// The library works, and reports that no peer is present on its bus: the library's words, and the remedy.
    NoPeer(&'static str),
    /// The exchange was stopped while it waited.
    Stopped,
}

/// Makes single exchanges.
pub trait Exchange {
    /// The bytes to send in the next exchange: the frames of all stations, one after another.
    fn input(&mut self) -> &mut [u8];

    /// Makes one exchange.
    ///
    /// # Errors
    ///
    /// The line is broken; or, with [`BusError::Left`], the peer left properly, and the line stays open for the next
    /// one.
    fn exchange(&mut self, port: &Port, stop: &Stop) -> Result<Exchanged, BusError>;

    /// The bytes received by the last exchange, if it was fresh.
    fn output(&self) -> &[u8];
}

/// How exchanges are paced.
#[derive(Clone, Copy, Debug)]
pub struct Cycles {
    /// The time from one exchange to the next.
    pub cycle: Nanos,
    /// The time-out of an exchange.
    pub timeout: Nanos,
    /// The counter of exchanges that came back too late.
    pub slow: &'static str,
}

impl Cycles {
    /// Exchanges every cycle until `stop`.
    ///
    /// # Errors
    ///
    /// The line is broken.
    pub fn serve(
        &self,
        line: &mut impl Exchange,
        port: &mut Port,
        stop: &Stop,
    ) -> Result<(), BusError> {
        const WAITS: &str = "waiting for the next peer";
        port.opening("the bus is open; waiting for the peer");
        let mut is_running = false;
        let mut missing = "";
        let mut pace = Pace::new(port.clock().now(), self.cycle);
        while !stop.is_stopped() {
            let now = port.clock().now();
            // A call sends and receives at once: if nothing is to be sent, no call is made.
            if pace.take(now)
                && let Some(receipt) = fill(line.input(), now, port)
            {
                match self.cycle(line, &receipt, port, stop) {
                    Ok(Exchanged::Data { is_alive: true, .. }) if !is_running => {
                        (is_running, missing) = (true, "");
                        port.running("the peer is there");
                    }
                    Ok(Exchanged::NoPeer(why)) if is_running => {
                        (is_running, missing) = (false, why);
                        port.lost(&BusError::Link(why.to_owned()), WAITS);
                    }
                    Ok(Exchanged::NoPeer(why)) if missing != why => {
                        missing = why;
                        port.opening(&format!("the bus is open; {why}"));
                    }
                    Ok(Exchanged::Data { .. } | Exchanged::NoPeer(_)) => {}
                    Ok(Exchanged::Stopped) => return Ok(()),
                    Err(error @ BusError::Left(_)) => {
                        is_running = false;
                        port.lost(&error, WAITS);
                    }
                    Err(error) => return Err(error),
                }
            } else {
                port.observe(now);
            }
            port.wait_until(pace.due(), stop);
        }
        Ok(())
    }

    /// Makes the exchange for which the frames of `receipt` were filled in.
    fn cycle(
        &self,
        line: &mut impl Exchange,
        receipt: &Receipt,
        port: &mut Port,
        stop: &Stop,
    ) -> Result<Exchanged, BusError> {
        let begun = port.clock().now();
        let exchanged = line.exchange(port, stop)?;
        let now = port.clock().now();
        if now - begun > self.timeout + LATENESS {
            port.count(self.slow);
        }
        let Exchanged::Data {
            is_taken,
            is_fresh,
            is_alive,
        } = exchanged
        else {
            return Ok(exchanged);
        };
        if is_taken {
            port.sent(receipt);
        }
        port.together(|port| {
            let mut rest = line.output();
            for station in 0..port.stations() {
                let (frame, after) = rest.split_at(port.sizes(station).1);
                if is_fresh {
                    port.received(station, now, frame);
                } else if is_alive {
                    port.touch(station, now);
                }
                rest = after;
            }
        });
        Ok(exchanged)
    }
}

/// Fills in the frames to send at `now`; `None` if nothing goes out.
fn fill(mut space: &mut [u8], now: Nanos, port: &mut Port) -> Option<Receipt> {
    let mut frames = port.take_all(now)?;
    for station in frames.stations() {
        let bytes = frames.frame(station);
        let (frame, after) = space.split_at_mut(bytes.len());
        frame.copy_from_slice(bytes);
        space = after;
    }
    Some(frames.receipt())
}
