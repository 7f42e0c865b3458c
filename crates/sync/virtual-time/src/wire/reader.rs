//! Reading the parts of a frame.

use tickbus_image::signal::DataType;

use super::Slots;

/// The rest of a frame.
pub(super) struct Reader<'a>(&'a [u8]);

impl<'a> Reader<'a> {
    pub(super) const fn new(frame: &'a [u8]) -> Self {
        Self(frame)
    }

    pub(super) const fn is_at_end(&self) -> bool {
        self.0.is_empty()
    }

    pub(super) fn take<const COUNT: usize>(&mut self) -> Result<[u8; COUNT], String> {
        let (taken, rest) = self.0.split_first_chunk().ok_or_else(too_short)?;
        self.0 = rest;
        Ok(*taken)
    }

    pub(super) fn byte(&mut self) -> Result<u8, String> {
        self.take().map(|[byte]| byte)
    }

    pub(super) fn word(&mut self) -> Result<u64, String> {
        self.take().map(u64::from_le_bytes)
    }

    /// A text of at most 255 bytes.
    pub(super) fn name(&mut self) -> Result<&'a str, String> {
        let length = usize::from(self.byte()?);
        let (taken, rest) = self.0.split_at_checked(length).ok_or_else(too_short)?;
        self.0 = rest;
        text(taken)
    }

    pub(super) fn data_type(&mut self) -> Result<DataType, String> {
        let code = self.byte()?;
        let found = DataType::ALL.get(usize::from(code).wrapping_sub(1));
        found
            .copied()
            .ok_or_else(|| format!("sent the unknown type {code}"))
    }

    /// Slots up to the end.
    pub(super) fn slots(&mut self) -> Result<Slots<'a>, String> {
        let (slots, rest) = self.0.as_chunks();
        if !rest.is_empty() {
            return Err("sent a message that ends within a value".to_owned());
        }
        self.0 = &[];
        Ok(Slots(slots))
    }

    pub(super) fn rest_as_text(&mut self) -> Result<&'a str, String> {
        text(std::mem::take(&mut self.0))
    }

    pub(super) fn finish(self) -> Result<(), String> {
        match self.0.len() {
            0 => Ok(()),
            more => Err(format!("sent a message with {more} bytes too many")),
        }
    }
}

fn text(bytes: &[u8]) -> Result<&str, String> {
    std::str::from_utf8(bytes).map_err(|_| "sent a text that is no UTF-8".to_owned())
}

fn too_short() -> String {
    "sent a message that is too short".to_owned()
}
