//! The guard of a PLC's memory: tickbus writes only to a PLC that the driver.cfg names.

use std::ops::Range;

use super::{Port, Role};
use tickbus_base::os::one_line;

/// Keeps a bus that connects to a PLC from writing to the wrong one.
///
/// A driver.cfg names the PLC in `write_to`, by the identity that the PLC reports. Until that identity was
/// [met](Self::meet), the bus only reads.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct WriteGuard {
    write_to: Option<String>,
    may_write: bool,
    /// The identity last logged as the wrong one.
    told: Option<String>,
    /// True at an end that has nothing to write, and so no PLC that it may write to.
    observes: bool,
}

impl WriteGuard {
    /// A guard that permits writes to the PLC that `write_to` names, or to none.
    pub fn new(write_to: Option<&str>) -> Self {
        Self {
            write_to: write_to.map(str::to_owned),
            may_write: false,
            told: None,
            observes: false,
        }
    }

    /// The guard of the end with `role`: an observer's permits no writes, whatever `write_to` names.
    pub fn of(role: Role, write_to: Option<&str>) -> Self {
        let observes = role == Role::Observer;
        Self {
            observes,
            ..Self::new(write_to.filter(|_| !observes))
        }
    }

    /// Returns true if a PLC is named.
    pub const fn names_one(&self) -> bool {
        self.write_to.is_some()
    }

    /// Returns true if the bus may write to the current PLC.
    pub const fn may_write(&self) -> bool {
        self.may_write
    }

    /// The PLC of these stations reports `identity`, or the bus identifies the PLC by it. Returns true if the bus may
    /// write to this PLC. If not, statistics and log report this, and the setting that would permit it.
    pub fn meet(&mut self, port: &mut Port, stations: Range<usize>, identity: &str) -> bool {
        let identity = &*one_line(identity);
        if self.observes {
            port.set_may_write(stations, false);
            port.tell("identity", identity);
            return false;
        }
        self.may_write = self.write_to.as_deref() == Some(identity);
        port.set_may_write(stations, self.may_write);
        port.tell("identity", identity);
        port.tell("writes", if self.may_write { "allowed" } else { "blocked" });
        if !self.may_write && self.told.as_deref() != Some(identity) {
            self.told = Some(identity.to_owned());
            let why = match &self.write_to {
                None => "no \"write_to\" names it".to_owned(),
                Some(other) => format!("\"write_to\" names \"{other}\""),
            };
            port.log(
                log::Level::Warn,
                "write_to",
                format_args!(
                    "nothing is written into the PLC \"{identity}\", because {why}; if its outputs may be moved \
                     from here, write into [fieldbus]: write_to = {}",
                    quoted(identity)
                ),
            );
        }
        self.may_write
    }

    /// The PLC is gone; the next one must be identified first.
    pub fn part(&mut self) {
        self.may_write = false;
    }
}

/// The text as a TOML string.
fn quoted(text: &str) -> String {
    format!("\"{}\"", text.replace('\\', "\\\\").replace('"', "\\\""))
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::LinkStatus;
    use tickbus_base::time::{Manual, Nanos};
    use tickbus_image::image;
    use tickbus_test_log as logged;

    fn port() -> (Port, LinkStatus, logged::Watch) {
        let logged = logged::Watch::over("tickbus_fieldbus");
        let status = LinkStatus::new("test", Nanos::from_millis(100));
        let clock: Arc<Manual> = Manual::new();
        let (_, end) = image(Vec::new());
        let port = Port::new(end, clock, Role::Device, None, status.clone());
        (port, status, logged)
    }

    fn statistics(status: &LinkStatus) -> String {
        let mut statistics = tickbus_base::statistics::Statistics::default();
        status.write(Nanos::ZERO, &mut statistics);
        statistics.to_string()
    }

    #[test]
    fn only_the_plc_that_was_named_is_written_to() {
        logged::expect("nothing is written into the PLC \"ACME ");
        let (mut port, status, _logged) = port();
        let mut guard = WriteGuard::new(Some("ACME 7"));
        assert!(!guard.may_write(), "nobody was met");
        assert!(!guard.meet(&mut port, 0..0, "ACME 8"));
        let text = statistics(&status);
        assert!(
            text.contains("\nidentity=ACME 8\nwrites=blocked\n"),
            "{text}"
        );
        assert!(guard.meet(&mut port, 0..0, "ACME 7") && guard.may_write());
        assert!(statistics(&status).contains("\nidentity=ACME 7\nwrites=allowed\n"));
        guard.part();
        assert!(!guard.may_write(), "it is gone");
        assert!(
            !WriteGuard::new(None).meet(&mut port, 0..0, "ACME 7"),
            "none was named"
        );
    }

    #[test]
    fn an_observer_may_not_write_to_the_plc_that_is_named() {
        let (mut port, status, _logged) = port();
        let mut guard = WriteGuard::of(Role::Observer, Some("ACME 7"));
        assert!(!guard.names_one());
        assert!(!guard.meet(&mut port, 0..0, "ACME 7") && !guard.may_write());
        assert!(statistics(&status).contains("\nidentity=ACME 7\n"));
    }

    #[test]
    fn an_identity_is_quoted_as_a_driver_cfg_wants_it() {
        assert_eq!(quoted(r#"6ES7 "x" C:\y"#), r#""6ES7 \"x\" C:\\y""#);
    }
}
