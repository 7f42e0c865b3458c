//! Why a driver cannot be opened.

use tickbus_plc as plc;
use tickbus_record::RecorderError;

use super::Code;

/// Why a driver cannot be opened.
#[derive(Debug, thiserror::Error)]
pub enum DriverError {
    /// The system refused a thread.
    #[error(
        "the system refused a thread for the bus: {0}; close other programs or raise the limit"
    )]
    Thread(#[from] std::io::Error),
    /// The hosted program does not exist, or rejects its options.
    #[error("{file}: {source}")]
    Program {
        /// The driver.cfg.
        file: String,
        /// The program's error.
        source: plc::ProgramError,
    },
    /// The recording cannot be started.
    #[error("{0}")]
    Recording(#[from] RecorderError),
    /// The program and the signal table do not fit.
    #[error("{0}")]
    Config(String),
    /// The driver.cfg is correct, but asks for something that this build or platform does not have.
    #[error("{0}")]
    Unsupported(String),
}

impl DriverError {
    /// Whether the driver.cfg must be changed, rather than the system.
    pub fn is_wrong_input(&self) -> bool {
        matches!(self.code(), Code::BadConfig | Code::Unsupported)
    }

    /// The status code for it.
    pub fn code(&self) -> Code {
        match self {
            Self::Thread(_) | Self::Recording(RecorderError::Thread(_)) => Code::BusFailed,
            Self::Program { .. } | Self::Config(_) | Self::Recording(RecorderError::File(_)) => {
                Code::BadConfig
            }
            Self::Unsupported(_) => Code::Unsupported,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_the_system_refuses_is_not_told_as_wrong_input() {
        let refused = || std::io::Error::from(std::io::ErrorKind::WouldBlock);
        let error = DriverError::from(RecorderError::Thread(refused()));
        assert!(!error.is_wrong_input(), "{error}");
        assert_eq!(error.code(), Code::BusFailed);
        let error = DriverError::from(RecorderError::File("run.csv: no".to_owned()));
        assert_eq!(error.code(), Code::BadConfig);
    }
}
