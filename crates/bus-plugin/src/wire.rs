//! The format of messages between host and helper: length, kind, fields.
//!
//! A message is a 32-bit length, one byte with its kind, and its fields; the length counts kind and fields.
//! Numbers are little-endian; a text is a 32-bit length and its bytes. Both ends are the same program on the
//! same computer; messages are checked because a library may have damaged its helper.

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
    /// The kind of message does not exist.
    #[error("a message of the unknown kind {0}")]
    Kind(u8),
    /// The fields end too early, are too long, or have invalid values.
    #[error("a message of kind {kind} with {what}")]
    Fields {
        /// The kind of message.
        kind: u8,
        /// What is wrong with it.
        what: &'static str,
    },
}

/// A message of one direction.
pub trait Message: Sized {
    /// The longest message: kind and fields, in bytes.
    const MOST: usize;

    /// Reads the fields of a message of this kind.
    ///
    /// # Errors
    ///
    /// The kind is unknown, or the fields are wrong.
    fn read(kind: u8, fields: &mut Fields<'_>) -> Result<Self, WireError>;
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
        let Some((&kind, bytes)) = message.split_first() else {
            return Err(WireError::Kind(0));
        };
        let mut fields = Fields { kind, bytes };
        let read = M::read(kind, &mut fields)?;
        if !fields.bytes.is_empty() {
            return Err(fields.wrong("bytes left over"));
        }
        self.bytes.drain(..4 + length);
        Ok(Some(read))
    }
}

/// The fields of a message, read one after another.
#[derive(Debug)]
pub struct Fields<'a> {
    kind: u8,
    bytes: &'a [u8],
}

impl<'a> Fields<'a> {
    pub(super) fn wrong(&self, what: &'static str) -> WireError {
        WireError::Fields {
            kind: self.kind,
            what,
        }
    }

    fn take(&mut self, count: usize) -> Result<&'a [u8], WireError> {
        let (taken, rest) = self
            .bytes
            .split_at_checked(count)
            .ok_or_else(|| self.wrong("fields missing"))?;
        self.bytes = rest;
        Ok(taken)
    }

    pub(super) fn byte(&mut self) -> Result<u8, WireError> {
        Ok(self.take(1)?[0])
    }

    pub(super) fn word(&mut self) -> Result<u32, WireError> {
        let bytes = self.take(4)?;
        Ok(u32::from_le_bytes(bytes.try_into().expect("four bytes")))
    }

    pub(super) fn long(&mut self) -> Result<u64, WireError> {
        let bytes = self.take(8)?;
        Ok(u64::from_le_bytes(bytes.try_into().expect("eight bytes")))
    }

    pub(super) fn bytes(&mut self) -> Result<&'a [u8], WireError> {
        let length = self.word()?;
        self.take(length as usize)
    }

    pub(super) fn text(&mut self) -> Result<String, WireError> {
        let bytes = self.bytes()?;
        String::from_utf8(bytes.to_vec()).map_err(|_| self.wrong("a text that is no UTF-8"))
    }

    /// A list of at most `most` elements, each read by `element`.
    pub(super) fn list<T>(
        &mut self,
        most: u32,
        mut element: impl FnMut(&mut Self) -> Result<T, WireError>,
    ) -> Result<Vec<T>, WireError> {
        let count = self.word()?;
        if count > most {
            return Err(self.wrong("too long a list"));
        }
        (0..count).map(|_| element(self)).collect()
    }
}

/// A message being written, field by field.
#[derive(Debug)]
pub(super) struct Letter(Vec<u8>);

impl Letter {
    pub(super) fn new(kind: u8) -> Self {
        Self(vec![0, 0, 0, 0, kind])
    }

    pub(super) fn byte(mut self, byte: u8) -> Self {
        self.0.push(byte);
        self
    }

    pub(super) fn word(mut self, word: u32) -> Self {
        self.0.extend_from_slice(&word.to_le_bytes());
        self
    }

    pub(super) fn long(mut self, long: u64) -> Self {
        self.0.extend_from_slice(&long.to_le_bytes());
        self
    }

    pub(super) fn bytes(self, bytes: &[u8]) -> Self {
        let mut letter = self.word(count(bytes.len()));
        letter.0.extend_from_slice(bytes);
        letter
    }

    pub(super) fn text(self, text: &str) -> Self {
        self.bytes(text.as_bytes())
    }

    pub(super) fn list<T>(self, list: &[T], element: impl Fn(Self, &T) -> Self) -> Self {
        let letter = self.word(count(list.len()));
        list.iter().fold(letter, element)
    }

    /// The bytes to send.
    pub(super) fn seal(mut self) -> Vec<u8> {
        let length = count(self.0.len() - 4);
        self.0[..4].copy_from_slice(&length.to_le_bytes());
        self.0
    }
}

fn count(length: usize) -> u32 {
    u32::try_from(length).expect("messages are far below 4 GiB")
}
