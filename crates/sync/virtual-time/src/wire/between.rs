//! The messages by which clients meet and exchange their values without the server.

use tickbus_base::time::Nanos;

use super::{
    AT, DIRECT, DONE, DONE_UNTIL, ENDED, FINISHED, HELLO, LONGEST_FRAME, MAGIC, MET, append, cut,
};
use crate::MemberList;
use crate::bytes::{Reader, count, declared, name, read_declared};

/// The longest address, in bytes.
pub(super) const LONGEST_ADDRESS: usize = 255;

/// A list is as long as a frame at most.
const _: () = assert!(MemberList::LONGEST == LONGEST_FRAME);

/// Appends the content of a list, for the client at `own`.
pub(super) fn write_members(out: &mut Vec<u8>, list: &MemberList, own: usize) {
    out.extend_from_slice(&list.token.to_le_bytes());
    out.extend_from_slice(&list.step.0.to_le_bytes());
    count(out, own);
    count(out, list.members.len());
    for (address, declaration) in &list.members {
        name(out, address);
        declared(out, declaration);
    }
}

/// Reads the content of a list.
pub(super) fn read_members(reader: &mut Reader<'_>) -> Result<MemberList, String> {
    let token = reader.word()?;
    let step = Nanos(reader.word()?.cast_signed());
    let own = u16::from_le_bytes(reader.take()?).into();
    let mut members = Vec::new();
    for _ in 0..u16::from_le_bytes(reader.take()?) {
        let address = reader.name()?.to_owned();
        members.push((address, read_declared(reader, true)?));
    }
    Ok(MemberList {
        token,
        step,
        own,
        members,
    })
}

/// Appends the address where other clients can connect, at most 255 bytes; an empty one: they cannot.
pub fn at(out: &mut Vec<u8>, token: u64, address: &str) {
    let address = if address.len() > LONGEST_ADDRESS {
        ""
    } else {
        address
    };
    append(out, AT, |out| {
        out.extend_from_slice(&token.to_le_bytes());
        out.extend_from_slice(address.as_bytes());
    });
}

/// Appends the result of connecting with the other clients: the reason why not all could be reached, or nothing.
pub fn met(out: &mut Vec<u8>, token: u64, reason: &str) {
    append(out, MET, |out| {
        out.extend_from_slice(&token.to_le_bytes());
        out.extend_from_slice(cut(reason).as_bytes());
    });
}

/// Appends the first frame of a connection between two clients, from the client at `own`.
pub fn hello(out: &mut Vec<u8>, token: u64, own: usize) {
    append(out, HELLO, |out| {
        out.extend_from_slice(&MAGIC);
        out.extend_from_slice(&DIRECT.to_le_bytes());
        out.extend_from_slice(&token.to_le_bytes());
        count(out, own);
    });
}

/// Reads the first frame of a connection between two clients, without its header: the token, and the place of the sender
/// in the list.
///
/// # Errors
///
/// How the frame violates the format.
pub fn read_hello(frame: &[u8]) -> Result<(u64, usize), String> {
    let mut reader = Reader::new(frame);
    if reader.byte()? != HELLO
        || reader.take::<4>()? != MAGIC
        || u16::from_le_bytes(reader.take()?) != DIRECT
    {
        return Err("sent something else than a greeting".to_owned());
    }
    let token = reader.word()?;
    let own = u16::from_le_bytes(reader.take()?).into();
    reader.finish()?;
    Ok((token, own))
}

/// True if a frame, without its header, holds a client's values of a step.
pub fn is_done(frame: &[u8]) -> bool {
    matches!(frame.first(), Some(&DONE | &DONE_UNTIL))
}

/// The step of a frame, without its header, that holds a client's values.
pub(crate) fn done_step(frame: &[u8]) -> Option<u64> {
    let sequence = frame.get(1..)?.first_chunk()?;
    is_done(frame).then(|| u64::from_le_bytes(*sequence))
}

/// True if a frame of the server, without its header, ends the run.
pub(crate) fn is_end(frame: &[u8]) -> bool {
    matches!(frame.first(), Some(&FINISHED | &ENDED))
}
