//! The observer of a run, beside its steps.

use tickbus_base::Mistake;
use tickbus_driver::Driver;
use tickbus_image::signal::Slot;

use super::failure::Halt;
use super::watch::Watch;

/// Sees every tick of a run, and may disturb it.
pub(super) trait Observer {
    /// True if the conditions of the steps count: if not, a step fails for nothing, and waits without a limit.
    fn is_strict(&self) -> bool {
        true
    }

    /// Called before the PLC gets the sensors of the next tick, after `ticks` of them; the machine has set `slots`.
    ///
    /// # Errors
    ///
    /// The driver refuses a fault.
    fn before(
        &mut self,
        ticks: u64,
        driver: &mut Driver,
        slots: &mut [Slot],
    ) -> Result<(), Mistake> {
        let _ = (ticks, driver, slots);
        Ok(())
    }

    /// Called after the exchange: puts back what [`before`](Self::before) has replaced.
    fn after(&mut self, slots: &mut [Slot]) {
        let _ = slots;
    }

    /// The last step is done.
    fn idle(&mut self, ticks: u64) {
        let _ = ticks;
    }

    /// The values at the end of tick `ticks`; before the first one it is 0.
    ///
    /// # Errors
    ///
    /// The run is over.
    fn look(&mut self, ticks: u64, watches: &[Watch], slots: &[Slot]) -> Result<(), Halt>;
}
