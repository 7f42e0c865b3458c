//! Finding servers that no driver.cfg names.

use tickbus_fieldbus::examine::{Found, Search, Searching};

use super::hello::{Answer, greet};
use super::url::PORT;

/// How OPC UA servers are found.
pub(crate) const SEARCH: Search = Search {
    bus: "opcua",
    port: PORT,
    ask,
    datagrams: None,
};

fn ask(searching: Searching<'_>) -> Vec<Found> {
    let Searching { peer, mut wire, .. } = searching;
    let url = format!("opc.tcp://{}", peer.address);
    match greet(&mut wire, &url) {
        Answer::Acknowledged | Answer::Refused(..) => {}
        Answer::Alien(_) | Answer::End(_) => return Vec::new(),
    }
    #[cfg(feature = "opcua")]
    let (identity, facts, security, named) = super::client::found(&peer, &url);
    #[cfg(not(feature = "opcua"))]
    let (identity, facts, security, named) =
        (String::new(), Vec::new(), "Basic256Sha256", Vec::new());
    vec![Found {
        identity,
        facts,
        stanza: format!(
            "[fieldbus]\nkind     = \"opcua-client\"\nurl      = \"{url}\"\nsecurity = \"{security}\"\n"
        ),
        named,
    }]
}
