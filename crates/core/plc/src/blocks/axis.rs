//! Commands for one axis of the axis link: the counterpart of `MC_MoveAbsolute` and similar blocks.

use tickbus_axis::{Demand, Mode, Motion};
use tickbus_base::time::Nanos;

/// How long the machine may take to acknowledge a command before the command is repeated.
const ACKNOWLEDGE_LIMIT: Nanos = Nanos::from_secs(1);

/// How `Execute` makes sure that the machine sees its edge.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Execute {
    /// `Execute` stays on for this long; 500 ms in 2018, so at most two commands per second.
    Hold(Nanos),
    /// `Execute` stays on until the machine acknowledges, and the next edge waits until the acknowledge is off again.
    Acknowledge,
}

/// One command.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct AxisCommand {
    /// The mode.
    pub mode: Mode,
    /// The numbers.
    pub motion: Motion<f64>,
    /// If not 0, the machine's own table provides the numbers that are missing here.
    pub number: u16,
}

/// The feedback of an axis in this scan.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct AxisInputs {
    /// The axis has no fault.
    pub healthy: bool,
    /// The target of the last command is reached.
    pub in_position: bool,
    /// The machine has accepted the command.
    pub acknowledge: bool,
    /// The actual position.
    pub position: f64,
    /// The actual speed.
    pub speed: f64,
}

#[derive(Clone, Copy, Debug, Default, PartialEq)]
enum Phase {
    /// `Execute` is off, and setting it would be a new edge.
    #[default]
    Ready,
    /// `Execute` has been on since then.
    Raised(Nanos),
    /// `Execute` is off, but the machine may not have seen that yet.
    Falling,
}

/// Sends commands to one axis and tracks their progress.
///
/// A command that is [given](Self::give) while another one is in progress waits; a newer one replaces it.
#[derive(Clone, Debug)]
pub struct AxisControl {
    execute: Execute,
    /// The output to the machine, as of the last call.
    pub demand: Demand,
    /// The number of the command in it.
    pub number: u16,
    phase: Phase,
    waiting: Option<AxisCommand>,
    given: Option<AxisCommand>,
    /// The machine has accepted the last command.
    taken: bool,
    commands: u64,
}

impl AxisControl {
    /// An axis without a command.
    pub fn new(execute: Execute) -> Self {
        Self {
            execute,
            demand: Demand::default(),
            number: 0,
            phase: Phase::default(),
            waiting: None,
            given: None,
            taken: false,
            commands: 0,
        }
    }

    /// Queues this command.
    pub fn give(&mut self, command: AxisCommand) {
        self.waiting = Some(command);
    }

    /// Ends a continuous command: tracking, or running at a speed.
    pub fn release(&mut self) {
        self.waiting = None;
        self.demand.tracking = false;
        self.demand.speed_control = false;
    }

    /// True if a command given now would be sent at once.
    pub fn is_ready(&self) -> bool {
        self.waiting.is_none() && self.phase == Phase::Ready
    }

    /// True if the machine has accepted every command.
    pub fn is_taken(&self) -> bool {
        self.waiting.is_none() && self.taken
    }

    /// True if the last command was accepted and its target is reached.
    pub fn is_done(&self, inputs: &AxisInputs) -> bool {
        self.is_taken() && inputs.in_position
    }

    /// The number of commands sent, repetitions included.
    pub fn commands(&self) -> u64 {
        self.commands
    }

    /// Evaluates the block: one scan at `now`. Without `enable` the axis stops, and all commands are discarded.
    pub fn call(&mut self, now: Nanos, inputs: &AxisInputs, enable: bool) {
        self.demand.enable = enable;
        if !enable {
            self.demand.execute = false;
            self.release();
            (self.phase, self.given, self.taken) = (Phase::Ready, None, false);
            return;
        }
        match self.phase {
            Phase::Raised(since) => self.await_machine(now, since, inputs),
            Phase::Falling if self.execute != Execute::Acknowledge || !inputs.acknowledge => {
                self.phase = Phase::Ready;
            }
            Phase::Falling | Phase::Ready => {}
        }
        if self.phase == Phase::Ready
            && let Some(command) = self.waiting.take()
        {
            let [tracking, torque_control, speed_control] = command.mode.bits();
            self.demand = Demand {
                execute: true,
                tracking,
                torque_control,
                speed_control,
                enable,
                motion: command.motion,
                jerk: self.demand.jerk,
            };
            self.number = command.number;
            self.given = Some(command);
            self.taken = false;
            self.commands += 1;
            self.phase = Phase::Raised(now);
        }
    }

    fn await_machine(&mut self, now: Nanos, since: Nanos, inputs: &AxisInputs) {
        let lasts = now - since;
        let (taken, over) = match self.execute {
            // This command cleared InPosition; otherwise only time can tell.
            Execute::Hold(hold) => (!inputs.in_position || lasts >= hold, lasts >= hold),
            Execute::Acknowledge => (inputs.acknowledge, inputs.acknowledge),
        };
        self.taken |= taken;
        if over {
            self.demand.execute = false;
            self.phase = Phase::Falling;
        } else if self.execute == Execute::Acknowledge && lasts >= ACKNOWLEDGE_LIMIT {
            // The machine was restarted, or does not acknowledge at all: repeat the edge.
            self.demand.execute = false;
            self.phase = Phase::Falling;
            self.waiting = self.waiting.or(self.given);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SCAN: Nanos = Nanos::from_millis(10);

    fn to(position: f64) -> AxisCommand {
        AxisCommand {
            motion: Motion {
                position,
                ..Motion::default()
            },
            ..AxisCommand::default()
        }
    }

    /// Scans `scans` times with a machine that returns Execute after `lag` scans, giving a command whenever
    /// none is pending; counts rising edges.
    fn commands_in(control: &mut AxisControl, scans: usize, lag: usize) -> u64 {
        let mut wire = vec![false; lag];
        let mut rises = 0;
        let mut before = false;
        for scan in 0..scans {
            if control.is_ready() {
                control.give(to(1.0));
            }
            let acknowledge = wire[scan % lag];
            let inputs = AxisInputs {
                acknowledge,
                ..AxisInputs::default()
            };
            let now = Nanos(SCAN.0 * i64::try_from(scan).expect("short"));
            control.call(now, &inputs, true);
            wire[scan % lag] = control.demand.execute;
            rises += u64::from(control.demand.execute && !before);
            before = control.demand.execute;
        }
        assert_eq!(rises, control.commands());
        rises
    }

    #[test]
    fn holding_for_500_ms_gives_less_than_two_commands_a_second() {
        let mut control = AxisControl::new(Execute::Hold(Nanos::from_millis(500)));
        assert_eq!(commands_in(&mut control, 1_000, 2), 20);
    }

    #[test]
    fn an_acknowledge_makes_the_rate_that_of_the_way_there_and_back() {
        // Two scans for the edge and its acknowledge, two for the falling edge, and one in which the next
        // command is given.
        let mut control = AxisControl::new(Execute::Acknowledge);
        assert_eq!(commands_in(&mut control, 1_000, 2), 200);
    }

    #[test]
    fn a_command_is_done_when_the_machine_has_taken_it_and_not_for_the_last_one_s_sake() {
        let mut control = AxisControl::new(Execute::Acknowledge);
        let there = AxisInputs {
            in_position: true,
            ..AxisInputs::default()
        };
        control.give(to(5.0));
        control.call(SCAN, &there, true);
        assert!(control.demand.execute && !control.is_done(&there));
        let taken = AxisInputs {
            acknowledge: true,
            in_position: false,
            ..there
        };
        control.call(SCAN + SCAN, &taken, true);
        assert!(control.is_taken() && !control.is_done(&taken));
        assert!(control.is_done(&there));
    }

    #[test]
    fn the_newest_command_waits_and_the_numbers_stand_still_while_execute_is_on() {
        let mut control = AxisControl::new(Execute::Hold(Nanos::from_millis(50)));
        control.give(to(1.0));
        let inputs = AxisInputs::default();
        let mut now = Nanos::ZERO;
        let mut seen = Vec::new();
        for scan in 0..14 {
            if scan == 1 || scan == 2 {
                control.give(to(f64::from(scan) * 10.0));
            }
            control.call(now, &inputs, true);
            now += SCAN;
            seen.push((control.demand.execute, control.demand.motion.position));
        }
        assert!(
            seen[..5].iter().all(|seen| *seen == (true, 1.0)),
            "{seen:?}"
        );
        assert_eq!(seen[5], (false, 1.0));
        assert!(
            seen[6..11].iter().all(|seen| *seen == (true, 20.0)),
            "{seen:?}"
        );
        assert!(!seen[11].0 && control.is_taken());
    }

    #[test]
    fn nobody_who_acknowledges_gets_the_edge_again_and_no_enable_forgets_all() {
        let mut control = AxisControl::new(Execute::Acknowledge);
        control.give(to(1.0));
        let mut now = Nanos::ZERO;
        for _ in 0..310 {
            control.call(now, &AxisInputs::default(), true);
            now += SCAN;
        }
        assert_eq!(control.commands(), 4);
        control.call(now, &AxisInputs::default(), false);
        assert!(!control.demand.execute);
        control.call(now + SCAN, &AxisInputs::default(), true);
        assert!(!control.demand.execute && control.is_ready() && !control.is_taken());
    }

    #[test]
    fn what_lasts_ends_by_its_bit_alone() {
        let mut control = AxisControl::new(Execute::Acknowledge);
        control.give(AxisCommand {
            mode: Mode::Tracking,
            ..to(0.0)
        });
        control.call(SCAN, &AxisInputs::default(), true);
        assert!(control.demand.tracking);
        control.release();
        control.call(SCAN + SCAN, &AxisInputs::default(), true);
        assert!(!control.demand.tracking && control.commands() == 1);
    }
}
