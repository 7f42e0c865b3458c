//! The token, and the file in which it survives a restart.

use std::fmt::Write as _;
use std::fs::{self, OpenOptions};
use std::io::{self, Read as _, Write as _};
use std::path::Path;

/// Digits of a token.
const LENGTH: usize = 32;

/// A new token.
pub(crate) fn fresh() -> io::Result<String> {
    let mut random = [0; LENGTH / 2];
    getrandom::fill(&mut random).map_err(io::Error::other)?;
    let mut token = String::new();
    for byte in random {
        // Writing to a String cannot fail.
        let _ = write!(token, "{byte:02x}");
    }
    Ok(token)
}

/// The token in the file at `path`. A missing file is created with `token`. Only its owner may read it.
pub(crate) fn kept(path: &Path, token: &str) -> io::Result<String> {
    let mut options = OpenOptions::new();
    options.write(true).create_new(true);
    #[cfg(unix)]
    {
        use std::os::unix::fs::OpenOptionsExt as _;
        options.mode(0o600);
    }
    match options.open(path) {
        Ok(mut file) => {
            writeln!(file, "{token}")?;
            file.sync_all()?;
            Ok(token.to_owned())
        }
        Err(error) if error.kind() == io::ErrorKind::AlreadyExists => read(path),
        Err(error) => Err(error),
    }
}

fn read(path: &Path) -> io::Result<String> {
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt as _;
        if fs::metadata(path)?.permissions().mode() & 0o077 != 0 {
            let text = "other users may read the file with the token; chmod 600 it, or remove it";
            return Err(io::Error::other(text));
        }
    }
    let mut text = String::new();
    let file = fs::File::open(path)?;
    file.take(2 * LENGTH as u64).read_to_string(&mut text)?;
    let token = text.trim();
    let is_token = token.len() == LENGTH
        && token
            .bytes()
            .all(|byte| matches!(byte, b'0'..=b'9' | b'a'..=b'f'));
    if !is_token {
        let text = "the file with the token holds something else; remove it, and it is made again";
        return Err(io::Error::other(text));
    }
    Ok(token.to_owned())
}
