//! Sets up the crate's server as a driver.cfg describes.

use std::net::{IpAddr, SocketAddr};
use std::sync::Arc;

use opcua::crypto::X509Data;
use opcua::types::{BuildInfo, DateTime, MessageSecurityMode};
use opcua_server::diagnostics::DiagnosticsNodeManagerBuilder;
use opcua_server::node_manager::ServerContext;
use opcua_server::node_manager::memory::InMemoryNodeManagerBuilder;
use opcua_server::{
    ANONYMOUS_USER_TOKEN_ID, Server, ServerBuilder, ServerEndpoint, ServerHandle, ServerUserToken,
};

use crate::namespaces::FIRST;
use crate::pki::{PRODUCT, PRODUCT_URI, security_policy};
use crate::{Mode, Policy, Trust};
use tickbus_base::time::Nanos;
use tickbus_fieldbus::BusError;

use super::manager::Signals;
use super::standard::Standard;
use super::{SESSIONS, space};

/// The crate's name for the only user.
const USER: &str = "user";

/// How often subscriptions are processed, in milliseconds, which is also the shortest publishing interval:
/// the bus cycle, limited to 1 to 10 ms.
fn rhythm(cycle: Nanos) -> u64 {
    let millis = cycle.0 / Nanos::from_millis(1).0;
    u64::try_from(millis.clamp(1, 10)).expect("it is positive")
}

/// The number of publishing intervals without changes after which a keep-alive is due: three times within `max_age` for
/// a subscription that publishes every 100 ms, as most do.
fn keep_alives(max_age: Nanos) -> u32 {
    u32::try_from(max_age.0 / Nanos::from_millis(300).0)
        .unwrap_or(u32::MAX)
        .max(1)
}

/// Builds the server of the bus `of`, bound to `bound`, with the nodes of `signals`.
pub(super) fn build(
    of: &super::Server,
    max_age: Nanos,
    login: Option<(String, String)>,
    bound: SocketAddr,
    signals: Signals,
) -> Result<(Server, ServerHandle), BusError> {
    let (options, pki) = (&of.options, &of.pki);
    let folder = if of.is_secure() {
        pki.folder.clone()
    } else {
        // The crate would create folders at any path; below a file it cannot.
        std::env::current_exe().unwrap_or_default().join("none")
    };
    let identity = &options.identity;
    let rhythm = rhythm(of.cycle);
    let host = match &options.host {
        Some(host) => host.clone(),
        None => announced(bound.ip()),
    };
    let mut builder = ServerBuilder::new()
        .application_name(&pki.application)
        .application_uri(&pki.uri)
        .product_uri(stated(identity.product_uri.as_ref(), PRODUCT_URI))
        .pki_dir(folder)
        .certificate_path(&pki.certificate)
        .private_key_path(&pki.key)
        .trust_client_certs(pki.trust == Trust::Any)
        .discovery_urls(vec![format!("opc.tcp://{host}:{}/", bound.port())])
        .host(host)
        .port(bound.port())
        // The diagnostics count the sessions.
        .diagnostics_enabled(true)
        .subscription_poll_interval_ms(rhythm)
        .max_sessions(SESSIONS)
        .build_info(BuildInfo {
            product_uri: stated(identity.product_uri.as_ref(), PRODUCT_URI).into(),
            manufacturer_name: stated(identity.manufacturer.as_ref(), PRODUCT).into(),
            product_name: stated(identity.product.as_ref(), PRODUCT).into(),
            software_version: stated(identity.version.as_ref(), env!("CARGO_PKG_VERSION")).into(),
            build_number: stated(identity.build.as_ref(), "0").into(),
            build_date: DateTime::null(),
        });
    let limits = &mut builder.limits_mut().subscriptions;
    #[expect(clippy::cast_precision_loss, reason = "a few milliseconds")]
    let shortest = rhythm as f64;
    limits.min_publishing_interval_ms = shortest;
    // A client's request for the next publish is its sign of life, so requests must be answered often enough.
    limits.max_keep_alive_count = keep_alives(max_age);
    limits.default_keep_alive_count = limits.max_keep_alive_count;
    // Changes are reported as they happen.
    limits.min_sampling_interval_ms = 0.0;
    limits.max_monitored_items_per_sub = limits
        .max_monitored_items_per_sub
        .max(2 * of.table.signals.len());
    let mut users = Vec::new();
    if options.anonymous {
        users.push(ANONYMOUS_USER_TOKEN_ID.to_owned());
    }
    if let Some((name, password)) = login {
        builder = builder.add_user_token(USER, ServerUserToken::user_pass(name, password));
        users.push(USER.to_owned());
    }
    let mode = match options.credentials.mode {
        Mode::Sign => MessageSecurityMode::Sign,
        Mode::SignAndEncrypt => MessageSecurityMode::SignAndEncrypt,
    };
    for policy in &options.security {
        let mode = match policy {
            Policy::None => MessageSecurityMode::None,
            _ => mode,
        };
        let endpoint = ServerEndpoint::new("/", security_policy(*policy), mode, &users);
        builder = builder.add_endpoint(policy.name(), endpoint);
    }
    let places = Arc::clone(&of.places);
    let (table, name, reads) = (of.table.clone(), of.name.clone(), of.role.areas().1);
    let nodes = move |context: ServerContext, address_space: &mut _| {
        let address_space: &mut opcua_server::address_space::AddressSpace = address_space;
        for (uri, promised) in places.uris.iter().zip(FIRST..) {
            let index = context
                .type_tree
                .write()
                .namespaces_mut()
                .add_namespace(uri);
            debug_assert_eq!(index, promised, "node ids promise it");
            address_space.add_namespace(uri, index);
        }
        space::build(address_space, &places, &name, &table, reads);
        signals
    };
    let wall = pki.wall;
    if let Some(loader) = of.places.wholes.loader() {
        builder = builder.with_type_loader(loader);
    }
    let built = builder
        // The signals' own manager must be the last.
        .with_node_manager(move |context| Standard::new(context, wall))
        .with_node_manager(DiagnosticsNodeManagerBuilder)
        .with_node_manager(InMemoryNodeManagerBuilder::new(nodes))
        .build();
    built.map_err(|error| BusError::Refused(format!("there can be no server ({error})")))
}

/// A stated name, or the usual one.
fn stated<'n>(name: Option<&'n String>, usual: &'n str) -> &'n str {
    name.map_or(usual, String::as_str)
}

/// The host announced to clients: the address to listen on, or the machine's name if that is a wildcard.
fn announced(ip: IpAddr) -> String {
    let name = || X509Data::computer_hostnames().into_iter().next();
    match ip {
        _ if ip.is_unspecified() => name().unwrap_or_else(|| ip.to_string()),
        IpAddr::V4(ip) => ip.to_string(),
        IpAddr::V6(ip) => format!("[{ip}]"),
    }
}
