//! A client's session, as the bus sees it.

use std::sync::Arc;
use std::time::Duration;

use opcua_server::node_manager::RequestContext;

/// A client's session, accessed through closures because the crate does not export its type.
pub(super) struct Visitor {
    /// The session's number.
    pub(super) id: u32,
    /// The client's name, or otherwise the session's.
    pub(super) name: String,
    /// How much later the session will expire than it would have when this was made, as every request postpones that;
    /// `None` if it has ended.
    pub(super) postponed: Box<dyn Fn() -> Option<Duration> + Send>,
}

impl Visitor {
    /// True as long as the session lasts.
    pub(super) fn is_there(&self) -> bool {
        (self.postponed)().is_some()
    }

    /// The session that makes a request.
    pub(super) fn of(context: &RequestContext) -> Self {
        let session = Arc::clone(&context.session);
        let read = session.read();
        let application = read
            .application_description()
            .application_name
            .text
            .to_string();
        let name = if application.is_empty() {
            read.session_name().to_owned()
        } else {
            application
        };
        let first = read.deadline();
        drop(read);
        Self {
            id: context.session_id,
            name,
            postponed: Box::new(move || {
                let session = session.read();
                let deadline = session.is_activated().then(|| session.deadline())?;
                Some(deadline.saturating_duration_since(first))
            }),
        }
    }
}
