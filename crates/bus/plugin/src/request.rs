//! Messages from a host to its helper.

use serde::{Deserialize, Serialize};

use super::setup::Setup;
use tickbus_net::Message;

/// A request from a host to its helper. The end of the stream asks it to close and end.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(super) enum Request {
    /// Load the library and open its bus. Sent first.
    Open {
        setup: Setup,
        /// How long the library may take to close, in milliseconds, if the host has gone.
        grace_ms: u64,
    },
    /// Exchange: the bytes to send are in the shared memory.
    Exchange,
}

impl Message for Request {
    const MOST: usize = 4 << 20;
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::setup::Station;
    use std::ffi::OsString;
    use tickbus_fieldbus::Role;
    use tickbus_net::Inbox;

    /// A path that is no text.
    #[cfg(unix)]
    fn library() -> OsString {
        std::os::unix::ffi::OsStringExt::from_vec(b"/opt/vendor \xFF/libx.so".to_vec())
    }

    #[cfg(windows)]
    fn library() -> OsString {
        std::os::windows::ffi::OsStringExt::from_wide(&[0x0043, 0x003A, 0xD800, 0x0078])
    }

    #[test]
    fn requests_arrive_as_they_were_sent() {
        let station = |name: &str, tx, rx| Station {
            name: name.to_owned(),
            tx,
            rx,
        };
        let setup = Setup {
            library: library(),
            name: "Zelle 4".to_owned(),
            directory: "/opt/cell".to_owned(),
            role: Role::Controller,
            options: vec![("card".to_owned(), "0".to_owned())],
            stations: vec![station("left", 3, 0), station("right", 1, 70_000)],
            timeout_ms: 10,
            cycle_ns: 10_000_000,
            max_age_ns: u64::MAX,
        };
        let open = Request::Open {
            setup,
            grace_ms: 2000,
        };
        let mut inbox = Inbox::new();
        for sent in [open, Request::Exchange] {
            let bytes = sent.write();
            let (last, all_but) = bytes.split_last().expect("not empty");
            inbox.push(all_but);
            assert_eq!(inbox.take::<Request>(), Ok(None));
            inbox.push(&[*last]);
            assert_eq!(inbox.take(), Ok(Some(sent)));
        }
    }
}
