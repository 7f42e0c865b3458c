//! Injected faults of a driver.

use std::sync::Arc;

use super::Driver;
use super::bus_handle::BusHandle;
use tickbus_base::Mistake;
use tickbus_base::toml_text::Mistakes;
use tickbus_fieldbus::faults::{self, Effect, Fault, FaultBoard, FaultStatus, Slots};

impl Driver {
    /// Injects a fault, which can begin at the next exchange. Returns the fault's number.
    ///
    /// # Errors
    ///
    /// Too many faults are waiting or active, or the simulation's model has [declared](Self::declare_model_faults) no
    /// fault of this name.
    pub fn inject(&mut self, fault: &Fault) -> Result<u32, Mistake> {
        if let Effect::Model(_) = fault.effect {
            self.board.check_model_fault(&fault.name)?;
        }
        self.inject_unchecked(fault)
    }

    /// As [`inject`](Self::inject), while the model may still declare its faults.
    pub(super) fn inject_unchecked(&mut self, fault: &Fault) -> Result<u32, Mistake> {
        self.config.role.check_faults()?;
        let slots = Slots {
            table: &self.config.table,
            writes: self.config.role.areas().0,
            edges: &self.slots.edges,
        };
        let id = self.extras.inject(fault, slots, &self.board)?;
        self.shape = self.fitting_shape();
        // Adopt the fault now, so that the tick need not allocate memory.
        if let BusHandle::Stepped { port, .. } = &mut self.line {
            let now = port.clock().now();
            port.observe(now);
        }
        Ok(id)
    }

    /// Injects the fault that a `[[fault]]` section describes, with or without its header.
    ///
    /// # Errors
    ///
    /// Returns every mistake in the text, or an error of [`inject`](Self::inject).
    pub fn inject_text(&mut self, text: &str) -> Result<u32, Mistakes> {
        let fault = faults::read_one(text, self.config.fault_scope())?;
        self.inject_read(&fault)
    }

    /// As [`inject_text`](Self::inject_text), for a fault that has already been read.
    ///
    /// # Errors
    ///
    /// As [`inject`](Self::inject).
    pub fn inject_read(&mut self, fault: &Fault) -> Result<u32, Mistakes> {
        self.inject(fault)
            .map_err(|mistake| Mistakes::of("fault", mistake))
    }

    /// Ends a fault at the next exchange. Returns false if no fault has this number.
    pub fn end_fault(&mut self, id: u32) -> bool {
        self.extras.end_fault(id)
    }

    /// Takes the names of the faults that the simulation's model can have: those that a fault of the kind "model" can
    /// name from now on, in place of earlier ones. A simulation with such faults calls this once, before its first tick.
    ///
    /// # Errors
    ///
    /// A name is empty, has a control character or is there twice, or a fault that is not over, such as one of the
    /// configuration, has none of the names. Then no name is taken.
    pub fn declare_model_faults(&mut self, names: Vec<String>) -> Result<(), Mistake> {
        self.extras.make_room(&self.board).declare(names)
    }

    /// Returns whether [`next_model_change`](Self::next_model_change) may have one: false costs a look.
    #[inline]
    pub fn has_model_change(&self) -> bool {
        self.extras.has_model_change()
    }

    /// Returns the next fault of the model that began, ended or changed its value in the ticks since the model was last
    /// told: its place among the declared names, and its value; `None` for a fault that is off. The simulation asks
    /// after each exchange, or between [`receive`](Self::receive) and [`send`](Self::send), until there is no more.
    #[inline]
    pub fn next_model_change(&mut self) -> Option<(usize, Option<f64>)> {
        self.extras.next_model_change()
    }

    /// Lets the caller write the signal of a [reply](tickbus_driver_cfg::Config::replies) with this index for a while, as
    /// a test does that forces it: no reply writes the signal until the caller gives it back, with `borrowed` false.
    pub fn borrow_reply(&mut self, signal: usize, borrowed: bool) {
        self.extras.borrow_reply(signal, borrowed);
    }

    /// Returns the board where the faults publish their state, readable from any thread.
    pub fn board(&self) -> &Arc<FaultBoard> {
        &self.board
    }

    /// Returns the injected faults in order of injection; faults that ended long ago may be missing.
    pub fn injected_faults(&self) -> Vec<FaultStatus> {
        self.board.list()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Watch;
    use crate::shape::Shape;
    use tickbus_base::time::{Manual, Monotonic, Nanos};
    use tickbus_driver_cfg::Config;
    use tickbus_image::signal::Slot;

    #[test]
    fn a_driver_whose_faults_are_over_takes_the_quick_way_again_whoever_injected_them() {
        let text = "[driver]\nid = 1\nname = \"x\"\n[fieldbus]\nkind = \"loopback\"\nprogram = \"mirror\"\n\
                    scan = \"1ms\"\n[[signal]]\nname = \"a\"\naddress = \"%IB0\"\n";
        let config =
            Config::parse("driver.cfg", text, &crate::KINDS).unwrap_or_else(|why| panic!("{why}"));
        let mut driver = Driver::open(config, Monotonic::shared()).expect("opens");
        let mut watch = driver.watch();
        let mut slots = driver.initial_slots();
        // Ticks once while watched; returns true if the next tick is quick.
        let mut tick = |driver: &mut Driver, watch: &mut Watch| {
            watch.ask(false);
            driver.exchange(None, &mut slots);
            driver.shape == Shape::Plain
        };
        assert!(tick(&mut driver, &mut watch), "nothing is to be done");
        let fault = watch.force(0, Slot::from_real(5.0)).expect("room");
        assert!(!tick(&mut driver, &mut watch), "it is forced");
        watch.end_fault(fault).expect("room");
        tick(&mut driver, &mut watch);
        assert!((0..3).any(|_| tick(&mut driver, &mut watch)), "released");
        for _ in 0..2 {
            let text = "kind = \"stuck\"\nsignal = \"a\"\nvalue = 7\n";
            let fault = driver
                .inject_text(text)
                .unwrap_or_else(|why| panic!("{why}"));
            assert!(!tick(&mut driver, &mut watch), "it is injected");
            assert!(driver.end_fault(fault));
            assert!((0..3).any(|_| tick(&mut driver, &mut watch)), "it is over");
        }
        driver.close();
    }

    #[test]
    fn a_fault_from_before_anyone_looked_at_the_driver_does_not_keep_it_from_the_quick_way() {
        let text = "[driver]\nid = 1\nname = \"x\"\n[fieldbus]\nkind = \"loopback\"\nprogram = \"mirror\"\n\
                    scan = \"1ms\"\n[[signal]]\nname = \"a\"\naddress = \"%IB0\"\n";
        let config =
            Config::parse("driver.cfg", text, &crate::KINDS).unwrap_or_else(|why| panic!("{why}"));
        let mut driver = Driver::open(config, Monotonic::shared()).expect("opens");
        let mut slots = driver.initial_slots();
        for is_watched in [false, true] {
            let text = "kind = \"stuck\"\nsignal = \"a\"\nvalue = 7\nticks = 2\n";
            driver
                .inject_text(text)
                .unwrap_or_else(|why| panic!("{why}"));
            let _watch = is_watched.then(|| driver.watch());
            driver.exchange(None, &mut slots);
            assert_ne!(driver.shape, Shape::Plain, "it is injected");
            for _ in 0..3 {
                driver.exchange(None, &mut slots);
            }
            assert_eq!(driver.shape, Shape::Plain, "it is over");
        }
        driver.close();
    }

    /// A driver on a stepped bus whose time stands still unless someone ticks.
    fn stepped(more: &str) -> Driver {
        let text = format!(
            "[driver]\nid = 1\nname = \"x\"\n[fieldbus]\nkind = \"loopback\"\nmode = \"stepped\"\n\
             program = \"mirror\"\nscan = \"1ms\"\n{more}[[signal]]\nname = \"life\"\naddress = \"%IB0\"\n\
             [[signal]]\nname = \"a\"\naddress = \"%IB1\"\n"
        );
        let config =
            Config::parse("driver.cfg", &text, &crate::KINDS).unwrap_or_else(|why| panic!("{why}"));
        Driver::open(config, Manual::new()).expect("opens")
    }

    #[test]
    fn a_heartbeat_goes_on_when_a_forcing_ends() {
        let mut driver = stepped("heartbeat = { signal = \"life\", every = \"1ms\" }\n");
        let (mut watch, mut slots) = (driver.watch(), driver.initial_slots());
        let mut force = None;
        for step in 1..=60_u32 {
            watch.ask(false);
            match step % 20 {
                5 => force = Some(watch.force(1, Slot::from_real(5.0)).expect("room")),
                10 => watch
                    .end_fault(force.take().expect("it is forced"))
                    .expect("room"),
                _ => {}
            }
            driver.exchange(Nanos::from_millis(step.into()), &mut slots);
            assert_eq!(
                slots[0],
                Slot::from_real(step.into()),
                "each tick is a beat"
            );
        }
        driver.close();
    }

    #[test]
    fn a_fault_is_felt_in_the_next_tick_though_nobody_looks_at_the_driver() {
        let text = "[driver]\nid = 1\nname = \"x\"\n[fieldbus]\nkind = \"loopback\"\nprogram = \"mirror\"\n\
                    scan = \"1ms\"\n[[signal]]\nname = \"a\"\naddress = \"%IB0\"\n\
                    [[signal]]\nname = \"b\"\naddress = \"%QB0\"\n";
        let config =
            Config::parse("driver.cfg", text, &crate::KINDS).unwrap_or_else(|why| panic!("{why}"));
        let mut driver = Driver::open(config, Monotonic::shared()).expect("opens");
        let mut slots = driver.initial_slots();
        // The first ticks do more than exchange.
        for _ in 0..3 {
            driver.exchange(None, &mut slots);
        }
        assert_eq!(driver.shape, Shape::Plain);
        let fault = driver
            .inject_text("kind = \"stuck\"\nsignal = \"b\"\nvalue = 9\n")
            .unwrap_or_else(|why| panic!("{why}"));
        driver.exchange(None, &mut slots);
        assert_eq!(slots[1], Slot::from_real(9.0));
        assert!(driver.end_fault(fault));
        driver.exchange(None, &mut slots);
        assert_eq!(slots[1], Slot::from_real(0.0));
        driver.close();
    }

    #[test]
    fn a_fault_that_waits_changes_its_signal_in_its_ticks_alone_in_both_directions() {
        let text = "[driver]\nid = 1\nname = \"x\"\n[fieldbus]\nkind = \"loopback\"\nmode = \"stepped\"\n\
                    program = \"mirror\"\nscan = \"1ms\"\n[[signal]]\nname = \"a\"\naddress = \"%IB0\"\n\
                    [[signal]]\nname = \"b\"\naddress = \"%QB0\"\n";
        let config =
            Config::parse("driver.cfg", text, &crate::KINDS).unwrap_or_else(|why| panic!("{why}"));
        for (is_halved, signal) in [(false, "a"), (false, "b"), (true, "a"), (true, "b")] {
            let mut driver = Driver::open(config.clone(), Manual::new()).expect("opens");
            let mut slots = driver.initial_slots();
            slots[0] = Slot::from_real(3.0);
            let fault = format!(
                "kind = \"stuck\"\nsignal = \"{signal}\"\nvalue = 9\ntick = 8\nticks = 4\n"
            );
            driver
                .inject_text(&fault)
                .unwrap_or_else(|why| panic!("{why}"));
            let seen = (1..=20).map(|tick| {
                let time = Nanos::from_millis(tick);
                if is_halved {
                    driver.receive(time, &mut slots);
                    driver.send(&mut slots);
                } else {
                    driver.exchange(time, &mut slots);
                }
                assert_eq!(slots[0], Slot::from_real(3.0), "the simulation's own");
                slots[1]
            });
            let seen: Vec<Slot> = seen.collect();
            let [bent, sound] = [9.0, 3.0].map(Slot::from_real);
            let count = |of| seen[5..].iter().filter(|value| **value == of).count();
            let (bent, sound) = (count(bent), count(sound));
            assert_eq!(
                (bent, sound),
                (4, 11),
                "{signal}, halved: {is_halved}: {seen:?}"
            );
            if signal == "b" {
                assert_eq!(seen[7..11], [Slot::from_real(9.0); 4], "at once");
            }
            driver.close();
        }
    }
}
