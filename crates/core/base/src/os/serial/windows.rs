//! Serial ports of Windows, the COM ports.

#![allow(
    unsafe_code,
    reason = "the system is asked for waiting bytes, and to end a read"
)]

use std::io::{self, ErrorKind, Read, Write};
use std::net::{Shutdown, TcpStream};
use std::os::windows::io::{AsRawHandle as _, AsSocket, BorrowedSocket};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{Builder, JoinHandle};
use std::time::Duration;

use serial2::{CharSize, FlowControl, StopBits};
use windows_sys::Win32::Devices::Communication::{COMSTAT, ClearCommError};
use windows_sys::Win32::System::IO::CancelIoEx;

use super::{Parity, SerialSettings};
use crate::net::local_pair;
use crate::time::{Clock as _, Monotonic, Nanos, Stop};

/// The longest time for a read from the port.
const PATIENCE: Duration = Duration::from_millis(50);

/// How long to wait until a thread has ended before its read is cancelled again.
const ENDING: Nanos = Nanos::from_millis(2);

/// The longest time for bytes that were accepted to leave the port that is closed, in units of [`ENDING`]: 1,000 characters
/// at 9,600 baud.
const LEAVING: u32 = 500;

/// An open serial port. Reading and writing never block; a [`PollSet`](crate::os::PollSet) can wait for it.
///
/// Windows waits for sockets alone, so that two threads carry the bytes between the port and a socket.
#[derive(Debug)]
pub struct SerialPort {
    /// `None` once it is closed.
    line: Option<TcpStream>,
    port: Arc<serial2::SerialPort>,
    flags: Arc<Flags>,
    threads: Vec<JoinHandle<()>>,
}

/// Wishes of the port's owner to the thread that reads.
#[derive(Debug, Default)]
struct Flags {
    is_closing: AtomicBool,
    /// See [`SerialPort::mark_damaged`].
    marks: AtomicBool,
}

impl SerialPort {
    /// Opens the port that the system calls `device`, such as `COM3`, for exclusive use.
    ///
    /// # Errors
    ///
    /// The port does not exist, is no serial port, is in use by another program, or does not support the settings.
    pub fn open(device: &Path, settings: SerialSettings) -> io::Result<Self> {
        if settings.rs485 {
            return Err(ErrorKind::Unsupported.into());
        }
        let apply = |mut applied: serial2::Settings| {
            applied.set_raw();
            applied.set_baud_rate(settings.baud)?;
            applied.set_char_size(if settings.seven_bits {
                CharSize::Bits7
            } else {
                CharSize::Bits8
            });
            applied.set_flow_control(FlowControl::None);
            applied.set_parity(match settings.parity {
                Parity::Even => serial2::Parity::Even,
                Parity::Odd => serial2::Parity::Odd,
                Parity::None => serial2::Parity::None,
            });
            applied.set_stop_bits(if settings.two_stop_bits {
                StopBits::Two
            } else {
                StopBits::One
            });
            Ok(applied)
        };
        let mut port = serial2::SerialPort::open(device, apply).map_err(in_use)?;
        port.set_read_timeout(PATIENCE)?;
        port.discard_buffers()?;
        let port = Arc::new(port);
        let (line, theirs) = local_pair()?;
        line.set_nonblocking(true)?;
        let flags = Arc::<Flags>::default();
        let (reader, writer) = (theirs.try_clone()?, theirs);
        let mut opened = Self {
            line: Some(line),
            port: Arc::clone(&port),
            flags: Arc::clone(&flags),
            threads: Vec::new(),
        };
        let from = Arc::clone(&port);
        opened.thread("serial-in", move || receive(&from, reader, &flags))?;
        opened.thread("serial-out", move || send(&port, writer))?;
        Ok(opened)
    }

    /// As [`open`](Self::open), for an owner that only reads; the system would accept a write.
    ///
    /// # Errors
    ///
    /// As of [`open`](Self::open).
    pub fn open_to_listen(device: &Path, settings: SerialSettings) -> io::Result<Self> {
        Self::open(device, settings)
    }

    fn thread(&mut self, name: &str, work: impl FnOnce() + Send + 'static) -> io::Result<()> {
        let thread = Builder::new().name(name.to_owned()).spawn(work)?;
        self.threads.push(thread);
        Ok(())
    }

    /// From now on, delivers bytes in the code that [`Marks`](crate::os::Marks) decodes. Windows tells that a character was
    /// damaged, but not which one: none is marked, and the checksum of the telegram has to find them.
    ///
    /// # Errors
    ///
    /// None.
    #[expect(clippy::unnecessary_wraps, reason = "as on Unix")]
    pub fn mark_damaged(&self) -> io::Result<()> {
        self.flags.marks.store(true, Ordering::Release);
        Ok(())
    }

    fn line(&self) -> io::Result<&TcpStream> {
        self.line
            .as_ref()
            .ok_or_else(|| ErrorKind::NotConnected.into())
    }
}

/// The error that says that the port is in use: Windows then denies access, as for a lack of rights, which COM ports do
/// not have.
fn in_use(error: io::Error) -> io::Error {
    match error.kind() {
        ErrorKind::PermissionDenied => io::Error::new(ErrorKind::ResourceBusy, error),
        _ => error,
    }
}

/// Carries bytes from the port to the socket, whose end tells that the port is gone.
fn receive(port: &serial2::SerialPort, mut line: TcpStream, flags: &Flags) {
    let mut bytes = [0; 4096];
    let mut coded = Vec::new();
    while !flags.is_closing.load(Ordering::Acquire) {
        match read(port, &mut bytes) {
            Ok(0) => break,
            Ok(count) => {
                let marks = flags.marks.load(Ordering::Acquire);
                coded.clear();
                for byte in &bytes[..count] {
                    // The code of a plain FF.
                    let repeats = if marks && *byte == 0xFF { 2 } else { 1 };
                    coded.extend(std::iter::repeat_n(*byte, repeats));
                }
                if line.write_all(&coded).is_err() {
                    break;
                }
            }
            Err(error) if matches!(error.kind(), ErrorKind::TimedOut | ErrorKind::Interrupted) => {}
            Err(error) => {
                log::debug!("the serial port ends: {error}");
                break;
            }
        }
    }
    // If this fails, the other end has closed the socket.
    let _ = line.shutdown(Shutdown::Both);
}

/// Lets a thread end.
fn pause() {
    let clock = Monotonic::shared();
    clock.wait_until(clock.now() + ENDING, &Stop::new());
}

/// Waits for a byte, and reads it with all others that are there. A longer read would wait for as many bytes as it has room
/// for, in Wine and with some drivers of ports.
fn read(port: &serial2::SerialPort, bytes: &mut [u8]) -> io::Result<usize> {
    let (first, rest) = bytes.split_at_mut(1);
    let read = port.read(first);
    let mut errors = 0;
    let mut state = COMSTAT::default();
    // After a damaged character, some drivers refuse to read until this is called.
    // SAFETY: the handle is open, and both numbers are written.
    let known = unsafe { ClearCommError(port.as_raw_handle(), &raw mut errors, &raw mut state) };
    if read? == 0 {
        return Ok(0);
    }
    let waiting = match usize::try_from(state.cbInQue) {
        Ok(waiting) if known != 0 => waiting.min(rest.len()),
        _ => 0,
    };
    if waiting == 0 {
        return Ok(1);
    }
    match port.read(&mut rest[..waiting]) {
        Ok(count) => Ok(1 + count),
        Err(error) if error.kind() == ErrorKind::TimedOut => Ok(1),
        Err(error) => Err(error),
    }
}

/// Carries bytes from the socket to the port.
fn send(port: &serial2::SerialPort, mut line: TcpStream) {
    let mut bytes = [0; 4096];
    while let Ok(count) = line.read(&mut bytes) {
        if count == 0 || port.write_all(&bytes[..count]).is_err() {
            break;
        }
    }
    let _ = line.shutdown(Shutdown::Both);
}

impl Read for SerialPort {
    /// Reads the bytes that have arrived; without any, fails with [`WouldBlock`](io::ErrorKind::WouldBlock).
    /// Returns 0 once the port is gone.
    fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        self.line()?.read(bytes)
    }
}

impl Write for SerialPort {
    /// Writes as much as fits into the port's buffer.
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.line()?.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

impl Drop for SerialPort {
    /// Closes the port when what was written has left it, so that it can be opened again at once.
    fn drop(&mut self) {
        let line = self.line.take();
        if let (Some(line), Some(sender)) = (&line, self.threads.last()) {
            let _ = line.shutdown(Shutdown::Write);
            let mut patience = LEAVING;
            while !sender.is_finished() && patience > 0 {
                pause();
                patience -= 1;
            }
        }
        self.flags.is_closing.store(true, Ordering::Release);
        if let Some(line) = line {
            let _ = line.shutdown(Shutdown::Both);
        }
        for thread in self.threads.drain(..) {
            while !thread.is_finished() {
                // SAFETY: the handle is open. There may be nothing to cancel.
                let _ = unsafe { CancelIoEx(self.port.as_raw_handle(), std::ptr::null()) };
                pause();
            }
            // A thread that panicked has closed its end as well.
            let _ = thread.join();
        }
    }
}

impl AsSocket for SerialPort {
    fn as_socket(&self) -> BorrowedSocket<'_> {
        self.line
            .as_ref()
            .expect("it is taken out when the port is dropped")
            .as_socket()
    }
}
