//! Serial ports of Unix.

use std::fs::File;
use std::io::{self, Read, Write};
use std::path::Path;

use rustix::fd::{AsFd, BorrowedFd};
use rustix::fs::{FlockOperation, Mode, OFlags, flock, open};
use rustix::io::Errno;
use rustix::termios::{
    ControlModes, InputModes, LocalModes, OptionalActions, OutputModes, QueueSelector,
    SpecialCodeIndex, Termios, ioctl_tiocexcl, ioctl_tiocnxcl, tcflush, tcgetattr, tcsetattr,
};

use super::{Parity, SerialSettings};
use crate::os::pseudo_terminal::names_pseudo_terminal;

/// An open serial port. Reading and writing never block; a [`PollSet`](crate::os::PollSet) can wait for it.
#[derive(Debug)]
pub struct SerialPort(File);

impl SerialPort {
    /// Opens the port that the system calls `device`, for exclusive use.
    ///
    /// # Errors
    ///
    /// The port does not exist, is no serial port, is in use by another program, or does not support the settings.
    pub fn open(device: &Path, settings: SerialSettings) -> io::Result<Self> {
        Self::open_for(device, settings, OFlags::RDWR)
    }

    /// As [`open`](Self::open), for reading alone: the system refuses every write.
    ///
    /// # Errors
    ///
    /// As of [`open`](Self::open).
    pub fn open_to_listen(device: &Path, settings: SerialSettings) -> io::Result<Self> {
        Self::open_for(device, settings, OFlags::RDONLY)
    }

    fn open_for(device: &Path, settings: SerialSettings, access: OFlags) -> io::Result<Self> {
        let flags = access | OFlags::NOCTTY | OFlags::NONBLOCK | OFlags::CLOEXEC;
        let port = open(device, flags, Mode::empty())?;
        let is_pseudo = is_pseudo_terminal(device);
        if is_pseudo {
            // The flag of exclusive use would outlive a killed program, since the far end keeps the near one open;
            // a lock ends with its program.
            flock(&port, FlockOperation::NonBlockingLockExclusive).map_err(
                |error| match error {
                    Errno::WOULDBLOCK => Errno::BUSY,
                    other => other,
                },
            )?;
        }
        let mut attributes = tcgetattr(&port)?;
        attributes.make_raw();
        attributes.input_modes |= InputModes::IGNBRK;
        attributes.input_modes -= InputModes::INPCK | InputModes::IXON | InputModes::IXOFF;
        attributes.output_modes -= OutputModes::OPOST;
        attributes.local_modes -= LocalModes::ECHO | LocalModes::ICANON | LocalModes::ISIG;
        let control = &mut attributes.control_modes;
        *control -= ControlModes::CSIZE
            | ControlModes::PARENB
            | ControlModes::PARODD
            | ControlModes::CSTOPB
            | ControlModes::CRTSCTS;
        *control |= ControlModes::CREAD | ControlModes::CLOCAL;
        *control |= if settings.seven_bits {
            ControlModes::CS7
        } else {
            ControlModes::CS8
        };
        *control |= match settings.parity {
            Parity::Even => ControlModes::PARENB,
            Parity::Odd => ControlModes::PARENB | ControlModes::PARODD,
            Parity::None => ControlModes::empty(),
        };
        if settings.parity != Parity::None {
            // A character with wrong parity is read as zero; the checksum then finds the error.
            attributes.input_modes |= InputModes::INPCK;
        }
        if settings.two_stop_bits {
            attributes.control_modes |= ControlModes::CSTOPB;
        }
        attributes.special_codes[SpecialCodeIndex::VMIN] = 1;
        attributes.special_codes[SpecialCodeIndex::VTIME] = 0;
        attributes.set_speed(settings.baud)?;
        tcsetattr(&port, OptionalActions::Now, &attributes)?;
        check(&tcgetattr(&port)?, settings, is_pseudo)?;
        if settings.rs485 {
            switch_direction(&port)?;
        }
        ask_for_low_latency(&port);
        if !is_pseudo {
            ioctl_tiocexcl(&port)?;
        }
        tcflush(&port, QueueSelector::IOFlush)?;
        Ok(Self(File::from(port)))
    }

    /// From now on, marks characters that were damaged on the line, in the code that [`Marks`](crate::os::Marks)
    /// decodes. Without this, they are read as zero, which only a strong checksum detects.
    ///
    /// # Errors
    ///
    /// The port is gone.
    pub fn mark_damaged(&self) -> io::Result<()> {
        let mut attributes = tcgetattr(&self.0)?;
        attributes.input_modes -= InputModes::IGNBRK | InputModes::BRKINT | InputModes::IGNPAR;
        attributes.input_modes |= InputModes::INPCK | InputModes::PARMRK;
        tcsetattr(&self.0, OptionalActions::Now, &attributes)?;
        // Earlier bytes are not in this code.
        tcflush(&self.0, QueueSelector::IFlush)?;
        Ok(())
    }
}

/// Checks how the port's driver has applied the settings: some drivers round a rate, or leave the parity bit out,
/// without an error. A pseudo-terminal has neither.
fn check(has: &Termios, settings: SerialSettings, is_pseudo: bool) -> io::Result<()> {
    if is_pseudo {
        return Ok(());
    }
    let (baud, wanted) = (has.output_speed(), settings.baud);
    // Receivers tolerate 2 % at each end.
    if baud.abs_diff(wanted) > wanted / 50 {
        return Err(io::Error::other(format!("its driver sets {baud} baud")));
    }
    let parity = ControlModes::PARENB | ControlModes::PARODD;
    let wanted = match settings.parity {
        Parity::Even => ControlModes::PARENB,
        Parity::Odd => parity,
        Parity::None => ControlModes::empty(),
    };
    if has.control_modes & parity != wanted {
        return Err(io::Error::other("its driver does not set the parity bit"));
    }
    Ok(())
}

fn is_pseudo_terminal(device: &Path) -> bool {
    device
        .canonicalize()
        .is_ok_and(|path| names_pseudo_terminal(&path))
}

/// Asks the port's driver to deliver bytes at once: those of some USB adapters otherwise collect them for 16 ms. A
/// port without this setting works anyway.
#[cfg(target_os = "linux")]
#[allow(unsafe_code, reason = "no crate of ours wraps these requests")]
fn ask_for_low_latency(port: &impl AsFd) {
    use std::ffi::{c_int, c_uint, c_ulong, c_ushort};

    use rustix::ioctl::{Setter, Updater, ioctl};

    /// `struct serial_struct` of linux/tty.h.
    #[repr(C)]
    struct Serial {
        head: [c_int; 4],
        flags: c_int,
        sizes: [c_int; 3],
        close_delay: c_ushort,
        io_type: [u8; 2],
        hub6: c_int,
        closing_waits: [c_ushort; 2],
        iomem_base: usize,
        iomem_reg_shift: c_ushort,
        port_high: c_uint,
        iomap_base: c_ulong,
    }

    const TIOCGSERIAL: rustix::ioctl::Opcode = 0x541E;
    const TIOCSSERIAL: rustix::ioctl::Opcode = 0x541F;
    const LOW_LATENCY: c_int = 1 << 13;

    let mut serial = Serial {
        head: [0; 4],
        flags: 0,
        sizes: [0; 3],
        close_delay: 0,
        io_type: [0; 2],
        hub6: 0,
        closing_waits: [0; 2],
        iomem_base: 0,
        iomem_reg_shift: 0,
        port_high: 0,
        iomap_base: 0,
    };
    // SAFETY: the request writes one `serial_struct`, whose layout `Serial` has, and keeps no pointer to it.
    let is_read = unsafe { ioctl(port, Updater::<TIOCGSERIAL, Serial>::new(&mut serial)) }.is_ok();
    if is_read && serial.flags & LOW_LATENCY == 0 {
        serial.flags |= LOW_LATENCY;
        // SAFETY: likewise, read.
        let _ = unsafe { ioctl(port, Setter::<TIOCSSERIAL, Serial>::new(serial)) };
    }
}

#[cfg(not(target_os = "linux"))]
fn ask_for_low_latency(_port: &impl AsFd) {}

/// Lets the port's driver switch the direction by RTS, which is on while it sends.
#[cfg(target_os = "linux")]
#[allow(unsafe_code, reason = "no crate of ours wraps this request")]
fn switch_direction(port: &impl AsFd) -> io::Result<()> {
    use rustix::ioctl::{Setter, ioctl};

    /// `struct serial_rs485` of linux/serial.h: flags, delays in milliseconds before and after sending, padding.
    #[repr(C)]
    struct Rs485 {
        flags: u32,
        delay_before: u32,
        delay_after: u32,
        padding: [u32; 5],
    }

    const TIOCSRS485: rustix::ioctl::Opcode = 0x542F;
    const ENABLED: u32 = 1;
    const RTS_ON_SEND: u32 = 1 << 1;

    let settings = Rs485 {
        flags: ENABLED | RTS_ON_SEND,
        delay_before: 0,
        delay_after: 0,
        padding: [0; 5],
    };
    // SAFETY: the request reads one `serial_rs485`, whose layout `Rs485` has (32 bytes since Linux 2.6.34), and
    // keeps no pointer to it.
    unsafe { ioctl(port, Setter::<TIOCSRS485, Rs485>::new(settings)) }?;
    Ok(())
}

#[cfg(not(target_os = "linux"))]
fn switch_direction(_port: &impl AsFd) -> io::Result<()> {
    Err(io::ErrorKind::Unsupported.into())
}

impl Read for SerialPort {
    /// Reads the bytes that have arrived; without any, fails with [`WouldBlock`](io::ErrorKind::WouldBlock).
    /// Returns 0 once the port is gone.
    fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        self.0.read(bytes)
    }
}

impl Write for SerialPort {
    /// Writes as much as fits into the port's buffer.
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.0.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.0.flush()
    }
}

impl Drop for SerialPort {
    fn drop(&mut self) {
        // If another program has the port open as well, exclusive use would outlive this handle.
        let _ = ioctl_tiocnxcl(&self.0);
    }
}

impl AsFd for SerialPort {
    fn as_fd(&self) -> BorrowedFd<'_> {
        self.0.as_fd()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::os::PseudoTerminal;

    const SETTINGS: SerialSettings = SerialSettings {
        baud: 9600,
        parity: Parity::None,
        two_stop_bits: false,
        seven_bits: false,
        rs485: false,
    };

    #[test]
    fn a_pseudo_terminal_is_for_one_port_at_a_time_and_keeps_no_mark_of_it() {
        let (_far, near) = PseudoTerminal::open().expect("a pseudo-terminal");
        let port = SerialPort::open(&near, SETTINGS).expect("a port");
        let refused = SerialPort::open(&near, SETTINGS).expect_err("another one has it");
        assert_eq!(refused.kind(), io::ErrorKind::ResourceBusy);
        // A mark of exclusive use would lock out everybody but root, even after the program that set it was killed.
        let opened = File::open(&near);
        assert!(opened.is_ok(), "{opened:?}");
        drop(port);
        SerialPort::open(&near, SETTINGS).expect("it is free again");
    }

    #[test]
    fn a_port_that_was_opened_to_listen_reads_and_cannot_write() {
        let (mut far, near) = PseudoTerminal::open().expect("a pseudo-terminal");
        let mut port = SerialPort::open_to_listen(&near, SETTINGS).expect("a port");
        let refused = port.write(&[1]).expect_err("it only listens");
        assert_eq!(refused.raw_os_error(), Some(Errno::BADF.raw_os_error()));
        far.write_all(&[7]).expect("room");
        rustix::event::poll(
            &mut [rustix::event::PollFd::new(
                &port,
                rustix::event::PollFlags::IN,
            )],
            None,
        )
        .expect("it is there");
        let mut bytes = [0; 4];
        assert_eq!(port.read(&mut bytes).expect("a byte"), 1);
        assert_eq!(bytes[0], 7);
    }

    #[test]
    fn a_port_that_marks_damaged_characters_tells_them_from_the_character_ff() {
        use rustix::event::{PollFd, PollFlags, poll};

        let (mut far, near) = PseudoTerminal::open().expect("a pseudo-terminal");
        let mut port = SerialPort::open(&near, SETTINGS).expect("a port");
        port.mark_damaged().expect("it is there");
        let has = tcgetattr(&port).expect("it is there").input_modes;
        assert!(has.contains(InputModes::INPCK | InputModes::PARMRK));
        assert!(!has.intersects(InputModes::IGNBRK | InputModes::BRKINT | InputModes::IGNPAR));
        let sent = [0x10, 0xFF, 0x00, 0x80, 0xFF];
        far.write_all(&sent).expect("room");
        let (mut marks, mut read) = (crate::os::Marks::default(), Vec::<u8>::new());
        while read.len() < sent.len() {
            poll(&mut [PollFd::new(&port, PollFlags::IN)], None).expect("it is there");
            let mut bytes = [0; 16];
            let count = port.read(&mut bytes).expect("there is something");
            let characters = marks.read(&bytes[..count]);
            assert_eq!(characters.damaged, [0; 0]);
            read.extend(characters.bytes);
        }
        assert_eq!(read, sent);
    }

    #[test]
    fn a_port_that_was_not_set_as_wanted_is_refused() {
        let settings = SerialSettings {
            baud: 19_200,
            parity: Parity::Even,
            two_stop_bits: false,
            seven_bits: false,
            rs485: false,
        };
        let far = rustix::pty::openpt(rustix::pty::OpenptFlags::RDWR).expect("a pseudo-terminal");
        let mut has = tcgetattr(&far).expect("a terminal");
        has.control_modes -= ControlModes::PARODD;
        has.control_modes |= ControlModes::PARENB;
        for (baud, is_right) in [
            (19_200, true),
            (19_500, true),
            (18_800, false),
            (9_600, false),
        ] {
            has.set_speed(baud).expect("a rate");
            assert_eq!(check(&has, settings, false).is_ok(), is_right, "{baud}");
            assert!(check(&has, settings, true).is_ok());
        }
        has.set_speed(19_200).expect("a rate");
        has.control_modes |= ControlModes::PARODD;
        let error = check(&has, settings, false).expect_err("odd");
        assert!(error.to_string().contains("parity"), "{error}");
    }
}
