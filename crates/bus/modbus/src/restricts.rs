//! A service whose clients can be limited to reading.

use tickbus_fieldbus::tcp::Service;

/// A service that can refuse what a client writes.
pub(crate) trait Restricts: Service {
    /// The client may only read from now on.
    #[cfg_attr(
        not(feature = "tls"),
        expect(dead_code, reason = "only certificates limit clients")
    )]
    fn restrict(client: &mut Self::Client);
}
