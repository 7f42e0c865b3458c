//! The program "axes" in place of the machine: ideal drives for all axes of a driver.cfg, and nothing else.

use tickbus_axis::{Axis, Drive, Reflexes};
use tickbus_base::Mistake;
use tickbus_base::time::Nanos;
use tickbus_image::signal::{Addressing, Area, Plan, SignalTable, Slot};

use super::{Program, ProgramError, Scan};

/// The signal that carries the seconds since the start, if the driver.cfg has it.
const TIME: &str = "simulation time";

/// A machine that consists of axes only, for commissioning a PLC: each follows its commands like a [`Drive`].
/// A tracking axis follows its own `TargetPosition`; a closing axis closes to its lower limit.
///
/// Commands by number, acknowledges and end switches work as with a simulator.
#[derive(Debug)]
pub struct Axes {
    drives: Vec<(Axis, Drive)>,
    reflexes: Option<Reflexes>,
    image: Option<Image>,
    began: Option<Nanos>,
    last: Nanos,
}

#[derive(Debug)]
struct Image {
    decode: Plan,
    encode: Plan,
    slots: Vec<Slot>,
    input_bytes: usize,
    output_bytes: usize,
    time: Option<usize>,
}

impl Axes {
    /// The program's name.
    pub const NAME: &'static str = "axes";

    /// Drives for `axes`, each at rest in the middle of its limits, or at 0.
    pub fn new(axes: &[Axis]) -> Self {
        let drive = |axis: &Axis| {
            let middle = axis
                .limits
                .map_or(0.0, |[low, high]| f64::midpoint(low, high));
            Drive::new(axis.kind, middle, axis.limits)
        };
        Self {
            drives: axes
                .iter()
                .map(|axis| (axis.clone(), drive(axis)))
                .collect(),
            reflexes: Reflexes::new(axes),
            image: None,
            began: None,
            last: Nanos::ZERO,
        }
    }
}

impl Program for Axes {
    fn name(&self) -> &str {
        Self::NAME
    }

    fn fit(&mut self, table: &SignalTable, _: Addressing) -> Result<(), ProgramError> {
        if self.drives.is_empty() {
            return Err(ProgramError::Unfit {
                program: Self::NAME.to_owned(),
                mistake: Mistake::new(
                    "finds no axis",
                    "write [[axis]] tables, or use `tickbus mirror`",
                ),
            });
        }
        let station = &table.stations[0];
        let time = table
            .position(TIME)
            .filter(|place| table.signals[*place].area == Area::Input);
        self.image = Some(Image {
            decode: Plan::new(table, 0, Area::Output),
            encode: Plan::new(table, 0, Area::Input),
            slots: table
                .signals
                .iter()
                .map(|signal| signal.fail_safe)
                .collect(),
            input_bytes: station.output_bytes,
            output_bytes: station.input_bytes,
            time,
        });
        Ok(())
    }

    fn input_bytes(&self) -> usize {
        self.image.as_ref().map_or(0, |image| image.input_bytes)
    }

    fn output_bytes(&self) -> usize {
        self.image.as_ref().map_or(0, |image| image.output_bytes)
    }

    fn scan(&mut self, scan: &mut Scan<'_>) {
        let Some(Image {
            decode,
            encode,
            slots,
            input_bytes,
            output_bytes,
            time,
        }) = &mut self.image
        else {
            return;
        };
        let (Some(inputs), Some(outputs)) = (
            scan.inputs.get(..*input_bytes),
            scan.outputs.get_mut(..*output_bytes),
        ) else {
            return;
        };
        let began = *self.began.get_or_insert(scan.now);
        let seconds = |span: Nanos| span.to_duration().as_secs_f64();
        let passed = seconds((scan.now - self.last.max(began)).max(Nanos::ZERO));
        self.last = scan.now;
        // Without a PLC no axis is enabled.
        if scan.alive {
            decode.decode(inputs, slots);
        } else {
            decode.fail_safe(slots);
        }
        if let Some(reflexes) = &mut self.reflexes {
            reflexes.received(slots);
        }
        for (axis, drive) in &mut self.drives {
            let demand = axis.demand(slots);
            let [low, _] = axis.limits.unwrap_or([f64::NEG_INFINITY, 0.0]);
            let told = drive.step(passed, &demand, demand.motion.position, low);
            axis.tell(&told, slots);
        }
        if let Some(time) = *time {
            slots[time] = Slot::from_real(seconds(scan.now - began));
        }
        if let Some(reflexes) = &mut self.reflexes {
            reflexes.sending(slots);
        }
        encode.encode(slots, outputs);
        if let Some(reflexes) = &mut self.reflexes {
            reflexes.sent(slots);
        }
    }
}
