//! The calls of FMI 3.0's event mode.

#![allow(unsafe_code, reason = "foreign functions are called")]

use std::ffi::c_int;

use super::Instance;
use super::functions::{Handle, Plain};
use crate::value::Status;

/// `fmi3UpdateDiscreteStates`. The FMU may return values other than 0 and 1 for Booleans.
type Update =
    unsafe extern "C" fn(Handle, *mut u8, *mut u8, *mut u8, *mut u8, *mut u8, *mut f64) -> c_int;

super::functions::functions! { EventFunctions, "fmi3":
    enter: Plain = "EnterEventMode";
    leave: Plain = "EnterStepMode";
    update: Update = "UpdateDiscreteStates";
    set_clock: unsafe extern "C" fn(Handle, *const u32, usize, *const bool) -> c_int = "SetClock";
    get_clock: unsafe extern "C" fn(Handle, *const u32, usize, *mut u8) -> c_int = "GetClock";
    interval: unsafe extern "C" fn(Handle, *const u32, usize, *mut f64, *mut c_int) -> c_int = "GetIntervalDecimal";
    shift: unsafe extern "C" fn(Handle, *const u32, usize, *mut f64) -> c_int = "GetShiftDecimal";
}

/// The result of an iteration of the event mode.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::foreign) struct Updated {
    pub status: Status,
    /// True if another iteration is needed.
    pub again: bool,
    /// True if the FMU asks to end the run.
    pub terminate: bool,
    /// The time of the FMU's next event in seconds, if it has one.
    pub next: Option<f64>,
}

/// The answer to the question for a clock's interval.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::foreign) enum Interval {
    /// Not known yet.
    Unknown,
    /// As before.
    Unchanged,
    /// From now on this many seconds.
    Changed(f64),
}

impl Instance {
    fn events(&self) -> &EventFunctions {
        self.begin_call();
        self.events.as_ref().expect("its event mode is used")
    }

    /// Enters the event mode.
    pub(in crate::foreign) fn enter_events(&mut self) -> Status {
        let enter = self.events().enter;
        // SAFETY: the handle belongs to this library and is alive, here and below.
        let status = unsafe { enter(self.handle) };
        self.noted(status)
    }

    /// Leaves the event mode for the next step.
    pub(in crate::foreign) fn leave_events(&mut self) -> Status {
        let leave = self.events().leave;
        // SAFETY: as above.
        let status = unsafe { leave(self.handle) };
        self.noted(status)
    }

    /// Lets clocks tick.
    pub(in crate::foreign) fn tick(&mut self, clocks: &[u32]) -> Status {
        let set = self.events().set_clock;
        let values = vec![true; clocks.len()];
        // SAFETY: as above; both lists have this length and outlive the call.
        let status = unsafe { set(self.handle, clocks.as_ptr(), clocks.len(), values.as_ptr()) };
        self.noted(status)
    }

    /// Adds those of the FMU's own clocks that tick now to `ticking`.
    pub(in crate::foreign) fn own_ticks(
        &mut self,
        clocks: &[u32],
        ticking: &mut Vec<u32>,
    ) -> Status {
        let get = self.events().get_clock;
        let mut values = vec![0; clocks.len()];
        // SAFETY: as above.
        let status = unsafe {
            get(
                self.handle,
                clocks.as_ptr(),
                clocks.len(),
                values.as_mut_ptr(),
            )
        };
        let own = clocks.iter().zip(values).filter(|(_, value)| *value != 0);
        ticking.extend(own.map(|(clock, _)| *clock));
        self.noted(status)
    }

    /// Does one iteration of the event mode.
    pub(in crate::foreign) fn update(&mut self) -> Updated {
        let update = self.events().update;
        let (mut again, mut terminate, mut has_next) = (0, 0, 0);
        let (mut nominals, mut values, mut next) = (0, 0, 0.0);
        // SAFETY: as above.
        let status = unsafe {
            update(
                self.handle,
                &raw mut again,
                &raw mut terminate,
                &raw mut nominals,
                &raw mut values,
                &raw mut has_next,
                &raw mut next,
            )
        };
        Updated {
            status: self.noted(status),
            again: again != 0,
            terminate: terminate != 0,
            next: (has_next != 0 && next.is_finite()).then_some(next),
        }
    }

    /// Asks for the interval of a clock.
    pub(in crate::foreign) fn interval(&mut self, clock: u32) -> (Status, Interval) {
        let interval = self.events().interval;
        let (mut seconds, mut qualifier) = (0.0, 0);
        // SAFETY: as above.
        let status = unsafe {
            interval(
                self.handle,
                &raw const clock,
                1,
                &raw mut seconds,
                &raw mut qualifier,
            )
        };
        // fmi3IntervalNotYetKnown is 0, fmi3IntervalUnchanged 1, fmi3IntervalChanged 2.
        let interval = match qualifier {
            2 if seconds.is_finite() && seconds >= 0.0 => Interval::Changed(seconds),
            1 => Interval::Unchanged,
            _ => Interval::Unknown,
        };
        (self.noted(status), interval)
    }

    /// Asks for the shift of a clock, in seconds; 0 for one that is no time.
    pub(in crate::foreign) fn shift(&mut self, clock: u32) -> (Status, f64) {
        let shift = self.events().shift;
        let mut seconds = 0.0_f64;
        // SAFETY: as above.
        let status = unsafe { shift(self.handle, &raw const clock, 1, &raw mut seconds) };
        let is_time = seconds.is_finite() && seconds >= 0.0;
        (self.noted(status), if is_time { seconds } else { 0.0 })
    }
}
