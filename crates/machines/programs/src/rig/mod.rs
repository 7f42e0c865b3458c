//! The program "rig": runs the bottle treatment cell that the repository's `driver.cfg` describes.
//!
//! | phase | what it does | leads to |
//! |---|---|---|
//! | 0 initialise | nothing moves | home, when the peer is alive; abort, if the fault that it stood in was never reset |
//! | 1 home | acknowledges if Not OK; homes | when home: finalise if Stop was pressed, else run if it had been running, else ready; abort when homing fails |
//! | 2 ready | Ready lamp | run on Start; finalise on Stop; abort on Not OK |
//! | 3 run | Running lamp; the drum turns | finalise after the cycle in which Stop was pressed; abort on Not OK, a jam, an overdue step, a step that is complete too early, a wheel locked by a lift |
//! | 4 abort | Fault lamp; nothing moves | recover on Reset |
//! | 5 recover | acknowledges; homes | as home |
//! | 6 finalise | homes | parked when home; abort when homing fails |
//! | 7 parked | Parked lamp; nothing moves | home on Start |
//!
//! Any phase leads to initialise as soon as the peer is not alive. While it is alive, Stop is remembered in
//! any phase except parked, until the rig is parked. Start and Reset only have an effect in the phases named
//! in the table, and only on the rising edge.
//!
//! Homing goes through these steps:
//!
//! | step | done when | fails when |
//! |---|---|---|
//! | Acknowledge on (home if Not OK, recover always) | 100 ms have passed | |
//! | wait for the machine to clear its fault | Not OK is off | 2 s have passed |
//! | lower each lift that is not at its bottom switch | both switches have been on for 300 ms | 10 s have passed; Not OK, once a fault was acknowledged |
//! | suction off | 1 s has passed | Not OK |
//! | jog each wheel while its homing sensor is off | both sensors have been on for 300 ms; for 1.5 s, if one was off and lift 1 goes through the wheels next | 10 s have passed; Not OK; a lift off its switch |
//! | lift 1 up with suction (home and recover) | "step 2 complete" is on: it is the word of step 2 | 5 s have passed; Not OK; the bit is on within 50 ms, or while the lift's bottom switch is on |
//! | lift 1 down with suction | its switch has been on for 300 ms | 5 s have passed; Not OK |
//!
//! The last two bring down a bottle that may be in the sleeve over lift 1, which must be empty in step 2 of
//! the next cycle: a cycle may have been interrupted while the bottle was there.
//!
//! Not OK while the lifts go down, if this homing has not acknowledged anything yet, leads back to the
//! Acknowledge pulse once: a drive that still has its reference refuses to pass its bottom stop.
//!
//! Limits while running: a package sensor on for 1.5 s is a jam; a step may take 5 s, and takes at least 50 ms: a
//! "complete" that was on before its step began is broken feedback, and nothing of the step is commanded. The times of homing
//! start in the scan after the one that begins the step, because timers are called once per scan.
//!
//! The outputs are computed from scratch in each scan. A suction cup that holds a bottle keeps holding it through abort
//! and initialise, until the lifts are down. A program that was just started knows nothing about the machine, so it
//! assumes that both cups hold a bottle. (In the rig's `driver.cfg` the fail-safe value of a cup is on as well, for the
//! time without a program.) The logic is limited to Booleans, timers, edges and cases, so that it can be rewritten in
//! Structured Text and compared scan by scan; `docs/ARCHITECTURE.md` lists all its versions.

use self::cycle::Cycle;
use self::guard::{JamGuard, wheel_locked};
use self::homing::Homing;
use self::image::command::{LA1_CODE, LA1_CODE_HIGH, LA1_CODE_LOW, SUCTION};
use self::image::{INPUT_BYTES, Inputs, OUTPUT_BYTES, Outputs, lamp};
use self::phase::Phase;
use tickbus_base::time::Nanos;
use tickbus_plc::blocks::RTrig;
use tickbus_plc::{Program, ProgramError, Scan};

mod cycle;
mod guard;
mod homing;
mod image;
mod phase;
#[cfg(test)]
mod tests;

/// Which digit of lift 1's code is on the lower bit of the command word, bit 3.
///
/// The protocol's table does not say. Only the small moves differ.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum La1Code {
    /// The last digit, so the code reads as a number: 01 = − small is bit 3.
    #[default]
    MsbFirst,
    /// The first digit: 01 = − small is bit 4.
    LsbFirst,
}

impl La1Code {
    /// The values of the option `la1_code`.
    const NAMES: [&'static str; 2] = ["msb-first", "lsb-first"];

    /// Converts the code in an MSB-first command word to this order.
    fn ordered(self, word: u16) -> u16 {
        match self {
            Self::MsbFirst => word,
            Self::LsbFirst => {
                let mut swapped = word & !LA1_CODE;
                if word & LA1_CODE_LOW != 0 {
                    swapped |= LA1_CODE_HIGH;
                }
                if word & LA1_CODE_HIGH != 0 {
                    swapped |= LA1_CODE_LOW;
                }
                swapped
            }
        }
    }
}

/// The rig's program, described at the [module](self).
#[derive(Clone, Debug)]
pub struct Rig {
    la1_code: La1Code,
    phase: Phase,
    buttons: Buttons,
    memory: Memory,
    cycles: u16,
    /// The suction cups that hold, as bits of the command word.
    suction: u16,
    cycle: Cycle,
    homing: Homing,
    jam: JamGuard,
}

/// The edges of the push buttons.
#[derive(Clone, Copy, Debug, Default)]
struct Buttons {
    start: RTrig,
    stop: RTrig,
    reset: RTrig,
}

/// The state that survives a change of phase.
#[derive(Clone, Copy, Debug, Default)]
struct Memory {
    /// A run has begun and not ended: homing leads back to it.
    running: bool,
    /// Stop was pressed: homing, or the end of the cycle, leads to finalise.
    stop: bool,
    /// A fault was not reset: not even a lost link clears it.
    fault: bool,
}

/// The events up to this scan.
#[derive(Clone, Copy, Debug)]
#[expect(
    clippy::struct_excessive_bools,
    reason = "each is a contact of its own"
)]
struct Events {
    start: bool,
    reset: bool,
    /// This scan completed a cycle.
    cycle: bool,
    /// A bottle is stuck in a beam.
    jam: bool,
}

impl Rig {
    /// The name in [`program`](super::program).
    pub const NAME: &'static str = "rig";

    /// The program's options.
    const OPTIONS: [&'static str; 1] = ["la1_code"];

    /// The rig's program before its first scan.
    pub fn new(la1_code: La1Code) -> Self {
        Self {
            la1_code,
            phase: Phase::Initialise,
            buttons: Buttons::default(),
            memory: Memory::default(),
            cycles: 0,
            suction: SUCTION,
            cycle: Cycle::new(),
            homing: Homing::default(),
            jam: JamGuard::default(),
        }
    }

    /// Like [`new`](Self::new), with its options as text: `la1_code` is `msb-first` (the default) or `lsb-first`.
    ///
    /// # Errors
    ///
    /// The option does not exist, or does not accept the value.
    pub fn from_options(options: &[(String, String)]) -> Result<Self, ProgramError> {
        let mut la1_code = La1Code::default();
        for (option, value) in options {
            match (option.as_str(), value.as_str()) {
                ("la1_code", "msb-first") => la1_code = La1Code::MsbFirst,
                ("la1_code", "lsb-first") => la1_code = La1Code::LsbFirst,
                ("la1_code", _) => {
                    let known = &La1Code::NAMES;
                    return Err(ProgramError::none_of(Self::NAME, "la1_code", value, known));
                }
                _ => {
                    return Err(ProgramError::UnknownOption {
                        program: Self::NAME,
                        option: option.clone(),
                        known: &Self::OPTIONS,
                    });
                }
            }
        }
        Ok(Self::new(la1_code))
    }

    /// The phase that follows this one; may be the same.
    fn next_phase(&self, inputs: Inputs, events: Events) -> Phase {
        match self.phase {
            Phase::Initialise if self.memory.fault => Phase::Abort,
            Phase::Initialise => Phase::Home,
            Phase::Home | Phase::Recover | Phase::Finalise if self.homing.failed() => Phase::Abort,
            Phase::Home | Phase::Recover if self.homing.done() => {
                if self.memory.stop {
                    Phase::Finalise
                } else if self.memory.running {
                    Phase::Run
                } else {
                    Phase::Ready
                }
            }
            Phase::Finalise if self.homing.done() => Phase::Parked,
            Phase::Ready if inputs.not_ok() => Phase::Abort,
            Phase::Ready if self.memory.stop => Phase::Finalise,
            Phase::Ready if events.start => Phase::Run,
            Phase::Run if inputs.not_ok() || events.jam || self.cycle.overdue() => Phase::Abort,
            Phase::Run if events.cycle && self.memory.stop => Phase::Finalise,
            Phase::Abort if events.reset => Phase::Recover,
            Phase::Parked if events.start => Phase::Home,
            same => same,
        }
    }

    /// Changes to another phase.
    fn enter(&mut self, phase: Phase, inputs: Inputs) {
        let not_ok = inputs.not_ok();
        self.homing.stop();
        match phase {
            Phase::Initialise | Phase::Ready => {}
            Phase::Home => self.homing.begin(not_ok, not_ok, true),
            Phase::Run => self.memory.running = true,
            Phase::Abort => self.memory.fault = true,
            Phase::Recover => {
                self.memory.fault = false;
                self.homing.begin(true, not_ok, true);
            }
            Phase::Finalise => {
                self.memory.running = false;
                self.homing.begin(false, not_ok, false);
            }
            Phase::Parked => self.memory.stop = false,
        }
        self.phase = phase;
    }

    /// The outputs of the phase.
    fn outputs(&mut self, inputs: Inputs) -> Outputs {
        self.suction = match self.phase {
            Phase::Run => self.cycle.command() & SUCTION,
            Phase::Ready | Phase::Parked => 0,
            phase if phase.homes() => self.homing.suction(self.suction),
            _ => self.suction,
        };
        let motion = match self.phase {
            Phase::Run => self.cycle.command(),
            phase if phase.homes() => self.homing.command(inputs),
            _ => 0,
        };
        Outputs {
            command: self.la1_code.ordered(motion | self.suction),
            lamps: match self.phase {
                Phase::Ready => lamp::READY,
                Phase::Run => lamp::RUNNING,
                Phase::Abort => lamp::FAULT,
                Phase::Parked => lamp::PARKED,
                _ => 0,
            },
            phase: self.phase as u8,
            step: if self.phase == Phase::Run {
                self.cycle.step()
            } else {
                0
            },
            cycles: self.cycles,
        }
    }

    /// One scan, from inputs to outputs.
    fn solve(&mut self, now: Nanos, alive: bool, inputs: Inputs) -> Outputs {
        // Every block is called in every scan, so that its edges and timers stay current.
        let running = self.phase == Phase::Run;
        let stop = self.buttons.stop.call(inputs.stop());
        let events = Events {
            start: self.buttons.start.call(inputs.start()),
            reset: self.buttons.reset.call(inputs.reset()),
            cycle: self.cycle.call(now, running, inputs.status),
            jam: self.jam.call(now, running, inputs),
        };
        self.homing.call(now, inputs);

        if events.cycle {
            self.cycles = self.cycles.wrapping_add(1);
        }
        if alive {
            if stop && self.phase != Phase::Parked {
                self.memory.stop = true;
            }
            let next = self.next_phase(inputs, events);
            if next != self.phase {
                self.enter(next, inputs);
            }
            let refused =
                wheel_locked(self.cycle.command(), inputs) || self.cycle.early(now, inputs.status);
            if self.phase == Phase::Run && refused {
                self.enter(Phase::Abort, inputs);
            }
        } else if self.phase != Phase::Initialise {
            self.enter(Phase::Initialise, inputs);
        }
        self.outputs(inputs)
    }
}

impl Program for Rig {
    fn name(&self) -> &str {
        Self::NAME
    }

    fn input_bytes(&self) -> usize {
        INPUT_BYTES
    }

    fn output_bytes(&self) -> usize {
        OUTPUT_BYTES
    }

    fn scan(&mut self, scan: &mut Scan<'_>) {
        let inputs = Inputs::read(scan.inputs);
        self.solve(scan.now, scan.alive, inputs).write(scan.outputs);
    }
}
