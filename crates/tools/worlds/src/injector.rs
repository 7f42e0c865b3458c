//! Injects the faults of an end, forces its signals, and watches it as the live page does.

use tickbus_driver::{Code, Driver, Watch};
use tickbus_image::signal::Slot;

use crate::broken::Broken;
use crate::faults::{Effect, FaultPlan, Way};
use crate::plan::Plan;

/// The faults of a driver, and its viewer.
pub(crate) struct Injector {
    faults: Vec<FaultPlan>,
    /// The numbers of the active faults that have to be ended.
    numbers: Vec<Option<u32>>,
    watch: Option<Watch>,
    has_asked: bool,
}

fn refused(what: &str, why: impl std::fmt::Display) -> Broken {
    Broken {
        promise: "faults",
        what: format!("{what}: {why}"),
    }
}

impl Injector {
    /// An injector for a driver that has just been opened.
    pub(crate) fn new(plan: &Plan, end: usize, driver: &mut Driver) -> Self {
        let faults = plan.features.faults.iter().copied();
        let faults: Vec<FaultPlan> = faults.filter(|fault| fault.end == end).collect();
        let is_forced = faults.iter().any(|fault| fault.way == Way::Forced);
        Self {
            numbers: vec![None; faults.len()],
            watch: (is_forced || plan.features.watched[end]).then(|| driver.watch()),
            has_asked: false,
            faults,
        }
    }

    /// Starts and ends the faults that are due, before a tick.
    pub(crate) fn before(&mut self, tick: u64, driver: &mut Driver) -> Result<(), Broken> {
        for (fault, number) in self.faults.iter().zip(&mut self.numbers) {
            if tick != fault.first && tick != fault.first + fault.ticks {
                continue;
            }
            let text = fault.section();
            let inject = |driver: &mut Driver, text: &str| {
                let injected = driver.inject_text(text);
                injected.map_err(|why| refused(text, why))
            };
            if tick == fault.first {
                match fault.way {
                    Way::File => {}
                    Way::Injected => {
                        inject(driver, &format!("{text}ticks = {}", fault.ticks))?;
                    }
                    Way::Ended => *number = Some(inject(driver, &text)?),
                    Way::Forced => {
                        let name = fault.signal_name().unwrap_or_default();
                        let signals = &driver.config().table.signals;
                        let signal = signals.iter().position(|signal| signal.name == name);
                        if let (Some(watch), Some(signal), Effect::Stuck(_, _, Some(value))) =
                            (&mut self.watch, signal, fault.effect)
                        {
                            let forced = watch.force(signal, Slot::from_real(value));
                            *number = Some(forced.map_err(|why| refused(&name, why))?);
                        }
                    }
                }
            }
            if tick == fault.first + fault.ticks
                && let Some(number) = number.take()
            {
                if fault.way == Way::Ended && !driver.end_fault(number) {
                    return Err(refused(&text, "it cannot be ended"));
                }
                if let (Way::Forced, Some(watch)) = (fault.way, &mut self.watch) {
                    watch.end_fault(number).map_err(|why| refused(&text, why))?;
                }
            }
        }
        // Not in every tick, so that some ticks do nothing but exchange.
        self.has_asked = tick % 5 < 2 && self.watch.is_some();
        if let (true, Some(watch)) = (self.has_asked, &mut self.watch) {
            watch.ask(tick.is_multiple_of(10));
        }
        Ok(())
    }

    /// Judges that the viewer sees a tick that has just ended with these slots.
    pub(crate) fn behind(&mut self, tick: u64, code: Code, slots: &[Slot]) -> Result<(), Broken> {
        let (true, Some(watch)) = (self.has_asked, &mut self.watch) else {
            return Ok(());
        };
        let is_new = watch.update();
        watch.view(|view| {
            let is_right = view
                .slots
                .iter()
                .zip(slots)
                .all(|(one, other)| one.0 == other.0);
            if is_new && view.tick == tick && view.code == code && is_right {
                return Ok(());
            }
            Err(Broken {
                promise: "view",
                what: format!(
                    "who looks at tick {tick}, {code}, sees tick {}, {}, or other values",
                    view.tick, view.code
                ),
            })
        })
    }
}
