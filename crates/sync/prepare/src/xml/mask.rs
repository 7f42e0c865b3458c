//! Statements in XML as Structured Text.

/// Text of XML with references and markup replaced by characters and blanks, so that every byte keeps its position.
///
/// # Errors
///
/// The position of a reference to a character that may be part of a word or symbol: blanks next to it would split them.
pub(super) fn mask(raw: &str) -> Result<String, usize> {
    const MARKUP: [(&str, &str); 7] = [
        ("<![CDATA[", ""),
        ("]]>", ""),
        ("&lt;", "<"),
        ("&gt;", ">"),
        ("&amp;", "&"),
        ("&quot;", "\""),
        ("&apos;", "'"),
    ];
    let mut masked = String::with_capacity(raw.len());
    let mut rest = raw;
    let mut is_data = false;
    while let Some(c) = rest.chars().next() {
        let mut markup = MARKUP.iter().filter(|(from, _)| rest.starts_with(from));
        // In CDATA nothing but its end is markup.
        let found = markup.find(|(from, _)| !is_data || *from == "]]>");
        let (length, character) = if let Some((from, to)) = found {
            is_data = *from == "<![CDATA[" || (is_data && *from != "]]>");
            (from.len(), (*to).to_owned())
        } else if !is_data && rest.starts_with("&#") {
            let length = rest.find(';').map_or(rest.len(), |at| at + 1);
            let character = referenced(&rest[..length]).ok_or(raw.len() - rest.len())?;
            (length, character.to_string())
        } else {
            (c.len_utf8(), c.to_string())
        };
        let blanks = length - character.len();
        masked += &character;
        masked.extend(std::iter::repeat_n(' ', blanks));
        rest = &rest[length..];
    }
    Ok(masked)
}

/// The character of `&#39;` or `&#x27;`, if no other character can change its meaning.
fn referenced(reference: &str) -> Option<char> {
    let number = reference.strip_prefix("&#")?.strip_suffix(';')?;
    let code = match number.strip_prefix('x') {
        Some(digits) => u32::from_str_radix(digits, 16),
        None => number.parse(),
    };
    let found = char::from_u32(code.ok()?)?;
    (!found.is_ascii() || found.is_ascii_whitespace() || "'\"&<>".contains(found)).then_some(found)
}
