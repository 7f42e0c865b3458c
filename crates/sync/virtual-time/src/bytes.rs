//! The parts of frames and files as bytes: numbers, names, types, values and declarations. Numbers are little-endian.

use tickbus_base::time::Nanos;
use tickbus_image::signal::DataType;

use crate::{Declaration, Variable};

/// Slots as they are on the wire.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Slots<'a>(&'a [[u8; 8]]);

impl<'a> Slots<'a> {
    /// The slots as numbers.
    pub fn iter(self) -> impl ExactSizeIterator<Item = u64> + use<'a> {
        self.0.iter().map(|bytes| u64::from_le_bytes(*bytes))
    }
}

/// Appends a declaration.
pub(crate) fn declared(out: &mut Vec<u8>, declaration: &Declaration) {
    out.extend_from_slice(&declaration.multiple.get().to_le_bytes());
    let interval = declaration.interval.unwrap_or(Nanos::ZERO);
    out.extend_from_slice(&interval.0.to_le_bytes());
    name(out, &declaration.name);
    count(out, declaration.writes.len());
    for variable in &declaration.writes {
        out.push(code(variable.data_type));
        name(out, &variable.name);
    }
    count(out, declaration.reads.len());
    for read in &declaration.reads {
        name(out, read);
    }
}

/// Appends a text of at most 255 bytes.
pub(crate) fn name(out: &mut Vec<u8>, name: &str) {
    out.push(u8::try_from(name.len()).expect("a name has its limit"));
    out.extend_from_slice(name.as_bytes());
}

/// Appends a number of at most 65535.
pub(crate) fn count(out: &mut Vec<u8>, count: usize) {
    let count = u16::try_from(count).expect("their number has its limit");
    out.extend_from_slice(&count.to_le_bytes());
}

/// Appends values.
pub(crate) fn slots(out: &mut Vec<u8>, slots: &[u64]) {
    for slot in slots {
        out.extend_from_slice(&slot.to_le_bytes());
    }
}

/// The code of a type: BOOL is 1, LREAL 15, in the order of [`DataType::ALL`].
pub(crate) fn code(data_type: DataType) -> u8 {
    place_code(DataType::ALL.iter().position(|other| *other == data_type))
}

/// The code of an element of a list: the first one is 1.
pub(crate) fn place_code(place: Option<usize>) -> u8 {
    let place = place.expect("the list is complete");
    u8::try_from(place + 1).expect("a short list")
}

/// Reads a declaration; the first version of the format has no interval.
pub(crate) fn read_declared(
    reader: &mut Reader<'_>,
    has_interval: bool,
) -> Result<Declaration, String> {
    let multiple = u32::from_le_bytes(reader.take()?).try_into();
    let multiple = multiple.map_err(|_| "runs every 0 steps; expected 1 or more".to_owned())?;
    let interval = if has_interval {
        i64::from_le_bytes(reader.take()?)
    } else {
        0
    };
    if interval < 0 {
        return Err(format!("runs every {interval} ns; expected 0 or more"));
    }
    let name = reader.name()?.to_owned();
    let mut writes = Vec::new();
    for _ in 0..u16::from_le_bytes(reader.take()?) {
        let data_type = reader.data_type()?;
        writes.push(Variable::new(reader.name()?, data_type));
    }
    let mut reads = Vec::new();
    for _ in 0..u16::from_le_bytes(reader.take()?) {
        reads.push(reader.name()?.to_owned());
    }
    Ok(Declaration {
        name,
        multiple,
        interval: (interval > 0).then_some(Nanos(interval)),
        writes,
        reads,
    })
}

/// The unread rest of a frame or of a file's content.
#[derive(Debug)]
pub(crate) struct Reader<'a>(&'a [u8]);

impl<'a> Reader<'a> {
    pub(crate) const fn new(frame: &'a [u8]) -> Self {
        Self(frame)
    }

    pub(crate) const fn is_at_end(&self) -> bool {
        self.0.is_empty()
    }

    pub(crate) fn take<const COUNT: usize>(&mut self) -> Result<[u8; COUNT], String> {
        let (taken, rest) = self.0.split_first_chunk().ok_or_else(too_short)?;
        self.0 = rest;
        Ok(*taken)
    }

    pub(crate) fn byte(&mut self) -> Result<u8, String> {
        self.take().map(|[byte]| byte)
    }

    pub(crate) fn word(&mut self) -> Result<u64, String> {
        self.take().map(u64::from_le_bytes)
    }

    /// A text of at most 255 bytes.
    pub(crate) fn name(&mut self) -> Result<&'a str, String> {
        let length = usize::from(self.byte()?);
        let (taken, rest) = self.0.split_at_checked(length).ok_or_else(too_short)?;
        self.0 = rest;
        text(taken)
    }

    pub(crate) fn data_type(&mut self) -> Result<DataType, String> {
        let code = self.byte()?;
        let found = DataType::ALL.get(usize::from(code).wrapping_sub(1));
        found
            .copied()
            .ok_or_else(|| format!("sent the unknown type {code}"))
    }

    /// A number of 4 bytes.
    pub(crate) fn half(&mut self) -> Result<u32, String> {
        self.take().map(u32::from_le_bytes)
    }

    /// `count` numbers of 8 bytes.
    pub(crate) fn words(&mut self, count: u64) -> Result<Slots<'a>, String> {
        let bytes = usize::try_from(count)
            .ok()
            .and_then(|count| count.checked_mul(8));
        let (taken, rest) = bytes
            .and_then(|bytes| self.0.split_at_checked(bytes))
            .ok_or_else(too_short)?;
        self.0 = rest;
        Ok(Slots(taken.as_chunks().0))
    }

    /// `count` bytes.
    pub(crate) fn bytes(&mut self, count: usize) -> Result<&'a [u8], String> {
        let (taken, rest) = self.0.split_at_checked(count).ok_or_else(too_short)?;
        self.0 = rest;
        Ok(taken)
    }

    /// Slots up to the end.
    pub(crate) fn slots(&mut self) -> Result<Slots<'a>, String> {
        let (slots, rest) = self.0.as_chunks();
        if !rest.is_empty() {
            return Err("sent a message that ends within a value".to_owned());
        }
        self.0 = &[];
        Ok(Slots(slots))
    }

    /// Everything up to the end.
    pub(crate) fn rest(&mut self) -> &'a [u8] {
        std::mem::take(&mut self.0)
    }

    pub(crate) fn rest_as_text(&mut self) -> Result<&'a str, String> {
        text(std::mem::take(&mut self.0))
    }

    pub(crate) fn finish(self) -> Result<(), String> {
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
