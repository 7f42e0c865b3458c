//! Percent-encoding, as in URLs.

/// The decoded bytes of a percent-encoded text; a `%` without two hexadecimal digits is kept.
pub fn percent_decoded(text: &str) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(text.len());
    let mut rest = text.as_bytes();
    while let Some((first, after)) = rest.split_first() {
        let escape = after.get(..2).filter(|_| *first == b'%');
        let escape = escape.filter(|digits| digits.iter().all(u8::is_ascii_hexdigit));
        let escape = escape.and_then(|digits| std::str::from_utf8(digits).ok());
        if let Some(byte) = escape.and_then(|digits| u8::from_str_radix(digits, 16).ok()) {
            bytes.push(byte);
            rest = &after[2..];
        } else {
            bytes.push(*first);
            rest = after;
        }
    }
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn escapes_are_bytes_and_everything_else_stands_for_itself() {
        assert_eq!(percent_decoded("a%20b"), b"a b");
        assert_eq!(
            percent_decoded("pr%FCfung/%zz%2%+1%"),
            b"pr\xfcfung/%zz%2%+1%"
        );
    }
}
