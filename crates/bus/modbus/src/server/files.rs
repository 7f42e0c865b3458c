//! The files of a device, whose records functions 20 and 21 read and write.

use std::collections::BTreeMap;
use std::ops::Range;

use crate::{Exception, Function, PDU_LIMIT};
use tickbus_base::toml_text::Value;

/// The most files of a device.
pub(crate) const FILES: usize = 16;

/// The records of a file, each with 16 bits.
const RECORDS: usize = 10_000;

/// The type of reference that each part of a request has.
const REFERENCE: u8 = 6;

/// The bytes of a part without records: reference, file, record, length.
const HEAD: usize = 7;

/// The limits of the standard for the byte count of a request that reads, and of one that writes.
const READS: std::ops::RangeInclusive<usize> = 7..=0xF5;
const WRITES: std::ops::RangeInclusive<usize> = 9..=0xFB;

/// The files of a unit, in memory: zero at first, and as clients write them.
#[derive(Debug)]
pub(super) struct Files(BTreeMap<u16, Box<[u8]>>);

/// A part of a request: the file, and the bytes of its records.
struct Part {
    file: u16,
    bytes: Range<usize>,
}

impl Files {
    /// Empty files with these numbers.
    pub(super) fn new(numbers: &[u16]) -> Self {
        let file = |number: &u16| (*number, vec![0; 2 * RECORDS].into());
        Self(numbers.iter().map(file).collect())
    }

    /// Answers a request of function 20 or 21, whose code is in `reply` already; `data` follows the code.
    ///
    /// # Errors
    ///
    /// The device has no files, a length does not fit, or a file or record does not exist.
    pub(super) fn answer(
        &mut self,
        function: Function,
        data: &[u8],
        reply: &mut Vec<u8>,
    ) -> Result<(), Exception> {
        if self.0.is_empty() {
            return Err(Exception::ILLEGAL_FUNCTION);
        }
        let (&count, parts) = data.split_first().ok_or(Exception::ILLEGAL_DATA_VALUE)?;
        if parts.len() != usize::from(count) {
            return Err(Exception::ILLEGAL_DATA_VALUE);
        }
        if function == Function::WriteFileRecord {
            self.write(parts)?;
            reply.extend_from_slice(data);
            return Ok(());
        }
        if !READS.contains(&parts.len()) || !parts.len().is_multiple_of(HEAD) {
            return Err(Exception::ILLEGAL_DATA_VALUE);
        }
        let at = reply.len();
        reply.push(0);
        for head in parts.chunks_exact(HEAD) {
            let Part { file, bytes } = self.part(head)?;
            let length = bytes.len() + 1;
            // With its code and its count, the answer is not longer than a PDU.
            if 1 + reply.len() - at + 1 + length > PDU_LIMIT {
                return Err(Exception::ILLEGAL_DATA_VALUE);
            }
            let length = u8::try_from(length).map_err(|_| Exception::ILLEGAL_DATA_VALUE)?;
            reply.extend_from_slice(&[length, REFERENCE]);
            reply.extend_from_slice(&self.0[&file][bytes]);
        }
        reply[at] = u8::try_from(reply.len() - at - 1).expect("shorter than a PDU");
        Ok(())
    }

    /// Writes all parts of a request, or none.
    fn write(&mut self, parts: &[u8]) -> Result<(), Exception> {
        if !WRITES.contains(&parts.len()) {
            return Err(Exception::ILLEGAL_DATA_VALUE);
        }
        let mut rest = parts;
        let mut all = Vec::new();
        while !rest.is_empty() {
            let (head, values) = rest
                .split_at_checked(HEAD)
                .ok_or(Exception::ILLEGAL_DATA_VALUE)?;
            let length = 2 * usize::from(u16::from_be_bytes([head[5], head[6]]));
            let (values, after) = values
                .split_at_checked(length)
                .ok_or(Exception::ILLEGAL_DATA_VALUE)?;
            all.push((self.part(head)?, values));
            rest = after;
        }
        for (Part { file, bytes }, values) in all {
            if let Some(file) = self.0.get_mut(&file) {
                file[bytes].copy_from_slice(values);
            }
        }
        Ok(())
    }

    /// The records that the head of a part names.
    fn part(&self, head: &[u8]) -> Result<Part, Exception> {
        let word = |at: usize| u16::from_be_bytes([head[at], head[at + 1]]);
        let (file, first, count) = (word(1), usize::from(word(3)), usize::from(word(5)));
        let exists = self.0.contains_key(&file) && first + count <= RECORDS;
        if head[0] != REFERENCE || !exists {
            return Err(Exception::ILLEGAL_DATA_ADDRESS);
        }
        if count == 0 {
            return Err(Exception::ILLEGAL_DATA_VALUE);
        }
        Ok(Part {
            file,
            bytes: 2 * first..2 * (first + count),
        })
    }
}

/// Reads the numbers of the files.
pub(super) fn read_files(value: &Value<'_>) -> Option<Vec<u16>> {
    let list = value.list("write the numbers of the files, such as [1, 4]")?;
    if list.len() > FILES {
        value.wrong(
            format!("it has {} files", list.len()),
            format!("write at most {FILES}"),
        );
        return None;
    }
    let numbers = list
        .iter()
        .map(|number| u16::try_from(number.whole(1..=0xFFFF)?).ok());
    // All mistakes are reported, not only the first.
    numbers.collect::<Vec<_>>().into_iter().collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ask(files: &mut Files, pdu: &[u8]) -> Vec<u8> {
        let function = Function::of(pdu[0]).expect("one of the two");
        let mut reply = vec![pdu[0]];
        match files.answer(function, &pdu[1..], &mut reply) {
            Ok(()) => reply,
            Err(exception) => vec![pdu[0] | 0x80, exception.0],
        }
    }

    #[test]
    fn records_are_written_and_read_as_the_standard_has_them() {
        let mut files = Files::new(&[3, 4]);
        let write = [
            21, 0x0D, 6, 0, 4, 0, 7, 0, 3, 0x06, 0xAF, 0x04, 0xBE, 0x10, 0x0D,
        ];
        assert_eq!(ask(&mut files, &write), write);
        let write = [21, 11, 6, 0, 3, 0, 9, 0, 2, 0x33, 0xCD, 0x00, 0x40];
        assert_eq!(ask(&mut files, &write), write);
        let read = [
            20, 14, 6, 0, 4, 0, 8, 0, 2, // Records 8 and 9 of file 4.
            6, 0, 3, 0, 9, 0, 2,
        ];
        assert_eq!(
            ask(&mut files, &read),
            [
                20, 12, 5, 6, 0x04, 0xBE, 0x10, 0x0D, 5, 6, 0x33, 0xCD, 0x00, 0x40
            ]
        );
    }

    #[test]
    fn what_does_not_exist_or_fit_is_refused_and_writes_nothing() {
        let mut files = Files::new(&[1]);
        for (pdu, exception) in [
            (&[20][..], 3),
            (&[20, 0], 3),
            (&[20, 6, 6, 0, 1, 0, 0, 0], 3),
            (&[20, 7, 6, 0, 1, 0, 0, 0], 3),
            (&[20, 7, 6, 0, 1, 0, 0, 0, 0], 3),
            (&[20, 7, 5, 0, 1, 0, 0, 0, 1], 2),
            (&[20, 7, 6, 0, 2, 0, 0, 0, 1], 2),
            (&[20, 7, 6, 0, 1, 0x27, 0x0F, 0, 2], 2),
            // 125 registers have no room in an answer.
            (&[20, 7, 6, 0, 1, 0, 0, 0, 125], 3),
            (&[21, 9, 6, 0, 1, 0, 0, 0, 2, 1, 2], 3),
            // The first part is right, and the second one is not.
            (
                &[21, 18, 6, 0, 1, 0, 0, 0, 1, 1, 2, 6, 0, 9, 0, 0, 0, 1, 1, 2],
                2,
            ),
        ] {
            let refusal = [pdu[0] | 0x80, exception];
            assert_eq!(ask(&mut files, pdu), refusal, "{pdu:?}");
        }
        assert!(files.0[&1].iter().all(|byte| *byte == 0));
        // The last record, and the longest answer.
        let read = [20, 7, 6, 0, 1, 0x27, 0x0F, 0, 1];
        assert_eq!(ask(&mut files, &read), [20, 4, 3, 6, 0, 0]);
        let answer = ask(&mut files, &[20, 7, 6, 0, 1, 0, 0, 0, 124]);
        assert_eq!((answer.len(), answer[1]), (252, 250));
        let mut none = Files::new(&[]);
        assert_eq!(ask(&mut none, &read), [0x94, 1]);
    }
}
