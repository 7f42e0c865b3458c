//! A helper of Windows reads a note from stdin, with the line and the memory that its host has duplicated into it.

#![allow(
    unsafe_code,
    reason = "handles are duplicated into another process, and opened there"
)]

use std::ffi::c_void;
use std::io::{self, Read as _, Write as _};
use std::mem::MaybeUninit;
use std::net::TcpStream;
use std::os::windows::io::{
    AsHandle as _, AsRawHandle as _, AsRawSocket as _, FromRawHandle as _, FromRawSocket as _,
    OwnedHandle, OwnedSocket, RawSocket,
};
use std::os::windows::process::CommandExt as _;
use std::path::Path;
use std::process::{Child, Command, ExitStatus, Stdio};

use windows_sys::Win32::Foundation::{
    DUPLICATE_SAME_ACCESS, DuplicateHandle, INVALID_HANDLE_VALUE, NTSTATUS,
    STATUS_ACCESS_VIOLATION, STATUS_ILLEGAL_INSTRUCTION, STATUS_INTEGER_DIVIDE_BY_ZERO,
    STATUS_STACK_BUFFER_OVERRUN, STATUS_STACK_OVERFLOW,
};
use windows_sys::Win32::Networking::WinSock::{
    FROM_PROTOCOL_INFO, INVALID_SOCKET, WSA_FLAG_NO_HANDLE_INHERIT, WSA_FLAG_OVERLAPPED,
    WSADuplicateSocketW, WSAGetLastError, WSAPROTOCOL_INFOW, WSASocketW,
};
use windows_sys::Win32::System::Diagnostics::Debug::{
    SEM_FAILCRITICALERRORS, SEM_NOGPFAULTERRORBOX, SetErrorMode,
};
use windows_sys::Win32::System::Threading::{
    CREATE_NEW_PROCESS_GROUP, CREATE_NO_WINDOW, GetCurrentProcess, TerminateProcess,
};

use super::MemoryFile;
use crate::net::local_pair;

pub(super) type Line = TcpStream;

/// The first bytes of a note.
const MARK: [u8; 8] = *b"tickbus\x01";

/// The exit code of a process that was terminated by us or by the task manager.
const TERMINATED: u32 = 1;

pub(super) fn start(
    program: &Path,
    command: &str,
    memory: Option<&MemoryFile>,
) -> io::Result<(Child, Line)> {
    let (line, theirs) = local_pair()?;
    let stderr = || io::stderr().as_handle().try_clone_to_owned();
    let mut child = Command::new(program)
        .arg(command)
        .stdin(Stdio::piped())
        .stdout(stderr().map_or_else(|_| Stdio::null(), Stdio::from))
        .stderr(stderr().map_or_else(|_| Stdio::null(), Stdio::from))
        // A window of its own would open beside a simulator's; and Ctrl-C goes to the processes of the console's group.
        .creation_flags(CREATE_NO_WINDOW | CREATE_NEW_PROCESS_GROUP)
        .spawn()?;
    let mut note = MARK.to_vec();
    note.extend(socket_for(&child, &theirs)?);
    let memory = memory.map_or(Ok(0), |memory| handle_for(&child, memory))?;
    note.extend((memory as u64).to_le_bytes());
    if let Some(mut stdin) = child.stdin.take() {
        // A program that does not read is no helper, as its silence on the line will show.
        let _ = stdin.write_all(&note);
    }
    Ok((child, line))
}

/// Duplicates a socket into another process, which opens it by these bytes.
fn socket_for(child: &Child, socket: &TcpStream) -> io::Result<Vec<u8>> {
    let mut info = MaybeUninit::<WSAPROTOCOL_INFOW>::zeroed();
    let handle = socket.as_raw_socket() as usize;
    // SAFETY: the socket is open, and the function fills the structure.
    let result = unsafe { WSADuplicateSocketW(handle, child.id(), info.as_mut_ptr()) };
    if result != 0 {
        return Err(last_of_sockets());
    }
    // SAFETY: a structure of numbers, zeroed and then filled, has no byte that is not initialised.
    let bytes = unsafe {
        std::slice::from_raw_parts(info.as_ptr().cast::<u8>(), size_of::<WSAPROTOCOL_INFOW>())
    };
    Ok(bytes.to_vec())
}

/// Duplicates the handle of the memory into another process; returns its number there.
fn handle_for(child: &Child, memory: &MemoryFile) -> io::Result<usize> {
    let mut theirs = INVALID_HANDLE_VALUE;
    // SAFETY: the three handles are open.
    let done = unsafe {
        DuplicateHandle(
            GetCurrentProcess(),
            memory.as_raw_handle(),
            child.as_raw_handle(),
            &raw mut theirs,
            0,
            0,
            DUPLICATE_SAME_ACCESS,
        )
    };
    if done == 0 {
        return Err(io::Error::last_os_error());
    }
    Ok(theirs as usize)
}

pub(super) fn take_over(expects_memory: bool) -> io::Result<(Line, Option<MemoryFile>)> {
    // A crash ends the process at once: no window asks what to do about it.
    // SAFETY: the call has no preconditions.
    unsafe { SetErrorMode(SEM_FAILCRITICALERRORS | SEM_NOGPFAULTERRORBOX) };
    // Sockets work only after the first one of std.
    drop(std::net::UdpSocket::bind("127.0.0.1:0")?);
    let mut stdin = io::stdin().lock();
    let mut mark = [0; MARK.len()];
    stdin.read_exact(&mut mark)?;
    if mark != MARK {
        return Err(io::ErrorKind::InvalidData.into());
    }
    let mut info = [0; size_of::<WSAPROTOCOL_INFOW>()];
    stdin.read_exact(&mut info)?;
    let mut memory = [0; 8];
    stdin.read_exact(&mut memory)?;
    let line = opened_socket(&info)?;
    let memory = usize::try_from(u64::from_le_bytes(memory)).unwrap_or(0);
    if !expects_memory {
        return Ok((line, None));
    }
    if memory == 0 {
        return Err(io::ErrorKind::InvalidData.into());
    }
    // SAFETY: the host has duplicated this handle into this process, and nothing else uses it.
    let memory = unsafe { OwnedHandle::from_raw_handle(memory as *mut c_void) };
    Ok((line, Some(memory)))
}

/// Opens the socket that the host has duplicated.
fn opened_socket(info: &[u8; size_of::<WSAPROTOCOL_INFOW>()]) -> io::Result<TcpStream> {
    // SAFETY: a structure of numbers, for which all bytes are valid.
    let info: WSAPROTOCOL_INFOW = unsafe { std::ptr::read_unaligned(info.as_ptr().cast()) };
    // SAFETY: the structure is the one that the system has made for this process.
    let socket = unsafe {
        WSASocketW(
            FROM_PROTOCOL_INFO,
            FROM_PROTOCOL_INFO,
            FROM_PROTOCOL_INFO,
            &raw const info,
            0,
            WSA_FLAG_OVERLAPPED | WSA_FLAG_NO_HANDLE_INHERIT,
        )
    };
    if socket == INVALID_SOCKET {
        return Err(last_of_sockets());
    }
    // SAFETY: the socket was just opened, and nothing else uses it.
    let socket = unsafe { OwnedSocket::from_raw_socket(socket as RawSocket) };
    Ok(socket.into())
}

fn last_of_sockets() -> io::Error {
    // SAFETY: the call has no preconditions.
    io::Error::from_raw_os_error(unsafe { WSAGetLastError() })
}

pub(super) fn kill_this_process() {
    // SAFETY: the call has no preconditions; it does not return.
    let _ = unsafe { TerminateProcess(GetCurrentProcess(), TERMINATED) };
}

pub(super) fn send_quietly(mut line: &Line, bytes: &[u8]) -> io::Result<usize> {
    line.write(bytes)
}

/// The exit codes of processes that the system ends, and their usual cause.
const CODES: [(NTSTATUS, &str); 5] = [
    (
        STATUS_ACCESS_VIOLATION,
        "an access to memory that is not its own",
    ),
    (STATUS_STACK_OVERFLOW, "a stack overflow"),
    (
        STATUS_STACK_BUFFER_OVERRUN,
        "abort, which it calls for itself",
    ),
    (STATUS_INTEGER_DIVIDE_BY_ZERO, "a division by zero"),
    (STATUS_ILLEGAL_INSTRUCTION, "an illegal instruction"),
];

pub(super) fn ending(status: ExitStatus) -> String {
    let Some(code) = status.code() else {
        return "ended".to_owned();
    };
    match CODES.iter().find(|known| known.0 == code) {
        Some((_, cause)) => format!("was ended by {cause} (0x{code:08X})"),
        None => format!("ended with exit code {code}"),
    }
}

pub(super) fn was_killed(_status: ExitStatus) -> bool {
    // A process that was terminated has the exit code that the other one chose.
    false
}
