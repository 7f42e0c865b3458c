//! Opens a user session on a TCP connection.

use std::sync::Arc;

use futures_util::StreamExt as _;
use opcua::client::{
    Client, ClientBuilder, IdentityToken, Password, Session, SessionPollResult,
    SubscriptionActivity,
};
use opcua::core::comms::url::url_with_replaced_hostname;
use opcua::crypto::SecurityPolicy;
use opcua::types::{EndpointDescription, MessageSecurityMode, StatusCode, UserTokenType};

use crate::pki::{PRODUCT_URI, Pki, meaning, security_policy};
use crate::reactor::Inbox;
use crate::{ClientOptions, Mode, Policy, Trust};
use tickbus_base::time::Nanos;
use tickbus_fieldbus::BusError;

use super::dial::Dial;
use super::feed::Notification;

/// The user and the password, if there is a user.
pub(super) type Login = Option<(String, String)>;

/// The most elements of an array that a server sends.
const LONGEST_ARRAY: usize = 100_000;

/// The largest message of a server, in bytes.
const LARGEST_MESSAGE: usize = 16 << 20;

/// The crate's client, for a peer whose data are stale after `max_age`.
pub(super) fn client(options: &ClientOptions, pki: &Pki, max_age: Nanos) -> Client {
    let patience = max_age
        .times(2)
        .clamp(Nanos::from_secs(5), Nanos::from_secs(10));
    let heartbeat = Nanos(max_age.0 / 3).clamp(Nanos::from_millis(100), Nanos::from_secs(10));
    let secure = options.security != Policy::None;
    let folder = if secure {
        pki.folder.clone()
    } else {
        // The crate would create folders at any path; below a file it cannot.
        std::env::current_exe().unwrap_or_default().join("none")
    };
    let builder = ClientBuilder::new()
        .application_name(&pki.application)
        .application_uri(&pki.uri)
        .product_uri(PRODUCT_URI)
        .session_name(&pki.application)
        .pki_dir(folder)
        .certificate_path(&pki.certificate)
        .private_key_path(&pki.key)
        // The bus checks them before a session is opened, with helpful messages.
        .verify_server_certs(false)
        .trust_server_certs(pki.trust == Trust::Any)
        // The bus's supervisor reconnects, not the crate.
        .session_retry_limit(0)
        .request_timeout(patience.to_duration())
        .keep_alive_interval(heartbeat.to_duration())
        .max_failed_keep_alive_count(2)
        // Some servers list all that is in a folder at once, and nodes can have long arrays: with the crate's limits, of
        // 1,000 elements, the connection would end.
        .max_array_length(LONGEST_ARRAY)
        .max_message_size(LARGEST_MESSAGE)
        .max_chunk_count(LARGEST_MESSAGE >> 13)
        .min_publish_interval(std::time::Duration::from_millis(1))
        .recreate_subscriptions(false);
    Client::new(builder.into_config())
}

/// Asks the server for its endpoints, and chooses the one that matches `options`.
pub(super) async fn endpoint(
    client: &Client,
    dial: Dial,
    options: &ClientOptions,
    login: &Login,
) -> Result<EndpointDescription, BusError> {
    let url = &options.url;
    let endpoints = client.get_endpoints(dial, &[], &[]).await;
    let endpoints = endpoints.map_err(|error| {
        BusError::Protocol(format!(
            "{url} does not answer as an OPC UA server ({error}); check that this is its port"
        ))
    })?;
    choose(&endpoints, options, login).map_err(|refusal| BusError::Refused(refusal.text))
}

/// Why no endpoint of a server can be used.
pub(super) struct NoEndpoint {
    /// The cause as a fixed word.
    pub(super) cause: &'static str,
    /// The reason, and the remedy.
    pub(super) text: String,
}

/// Chooses the endpoint that matches `options`.
pub(super) fn choose(
    endpoints: &[EndpointDescription],
    options: &ClientOptions,
    login: &Login,
) -> Result<EndpointDescription, NoEndpoint> {
    let url = &options.url;
    let mode = match (options.security, options.credentials.mode) {
        (Policy::None, _) => MessageSecurityMode::None,
        (_, Mode::Sign) => MessageSecurityMode::Sign,
        (_, Mode::SignAndEncrypt) => MessageSecurityMode::SignAndEncrypt,
    };
    let policy = security_policy(options.security);
    let fits = |endpoint: &&EndpointDescription| {
        endpoint.security_mode == mode
            && SecurityPolicy::from_uri(endpoint.security_policy_uri.as_ref()) == policy
    };
    let Some(endpoint) = endpoints.iter().find(fits) else {
        let mut offered: Vec<String> = endpoints.iter().map(shown).collect();
        offered.dedup();
        return Err(NoEndpoint {
            cause: "no-endpoint",
            text: format!(
                "the server has no endpoint with {}; it has {}; write one of them as security and mode",
                asked(options),
                offered.join(" and ")
            ),
        });
    };
    let mut endpoint = endpoint.clone();
    check_user(&endpoint, login).map_err(|text| NoEndpoint {
        cause: if login.is_none() {
            "user-required"
        } else {
            "user-refused"
        },
        text,
    })?;
    // The server's own host name may be unknown here.
    let own = url_with_replaced_hostname(
        endpoint.endpoint_url.as_ref(),
        &url.address.host.to_string(),
    );
    endpoint.endpoint_url = own.unwrap_or_else(|_| url.to_string()).into();
    Ok(endpoint)
}

/// The security that the driver.cfg requests.
fn asked(options: &ClientOptions) -> String {
    match options.security {
        Policy::None => "security = \"None\"".to_owned(),
        policy => format!(
            "security = \"{}\" and mode = \"{}\"",
            policy.name(),
            options.credentials.mode.name()
        ),
    }
}

/// An endpoint in the terms of a driver.cfg.
pub(super) fn shown(endpoint: &EndpointDescription) -> String {
    let uri = endpoint.security_policy_uri.as_ref();
    let name = uri.rsplit_once('#').map_or(uri, |(_, name)| name);
    match endpoint.security_mode {
        MessageSecurityMode::None => "\"None\"".to_owned(),
        mode => format!("\"{name}\" with \"{}\"", String::from(mode)),
    }
}

/// Checks that the endpoint accepts this kind of user.
fn check_user(endpoint: &EndpointDescription, login: &Login) -> Result<(), String> {
    let Some(policies) = &endpoint.user_identity_tokens else {
        return Ok(());
    };
    let takes = |kind| policies.iter().any(|policy| policy.token_type == kind);
    match login {
        None if !takes(UserTokenType::Anonymous) => {
            Err("the server lets nobody in without a user; add user and password_file".to_owned())
        }
        Some((user, _)) if !takes(UserTokenType::UserName) => Err(format!(
            "the server takes no user with a password at this endpoint; remove user = \"{user}\", or let \
             the server take it"
        )),
        _ => Ok(()),
    }
}

/// Why there is no session.
pub(super) struct Unopened {
    /// The status that the server gave.
    pub(super) status: StatusCode,
    /// The reason, and the remedy.
    pub(super) error: BusError,
}

impl From<Unopened> for BusError {
    fn from(unopened: Unopened) -> Self {
        unopened.error
    }
}

/// Opens a session, and starts a task that maintains it and reports its end.
pub(super) async fn open(
    client: &Client,
    endpoint: EndpointDescription,
    dial: Dial,
    login: Login,
    pki: &Pki,
    inbox: Inbox<Notification>,
) -> Result<Arc<Session>, Unopened> {
    let secure = endpoint.security_mode != MessageSecurityMode::None;
    let user = login.as_ref().map(|(user, _)| user.clone());
    let token = match login {
        None => IdentityToken::Anonymous,
        Some((user, password)) => IdentityToken::UserName(user, Password::new(password)),
    };
    let store = Arc::clone(client.certificate_store());
    let built = client
        .session_builder()
        .connect_to_endpoint_directly(endpoint)
        .and_then(|builder| {
            let builder = builder.with_connector(dial).user_identity_token(token);
            builder.build(store)
        });
    let (session, events) = built.map_err(|error| Unopened {
        status: StatusCode::BadUnexpectedError,
        error: BusError::Refused(format!("there can be no session ({error})")),
    })?;
    session.disable_reconnects();
    let mut events = Box::pin(events.enter());
    loop {
        let status = match events.next().await {
            Some(Ok(SessionPollResult::Reconnected(_))) => break,
            Some(
                Ok(
                    SessionPollResult::ReconnectFailed(status)
                    | SessionPollResult::ConnectionLost(status),
                )
                | Err(status),
            ) => status,
            Some(Ok(_)) => continue,
            None => StatusCode::BadConnectionClosed,
        };
        let error = refusal(status, secure, user.as_deref(), pki);
        return Err(Unopened { status, error });
    }
    tokio::spawn(async move {
        let end = loop {
            match events.next().await {
                Some(Ok(SessionPollResult::ConnectionLost(status)) | Err(status)) => {
                    break BusError::Link(format!("the session ended ({})", meaning(status)));
                }
                Some(Ok(SessionPollResult::Subscription(
                    SubscriptionActivity::PublishFailed(status)
                    | SubscriptionActivity::FatalFailure(status),
                ))) if is_fatal(status) => {
                    break BusError::Left(format!(
                        "the server keeps the session no more ({})",
                        meaning(status)
                    ));
                }
                Some(Ok(_)) => {}
                None => {
                    break BusError::Left("the server closed the session".to_owned());
                }
            }
        };
        inbox.push(Notification::Ended(end));
    });
    Ok(session)
}

/// True if this status of publishing means that the subscription has ended.
fn is_fatal(status: StatusCode) -> bool {
    [
        StatusCode::BadNoSubscription,
        StatusCode::BadSessionClosed,
        StatusCode::BadSessionIdInvalid,
        StatusCode::BadSecureChannelClosed,
        StatusCode::BadConnectionClosed,
        StatusCode::BadServerHalted,
    ]
    .contains(&status)
}

/// Why there is no session, and the remedy.
fn refusal(status: StatusCode, secure: bool, user: Option<&str>, pki: &Pki) -> BusError {
    let why = meaning(status);
    match status {
        StatusCode::BadIdentityTokenRejected
        | StatusCode::BadIdentityTokenInvalid
        | StatusCode::BadUserAccessDenied
        | StatusCode::BadUserSignatureInvalid => BusError::Refused(match user {
            Some(user) => format!(
                "the server does not let user \"{user}\" in ({why}); check the name, and the password where \
                 it is kept"
            ),
            None => format!(
                "the server lets nobody in without a user ({why}); add user and password_file"
            ),
        }),
        _ if secure => {
            let certificate = pki.folder.join(&pki.certificate);
            let text = format!(
                "the server refused an encrypted session ({why}); if it does not know this end yet, let it \
                 trust \"{}\"",
                certificate.display()
            );
            BusError::Refused(text)
        }
        StatusCode::BadConnectionClosed | StatusCode::BadCommunicationError => {
            BusError::Left(format!("the server closed the connection ({why})"))
        }
        _ => BusError::Refused(format!("the server refused a session ({why})")),
    }
}

/// How long closing the session may take, in real time.
pub(super) const FAREWELL: std::time::Duration = std::time::Duration::from_millis(300);

/// Closes the session.
pub(super) async fn close(session: Arc<Session>) {
    // If this fails, the session is gone already.
    let _ = session.disconnect().await;
}

/// The name by which the server identifies itself: its application, then its product.
pub(super) fn identity(endpoint: &EndpointDescription, product: &str) -> String {
    let uri = endpoint.server.application_uri.as_ref();
    format!("{uri} {product}").trim().to_owned()
}
