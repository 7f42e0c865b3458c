//! The bus cycles of a plug-in, with or without a helper process.

use super::outcome::Outcome;
use super::setup::Setup;
use tickbus_base::time::{Nanos, Pace, Stop};
use tickbus_fieldbus::{BusError, Port, Receipt};

/// A call that returns later than this after its time-out counts as slow: a busy system delays any thread by
/// as much.
const LATENESS: Nanos = Nanos::from_millis(10);

/// Makes single exchanges.
pub(super) trait Exchange {
    /// The bytes to send in the next exchange.
    fn input(&mut self) -> &mut [u8];

    /// Makes one exchange; `None` if it was stopped while it waited.
    fn exchange(&mut self, port: &Port, stop: &Stop) -> Result<Option<Outcome>, BusError>;

    /// The bytes received by the last exchange, if its outcome was fresh.
    fn output(&self) -> &[u8];
}

/// Exchanges every cycle until `stop`.
pub(super) fn serve(
    line: &mut impl Exchange,
    setup: &Setup,
    port: &mut Port,
    stop: &Stop,
) -> Result<(), BusError> {
    port.opening("the bus is open; waiting for the peer");
    let mut is_running = false;
    let mut pace = Pace::new(port.clock().now(), setup.cycle());
    while !stop.is_stopped() {
        let now = port.clock().now();
        // A call sends and receives at once: if sending is suppressed, there is no call.
        if pace.take(now)
            && let Some(receipt) = fill(line.input(), now, port)
        {
            match cycle(line, setup, &receipt, port, stop) {
                Ok(Some(outcome)) if outcome.is_alive() && !is_running => {
                    is_running = true;
                    port.running("the peer is there");
                }
                Ok(Some(_)) => {}
                Ok(None) => return Ok(()),
                Err(error @ BusError::Left(_)) => {
                    is_running = false;
                    port.lost(&error, "waiting for the next peer");
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

/// Makes the exchange for which the frames of `receipt` were filled in.
fn cycle(
    line: &mut impl Exchange,
    setup: &Setup,
    receipt: &Receipt,
    port: &mut Port,
    stop: &Stop,
) -> Result<Option<Outcome>, BusError> {
    let begun = port.clock().now();
    let outcome = line.exchange(port, stop)?;
    let now = port.clock().now();
    if now - begun > setup.timeout() + LATENESS {
        port.count("plugin.slow_calls");
    }
    let Some(outcome) = outcome else {
        return Ok(None);
    };
    if outcome.is_taken() {
        port.sent(receipt);
    }
    let mut rest = line.output();
    for station in 0..port.stations() {
        let (frame, after) = rest.split_at(port.sizes(station).1);
        if outcome.is_fresh() {
            port.received(station, now, frame);
        } else if outcome.is_alive() {
            port.touch(station, now);
        }
        rest = after;
    }
    Ok(Some(outcome))
}
