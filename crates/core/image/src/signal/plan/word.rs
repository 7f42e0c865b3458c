//! The words on the wire, and their byte orders.

use std::fmt::Debug;

/// An unsigned integer as wide as a value on the wire.
pub(super) trait Word: Copy + Debug + Send + Sync + 'static {
    /// The size in bytes.
    const BYTES: usize;

    /// The same word, least significant byte first.
    fn reverse_bytes(self) -> Self;

    /// The same word, least significant 16-bit word first, the bytes within each word unchanged.
    fn reverse_words(self) -> Self;

    /// Reads a big-endian word; `bytes` is exactly [`Word::BYTES`] long.
    fn get(bytes: &[u8]) -> Self;

    /// Writes the word big-endian; `bytes` is exactly [`Word::BYTES`] long.
    fn put(self, bytes: &mut [u8]);
}

macro_rules! word {
    ($word:ident, $value:ident => $reverse_words:expr) => {
        impl Word for $word {
            const BYTES: usize = size_of::<Self>();

            fn reverse_bytes(self) -> Self {
                self.swap_bytes()
            }

            fn reverse_words(self) -> Self {
                let $value = self;
                $reverse_words
            }

            fn get(bytes: &[u8]) -> Self {
                let mut array = [0; Self::BYTES];
                array.copy_from_slice(bytes);
                Self::from_be_bytes(array)
            }

            fn put(self, bytes: &mut [u8]) {
                bytes.copy_from_slice(&self.to_be_bytes());
            }
        }
    };
}

word!(u8, value => value);
word!(u16, value => value);
word!(u32, value => value.rotate_left(16));
word!(u64, value => {
    const EVEN_WORDS: u64 = 0x0000_FFFF_0000_FFFF;
    let halves = value.rotate_left(32);
    ((halves & EVEN_WORDS) << 16) | ((halves >> 16) & EVEN_WORDS)
});

/// A byte order, known at compile time.
pub(super) trait Order: Debug + Send + Sync + 'static {
    /// Converts a value to the word whose big-endian bytes are on the wire, and back: every byte order is its
    /// own inverse.
    fn arrange<W: Word>(word: W) -> W;
}

/// [`ByteOrder::Abcd`](crate::signal::ByteOrder::Abcd).
#[derive(Debug)]
pub(super) struct Abcd;

/// [`ByteOrder::Cdab`](crate::signal::ByteOrder::Cdab).
#[derive(Debug)]
pub(super) struct Cdab;

/// [`ByteOrder::Badc`](crate::signal::ByteOrder::Badc).
#[derive(Debug)]
pub(super) struct Badc;

/// [`ByteOrder::Dcba`](crate::signal::ByteOrder::Dcba).
#[derive(Debug)]
pub(super) struct Dcba;

impl Order for Abcd {
    fn arrange<W: Word>(word: W) -> W {
        word
    }
}

impl Order for Cdab {
    fn arrange<W: Word>(word: W) -> W {
        word.reverse_words()
    }
}

impl Order for Badc {
    fn arrange<W: Word>(word: W) -> W {
        word.reverse_words().reverse_bytes()
    }
}

impl Order for Dcba {
    fn arrange<W: Word>(word: W) -> W {
        word.reverse_bytes()
    }
}
