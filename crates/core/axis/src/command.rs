//! Commands that a PLC gives by number: the simulator's side has their table.

/// The motion of a command, encoded in the bits of its command structure.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Mode {
    /// Moves to the target position. No bit.
    #[default]
    Position,
    /// Runs towards the target position for as long as `SpeedControl` is on.
    Speed,
    /// Closes with a pressure: the bit that is `Tracking` on other axes.
    Close,
    /// Opens with a pressure: the bit `TorqueControl`.
    Open,
    /// Follows for as long as `Tracking` is on.
    Tracking,
}

impl Mode {
    /// All modes, with their names in a driver.cfg.
    pub const ALL: [(&'static str, Self); 5] = [
        ("position", Self::Position),
        ("speed", Self::Speed),
        ("close", Self::Close),
        ("open", Self::Open),
        ("tracking", Self::Tracking),
    ];

    /// The name in a driver.cfg.
    pub fn name(self) -> &'static str {
        let found = Self::ALL.into_iter().find(|(_, mode)| *mode == self);
        found.map_or("", |(name, _)| name)
    }

    /// The bits `Tracking`, `TorqueControl` and `SpeedControl`.
    pub const fn bits(self) -> [bool; 3] {
        match self {
            Self::Position => [false, false, false],
            Self::Close | Self::Tracking => [true, false, false],
            Self::Open => [false, true, false],
            Self::Speed => [false, false, true],
        }
    }
}

/// The numbers of a command: `TargetPosition`, `Speed`, `Acceleration`, `Deceleration` and `Torque`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Motion<T> {
    /// The target; with tracking, the offset.
    pub position: T,
    /// The highest speed.
    pub speed: T,
    /// The acceleration.
    pub acceleration: T,
    /// The deceleration.
    pub deceleration: T,
    /// The pressure; for a knife carriage, the thickness of the veneer.
    pub torque: T,
}

impl Motion<f64> {
    /// True if no number is NaN or infinite.
    pub fn is_finite(&self) -> bool {
        let all = [
            self.position,
            self.speed,
            self.acceleration,
            self.deceleration,
            self.torque,
        ];
        all.into_iter().all(f64::is_finite)
    }
}

/// One command of the table.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Command {
    /// The number in the PLC; never 0, which means no command.
    pub number: u16,
    /// The motion.
    pub mode: Mode,
    /// The numbers. Those that are `None` come from the PLC.
    pub motion: Motion<Option<f64>>,
}
