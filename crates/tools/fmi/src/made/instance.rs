//! The inside of the FMU: a driver, and the values of its variables.

use std::ffi::CString;
use std::path::Path;
use std::sync::Arc;

use tickbus_base::time::{Clock as _, Monotonic, Nanos, Stop};
use tickbus_driver::{Code, Driver, Exchange};
use tickbus_driver_cfg::{Config, Kinds};
use tickbus_image::signal::Slot;
use tickbus_record as record;

use super::resources::token;
use super::variables::{Cell, Exposed, Place, Variable, default_pace, initial_slots, seconds};
use crate::real_time::RealTime;
use crate::value::{Number, Value, ValueType, Version};

/// The largest distance between the end of a step and the beginning of the next, in seconds, apart from the rounding
/// of doubles.
const TOLERANCE: f64 = 1e-9;

/// The state of an instance.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Phase {
    /// Created or reset: everything can be set.
    Before,
    /// The driver is open.
    Running,
    /// Ended or failed.
    Over,
}

/// One instance of an FMU.
#[derive(Debug)]
pub struct Instance {
    version: Version,
    config: Config,
    exposed: Exposed,
    slots: Vec<Slot>,
    found: Exchange,
    phase: Phase,
    driver: Option<Driver>,
    /// The end of the last step, in seconds.
    time: f64,
    /// The simulation time at which the driver's time is 0, in seconds: the driver's time is never negative.
    origin: f64,
    real_time: RealTime,
    address: CString,
    record: CString,
    clock: Arc<Monotonic>,
    stop: Stop,
}

impl Instance {
    /// Creates an instance of the FMU whose resources are in `folder`; its model description has the token `given`. Its
    /// driver.cfg can name these `kinds` of bus. No bus is open yet.
    ///
    /// # Errors
    ///
    /// There is no driver.cfg, it is not the exported one, or it is wrong: returns every mistake in it.
    pub fn new(
        version: Version,
        folder: &Path,
        given: &str,
        kinds: &'static Kinds,
    ) -> Result<Self, String> {
        let path = folder.join("driver.cfg");
        let bytes = std::fs::read(&path).map_err(|error| {
            format!(
                "{}: {error}; an FMU of tickbus has its driver.cfg among its resources: unpack all of it, or export it again",
                path.display()
            )
        })?;
        let own = token(&bytes);
        if own != given {
            return Err(format!(
                "{} and the modelDescription.xml beside its folder do not belong together: of this driver.cfg an FMU has the token \
                 {own}, and the importing tool hands in \"{given}\"; do not edit either within an FMU, but edit your own driver.cfg \
                 and export it again",
                path.display()
            ));
        }
        let config = Config::load(&path, kinds).map_err(|mistakes| mistakes.to_string())?;
        let exposed = Exposed::of(&config, version);
        let mut new = Self {
            version,
            exposed,
            slots: Vec::new(),
            found: Exchange::NONE,
            phase: Phase::Before,
            driver: None,
            time: 0.0,
            origin: 0.0,
            real_time: RealTime::new(0.0),
            address: CString::default(),
            record: CString::default(),
            clock: Monotonic::shared(),
            stop: Stop::new(),
            config,
        };
        new.reset();
        Ok(new)
    }

    /// Returns the driver's name.
    pub fn name(&self) -> &str {
        &self.config.name
    }

    /// Ends the run and resets every variable to its start value.
    pub fn reset(&mut self) {
        self.terminate();
        self.slots = initial_slots(&self.config);
        self.found = Exchange::NONE;
        self.phase = Phase::Before;
        self.time = 0.0;
        self.origin = 0.0;
        self.real_time = RealTime::new(default_pace(&self.config));
        let file = self.config.record.as_ref().map(|record| &record.file);
        let file = file.map(|file| file.to_string_lossy().into_owned());
        self.address = CString::default();
        self.record = CString::new(file.unwrap_or_default()).unwrap_or_default();
    }

    /// Sets the time at which the simulation will begin, in seconds.
    ///
    /// # Errors
    ///
    /// The run has begun already, or `start` is not a valid time.
    pub fn begin_at(&mut self, start: f64) -> Result<(), String> {
        if self.phase != Phase::Before {
            return Err("the run has begun already; reset the instance first".to_owned());
        }
        if !start.is_finite() {
            return Err(format!("the start time is {start}; hand in seconds"));
        }
        self.time = start;
        self.origin = start.min(0.0);
        Ok(())
    }

    /// Opens the bus. A free bus connects in the background; opening does not wait for that.
    ///
    /// # Errors
    ///
    /// The bus is already open, or cannot be opened; returns why.
    pub fn open(&mut self) -> Result<(), String> {
        if self.phase != Phase::Before {
            return Err("the run has begun already; reset the instance first".to_owned());
        }
        // Parameters are read-only from here on.
        self.phase = Phase::Over;
        let mut config = self.config.clone();
        if let Ok(address) = self.address.to_str()
            && !address.is_empty()
        {
            let set = config.bus.set_address(address);
            set.map_err(|mistake| format!("address: {mistake}"))?;
        }
        let file = self.record.to_str().unwrap_or_default();
        if file.is_empty() {
            config.record = None;
        } else {
            // Not next to driver.cfg: the FMU is unpacked to a temporary folder.
            let file = std::path::absolute(file).map_err(|why| format!("record: {why}"))?;
            let to = record::Options::to(&file);
            let to = to.map_err(|mistake| format!("record: {mistake}"))?;
            config.record = Some(match config.record.take() {
                Some(own) if file.ends_with(&own.file) => record::Options { file, ..own },
                _ => to,
            });
        }
        let driver = Driver::open(config, Monotonic::shared()).map_err(|why| why.to_string())?;
        self.driver = Some(driver);
        self.phase = Phase::Running;
        Ok(())
    }

    /// Does one step, from `from` to `from` + `length` seconds: sends the inputs, and receives the outputs at its end.
    ///
    /// # Errors
    ///
    /// No bus is open, the step does not follow the last one, or the line has failed.
    pub fn step(&mut self, from: f64, length: f64) -> Result<(), String> {
        let Some(driver) = &mut self.driver else {
            return Err(match self.phase {
                Phase::Before => "a step before the initialisation has ended; leave the initialisation mode first",
                _ => "a step after the end of the run; reset the instance, or make another one",
            }
            .to_owned());
        };
        let to = from + length;
        let is_next = (from - self.time).abs() <= TOLERANCE + 8.0 * f64::EPSILON * self.time.abs();
        if !is_next || length <= 0.0 || !to.is_finite() {
            return Err(not_next(self.time, from, length));
        }
        let at = nanos(to - self.origin);
        self.found = driver.exchange(at, &mut self.slots);
        if self.found.code.code() >= 0 && driver.is_over() {
            return Ok(());
        }
        self.time = to;
        if self.found.code.code() < 0 {
            let reason = driver.link().reason;
            return Err(failed(self.found.code, &reason));
        }
        if self.real_time.pace > 0.0 {
            self.wait(at);
        }
        Ok(())
    }

    /// Returns true if the bus has ended on its own, for example because a run on virtual time is over: the last step
    /// was not done, and no further one will be.
    pub fn is_over(&self) -> bool {
        self.driver.as_ref().is_some_and(Driver::is_over)
    }

    /// Returns the end of the last completed step, in seconds.
    pub const fn time(&self) -> f64 {
        self.time
    }

    /// Waits until the wall clock has reached the simulation time.
    fn wait(&mut self, time: Nanos) {
        let was_late = self.real_time.lost() > Nanos::ZERO;
        let due = self.real_time.due(time, self.clock.now());
        let lost = self.real_time.lost();
        if lost > Nanos::ZERO && !was_late {
            log::warn!(
                "{}: at {time} the simulation is {} behind the clock, and does not catch up; later delays are not logged",
                self.config.name,
                lost.rounded()
            );
        }
        if let Some(due) = due {
            while self.clock.now() < due {
                self.clock.wait_until(due, &self.stop);
            }
        }
    }

    /// Closes the bus. The variables keep their values.
    pub fn terminate(&mut self) {
        self.phase = Phase::Over;
        if let Some(mut driver) = self.driver.take() {
            driver.end_tick(&self.slots);
            driver.close();
        }
    }

    /// Sets variables of one type.
    ///
    /// # Errors
    ///
    /// A variable does not exist, is of another type, or cannot be set now; the variables before it are set.
    #[inline]
    pub fn set<T: Number>(
        &mut self,
        references: &[u32],
        values: impl Iterator<Item = T>,
    ) -> Result<(), String> {
        for (&reference, value) in references.iter().zip(values) {
            if let Some(Place::Slot(slot)) = Place::of(reference)
                && let Some(cell) = self.exposed.cells.get(slot)
                && cell.value_type == T::TYPE
                && (cell.is_input || self.phase == Phase::Before)
            {
                self.slots[slot] = value.value().slot(cell.kind);
            } else {
                self.set_other(reference, T::TYPE, value.value())?;
            }
        }
        Ok(())
    }

    /// Sets a variable that is not an input.
    fn set_other(&mut self, reference: u32, given: ValueType, value: Value) -> Result<(), String> {
        let place = self.number(reference, given)?;
        match place {
            Place::Slot(slot)
                if self.exposed.cells[slot].is_input || self.phase == Phase::Before =>
            {
                self.slots[slot] = value.slot(self.exposed.cells[slot].kind);
                Ok(())
            }
            Place::Pace if value.real().is_finite() && value.real() >= 0.0 => {
                self.real_time = RealTime::new(value.real());
                Ok(())
            }
            Place::Pace => Err(format!(
                "the pace is {}; write 1 for real time, or 0 for as fast as possible",
                value.real()
            )),
            // These variables have their start values, and nothing has been exchanged yet.
            Place::Status | Place::Age | Place::Sequence if self.phase == Phase::Before => Ok(()),
            _ => Err(self.read_only(reference)),
        }
    }

    /// Gets variables of one type.
    ///
    /// # Errors
    ///
    /// A variable does not exist, or is of another type.
    #[inline]
    pub fn get<T: Number>(
        &self,
        references: &[u32],
        mut put: impl FnMut(usize, T),
    ) -> Result<(), String> {
        for (at, &reference) in references.iter().enumerate() {
            if let Some(Place::Slot(slot)) = Place::of(reference)
                && let Some(&Cell {
                    value_type, kind, ..
                }) = self.exposed.cells.get(slot)
                && value_type == T::TYPE
            {
                put(at, T::of(Value::of(self.slots[slot], kind)));
            } else {
                put(at, T::of(self.other(reference, T::TYPE)?));
            }
        }
        Ok(())
    }

    fn other(&self, reference: u32, asked: ValueType) -> Result<Value, String> {
        Ok(match self.number(reference, asked)? {
            Place::Time => Value::Real(self.time),
            Place::Pace => Value::Real(self.real_time.pace),
            Place::Status => Value::Signed(self.found.code.code().into()),
            Place::Age => Value::Real(seconds(&self.found)),
            Place::Sequence => Value::Unsigned(self.found.sequence),
            Place::Slot(slot) => Value::of(self.slots[slot], self.exposed.cells[slot].kind),
            Place::Address | Place::Record => return Err(self.mistyped(reference, asked)),
        })
    }

    /// Sets a text.
    ///
    /// # Errors
    ///
    /// There is no such text, or the run has begun.
    pub fn set_text(&mut self, reference: u32, text: CString) -> Result<(), String> {
        let place = self.checked(reference, ValueType::String)?;
        if self.phase != Phase::Before {
            return Err(self.read_only(reference));
        }
        text.to_str()
            .map_err(|why| format!("a text that is not UTF-8: {why}"))?;
        match place {
            Place::Address => self.address = text,
            _ => self.record = text,
        }
        Ok(())
    }

    /// Returns a text, which stays valid until it is set again or the instance ends.
    ///
    /// # Errors
    ///
    /// There is no such text.
    pub fn text(&self, reference: u32) -> Result<&CString, String> {
        Ok(match self.checked(reference, ValueType::String)? {
            Place::Address => &self.address,
            _ => &self.record,
        })
    }

    /// As [`checked`](Self::checked), for numbers. In FMI 2.0 some tools get and set every variable as a Real; that is
    /// accepted, since nothing is lost.
    fn number(&self, reference: u32, asked: ValueType) -> Result<Place, String> {
        let is_text = |one: &Variable| one.value_type == ValueType::String;
        match (Place::of(reference), self.exposed.variable(reference)) {
            (Some(place), Some(variable))
                if self.version == Version::Two
                    && asked == ValueType::Float64
                    && !is_text(variable) =>
            {
                Ok(place)
            }
            _ => self.checked(reference, asked),
        }
    }

    /// Returns the place that a value reference stands for, if it is of this type.
    fn checked(&self, reference: u32, asked: ValueType) -> Result<Place, String> {
        let variable = self.exposed.variable(reference);
        match (Place::of(reference), variable) {
            (Some(place), Some(variable)) if variable.value_type == asked => Ok(place),
            (Some(_), Some(_)) => Err(self.mistyped(reference, asked)),
            _ => Err(format!(
                "there is no variable with the value reference {reference}; take those of modelDescription.xml"
            )),
        }
    }

    fn mistyped(&self, reference: u32, asked: ValueType) -> String {
        match self.exposed.variable(reference) {
            Some(variable) => format!(
                "\"{}\" (value reference {reference}) is of type {}, not {}; call the functions of its own type",
                variable.name,
                variable.value_type.name(),
                asked.name()
            ),
            None => format!("there is no variable with the value reference {reference}"),
        }
    }

    fn read_only(&self, reference: u32) -> String {
        let name = self.exposed.variable(reference);
        let name = name.map_or_else(String::new, |variable| variable.name.clone());
        format!(
            "\"{name}\" cannot be set now: outputs and fixed parameters have the values that they got before the initialisation"
        )
    }
}

impl Drop for Instance {
    fn drop(&mut self) {
        self.terminate();
    }
}

/// Rounds seconds, which are not negative, to the nearest nanosecond; 292 years at most.
#[inline]
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_precision_loss,
    reason = "it saturates, and a number with a fraction is exact as a double"
)]
fn nanos(seconds: f64) -> Nanos {
    let exact = seconds * 1e9;
    let whole = exact as i64;
    // Same result as `round`, which calls the C library on processors that may lack the instruction.
    Nanos(whole.saturating_add(i64::from(exact - whole as f64 >= 0.5)))
}

#[cold]
fn not_next(time: f64, from: f64, length: f64) -> String {
    if length <= 0.0 || !(from + length).is_finite() {
        return format!("a step of {length} s at {from} s; hand in seconds above 0");
    }
    format!(
        "a step from {from} s, but the last one has ended at {time} s; time cannot go back, and a bus cannot be set back: \
         begin each step where the last one has ended"
    )
}

#[cold]
fn failed(code: Code, reason: &str) -> String {
    let (name, remedy) = (code.name(), code.remedy());
    let what = if reason.is_empty() {
        code.text()
    } else {
        reason
    };
    format!("{name}: {what}; {remedy}")
}

#[cfg(test)]
mod tests {
    use super::*;

    static KINDS: Kinds = Kinds::LOOPBACK.with_programs(tickbus_programs::PROGRAMS);

    #[test]
    fn a_simulation_may_begin_before_zero() {
        let folder = tempfile::tempdir().expect("a folder");
        let text = "[driver]\nid = 1\nname = \"It\"\n[fieldbus]\nkind = \"loopback\"\nprogram = \"mirror\"\nmode = \"stepped\"\n\
                    [[signal]]\nname = \"in\"\naddress = \"%IX0.0\"\n[[signal]]\nname = \"out\"\naddress = \"%QX0.0\"\n";
        std::fs::write(folder.path().join("driver.cfg"), text).expect("a file");
        let made = Instance::new(Version::Two, folder.path(), &token(text.as_bytes()), &KINDS);
        let mut instance = made.unwrap_or_else(|why| panic!("{why}"));
        for start in [-2.0, 0.0, 1000.0] {
            assert_eq!(instance.begin_at(start), Ok(()));
            assert_eq!(instance.open(), Ok(()));
            assert_eq!(instance.step(start, 0.01), Ok(()), "{start}");
            assert_eq!(instance.step(start + 0.01, 0.01), Ok(()), "{start}");
            assert!(instance.step(start, 0.01).is_err(), "{start}");
            instance.reset();
        }
    }
}
