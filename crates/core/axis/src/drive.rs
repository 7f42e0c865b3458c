//! The effect of commands on an axis: one simulated drive, stepped through time.

use super::ramp::{Place, ramped};
use super::{AxisKind, Limits, Motion, Profile};

/// The tolerance within which a target counts as reached, in the unit of the axis.
const THERE: f64 = 1e-9;

/// The PLC's command to an axis.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[expect(
    clippy::struct_excessive_bools,
    reason = "the bits of the structure, one by one"
)]
pub struct Demand {
    /// A rising edge gives a command.
    pub execute: bool,
    /// Follow; on an axis of kind `torque`: close.
    pub tracking: bool,
    /// On an axis of kind `torque`: open. No meaning on others.
    pub torque_control: bool,
    /// Run.
    pub speed_control: bool,
    /// Without this the axis does not move.
    pub enable: bool,
    /// The numbers.
    pub motion: Motion<f64>,
    /// The rate of change of the acceleration; 0 lets it jump.
    pub jerk: f64,
}

/// The feedback of an axis to the PLC.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Feedback {
    /// The axis has no fault.
    pub healthy: bool,
    /// The target of the last command is reached.
    pub in_position: bool,
    /// The actual position.
    pub position: f64,
    /// The actual speed, with its sign.
    pub speed: f64,
    /// Bit 0 ready (enabled and healthy), 1 moving, 2 in position, 3 at the lower limit, 4 at the upper
    /// limit, 5 running at a speed, 6 tracking, 7 opening or closing.
    pub status: u16,
    /// 0, or why the last command was refused: one of the codes of this type.
    pub error: u16,
}

impl Feedback {
    /// The target was beyond the limits; the axis moved as far as it could.
    pub const BEYOND: u16 = 1;
    /// The command makes no sense: numbers without a speed or an acceleration, bits that this kind of axis
    /// does not have, or contradictory bits.
    pub const NONSENSE: u16 = 2;
    /// The axis has a fault.
    pub const UNHEALTHY: u16 = 4;
    /// Execute rose without Enable.
    pub const NOT_ENABLED: u16 = 7;
}

/// One simulated axis with an ideal drive.
///
/// A command begins with the rising edge of `Execute` while `Enable` is on. A move from standstill follows
/// its [`Profile`]; one that interrupts another motion brakes and reverses as fast as its limits permit,
/// without a limit of jerk.
#[derive(Clone, Debug)]
pub struct Drive {
    kind: AxisKind,
    limits: Option<[f64; 2]>,
    /// Tests clear it to simulate a fault.
    pub healthy: bool,
    position: f64,
    speed: f64,
    in_position: bool,
    executed: bool,
    doing: Doing,
    /// The numbers of the active command.
    motion: Motion<f64>,
    error: u16,
}

#[derive(Clone, Debug)]
enum Doing {
    Nothing,
    /// Follows a profile, from a position in a direction, for `since` seconds so far.
    Profile {
        profile: Box<Profile>,
        from: f64,
        sign: f64,
        since: f64,
        target: f64,
    },
    /// Moves to a target from any speed.
    Chase {
        target: f64,
    },
    Run {
        speed: f64,
    },
    Squeeze {
        speed: f64,
    },
    Follow,
}

/// The speed at which an axis that moves by pressure alone opens and closes.
const SQUEEZE: f64 = 400.0;

impl Drive {
    /// An axis of a kind, at rest.
    pub fn new(kind: AxisKind, position: f64, limits: Option<[f64; 2]>) -> Self {
        Self {
            kind,
            limits,
            healthy: true,
            position,
            speed: 0.0,
            in_position: false,
            executed: false,
            doing: Doing::Nothing,
            motion: Motion::default(),
            error: 0,
        }
    }

    /// Advances by `seconds` as `demand` says; `follows` is the position for a tracking axis to follow, and `stop` the
    /// position that a closing axis cannot pass.
    pub fn step(&mut self, seconds: f64, demand: &Demand, follows: f64, stop: f64) -> Feedback {
        let rises = demand.execute && !self.executed;
        self.executed = demand.execute;
        if !demand.enable || !self.healthy {
            if rises {
                self.error = if self.healthy {
                    Feedback::NOT_ENABLED
                } else {
                    Feedback::UNHEALTHY
                };
            }
            self.doing = Doing::Nothing;
            self.speed = 0.0;
            return self.feedback(demand.enable);
        }
        if rises {
            self.begin(demand);
        }
        match self.doing {
            Doing::Run { .. } if !demand.speed_control => self.doing = Doing::Run { speed: 0.0 },
            Doing::Follow if !demand.tracking => self.doing = Doing::Run { speed: 0.0 },
            Doing::Squeeze { .. } if !demand.tracking && !demand.torque_control => {
                self.doing = Doing::Nothing;
                self.speed = 0.0;
            }
            _ => {}
        }
        self.go(seconds, follows, stop);
        self.feedback(true)
    }

    /// Accepts a new command.
    fn begin(&mut self, demand: &Demand) {
        self.in_position = false;
        self.error = 0;
        let motion = &demand.motion;
        let [low, high] = self.limits.unwrap_or([f64::NEG_INFINITY, f64::INFINITY]);
        let limits = Limits {
            speed: motion.speed.abs(),
            acceleration: motion.acceleration.abs(),
            deceleration: motion.deceleration.abs(),
            jerk: (demand.jerk > 0.0).then_some(demand.jerk),
        };
        let is_torque = self.kind == AxisKind::Torque;
        let impossible = demand.torque_control && (!is_torque || demand.tracking);
        let moves = !demand.torque_control && !demand.tracking;
        // A REAL from the wire may be NaN or infinite: the position would never be valid again.
        if impossible || !motion.is_finite() || (moves && !limits.make_sense()) {
            self.error = Feedback::NONSENSE;
            // The axis brakes with the deceleration of the previous command.
            self.doing = Doing::Run { speed: 0.0 };
            return;
        }
        self.motion = demand.motion;
        let way = motion.position - self.position;
        if demand.torque_control {
            self.doing = Doing::Squeeze { speed: SQUEEZE };
        } else if demand.tracking {
            self.doing = if is_torque {
                Doing::Squeeze { speed: -SQUEEZE }
            } else {
                Doing::Follow
            };
        } else if demand.speed_control {
            let speed = limits.speed.copysign(way);
            self.doing = Doing::Run { speed };
        } else {
            let target = motion.position.clamp(low, high);
            if target.total_cmp(&motion.position).is_ne() {
                self.error = Feedback::BEYOND;
            }
            let way = target - self.position;
            let profile = Profile::new(way.abs(), &limits);
            self.doing = match profile {
                Some(profile) if self.speed.abs() < THERE => Doing::Profile {
                    profile: Box::new(profile),
                    from: self.position,
                    sign: 1.0_f64.copysign(way),
                    since: 0.0,
                    target,
                },
                _ => Doing::Chase { target },
            };
        }
    }

    fn go(&mut self, seconds: f64, follows: f64, stop: f64) {
        let [low, high] = self.limits.unwrap_or([f64::NEG_INFINITY, f64::INFINITY]);
        let before = self.position;
        match &mut self.doing {
            Doing::Nothing => {}
            Doing::Profile {
                profile,
                from,
                sign,
                since,
                target,
            } => {
                *since += seconds;
                let state = profile.at(*since);
                self.position = *from + *sign * state.distance;
                self.speed = *sign * state.speed;
                if *since >= profile.duration() {
                    self.position = *target;
                    self.arrive();
                }
            }
            Doing::Chase { target } => {
                let target = *target;
                let mut place = Place {
                    position: self.position,
                    speed: self.speed,
                };
                let is_there = place.chase(target, self.motion.speed, self.rates(), seconds);
                (self.position, self.speed) = (place.position, place.speed);
                if is_there {
                    self.arrive();
                }
            }
            Doing::Run { speed } => {
                let speed = *speed;
                self.speed = ramped(self.speed, speed, self.rates(), seconds);
                self.position += self.speed * seconds;
                if speed == 0.0 && self.speed == 0.0 {
                    self.arrive();
                }
            }
            Doing::Squeeze { speed } => {
                self.position += *speed * seconds;
                self.position = self.position.max(stop);
            }
            Doing::Follow => {
                let most = self.motion.speed.abs() * seconds;
                self.position += (follows - self.position).clamp(-most, most);
            }
        }
        let free = self.position;
        self.position = free.clamp(low, high);
        match self.doing {
            Doing::Squeeze { .. } | Doing::Follow if seconds > 0.0 => {
                self.speed = (self.position - before) / seconds;
            }
            Doing::Run { .. } if free.total_cmp(&self.position).is_ne() => {
                self.arrive();
            }
            _ => {}
        }
    }

    /// The rates of the command. One without a rate, as possible with tracking, changes the speed at once.
    fn rates(&self) -> [f64; 2] {
        [self.motion.acceleration, self.motion.deceleration]
    }

    fn arrive(&mut self) {
        self.speed = 0.0;
        self.in_position = true;
        self.doing = Doing::Nothing;
    }

    fn feedback(&self, enabled: bool) -> Feedback {
        let bit = |on: bool, bit: u16| u16::from(on) << bit;
        let at =
            |limit: Option<f64>| limit.is_some_and(|limit| (self.position - limit).abs() < THERE);
        Feedback {
            healthy: self.healthy,
            in_position: self.in_position,
            position: self.position,
            speed: self.speed,
            status: bit(enabled && self.healthy, 0)
                | bit(self.speed != 0.0, 1)
                | bit(self.in_position, 2)
                | bit(at(self.limits.map(|[low, _]| low)), 3)
                | bit(at(self.limits.map(|[_, high]| high)), 4)
                | bit(matches!(self.doing, Doing::Run { .. }), 5)
                | bit(matches!(self.doing, Doing::Follow), 6)
                | bit(matches!(self.doing, Doing::Squeeze { .. }), 7),
            error: self.error,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SCAN: f64 = 0.01;

    fn demand(position: f64) -> Demand {
        Demand {
            execute: true,
            enable: true,
            motion: Motion {
                position,
                speed: 100.0,
                acceleration: 1_000.0,
                deceleration: 1_000.0,
                torque: 0.0,
            },
            ..Demand::default()
        }
    }

    /// Steps until the axis is in position; returns the seconds that this took.
    fn arrives(drive: &mut Drive, demand: &Demand) -> f64 {
        for step in 1..10_000 {
            if drive.step(SCAN, demand, 0.0, 0.0).in_position {
                return f64::from(step) * SCAN;
            }
        }
        panic!("never there: {drive:?}");
    }

    #[test]
    fn a_position_command_takes_the_time_of_its_profile_and_ends_in_position() {
        let mut drive = Drive::new(AxisKind::Position, 50.0, Some([0.0, 400.0]));
        let seconds = arrives(&mut drive, &demand(250.0));
        assert!(
            (2.1 - SCAN..=2.1 + 2.0 * SCAN).contains(&seconds),
            "{seconds}"
        );
        let done = drive.step(SCAN, &demand(0.0), 0.0, 0.0);
        assert!(
            done.in_position && done.position.total_cmp(&250.0).is_eq(),
            "Execute is still on: no new command; {done:?}"
        );
    }

    #[test]
    fn nothing_moves_without_enable_and_a_command_is_gone_with_it() {
        let mut drive = Drive::new(AxisKind::Position, 0.0, None);
        let off = Demand {
            enable: false,
            ..demand(10.0)
        };
        let told = drive.step(SCAN, &off, 0.0, 0.0);
        assert_eq!((told.position, told.error), (0.0, Feedback::NOT_ENABLED));
        for _ in 0..20 {
            assert!(drive.step(SCAN, &demand(10.0), 0.0, 0.0).position.abs() <= 0.0);
        }
        let ready = Demand {
            execute: false,
            ..demand(10.0)
        };
        drive.step(SCAN, &ready, 0.0, 0.0);
        arrives(&mut drive, &demand(10.0));
    }

    #[test]
    fn a_command_in_mid_move_brakes_turns_and_arrives() {
        let mut drive = Drive::new(AxisKind::Position, 0.0, Some([0.0, 400.0]));
        for _ in 0..50 {
            drive.step(SCAN, &demand(300.0), 0.0, 0.0);
        }
        let back = demand(10.0);
        drive.step(
            SCAN,
            &Demand {
                execute: false,
                ..back
            },
            0.0,
            0.0,
        );
        let began = drive.step(SCAN, &back, 0.0, 0.0);
        assert!(began.speed > 0.0, "no jump in its speed: {began:?}");
        arrives(&mut drive, &back);
        assert!(drive.position.total_cmp(&10.0).is_eq());
    }

    #[test]
    fn a_jog_runs_for_as_long_as_its_bit_and_ends_at_the_limit() {
        let mut drive = Drive::new(AxisKind::Position, 0.0, Some([0.0, 100.0]));
        let jog = Demand {
            speed_control: true,
            ..demand(1e9)
        };
        for _ in 0..30 {
            drive.step(SCAN, &jog, 0.0, 0.0);
        }
        let stop = Demand {
            execute: false,
            speed_control: false,
            ..jog
        };
        arrives(&mut drive, &stop);
        assert!((30.0..40.0).contains(&drive.position), "{drive:?}");
        arrives(&mut drive, &jog);
        assert!(drive.position.total_cmp(&100.0).is_eq());
    }

    #[test]
    fn a_clamp_closes_on_what_is_there_and_opens_to_its_end() {
        let mut drive = Drive::new(AxisKind::Torque, 800.0, Some([0.0, 800.0]));
        let close = Demand {
            execute: true,
            enable: true,
            tracking: true,
            ..Demand::default()
        };
        let mut told = Feedback::default();
        for _ in 0..100 {
            told = drive.step(SCAN, &close, 0.0, 650.0);
        }
        assert_eq!((told.position, told.speed), (650.0, 0.0));
        let open = Demand {
            execute: false,
            tracking: false,
            torque_control: true,
            ..close
        };
        drive.step(SCAN, &open, 0.0, 650.0);
        let open = Demand {
            execute: true,
            ..open
        };
        for _ in 0..100 {
            told = drive.step(SCAN, &open, 0.0, 0.0);
        }
        assert_eq!((told.position, told.speed), (800.0, 0.0));
    }

    #[test]
    fn what_is_no_number_stops_an_axis_and_does_not_break_it() {
        let modes = [
            (false, false, false),
            (true, false, false),
            (false, true, false),
            (false, false, true),
        ];
        for (tracking, torque_control, speed_control) in modes {
            for wrong in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
                for field in 0..5 {
                    let kind = if torque_control {
                        AxisKind::Torque
                    } else {
                        AxisKind::Position
                    };
                    let mut drive = Drive::new(kind, 20.0, Some([0.0, 100.0]));
                    let mut numbers = [50.0, 10.0, 10.0, 10.0, 1.0];
                    numbers[field] = wrong;
                    let [position, speed, acceleration, deceleration, torque] = numbers;
                    let command = Demand {
                        tracking,
                        torque_control,
                        speed_control,
                        motion: Motion {
                            position,
                            speed,
                            acceleration,
                            deceleration,
                            torque,
                        },
                        ..demand(0.0)
                    };
                    for _ in 0..3 {
                        let told = drive.step(SCAN, &command, 30.0, 0.0);
                        assert_eq!((told.position, told.error), (20.0, Feedback::NONSENSE));
                    }
                    drive.step(
                        SCAN,
                        &Demand {
                            enable: true,
                            ..Demand::default()
                        },
                        0.0,
                        0.0,
                    );
                    arrives(&mut drive, &demand(40.0));
                }
            }
        }
    }

    #[test]
    fn an_axis_that_tracked_without_a_deceleration_stops_when_it_tracks_no_more() {
        let mut drive = Drive::new(AxisKind::Tracking, 0.0, None);
        let track = Demand {
            tracking: true,
            motion: Motion {
                speed: 100.0,
                ..Motion::default()
            },
            ..demand(0.0)
        };
        assert!(drive.step(SCAN, &track, 50.0, 0.0).speed > 0.0);
        let over = Demand {
            tracking: false,
            ..track
        };
        let told = drive.step(SCAN, &over, 50.0, 0.0);
        assert!(told.speed.abs() <= 0.0 && told.in_position, "{told:?}");
    }

    #[test]
    fn what_is_wrong_with_a_command_is_told() {
        let mut drive = Drive::new(AxisKind::Position, 0.0, Some([0.0, 100.0]));
        let none = Demand {
            motion: Motion {
                position: 10.0,
                ..Motion::default()
            },
            ..demand(0.0)
        };
        assert_eq!(drive.step(SCAN, &none, 0.0, 0.0).error, Feedback::NONSENSE);
        drive.step(SCAN, &Demand::default(), 0.0, 0.0);
        assert_eq!(
            drive.step(SCAN, &demand(101.0), 0.0, 0.0).error,
            Feedback::BEYOND
        );
        drive.healthy = false;
        assert!(!drive.step(SCAN, &demand(101.0), 0.0, 0.0).healthy);
    }

    #[test]
    fn a_clamp_closes_whatever_the_numbers_of_its_command_say() {
        for speed in [-1.0, 0.0, 100.0] {
            let mut drive = Drive::new(AxisKind::Torque, 800.0, Some([0.0, 800.0]));
            let mut close = demand(500.0);
            (close.tracking, close.motion.speed) = (true, speed);
            let mut told = Feedback::default();
            for _ in 0..300 {
                told = drive.step(SCAN, &close, 500.0, 0.0);
            }
            assert_eq!((told.position, told.error), (0.0, 0), "at speed {speed}");
        }
    }

    #[test]
    fn an_axis_without_a_clamp_does_not_open_and_none_opens_and_closes_at_once() {
        let open = Demand {
            torque_control: true,
            ..demand(500.0)
        };
        let both = Demand {
            tracking: true,
            ..open
        };
        let kinds = [AxisKind::Position, AxisKind::Speed, AxisKind::Tracking];
        let wrong = kinds.map(|kind| (kind, open));
        for (kind, command) in wrong.into_iter().chain([(AxisKind::Torque, both)]) {
            let mut drive = Drive::new(kind, 20.0, Some([0.0, 100.0]));
            for _ in 0..5 {
                let told = drive.step(SCAN, &command, 20.0, 0.0);
                assert_eq!(
                    (told.position, told.error),
                    (20.0, Feedback::NONSENSE),
                    "{kind:?}"
                );
            }
        }
    }

    #[test]
    fn what_tracks_at_speed_0_stays_where_it_is() {
        let mut drive = Drive::new(AxisKind::Tracking, 20.0, Some([0.0, 100.0]));
        let mut track = demand(0.0);
        (track.tracking, track.motion.speed) = (true, 0.0);
        for _ in 0..5 {
            let told = drive.step(SCAN, &track, 80.0, 0.0);
            assert_eq!((told.position, told.error), (20.0, 0));
        }
    }
}
