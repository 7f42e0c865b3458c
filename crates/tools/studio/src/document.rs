//! The text of a driver.cfg as a document of TOML, and back: with its byte order mark and its ends of lines.

use toml_edit::{Document, DocumentMut};

use crate::layout;

/// The byte order mark that some editors put ahead of a text.
const MARK: char = '\u{feff}';

/// The text without a byte order mark, as TOML has it.
pub(crate) fn body(text: &str) -> &str {
    text.strip_prefix(MARK).unwrap_or(text)
}

/// The document of a text.
///
/// # Errors
///
/// The text is no TOML; with the remedy.
pub(crate) fn parsed(text: &str) -> Result<DocumentMut, String> {
    let parsed = Document::parse(body(text)).map_err(|error| {
        let what = error.message();
        format!("the file is no TOML at the moment ({what}); mend that in its text first")
    })?;
    Ok(parsed.into_mut())
}

/// The text of a document that was made from `before`: with its byte order mark and its ends of lines.
pub(crate) fn written(before: &str, document: &DocumentMut) -> String {
    let mark = &before[..before.len() - body(before).len()];
    format!("{mark}{}", layout::ends_as(before, document.to_string()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_not_changed_is_written_as_it_was() {
        for text in ["a = 1\n", "\u{feff}a = 1\r\n# b\r\n", ""] {
            let document = parsed(text).expect("it is TOML");
            assert_eq!(written(text, &document), text);
        }
    }

    #[test]
    fn a_text_that_is_no_toml_is_told_with_the_remedy() {
        let why = parsed("a = ").expect_err("it has no value");
        assert!(why.contains("mend that in its text first"), "{why}");
    }
}
