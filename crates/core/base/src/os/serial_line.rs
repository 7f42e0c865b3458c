//! Serial lines of the operating system, or of a [simulation](crate::time::Simulation).

use std::io::{self, Read, Write};
use std::path::Path;

use super::{SerialPort, SerialSettings};
use crate::time::{SimulatedStream, Simulation};

/// An open serial port that [marks](SerialPort::mark_damaged) damaged characters.
#[derive(Debug)]
pub enum SerialLine {
    /// Of the operating system.
    Os(SerialPort),
    /// Of a simulation.
    Simulated(Box<dyn SimulatedStream>),
}

impl SerialLine {
    /// Opens the port that the system calls `device`.
    ///
    /// # Errors
    ///
    /// As of [`SerialPort::open`] and [`SerialPort::mark_damaged`].
    pub fn open(
        device: &str,
        settings: SerialSettings,
        simulation: Option<&dyn Simulation>,
    ) -> io::Result<Self> {
        if let Some(simulation) = simulation {
            return Ok(Self::Simulated(simulation.open_serial(device)?));
        }
        let port = SerialPort::open(Path::new(device), settings)?;
        port.mark_damaged()?;
        Ok(Self::Os(port))
    }
}

/// A serial line that is only listened to: it cannot be written to.
#[derive(Debug)]
pub struct SerialEar(SerialLine);

impl SerialEar {
    /// As [`SerialLine::open`]; on Unix the port itself is opened for reading alone.
    ///
    /// # Errors
    ///
    /// As of [`SerialLine::open`].
    pub fn open(
        device: &str,
        settings: SerialSettings,
        simulation: Option<&dyn Simulation>,
    ) -> io::Result<Self> {
        if simulation.is_some() {
            return Ok(Self(SerialLine::open(device, settings, simulation)?));
        }
        let port = SerialPort::open_to_listen(Path::new(device), settings)?;
        port.mark_damaged()?;
        Ok(Self(SerialLine::Os(port)))
    }

    /// The line to wait for.
    pub(super) fn line(&self) -> &SerialLine {
        &self.0
    }
}

impl Read for SerialEar {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        self.0.read(buffer)
    }
}

impl Read for SerialLine {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        match self {
            Self::Os(port) => port.read(buffer),
            Self::Simulated(stream) => stream.read(buffer),
        }
    }
}

impl Write for SerialLine {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        match self {
            Self::Os(port) => port.write(bytes),
            Self::Simulated(stream) => stream.write(bytes),
        }
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}
