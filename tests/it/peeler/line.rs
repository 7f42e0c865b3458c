//! Two programs and the plant between them, each scanned every 10 ms.

use std::path::Path;
use std::sync::Arc;

use tickbus::axis::{Field, Reflexes};
use tickbus::driver_cfg::Config;
use tickbus::plc::{Program, Report, Scan};
use tickbus::programs;
use tickbus::signal::{Area, Plan, Slot};
use tickbus::time::Nanos;
use tickbus_test_log as logged;

use super::plant::Plant;

pub(crate) const SCAN: Nanos = Nanos::from_millis(10);

/// One PLC and its end of the machine's image.
struct End {
    program: Box<dyn Program>,
    reflexes: Reflexes,
    encode: Plan,
    decode: Plan,
    slots: Vec<Slot>,
    inputs: Vec<u8>,
    outputs: Vec<u8>,
    config: Config,
}

impl End {
    fn new(name: &str, options: &[(&str, &str)]) -> Self {
        let file = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("plc/peeler/{name}.cfg"));
        let config =
            Config::load(&file, &tickbus::KINDS).unwrap_or_else(|mistakes| panic!("{mistakes}"));
        let options: Vec<(String, String)> = options
            .iter()
            .map(|(key, value)| ((*key).to_owned(), (*value).to_owned()))
            .collect();
        let mut program = programs::program(name, &options).expect("a program");
        let table = &config.table;
        program
            .fit(table, config.addressing)
            .expect("its own table");
        let station = &table.stations[0];
        Self {
            program,
            reflexes: Reflexes::new(&config.axes).expect("acknowledges"),
            encode: Plan::new(table, 0, Area::Input),
            decode: Plan::new(table, 0, Area::Output),
            slots: vec![Slot::default(); table.signals.len()],
            inputs: vec![0; station.input_bytes],
            outputs: vec![0; station.output_bytes],
            config,
        }
    }
}

/// Both PLCs and the plant.
pub(crate) struct Line {
    ends: [End; 2],
    pub(crate) plant: Plant,
    pub(crate) now: Nanos,
    /// True if each PLC receives data from the machine, and vice versa.
    pub(crate) alive: [bool; 2],
    /// The simulation stands still.
    pub(crate) frozen: bool,
    _logged: logged::Watch,
}

impl Line {
    pub(crate) fn new(charger: &[(&str, &str)], lathe: &[(&str, &str)]) -> Self {
        let ends = [End::new("charger", charger), End::new("lathe", lathe)];
        let plant = Plant::new([&ends[0].config, &ends[1].config]);
        Self {
            ends,
            plant,
            now: Nanos::ZERO,
            alive: [true; 2],
            frozen: false,
            _logged: logged::Watch::new(),
        }
    }

    /// Ends the simulation and restarts it.
    pub(crate) fn restart(&mut self) {
        self.plant = Plant::new([&self.ends[0].config, &self.ends[1].config]);
    }

    pub(crate) fn report(&self, end: usize) -> Arc<dyn Report> {
        self.ends[end].program.report().expect("it has one")
    }

    /// The number of enabled axes of a PLC.
    pub(crate) fn enabled(&self, end: usize) -> usize {
        let axes = &self.ends[end].config.axes;
        let on = |byte: usize, bit: u8| self.ends[end].outputs[byte] & (1 << bit) != 0;
        axes.iter()
            .filter(|axis| on(axis.command, Field::Enable.bit()))
            .count()
    }

    /// One scan of each PLC, then one tick of the plant.
    fn scan(&mut self) {
        self.now += SCAN;
        for (number, end) in self.ends.iter_mut().enumerate() {
            let alive = self.alive[number];
            if alive {
                end.reflexes.sending(&mut end.slots);
                end.encode.encode(&end.slots, &mut end.inputs);
                end.reflexes.sent(&mut end.slots);
            }
            end.program.scan(&mut Scan {
                now: self.now,
                alive,
                cycle: 0,
                inputs: &end.inputs,
                outputs: &mut end.outputs,
            });
            if alive {
                end.decode.decode(&end.outputs, &mut end.slots);
            } else {
                // The driver delivers these values when the data are stale.
                end.decode.fail_safe(&mut end.slots);
            }
            if !self.frozen {
                end.reflexes.received(&mut end.slots);
            }
        }
        if !self.frozen {
            let [charger, lathe] = &mut self.ends;
            self.plant.step(
                [&mut charger.slots, &mut lathe.slots],
                [&charger.config, &lathe.config],
            );
        }
    }

    /// The number of scans in this time.
    fn scans(seconds: f64) -> u32 {
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "short"
        )]
        let scans = (seconds * 100.0) as u32;
        scans
    }

    pub(crate) fn seconds(&mut self, seconds: f64) {
        for _ in 0..Self::scans(seconds) {
            self.scan();
        }
    }

    /// Scans until `is` holds, for at most `seconds`.
    #[track_caller]
    pub(crate) fn until(&mut self, what: &str, seconds: f64, is: impl Fn(&Self) -> bool) {
        let mut left = Self::scans(seconds);
        while !is(self) {
            left = left.saturating_sub(1);
            assert!(
                left > 0,
                "no {what} in {seconds} s: {:#?}\n{}\n{:?}\n{:?}",
                self.plant,
                self.report(0).summary(),
                self.ends[0].program_text(),
                self.ends[1].program_text(),
            );
            self.scan();
        }
    }
}

impl End {
    /// The positions of the axes, for finding out why nothing moves.
    fn program_text(&self) -> Vec<String> {
        let value = |axis: &tickbus::axis::Axis, field| {
            axis.slot(field).map_or(0.0, |slot| self.slots[slot].real())
        };
        let axes = self.config.axes.iter();
        axes.map(|axis| {
            format!(
                "{} at {:.1} → {:.1}{}",
                axis.name,
                value(axis, Field::ActualPosition),
                value(axis, Field::TargetPosition),
                if value(axis, Field::Execute) > 0.0 {
                    " !"
                } else {
                    ""
                }
            )
        })
        .collect()
    }
}
