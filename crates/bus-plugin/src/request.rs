//! Messages from a host to its helper.

use std::ffi::OsStr;
use std::os::unix::ffi::OsStrExt as _;

use super::setup::{Setup, Station};
use super::wire::{Fields, Letter, Message, WireError};
use tickbus_fieldbus::Role;

/// The most options or stations of a setup.
const LIST_LIMIT: u32 = 10_000;

/// A request from a host to its helper. The end of the stream asks it to close and end.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Request {
    /// Load the library and open its bus. Sent first.
    Open {
        setup: Setup,
        /// How long the library may take to close, in milliseconds, if the host has gone.
        grace_ms: u64,
    },
    /// Exchange: the bytes to send are in the shared memory.
    Exchange,
}

impl Request {
    /// The bytes to send.
    pub(super) fn write(&self) -> Vec<u8> {
        match self {
            Self::Open { setup, grace_ms } => write_setup(Letter::new(1).long(*grace_ms), setup),
            Self::Exchange => Letter::new(2),
        }
        .seal()
    }
}

fn write_setup(letter: Letter, setup: &Setup) -> Letter {
    letter
        .bytes(setup.library.as_os_str().as_bytes())
        .text(&setup.name)
        .text(&setup.directory)
        .byte(match setup.role {
            Role::Device => 0,
            Role::Controller => 1,
        })
        .list(&setup.options, |letter, (key, value)| {
            letter.text(key).text(value)
        })
        .list(&setup.stations, |letter, station| {
            letter.text(&station.name).word(station.tx).word(station.rx)
        })
        .word(setup.timeout_ms)
        .long(setup.cycle_ns)
        .long(setup.max_age_ns)
}

fn read_setup(fields: &mut Fields<'_>) -> Result<Setup, WireError> {
    Ok(Setup {
        library: OsStr::from_bytes(fields.bytes()?).into(),
        name: fields.text()?,
        directory: fields.text()?,
        role: match fields.byte()? {
            0 => Role::Device,
            1 => Role::Controller,
            _ => return Err(fields.wrong("an unknown role")),
        },
        options: fields.list(LIST_LIMIT, |fields| Ok((fields.text()?, fields.text()?)))?,
        stations: fields.list(LIST_LIMIT, |fields| {
            Ok(Station {
                name: fields.text()?,
                tx: fields.word()?,
                rx: fields.word()?,
            })
        })?,
        timeout_ms: fields.word()?,
        cycle_ns: fields.long()?,
        max_age_ns: fields.long()?,
    })
}

impl Message for Request {
    const MOST: usize = 4 << 20;

    fn read(kind: u8, fields: &mut Fields<'_>) -> Result<Self, WireError> {
        Ok(match kind {
            1 => Self::Open {
                grace_ms: fields.long()?,
                setup: read_setup(fields)?,
            },
            2 => Self::Exchange,
            other => return Err(WireError::Kind(other)),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::super::wire::Inbox;
    use super::*;

    #[test]
    fn requests_arrive_as_they_were_sent() {
        let station = |name: &str, tx, rx| Station {
            name: name.to_owned(),
            tx,
            rx,
        };
        let setup = Setup {
            library: OsStr::from_bytes(b"/opt/vendor \xFF/libx.so").into(),
            name: "Zelle 4".to_owned(),
            directory: "/opt/cell".to_owned(),
            role: Role::Controller,
            options: vec![("card".to_owned(), "0".to_owned())],
            stations: vec![station("left", 3, 0), station("right", 1, 70_000)],
            timeout_ms: 10,
            cycle_ns: 10_000_000,
            max_age_ns: u64::MAX,
        };
        let open = Request::Open {
            setup,
            grace_ms: 2000,
        };
        let mut inbox = Inbox::new();
        for sent in [open, Request::Exchange] {
            let bytes = sent.write();
            let (last, all_but) = bytes.split_last().expect("not empty");
            inbox.push(all_but);
            assert_eq!(inbox.take::<Request>(), Ok(None));
            inbox.push(&[*last]);
            assert_eq!(inbox.take(), Ok(Some(sent)));
        }
    }
}
