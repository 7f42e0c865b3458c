//! The two structures of an axis, field by field.

use tickbus_image::signal::{Area, DataType};

use super::AxisKind;

/// Size of a command structure, in `%Q`.
pub const COMMAND_BYTES: usize = 30;

/// Size of a feedback structure, in `%I`.
pub const FEEDBACK_BYTES: usize = 10;

/// Size of a feedback structure with diagnostics, or with the number of the last completed command.
pub const EXTENDED_FEEDBACK_BYTES: usize = 16;

/// One field of the structures of an axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Field {
    /// `%Q` bit: its rising edge gives the command.
    Execute,
    /// `%Q` bit: follow; on axes that open and close, close.
    Tracking,
    /// `%Q` bit: move with a torque; on axes that open and close, open.
    TorqueControl,
    /// `%Q` bit: run for as long as it is on.
    SpeedControl,
    /// `%Q` bit: without it the axis does not move.
    Enable,
    /// `%Q` REAL: the target.
    TargetPosition,
    /// `%Q` REAL: the highest speed.
    Speed,
    /// `%Q` REAL: the acceleration.
    Acceleration,
    /// `%Q` REAL: the deceleration.
    Deceleration,
    /// `%Q` REAL: torque, pressure, or thickness of the veneer.
    Torque,
    /// `%Q` UINT, in the first reserved REAL: the number of a command in the simulator's table.
    CommandNumber,
    /// `%Q` REAL, in the second reserved one: the rate of change of the acceleration.
    Jerk,
    /// `%I` bit: the axis has no fault. The thesis calls it Enable, like the command's bit.
    Healthy,
    /// `%I` bit: the target of the last command is reached.
    InPosition,
    /// `%I` bit, a reserved one: the machine has accepted the command, so that Execute may fall.
    Acknowledge,
    /// `%I` REAL: the actual position.
    ActualPosition,
    /// `%I` REAL: the actual speed, with its sign.
    ActualSpeed,
    /// `%I` WORD, extended: what the axis is doing.
    Status,
    /// `%I` WORD, extended: the fault or error of the axis.
    Error,
    /// `%I` UINT, extended: the number of the last completed command.
    CommandDone,
}

/// The quantity in a field, which determines its scale.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Quantity {
    /// A bit, by its number within its byte.
    Bit(u8),
    /// A position: scale and offset.
    Position,
    /// A speed with a sign.
    Velocity,
    /// An unsigned speed, acceleration or jerk: the power of the second in its unit.
    Magnitude(u8),
    /// A number without scale.
    Torque,
    /// An unsigned 16-bit number.
    Number,
    /// 16 bits.
    Word,
}

impl Field {
    /// The number of fields.
    pub const COUNT: usize = 20;

    /// All fields, in the order of their addresses, commands first.
    pub const ALL: [Self; Self::COUNT] = [
        Self::Execute,
        Self::Tracking,
        Self::TorqueControl,
        Self::SpeedControl,
        Self::Enable,
        Self::TargetPosition,
        Self::Speed,
        Self::Acceleration,
        Self::Deceleration,
        Self::Torque,
        Self::CommandNumber,
        Self::Jerk,
        Self::Healthy,
        Self::InPosition,
        Self::Acknowledge,
        Self::ActualPosition,
        Self::ActualSpeed,
        Self::Status,
        Self::Error,
        Self::CommandDone,
    ];

    /// The position in [`ALL`](Self::ALL).
    pub const fn index(self) -> usize {
        self as usize
    }

    /// The part of the signal's name after the axis' name and a dot.
    pub const fn name(self, kind: AxisKind) -> &'static str {
        match (self, kind) {
            (Self::Tracking, AxisKind::Torque) => "Close",
            (Self::TorqueControl, AxisKind::Torque) => "Open",
            (Self::Execute, _) => "Execute",
            (Self::Tracking, _) => "Tracking",
            (Self::TorqueControl, _) => "TorqueControl",
            (Self::SpeedControl, _) => "SpeedControl",
            (Self::Enable, _) => "Enable",
            (Self::TargetPosition, _) => "TargetPosition",
            (Self::Speed, _) => "Speed",
            (Self::Acceleration, _) => "Acceleration",
            (Self::Deceleration, _) => "Deceleration",
            (Self::Torque, _) => "Torque",
            (Self::CommandNumber, _) => "CommandNumber",
            (Self::Jerk, _) => "Jerk",
            (Self::Healthy, _) => "Healthy",
            (Self::InPosition, _) => "InPosition",
            (Self::Acknowledge, _) => "Acknowledge",
            (Self::ActualPosition, _) => "ActualPosition",
            (Self::ActualSpeed, _) => "ActualSpeed",
            (Self::Status, _) => "Status",
            (Self::Error, _) => "Error",
            (Self::CommandDone, _) => "CommandDone",
        }
    }

    /// `%Q` for commands, `%I` for feedback.
    pub const fn area(self) -> Area {
        if self.index() < Self::Healthy.index() {
            Area::Output
        } else {
            Area::Input
        }
    }

    /// The offset of the first byte in the structure.
    pub const fn offset(self) -> usize {
        match self {
            Self::Execute
            | Self::Tracking
            | Self::TorqueControl
            | Self::SpeedControl
            | Self::Enable
            | Self::Healthy
            | Self::InPosition
            | Self::Acknowledge => 0,
            Self::TargetPosition | Self::ActualPosition => 2,
            Self::Speed | Self::ActualSpeed => 6,
            Self::Acceleration | Self::Status => 10,
            Self::Error => 12,
            Self::Deceleration | Self::CommandDone => 14,
            Self::Torque => 18,
            Self::CommandNumber => 22,
            Self::Jerk => 26,
        }
    }

    /// The bit within that byte; 0 unless the field is a BOOL.
    pub const fn bit(self) -> u8 {
        match self.quantity() {
            Quantity::Bit(bit) => bit,
            _ => 0,
        }
    }

    /// The type of the signal.
    pub const fn data_type(self) -> DataType {
        match self.quantity() {
            Quantity::Bit(_) => DataType::Bool,
            Quantity::Number => DataType::Uint,
            Quantity::Word => DataType::Word,
            _ => DataType::Real,
        }
    }

    pub(super) const fn quantity(self) -> Quantity {
        match self {
            Self::Execute | Self::Healthy => Quantity::Bit(0),
            Self::Tracking | Self::InPosition => Quantity::Bit(1),
            Self::TorqueControl | Self::Acknowledge => Quantity::Bit(2),
            Self::SpeedControl => Quantity::Bit(3),
            Self::Enable => Quantity::Bit(4),
            Self::TargetPosition | Self::ActualPosition => Quantity::Position,
            Self::ActualSpeed => Quantity::Velocity,
            Self::Speed => Quantity::Magnitude(1),
            Self::Acceleration | Self::Deceleration => Quantity::Magnitude(2),
            Self::Jerk => Quantity::Magnitude(3),
            Self::Torque => Quantity::Torque,
            Self::CommandNumber | Self::CommandDone => Quantity::Number,
            Self::Status | Self::Error => Quantity::Word,
        }
    }
}
