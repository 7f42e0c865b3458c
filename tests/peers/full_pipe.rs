//! A full pipe that is not read.
#![cfg(unix)]
#![allow(unreachable_pub, reason = "a benchmark uses it, too")]

use std::io::{ErrorKind, PipeReader, PipeWriter, Write as _};

use rustix::fs::{OFlags, fcntl_getfl, fcntl_setfl};

/// Both ends of a full pipe: a write blocks until it is read.
pub fn full_pipe() -> (PipeReader, PipeWriter) {
    let (reader, mut writer) = std::io::pipe().expect("a pipe");
    let flags = fcntl_getfl(&writer).expect("it is open");
    fcntl_setfl(&writer, flags | OFlags::NONBLOCK).expect("it is open");
    for size in [4096, 1] {
        loop {
            match writer.write(&[b'.'; 4096][..size]) {
                Ok(_) => {}
                Err(error) if error.kind() == ErrorKind::WouldBlock => break,
                Err(error) => panic!("{error}"),
            }
        }
    }
    fcntl_setfl(&writer, flags).expect("it is open");
    (reader, writer)
}
