//! The identity of a server that no driver.cfg names.

use opcua::client::{Client, ClientBuilder};
use opcua::types::{EndpointDescription, Error};
use tickbus_base::time::Stop;
use tickbus_fieldbus::examine::Peer;

use super::connect::shown;
use super::dial::Dial;
use crate::Policy;
use crate::pki::PRODUCT_URI;
use crate::reactor::{Driven, Reactor};

/// How long a server may take to list its endpoints, as a multiple of the time for an answer.
const PATIENCE: i64 = 4;

/// Asks the server for its endpoints: its name, further facts, and the strongest policy that it offers.
pub(crate) fn identity(
    peer: &Peer,
    url: &str,
) -> (
    String,
    Vec<(&'static str, String)>,
    &'static str,
    Vec<String>,
) {
    let endpoints = endpoints(peer, url).unwrap_or_default();
    let Some(first) = endpoints.first() else {
        let security = Policy::Basic256Sha256.name();
        return (String::new(), Vec::new(), security, Vec::new());
    };
    let server = &first.server;
    let name = server.application_name.text.as_ref();
    let identity = format!("{name} ({})", server.application_uri.as_ref());
    let mut offered: Vec<String> = endpoints.iter().map(shown).collect();
    offered.sort();
    offered.dedup();
    let policies = Policy::NAMES.iter().rev().map(|(name, _)| *name);
    let mut strongest = policies.filter(|name| {
        let uri = format!("#{name}");
        endpoints
            .iter()
            .any(|endpoint| endpoint.security_policy_uri.as_ref().ends_with(&uri))
    });
    let security = strongest.next().unwrap_or(Policy::None.name());
    let facts = vec![("security", offered.join(" or "))];
    let own = server.application_uri.as_ref();
    (identity, facts, security, others(peer, url, own))
}

/// The addresses of the other servers that a server lists, as a discovery server does for those that register with it.
fn others(peer: &Peer, url: &str, own: &str) -> Vec<String> {
    let listed = asked(peer, url, async |client, dial| {
        client.find_servers(dial, None, None).await
    });
    let listed = listed.unwrap_or_default().into_iter();
    let others = listed.filter(|server| server.application_uri.as_ref() != own);
    let urls = others.flat_map(|server| server.discovery_urls.unwrap_or_default());
    let mut urls: Vec<String> = urls.map(|url| url.as_ref().to_owned()).collect();
    urls.retain(|url| url.starts_with("opc.tcp://"));
    urls.sort();
    urls.dedup();
    urls
}

fn endpoints(peer: &Peer, url: &str) -> Option<Vec<EndpointDescription>> {
    asked(peer, url, async |client, dial| {
        client.get_endpoints(dial, &[], &[]).await
    })
}

/// The answer to one question, on a connection of its own and without a session.
fn asked<T>(
    peer: &Peer,
    url: &str,
    ask: impl AsyncFnOnce(&Client, Dial) -> Result<T, Error>,
) -> Option<T> {
    let stream = peer.dial().ok()?.socket().ok()?;
    stream.set_nonblocking(true).ok()?;
    // The crate would create folders at any path; below a file it cannot.
    let nowhere = std::env::current_exe().unwrap_or_default().join("none");
    let config = ClientBuilder::new()
        .application_name("tickbus")
        .application_uri("urn:tickbus:find")
        .product_uri(PRODUCT_URI)
        .pki_dir(nowhere)
        .session_retry_limit(0)
        .request_timeout(peer.patience().times(PATIENCE).to_duration())
        .into_config();
    let client = Client::new(config);
    let reactor = Reactor::new(&Stop::new()).ok()?;
    let answer = ask(&client, Dial::new(stream, url));
    let deadline = peer.now() + peer.patience().times(PATIENCE);
    match reactor.drive(peer.clock(), deadline, answer) {
        Driven::Done(answer) => answer.ok(),
        Driven::Late | Driven::Stopped => None,
    }
}
