//! The messages as bytes; docs/sdsp.md describes the format for all implementations.
//!
//! A frame is a length of four bytes, a kind of one byte, and the content; the length includes the kind. Numbers are
//! little-endian.

mod between;
#[cfg(test)]
mod tests;

use tickbus_base::time::Nanos;
use tickbus_image::signal::DataType;

pub use crate::bytes::Slots;
use crate::bytes::{Reader, code, count, declared, place_code, read_declared, slots};
use crate::server::ToClient;
use crate::{Cause, Declaration, Ended, MemberList, Outcome, Step, TraceHash};
pub use between::{at, hello, is_done, met, read_hello};
pub(crate) use between::{done_step, is_end};

/// The version of this format. Joins of version 1 have no interval, and their clients get no [`ToClient::Waiting`] and
/// ask for no step. Clients of version 2 exchange nothing with each other, and those of version 3 save no state.
pub const VERSION: u16 = 4;

/// The first version whose clients can exchange their values without the server.
pub(crate) const DIRECT: u16 = 3;

/// The first version whose clients can save their states.
pub(crate) const STATE: u16 = 4;

pub use crate::saved_run::LONGEST_STATE;

/// The oldest version that a server accepts.
const OLDEST: u16 = 1;

/// The longest frame, without the four bytes of its length.
pub const LONGEST_FRAME: usize = 1 << 20;

/// The bytes of a frame's length.
pub const HEADER: usize = 4;

/// The values that a client writes and its state fit into one frame.
const _: () = assert!(11 + 8 * 65_535 + LONGEST_STATE <= LONGEST_FRAME);

/// The longest reason, in bytes; longer ones are cut.
const LONGEST_REASON: usize = 4096;

/// The first bytes of a join.
const MAGIC: [u8; 4] = *b"SDSP";

const JOIN: u8 = 0x01;
const DONE: u8 = 0x02;
const GIVE_UP: u8 = 0x03;
const DONE_UNTIL: u8 = 0x04;
const AT: u8 = 0x05;
const MET: u8 = 0x06;
const HELLO: u8 = 0x07;
const SAVED: u8 = 0x08;
const START: u8 = 0x81;
const STEP: u8 = 0x82;
const FINISHED: u8 = 0x83;
const ENDED: u8 = 0x84;
const WAITING: u8 = 0x85;
const MEET: u8 = 0x86;
const MEMBERS: u8 = 0x87;
const UNTIL: u8 = 0x88;
const SAVE: u8 = 0x89;
const RESTORE: u8 = 0x8A;

/// A message of a client.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum FromClient<'a> {
    /// The first message: the variables that the client writes and reads.
    Join {
        /// The declaration.
        declaration: Declaration,
        /// The client's version of the format.
        version: u16,
    },
    /// The client has run.
    Done {
        /// The step; 0 is the initial write.
        sequence: u64,
        /// The step in which the client wants to run next; 0: as declared.
        next: u64,
        /// The values that the client writes, in the order of its declaration.
        writes: Slots<'a>,
    },
    /// The client cannot or will not continue.
    GiveUp(&'a str),
    /// The answer to [`ToClient::Meet`].
    At {
        /// The token of the request.
        token: u64,
        /// The address where the other clients can connect; empty if they cannot.
        address: &'a str,
    },
    /// The answer to [`ToClient::Members`].
    Met {
        /// The token of the request.
        token: u64,
        /// Why not all clients could be reached; empty if all were.
        reason: &'a str,
    },
    /// The answer to [`ToClient::Save`].
    Saved {
        /// The step.
        sequence: u64,
        /// The state of the client after it, or why it has none to give.
        state: Result<&'a [u8], &'a str>,
    },
}

/// A message of the server, as a client reads it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum FromServer<'a> {
    /// Everyone has joined; see [`ToClient::Start`].
    Start {
        /// The virtual time of one step of the server.
        step: Nanos,
        /// The types of the variables that the client reads.
        reads: Vec<DataType>,
    },
    /// See [`ToClient::Step`].
    Step {
        /// The step.
        step: Step,
        /// The values that the client reads.
        reads: Slots<'a>,
    },
    /// See [`ToClient::End`].
    End(Result<Outcome, Ended>),
    /// See [`ToClient::Waiting`].
    Waiting(&'a str),
    /// See [`ToClient::Meet`].
    Meet(u64),
    /// See [`ToClient::Members`].
    Members(MemberList),
    /// See [`ToClient::Until`].
    Until(u64),
    /// See [`ToClient::Save`].
    Save(u64),
    /// See [`ToClient::Restore`].
    Restore {
        /// The step.
        sequence: u64,
        /// The values that the client had written.
        writes: Slots<'a>,
        /// The state.
        state: &'a [u8],
    },
}

/// The length of the frame at the beginning of `bytes`, with its header, if already known.
///
/// # Errors
///
/// The frame is not valid.
pub fn frame_length(bytes: &[u8]) -> Result<Option<usize>, String> {
    let Some(header) = bytes.first_chunk::<HEADER>() else {
        return Ok(None);
    };
    let length = u32::from_le_bytes(*header);
    match usize::try_from(length) {
        Ok(length @ 1..=LONGEST_FRAME) => Ok(Some(HEADER + length)),
        _ => Err(format!(
            "sent a frame of {length} bytes, expected 1 to {LONGEST_FRAME}"
        )),
    }
}

/// The frame at the beginning of `bytes`, without its header, if it is complete.
///
/// # Errors
///
/// The frame is not valid.
pub fn frame(bytes: &[u8]) -> Result<Option<&[u8]>, String> {
    let length = frame_length(bytes)?;
    Ok(length.and_then(|length| bytes.get(HEADER..length)))
}

/// Appends a frame to `out`.
fn append(out: &mut Vec<u8>, kind: u8, content: impl FnOnce(&mut Vec<u8>)) {
    let start = out.len();
    out.extend_from_slice(&[0; HEADER]);
    out.push(kind);
    content(out);
    let length = out.len() - start - HEADER;
    debug_assert!(length <= LONGEST_FRAME, "a frame of {length} bytes");
    let length = u32::try_from(length).expect("a frame has its limit");
    out[start..start + HEADER].copy_from_slice(&length.to_le_bytes());
}

/// Appends the join of a client with this declaration, which was [checked](Declaration::check).
///
/// # Errors
///
/// The names are too long to be sent.
pub fn join(out: &mut Vec<u8>, declaration: &Declaration) -> Result<(), String> {
    let start = out.len();
    // Not by `append`: a frame that is too long is an error here, not a bug.
    out.extend_from_slice(&[0; HEADER]);
    out.push(JOIN);
    out.extend_from_slice(&MAGIC);
    out.extend_from_slice(&VERSION.to_le_bytes());
    declared(out, declaration);
    let length = out.len() - start - HEADER;
    if length > LONGEST_FRAME {
        out.truncate(start);
        return Err(format!(
            "the names of its variables take {length} bytes, of {LONGEST_FRAME} at most; shorten them"
        ));
    }
    let length = u32::try_from(length).expect("a frame has its limit");
    out[start..start + HEADER].copy_from_slice(&length.to_le_bytes());
    Ok(())
}

/// Appends the values that a client writes after its run of the step `sequence`. It runs next in the step `next`; 0: as
/// declared.
pub fn done(out: &mut Vec<u8>, sequence: u64, next: u64, writes: &[u64]) {
    let kind = if next == 0 { DONE } else { DONE_UNTIL };
    append(out, kind, |out| {
        out.extend_from_slice(&sequence.to_le_bytes());
        if next != 0 {
            out.extend_from_slice(&next.to_le_bytes());
        }
        slots(out, writes);
    });
}

/// Appends a message that a client gives up for this reason.
pub fn give_up(out: &mut Vec<u8>, reason: &str) {
    append(out, GIVE_UP, |out| {
        out.extend_from_slice(cut(reason).as_bytes());
    });
}

/// Appends the state of a client after the step `sequence`, or why it has none to give.
///
/// # Panics
///
/// If the state is longer than [`LONGEST_STATE`].
pub fn saved(out: &mut Vec<u8>, sequence: u64, state: Result<&[u8], &str>) {
    append(out, SAVED, |out| {
        out.extend_from_slice(&sequence.to_le_bytes());
        out.push(state.is_ok().into());
        match state {
            Ok(state) => {
                assert!(state.len() <= LONGEST_STATE, "a state has its limit");
                out.extend_from_slice(state);
            }
            Err(reason) => out.extend_from_slice(cut(reason).as_bytes()),
        }
    });
}

/// Appends a message of the server.
pub fn to_client(out: &mut Vec<u8>, message: &ToClient<'_>) {
    match message {
        ToClient::Start { step, reads } => append(out, START, |out| {
            out.extend_from_slice(&step.0.to_le_bytes());
            out.extend(reads.iter().map(|data_type| code(*data_type)));
        }),
        ToClient::Step { step, reads } => append(out, STEP, |out| {
            out.extend_from_slice(&step.sequence.to_le_bytes());
            out.extend_from_slice(&step.time.0.to_le_bytes());
            slots(out, reads);
        }),
        ToClient::Waiting(what) => append(out, WAITING, |out| {
            out.extend_from_slice(cut(what).as_bytes());
        }),
        ToClient::Meet(token) => append(out, MEET, |out| {
            out.extend_from_slice(&token.to_le_bytes());
        }),
        ToClient::Members(own, list) => append(out, MEMBERS, |out| {
            between::write_members(out, list, *own);
        }),
        ToClient::Until(step) => append(out, UNTIL, |out| {
            out.extend_from_slice(&step.to_le_bytes());
        }),
        ToClient::Save(step) => append(out, SAVE, |out| {
            out.extend_from_slice(&step.to_le_bytes());
        }),
        ToClient::Restore {
            sequence,
            writes,
            state,
        } => append(out, RESTORE, |out| {
            out.extend_from_slice(&sequence.to_le_bytes());
            count(out, writes.len());
            slots(out, writes);
            out.extend_from_slice(state);
        }),
        ToClient::End(Ok(outcome)) => append(out, FINISHED, |out| {
            out.extend_from_slice(&outcome.steps.to_le_bytes());
            out.extend_from_slice(&outcome.time.0.to_le_bytes());
            out.extend_from_slice(&outcome.hash.0.to_le_bytes());
        }),
        ToClient::End(Err(ended)) => append(out, ENDED, |out| {
            let cause = Cause::ALL.iter().position(|cause| *cause == ended.cause);
            out.push(place_code(cause));
            out.extend_from_slice(&ended.steps.to_le_bytes());
            let client = ended.client.as_deref().unwrap_or("");
            // The name of a refused client may be longer than allowed; then it is left out.
            let length = u8::try_from(client.len()).unwrap_or(0);
            out.push(length);
            out.extend_from_slice(&client.as_bytes()[..usize::from(length)]);
            out.extend_from_slice(cut(&ended.reason).as_bytes());
        }),
    }
}

/// Reads a message of a client, without its header.
///
/// # Errors
///
/// How the message violates the format, as the continuation of "the client …".
pub fn from_client(frame: &[u8]) -> Result<FromClient<'_>, String> {
    let mut reader = Reader::new(frame);
    let message = match reader.byte()? {
        JOIN => read_join(&mut reader)?,
        DONE => FromClient::Done {
            sequence: reader.word()?,
            next: 0,
            writes: reader.slots()?,
        },
        DONE_UNTIL => FromClient::Done {
            sequence: reader.word()?,
            next: match reader.word()? {
                0 => return Err("asked for step 0 as its next one; expected 1 or more".to_owned()),
                next => next,
            },
            writes: reader.slots()?,
        },
        GIVE_UP => FromClient::GiveUp(reader.rest_as_text()?),
        AT => FromClient::At {
            token: reader.word()?,
            address: match reader.rest_as_text()? {
                long if long.len() > between::LONGEST_ADDRESS => {
                    return Err(format!("sent an address of {} bytes", long.len()));
                }
                address => address,
            },
        },
        MET => FromClient::Met {
            token: reader.word()?,
            reason: reader.rest_as_text()?,
        },
        SAVED => FromClient::Saved {
            sequence: reader.word()?,
            state: match reader.byte()? {
                0 => Err(reader.rest_as_text()?),
                1 => match reader.rest() {
                    long if long.len() > LONGEST_STATE => {
                        return Err(format!(
                            "sent a state of {} bytes, {LONGEST_STATE} at most",
                            long.len()
                        ));
                    }
                    state => Ok(state),
                },
                other => return Err(format!("sent a state of the unknown kind {other}")),
            },
        },
        kind => return Err(format!("sent a message of the unknown kind 0x{kind:02X}")),
    };
    reader.finish()?;
    Ok(message)
}

fn read_join<'a>(reader: &mut Reader<'_>) -> Result<FromClient<'a>, String> {
    if reader.take::<4>()? != MAGIC {
        return Err("sent a join without the letters SDSP".to_owned());
    }
    let version = u16::from_le_bytes(reader.take()?);
    if !(OLDEST..=VERSION).contains(&version) {
        return Err(format!(
            "speaks version {version} of the format, and this server versions {OLDEST} to {VERSION}"
        ));
    }
    let declaration = read_declared(reader, version != OLDEST)?;
    Ok(FromClient::Join {
        declaration,
        version,
    })
}

/// Reads a message of the server, without its header.
///
/// # Errors
///
/// How the message violates the format, as the continuation of "the server …".
pub fn from_server(frame: &[u8]) -> Result<FromServer<'_>, String> {
    let mut reader = Reader::new(frame);
    let nanos = |word: u64| Nanos(word.cast_signed());
    let message = match reader.byte()? {
        START => {
            let step = nanos(reader.word()?);
            let mut reads = Vec::new();
            while !reader.is_at_end() {
                reads.push(reader.data_type()?);
            }
            FromServer::Start { step, reads }
        }
        STEP => FromServer::Step {
            step: Step {
                sequence: reader.word()?,
                time: nanos(reader.word()?),
            },
            reads: reader.slots()?,
        },
        WAITING => FromServer::Waiting(reader.rest_as_text()?),
        MEET => FromServer::Meet(reader.word()?),
        MEMBERS => FromServer::Members(between::read_members(&mut reader)?),
        UNTIL => FromServer::Until(reader.word()?),
        SAVE => FromServer::Save(reader.word()?),
        RESTORE => FromServer::Restore {
            sequence: reader.word()?,
            writes: {
                let count = u16::from_le_bytes(reader.take()?);
                reader.words(count.into())?
            },
            state: reader.rest(),
        },
        FINISHED => FromServer::End(Ok(Outcome {
            steps: reader.word()?,
            time: nanos(reader.word()?),
            hash: TraceHash(reader.word()?),
        })),
        ENDED => {
            let code = reader.byte()?;
            let cause = Cause::ALL.get(usize::from(code).wrapping_sub(1));
            let cause = *cause.ok_or_else(|| format!("sent the unknown cause {code}"))?;
            let steps = reader.word()?;
            let client = reader.name()?;
            FromServer::End(Err(Ended {
                cause,
                client: (!client.is_empty()).then(|| client.to_owned()),
                reason: reader.rest_as_text()?.to_owned(),
                steps,
            }))
        }
        kind => return Err(format!("sent a message of the unknown kind 0x{kind:02X}")),
    };
    reader.finish()?;
    Ok(message)
}

/// The first [`LONGEST_REASON`] bytes at most.
fn cut(reason: &str) -> &str {
    let end = (0..=reason.len().min(LONGEST_REASON)).rev();
    let end = end.into_iter().find(|end| reason.is_char_boundary(*end));
    &reason[..end.unwrap_or(0)]
}
