//! A client's session, as the bus knows it.

use std::sync::Arc;
use std::time::Instant;

use opcua::server::node_manager::RequestContext;

/// A client's session. It is reached through closures because the crate does not export its type.
pub(super) struct Visitor {
    /// The session's number.
    pub(super) id: u32,
    /// The client's name, or else the session's.
    pub(super) name: String,
    /// When the session will expire, which every request postpones; `None` if it is over.
    pub(super) deadline: Box<dyn Fn() -> Option<Instant> + Send>,
}

impl Visitor {
    /// Whether its session lasts.
    pub(super) fn is_there(&self) -> bool {
        (self.deadline)().is_some()
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
        drop(read);
        Self {
            id: context.session_id,
            name,
            deadline: Box::new(move || {
                let session = session.read();
                session.is_activated().then(|| session.deadline())
            }),
        }
    }
}
