//! The text of a file, whatever wrote it.

/// What Windows-1252 has at 0x80 to 0x9F; the rest of it is Latin-1.
const WINDOWS: [char; 32] = [
    '€', '\u{81}', '‚', 'ƒ', '„', '…', '†', '‡', 'ˆ', '‰', 'Š', '‹', 'Œ', '\u{8d}', 'Ž', '\u{8f}',
    '\u{90}', '‘', '’', '“', '”', '•', '–', '—', '˜', '™', 'š', '›', 'œ', '\u{9d}', 'ž', 'Ÿ',
];

/// What a file is that is no text at all, and what to do about it.
pub(super) fn no_table(bytes: &[u8]) -> Option<(&'static str, &'static str)> {
    // Workbooks are zip archives, or compound files as Excel wrote them before 2007.
    if bytes.starts_with(b"PK\x03\x04") || bytes.starts_with(b"\xD0\xCF\x11\xE0") {
        Some((
            "this is a workbook, not a text",
            "open it in Excel or LibreOffice, and save the sheet as CSV (UTF-8 or Unicode text)",
        ))
    } else if bytes.starts_with(b"<?xml") || bytes.starts_with(b"\xEF\xBB\xBF<?xml") {
        Some((
            "this is XML",
            "export the tag table as SDF or XLSX, and save that as CSV",
        ))
    } else {
        None
    }
}

/// The text of `bytes`: UTF-16 and UTF-8 by their marks, UTF-16 without one by its zero bytes, UTF-8 if it is that, else
/// Windows-1252.
pub(super) fn decoded(bytes: &[u8]) -> String {
    if let Some(rest) = bytes.strip_prefix(b"\xFF\xFE") {
        return utf16(rest, u16::from_le_bytes);
    }
    if let Some(rest) = bytes.strip_prefix(b"\xFE\xFF") {
        return utf16(rest, u16::from_be_bytes);
    }
    let start = &bytes[..bytes.len().min(64)];
    if start.len() >= 4
        && start
            .chunks_exact(2)
            .all(|pair| pair[0] != 0 && pair[1] == 0)
    {
        return utf16(bytes, u16::from_le_bytes);
    }
    let bytes = bytes.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(bytes);
    match std::str::from_utf8(bytes) {
        Ok(text) => text.to_owned(),
        Err(_) => bytes.iter().copied().map(windows).collect(),
    }
}

fn utf16(bytes: &[u8], unit: fn([u8; 2]) -> u16) -> String {
    let units = bytes.chunks_exact(2).map(|pair| unit([pair[0], pair[1]]));
    char::decode_utf16(units)
        .map(|character| character.unwrap_or(char::REPLACEMENT_CHARACTER))
        .collect()
}

fn windows(byte: u8) -> char {
    match byte {
        0x80..=0x9F => WINDOWS[usize::from(byte - 0x80)],
        _ => char::from(byte),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_way_to_save_gives_the_same_text() {
        let text = "Förderer;%I0.0;Bool;„läuft“ – 5 €\r\n";
        let little: Vec<u8> = text.encode_utf16().flat_map(u16::to_le_bytes).collect();
        let big: Vec<u8> = text.encode_utf16().flat_map(u16::to_be_bytes).collect();
        let ansi: Vec<u8> = text
            .chars()
            .map(|c| match WINDOWS.iter().position(|w| *w == c) {
                Some(at) => 0x80 + u8::try_from(at).unwrap(),
                None => u8::try_from(u32::from(c)).unwrap(),
            })
            .collect();
        for bytes in [
            text.as_bytes().to_vec(),
            [b"\xEF\xBB\xBF", text.as_bytes()].concat(),
            [&b"\xFF\xFE"[..], &little].concat(),
            [&b"\xFE\xFF"[..], &big].concat(),
            ansi,
        ] {
            assert_eq!(decoded(&bytes), text);
        }
        let plain: Vec<u8> = "a;%I0.0\n"
            .encode_utf16()
            .flat_map(u16::to_le_bytes)
            .collect();
        assert_eq!(decoded(&plain), "a;%I0.0\n");
    }
}
