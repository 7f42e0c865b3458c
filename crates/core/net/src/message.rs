//! The format of messages between a host and its helper process: a little-endian 32-bit length, and as many bytes of
//! `postcard`.
//!
//! Both ends are the same program on the same computer; messages are checked because a library may have damaged its
//! helper.

use serde::Serialize;
use serde::de::DeserializeOwned;

/// Why bytes are not a message.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum WireError {
    /// The length exceeds that of any message.
    #[error("a message of {length} bytes, expected at most {most}")]
    TooLong {
        /// The stated length.
        length: usize,
        /// The longest accepted length.
        most: usize,
    },
    /// The kind of message does not exist, or its fields end too early or have invalid values.
    #[error("a message that cannot be read ({0})")]
    Unreadable(#[from] postcard::Error),
    /// The fields end before the message.
    #[error("a message with bytes left over")]
    LeftOver,
}

/// A message of one direction, between a host and its helper process.
pub trait Message: Serialize + DeserializeOwned {
    /// The longest message in bytes, without its length.
    const MOST: usize;

    /// The bytes to send.
    fn write(&self) -> Vec<u8> {
        let mut bytes = postcard::to_extend(self, vec![0; 4]).expect("memory takes any message");
        let length = u32::try_from(bytes.len() - 4).expect("messages are far below 4 GiB");
        bytes[..4].copy_from_slice(&length.to_le_bytes());
        bytes
    }
}

/// Splits a stream of bytes into messages.
#[derive(Debug, Default)]
pub struct Inbox {
    bytes: Vec<u8>,
}

impl Inbox {
    /// An empty inbox.
    pub fn new() -> Self {
        Self::default()
    }

    /// Appends received bytes.
    pub fn push(&mut self, bytes: &[u8]) {
        self.bytes.extend_from_slice(bytes);
    }

    /// The next whole message, if it has arrived.
    ///
    /// # Errors
    ///
    /// The bytes are not a message. There is no way to continue after them.
    pub fn take<M: Message>(&mut self) -> Result<Option<M>, WireError> {
        let Some((length, rest)) = self.bytes.split_first_chunk::<4>() else {
            return Ok(None);
        };
        let length = u32::from_le_bytes(*length) as usize;
        if length > M::MOST {
            return Err(WireError::TooLong {
                length,
                most: M::MOST,
            });
        }
        let Some(message) = rest.get(..length) else {
            return Ok(None);
        };
        let (read, rest) = postcard::take_from_bytes(message)?;
        if !rest.is_empty() {
            return Err(WireError::LeftOver);
        }
        self.bytes.drain(..4 + length);
        Ok(Some(read))
    }
}
