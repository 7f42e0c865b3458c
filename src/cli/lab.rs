//! Shared by the commands of a virtual laboratory.

use std::io::{self, IsTerminal as _, Write as _};
use std::path::Path;

use super::Outcome;
use tickbus_base::Mistake;
use tickbus_base::time::Stop;
use tickbus_dispatcher::Key;
use tickbus_net::Address;

/// Parses an address to listen on.
pub(super) fn address(text: &str) -> Result<Address, String> {
    text.parse().map_err(|mistake: Mistake| mistake.to_string())
}

/// Parses an address to connect to.
pub(super) fn dialled(text: &str) -> Result<Address, String> {
    let address = address(text)?;
    let checked = address.check_dialled();
    checked.map_err(|mistake| mistake.to_string())?;
    Ok(address)
}

/// Reads the key of a laboratory from the file that `--key-file` names.
pub(super) fn key(file: &str) -> Result<Key, String> {
    Key::load(Path::new(file)).map_err(|mistake| mistake.to_string())
}

/// Prints a line of the command `title`. The command continues even if the reader of stdout is gone.
pub(super) fn say(title: &str, line: &str) {
    let mut out = io::stdout().lock();
    let _ = writeln!(out, "{title}: {line}").and_then(|()| out.flush());
}

/// Prints the address of a page, and on a terminal how other devices open it. The token is not for a log.
pub(super) fn say_page(title: &str, url: &str, invitation: &str) {
    let mut out = io::stdout().lock();
    let invitation = if out.is_terminal() { invitation } else { "" };
    let _ = write!(out, "{title}: page at {url}\n{invitation}").and_then(|()| out.flush());
}

/// Returns a stop that Ctrl-C triggers; reports an error if Ctrl-C cannot be caught.
pub(super) fn until_ctrl_c(title: &str) -> Result<Stop, Outcome> {
    let stop = Stop::new();
    let handler = {
        let stop = stop.clone();
        move || stop.stop()
    };
    ctrlc::set_handler(handler).map_err(|error| {
        eprintln!("{title}: Ctrl-C cannot be caught: {error}");
        Outcome::BusFailed
    })?;
    Ok(stop)
}
