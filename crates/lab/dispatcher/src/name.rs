//! Names of clients.

/// The longest name of a client, in characters.
pub const LONGEST_NAME: usize = 63;

/// True if `text` can be the name of a client.
pub fn is_name(text: &str) -> bool {
    let letter = |byte: u8| byte.is_ascii_alphanumeric() || b"_-.".contains(&byte);
    (1..=LONGEST_NAME).contains(&text.len()) && text.bytes().all(letter)
}

/// True if a client can be shown by this text: a name, or `NAME@HOST` while a client of another host has its name, and
/// `NAME@HOST@2` for the second of two computers with the same name.
pub(crate) fn is_shown_name(text: &str) -> bool {
    text.split('@').all(is_name)
}
