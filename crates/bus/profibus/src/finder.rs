//! Finds the telegrams among the bytes of a line.

use tickbus_base::os::Characters;
use tickbus_base::time::Nanos;

use crate::telegram::Telegram;

/// A telegram still incomplete after a pause of this length never completes, however late a driver hands over its
/// bytes.
pub(crate) const PATIENCE: Nanos = Nanos::from_millis(50);

/// The silence, in bit times, that precedes every request.
pub(crate) const SILENCE: i64 = 33;

/// The time of this many bits.
pub(crate) fn bits(baud: u32, count: i64) -> Nanos {
    Nanos(count * 1_000_000_000 / i64::from(baud))
}

/// The bytes of the next telegram so far.
#[derive(Debug)]
pub(crate) struct Finder {
    silence: Nanos,
    buffer: Vec<u8>,
    /// The indices of the damaged characters among them.
    damaged: Vec<usize>,
    /// When the last bytes arrived.
    heard: Nanos,
}

/// A piece of the line's traffic.
#[derive(Debug)]
pub(crate) enum Found<'a> {
    /// A telegram, and its bytes.
    Telegram(Telegram<'a>, &'a [u8]),
    /// Any number of bytes that are no telegram.
    Damaged,
}

impl Finder {
    /// For a line of `baud` bits per second.
    pub(crate) fn new(baud: u32) -> Self {
        Self {
            silence: bits(baud, SILENCE),
            buffer: Vec::new(),
            damaged: Vec::new(),
            heard: Nanos(0),
        }
    }

    /// Takes characters off the line, and passes on the telegrams in them. A telegram with a damaged character counts
    /// as damaged whatever its checksum: two damaged characters can leave the sum unchanged.
    ///
    /// # Errors
    ///
    /// An error of `each`.
    pub(crate) fn hear<E>(
        &mut self,
        now: Nanos,
        characters: Characters<'_>,
        mut each: impl FnMut(Found<'_>) -> Result<(), E>,
    ) -> Result<(), E> {
        let pause = now - self.heard;
        self.heard = now;
        let is_frame = |bytes| matches!(Telegram::parse(bytes), Ok(Some((Telegram::Frame(_), _))));
        let begins_anew = pause > self.silence && is_frame(characters.bytes);
        if !self.buffer.is_empty() && (pause > PATIENCE || begins_anew) {
            self.buffer.clear();
            self.damaged.clear();
            each(Found::Damaged)?;
        }
        let before = self.buffer.len();
        self.damaged
            .extend(characters.damaged.iter().map(|index| before + index));
        self.buffer.extend_from_slice(characters.bytes);
        let mut at = 0;
        let mut is_damaged = false;
        while let Some(found) = Telegram::parse(&self.buffer[at..]).transpose() {
            let length = found.map_or(1, |(_, length)| length);
            let own = at..at + length;
            let is_sound = !self.damaged.iter().any(|index| own.contains(index));
            at = own.end;
            match found {
                Ok((telegram, _)) if is_sound => {
                    is_damaged = false;
                    each(Found::Telegram(telegram, &self.buffer[own]))?;
                }
                _ => {
                    if !std::mem::replace(&mut is_damaged, true) {
                        each(Found::Damaged)?;
                    }
                }
            }
        }
        self.buffer.drain(..at);
        self.damaged.retain_mut(|index| {
            let is_left = *index >= at;
            *index = index.saturating_sub(at);
            is_left
        });
        Ok(())
    }

    /// True if a telegram has begun and is incomplete.
    pub(crate) fn has_begun(&self) -> bool {
        !self.buffer.is_empty()
    }
}
