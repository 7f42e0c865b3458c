//! Decodes the text of a file from any program.

use encoding_rs::{Encoding, UTF_16BE, UTF_16LE, WINDOWS_1252};

/// The type of a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum FileType {
    /// A table as text.
    Table,
    /// A workbook of Excel 2007 and later: a zip archive.
    Workbook,
    Xml,
    /// A workbook of Excel before 2007, or one with a password: a compound file.
    OldWorkbook,
}

/// The type of `bytes`, by their beginning.
pub(super) fn kind(bytes: &[u8]) -> FileType {
    if bytes.starts_with(b"PK\x03\x04") {
        return FileType::Workbook;
    }
    if bytes.starts_with(b"\xD0\xCF\x11\xE0") {
        return FileType::OldWorkbook;
    }
    let start = decoded(&bytes[..bytes.len().min(200)]);
    let start = start.trim_start();
    let is_tag = start.strip_prefix('<').is_some_and(|rest| {
        rest.starts_with(|c: char| c.is_ascii_alphabetic() || c == '?' || c == '!')
    });
    if is_tag {
        FileType::Xml
    } else {
        FileType::Table
    }
}

/// The text of `bytes`: UTF-16 or UTF-8 by their byte order marks, otherwise UTF-8 if valid, else
/// Windows-1252, as saved by spreadsheets in Western Europe.
pub(super) fn decoded(bytes: &[u8]) -> String {
    if let Some((encoding, mark)) = Encoding::for_bom(bytes) {
        return encoding
            .decode_without_bom_handling(&bytes[mark..])
            .0
            .into_owned();
    }
    // The first characters of every table are ASCII: in UTF-16 each has a zero byte.
    let encoding = match bytes {
        [first, 0, second, 0, ..] if *first > 0 && *second > 0 => UTF_16LE,
        [0, first, 0, second, ..] if *first > 0 && *second > 0 => UTF_16BE,
        _ => match std::str::from_utf8(bytes) {
            Ok(text) => return text.to_owned(),
            Err(_) => WINDOWS_1252,
        },
    };
    encoding.decode_without_bom_handling(bytes).0.into_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_way_to_save_gives_the_same_text() {
        let text = "Motor läuft;%I0.0;Bool;„läuft“ – 5 €\r\n";
        let little: Vec<u8> = text.encode_utf16().flat_map(u16::to_le_bytes).collect();
        let big: Vec<u8> = text.encode_utf16().flat_map(u16::to_be_bytes).collect();
        for bytes in [
            text.as_bytes().to_vec(),
            [b"\xEF\xBB\xBF", text.as_bytes()].concat(),
            [&b"\xFF\xFE"[..], &little].concat(),
            [&b"\xFE\xFF"[..], &big].concat(),
            little,
            big,
            WINDOWS_1252.encode(text).0.into_owned(),
        ] {
            assert_eq!(decoded(&bytes), text);
            assert_eq!(kind(&bytes), FileType::Table);
        }
    }

    #[test]
    fn files_are_known_by_how_they_begin() {
        for (bytes, expected) in [
            (&b"PK\x03\x04"[..], FileType::Workbook),
            (b"\xD0\xCF\x11\xE0", FileType::OldWorkbook),
            (b"<?xml version='1.0'?>", FileType::Xml),
            (b"\xEF\xBB\xBF  <project/>", FileType::Xml),
            (b"<5 mm;%I0.0;Bool", FileType::Table),
            (b"", FileType::Table),
        ] {
            assert_eq!(kind(bytes), expected);
        }
    }
}
