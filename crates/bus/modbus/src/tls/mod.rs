//! Modbus/TCP Security: telegrams of Modbus TCP within TLS, where each end shows a certificate.

mod accepted;
mod called;
mod examined;
mod files;
mod reason;
mod role;

use std::path::Path;
use std::sync::Arc;

use rustls::pki_types::ServerName;
use rustls::server::WebPkiClientVerifier;
use rustls::{ClientConfig, ConfigBuilder, ConfigSide, ServerConfig, WantsVerifier};
use tickbus_base::Mistake;
use tickbus_base::time::{Nanos, Stop};
use tickbus_fieldbus::tcp::{self, Call, Caller};
use tickbus_fieldbus::{BusError, OpenError, Port};
use tickbus_net::{Address, Host, Stream};

use crate::restricts::Restricts;
use crate::tls_options::Tls;
use accepted::TlsService;
use called::TlsCaller;
pub(crate) use examined::open;
use files::Files;

/// The certificates of a server, for its clients.
#[derive(Clone, Debug)]
pub(crate) struct ServerSide(Arc<ServerConfig>);

/// The certificates of a client, and the name of its server.
#[derive(Clone, Debug)]
pub(crate) struct ClientSide(Arc<ClientConfig>, ServerName<'static>);

/// Serves a service within TLS until `stop`; of its clients those with one of `write_roles` may write, and all of them
/// without such a list.
///
/// # Errors
///
/// As for [`serve`](tcp::serve).
pub(crate) fn serve<S: Restricts>(
    side: &ServerSide,
    write_roles: Option<&[String]>,
    service: S,
    address: &Address,
    port: &mut Port,
    stop: &Stop,
) -> Result<(), BusError> {
    let mut service = TlsService::new(service, side, write_roles);
    tcp::serve(address, &mut service, port, stop)
}

/// Runs a caller within TLS; the peer has `timeout` to show its certificate.
///
/// # Errors
///
/// As for [`Call::run`].
pub(crate) fn call<S: Stream>(
    side: &ClientSide,
    call: &mut Call<S>,
    caller: &mut impl Caller,
    (peer, timeout): (String, Nanos),
    port: &mut Port,
    stop: &Stop,
) -> Result<(), BusError> {
    let now = port.clock().now();
    let mut caller = TlsCaller::new(side, caller, peer, now, timeout);
    call.run(&mut caller, port, stop)
}

/// Reads the files and reports a mistake in them.
pub(crate) fn check(tls: &Tls, folder: &Path, is_server: bool) -> Result<(), Mistake> {
    if is_server {
        server_config(tls, folder).map(|_| ())
    } else {
        client_config(tls, folder).map(|_| ())
    }
}

impl ServerSide {
    /// Reads the files of a server.
    pub(crate) fn load(tls: &Tls, folder: &Path) -> Result<Self, OpenError> {
        let config = server_config(tls, folder).map_err(OpenError::Config)?;
        Ok(Self(config.into()))
    }
}

impl ClientSide {
    /// Reads the files of a client of the server at `address`.
    pub(crate) fn load(tls: &Tls, address: &Address, folder: &Path) -> Result<Self, OpenError> {
        let config = client_config(tls, folder).map_err(OpenError::Config)?;
        let name = match (&tls.server_name, &address.host) {
            (None, Host::Ip(ip)) => ip.to_string(),
            (Some(name), _) | (None, Host::Name(name)) => name.clone(),
        };
        let name = ServerName::try_from(name).map_err(|_| {
            OpenError::Config(Mistake::new(
                "the name of the server is no name of a host",
                "write server_name as the certificate of the server has it, such as \"plc-7.example.com\"",
            ))
        })?;
        Ok(Self(config.into(), name))
    }
}

fn server_config(tls: &Tls, folder: &Path) -> Result<ServerConfig, Mistake> {
    let files = Files::read(tls, folder)?;
    let provider = Arc::new(rustls::crypto::ring::default_provider());
    let roots = Arc::new(files.roots);
    let verifier = WebPkiClientVerifier::builder_with_provider(roots, Arc::clone(&provider))
        .build()
        .map_err(|error| files::wrong("ca_file", &error))?;
    let config = begin(ServerConfig::builder_with_provider(provider))?
        .with_client_cert_verifier(verifier)
        .with_single_cert(files.chain, files.key);
    config.map_err(|error| files::wrong("certificate_file with private_key_file", &error))
}

fn client_config(tls: &Tls, folder: &Path) -> Result<ClientConfig, Mistake> {
    let files = Files::read(tls, folder)?;
    let provider = Arc::new(rustls::crypto::ring::default_provider());
    let config = begin(ClientConfig::builder_with_provider(provider))?
        .with_root_certificates(files.roots)
        .with_client_auth_cert(files.chain, files.key);
    config.map_err(|error| files::wrong("certificate_file with private_key_file", &error))
}

/// TLS 1.2 and 1.3.
fn begin<S: ConfigSide>(
    builder: ConfigBuilder<S, rustls::WantsVersions>,
) -> Result<ConfigBuilder<S, WantsVerifier>, Mistake> {
    let builder = builder.with_safe_default_protocol_versions();
    builder.map_err(|error| files::wrong("TLS", &error))
}
