//! The reasons why a driver cannot be opened.

use tickbus_base::Mistake;
use tickbus_plc as plc;
use tickbus_record::{RecorderError, RecordingError};

use super::Code;

/// Says why a driver cannot be opened.
#[derive(Debug, thiserror::Error)]
pub enum DriverError {
    /// The system refused a thread.
    #[error(
        "the system refused a thread for {what}: {source}; close other programs or raise the limit"
    )]
    System {
        /// The part of the driver that needs the thread.
        what: &'static str,
        /// The system's reason.
        source: std::io::Error,
    },
    /// The hosted program does not exist, or rejects its options or the image.
    #[error("{file}: {source}")]
    Program {
        /// The driver.cfg.
        file: String,
        /// The program's error.
        source: plc::ProgramError,
    },
    /// The program, the stations and the bus do not fit together.
    #[error("{file}: {mistake}")]
    Fit {
        /// The driver.cfg.
        file: String,
        /// The misfit, and what would fit.
        mistake: Mistake,
    },
    /// The bus does not find something that the driver.cfg names.
    #[error("{file}: {mistake}")]
    Bus {
        /// The driver.cfg.
        file: String,
        /// The missing thing, and what to do about it.
        mistake: Mistake,
    },
    /// The recording cannot be made.
    #[error("{0}")]
    Record(String),
    /// The recording that replaces the peer cannot be read, or contains other signals.
    #[error(transparent)]
    Replay(#[from] RecordingError),
    /// A fault cannot be injected.
    #[error("{0}")]
    Fault(Mistake),
    /// The system refuses real-time settings that are required.
    #[error("{0}")]
    RealTime(String),
    /// The driver.cfg is correct, but asks for something that this build or platform does not have.
    #[error("{0}")]
    Unsupported(String),
}

impl From<RecorderError> for DriverError {
    fn from(error: RecorderError) -> Self {
        match error {
            RecorderError::File(text) => Self::Record(text),
            RecorderError::Thread(source) => Self::System {
                what: "the recording",
                source,
            },
        }
    }
}

impl DriverError {
    /// Creates the error for a thread that the system refused.
    pub(crate) fn no_thread(what: &'static str, source: std::io::Error) -> Self {
        Self::System { what, source }
    }

    /// Returns true if the driver.cfg must be changed, rather than the system.
    pub fn is_wrong_input(&self) -> bool {
        matches!(self.code(), Code::BadConfig | Code::Unsupported)
    }

    /// Returns the status code of this error.
    pub fn code(&self) -> Code {
        match self {
            Self::System { .. } | Self::RealTime(_) => Code::BusFailed,
            Self::Unsupported(_) => Code::Unsupported,
            Self::Program { .. }
            | Self::Fit { .. }
            | Self::Bus { .. }
            | Self::Record(_)
            | Self::Replay(_)
            | Self::Fault(_) => Code::BadConfig,
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
        assert!(error.to_string().contains("for the recording: "), "{error}");
        assert_eq!(error.code(), Code::BusFailed);
        let error = DriverError::from(RecorderError::File("run.csv: no".to_owned()));
        assert_eq!(error.code(), Code::BadConfig);
    }
}
