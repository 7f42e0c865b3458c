//! The interface that every client implements.

use tickbus_base::time::Nanos;

use crate::{Declaration, Step};

/// A client, which runs in this process, over TCP, a Unix socket or through shared memory without knowing which.
pub trait Participant {
    /// The variables that the client writes and reads. Called once, before the run.
    fn declare(&self) -> Declaration;

    /// Fills in the values before the first step, one slot per variable of [`Declaration::writes`]; all are 0 at first.
    fn initial(&mut self, writes: &mut [u64]);

    /// Runs one step.
    ///
    /// `reads` has a slot per variable of [`Declaration::reads`], from the snapshot that all clients of the step see:
    /// values that others write in this step appear in the next one. `writes` still holds the last written values.
    /// Slots hold raw values; see [`is_raw`](crate::is_raw).
    ///
    /// # Errors
    ///
    /// The reason why the client cannot continue; this ends the run for everyone.
    fn run(&mut self, step: Step, reads: &[u64], writes: &mut [u64]) -> Result<(), String>;

    /// The virtual time at which the client wants to run next, asked after [`initial`](Self::initial) and after each
    /// [`run`](Self::run), for simulations that know the time of their next event. The client runs in the first step at
    /// or after this time, in the following step at the earliest; the values that it has written stay until then.
    /// `None`: as declared, by its multiple or interval. [`Nanos::MAX`]: never again, unless it asks otherwise; a run
    /// without a number of steps ends when no client wants to run again.
    fn next_update(&self) -> Option<Nanos> {
        None
    }

    /// The state after the last [`run`](Self::run), as bytes of its own format, at most
    /// [`LONGEST_STATE`](crate::wire::LONGEST_STATE): asked when the run is saved. A client that has none to give runs its
    /// steps again when the run is restored.
    ///
    /// # Errors
    ///
    /// The reason why it has none.
    fn save(&mut self) -> Result<Vec<u8>, String> {
        Err("it has no way to save its state".to_owned())
    }

    /// Takes over a [saved](Self::save) state, after [`initial`](Self::initial) and before the next [`run`](Self::run).
    ///
    /// # Errors
    ///
    /// The reason why it cannot; this ends the run for everyone.
    fn restore(&mut self, state: &[u8]) -> Result<(), String> {
        let _ = state;
        Err("it has no way to restore its state".to_owned())
    }

    /// The server waits, and this client has nothing to do: other clients have to join or to finish a step, or the run is
    /// paused. `for_whom` is a text for people, such as `"plc" to finish step 42`. Over TCP and Unix sockets this is
    /// called about once a second while the wait lasts; a shorter wait has no call. It is never called through shared
    /// memory or in one process.
    fn waiting(&mut self, for_whom: &str) {
        let _ = for_whom;
    }
}
