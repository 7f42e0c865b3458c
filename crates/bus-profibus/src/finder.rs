//! Finds the telegrams among the bytes of a line.

use tickbus_base::time::Nanos;

use crate::telegram::Telegram;

/// A telegram that is not complete after so long a pause never will be, however late a driver hands over its bytes.
pub(crate) const PATIENCE: Nanos = Nanos::from_millis(50);

/// The silence, in bit times, that precedes every request.
pub(crate) const SILENCE: i64 = 33;

/// The time of this many bits.
pub(crate) fn bits(baud: u32, count: i64) -> Nanos {
    Nanos(count * 1_000_000_000 / i64::from(baud))
}

/// What has arrived of the next telegram.
#[derive(Debug)]
pub(crate) struct Finder {
    silence: Nanos,
    buffer: Vec<u8>,
    /// When the last bytes arrived.
    heard: Nanos,
}

/// What a piece of the line's traffic is.
#[derive(Debug)]
pub(crate) enum Found<'a> {
    /// A telegram, and its bytes.
    Telegram(Telegram<'a>, &'a [u8]),
    /// Bytes that are none, however many.
    Damaged,
}

impl Finder {
    /// For a line of `baud` bits per second.
    pub(crate) fn new(baud: u32) -> Self {
        Self {
            silence: bits(baud, SILENCE),
            buffer: Vec::new(),
            heard: Nanos(0),
        }
    }

    /// Takes bytes off the line, and hands out what is found in them.
    ///
    /// # Errors
    ///
    /// That of `each`.
    pub(crate) fn hear<E>(
        &mut self,
        now: Nanos,
        bytes: &[u8],
        mut each: impl FnMut(Found<'_>) -> Result<(), E>,
    ) -> Result<(), E> {
        let pause = now - self.heard;
        self.heard = now;
        let begins_anew = pause > self.silence
            && matches!(Telegram::parse(bytes), Ok(Some((Telegram::Frame(_), _))));
        if !self.buffer.is_empty() && (pause > PATIENCE || begins_anew) {
            self.buffer.clear();
            each(Found::Damaged)?;
        }
        self.buffer.extend_from_slice(bytes);
        let mut rest = &self.buffer[..];
        let mut is_damaged = false;
        loop {
            match Telegram::parse(rest) {
                Ok(None) => break,
                Ok(Some((telegram, length))) => {
                    let (own, behind) = rest.split_at(length);
                    rest = behind;
                    is_damaged = false;
                    each(Found::Telegram(telegram, own))?;
                }
                Err(_) => {
                    if !std::mem::replace(&mut is_damaged, true) {
                        each(Found::Damaged)?;
                    }
                    rest = &rest[1..];
                }
            }
        }
        let is_read = self.buffer.len() - rest.len();
        self.buffer.drain(..is_read);
        Ok(())
    }

    /// Whether the next telegram has begun, and is not complete.
    pub(crate) fn has_begun(&self) -> bool {
        !self.buffer.is_empty()
    }
}
