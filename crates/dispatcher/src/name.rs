//! Names of clients.

/// The longest name of a client, in characters.
pub const LONGEST_NAME: usize = 63;

/// Whether `text` can be the name of a client.
pub fn is_name(text: &str) -> bool {
    let letter = |byte: u8| byte.is_ascii_alphanumeric() || b"_-.".contains(&byte);
    (1..=LONGEST_NAME).contains(&text.len()) && text.bytes().all(letter)
}
