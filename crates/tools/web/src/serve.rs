//! One request and its answer.

use std::convert::Infallible;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Duration;

use futures_util::{Stream, StreamExt as _};
use http_body_util::combinators::UnsyncBoxBody;
use http_body_util::{BodyExt as _, Full, Limited, StreamBody};
use hyper::body::{Bytes, Incoming};
use hyper::header::{
    ALLOW, CACHE_CONTROL, CONTENT_SECURITY_POLICY, CONTENT_TYPE, HeaderName, HeaderValue, LOCATION,
    REFERRER_POLICY, X_CONTENT_TYPE_OPTIONS,
};
use hyper::{Method, Request, Response, StatusCode};
use tokio::time::timeout;

use crate::events;
use crate::feed::json;
use crate::feeds::Feeds;
use crate::guard::{Guard, Token};
use crate::pages::Pages;
use crate::site::{Answer, Change, Verb};
use crate::slim::slim;

/// Only the page and its own files; nothing from other hosts, nothing inline, not within a frame.
const POLICY: &str = "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; img-src 'self' data:; \
     base-uri 'none'; form-action 'none'; frame-ancestors 'none'";

const JSON: &str = "application/json";

/// The data shared by all connections.
pub(crate) struct Hall {
    pub(crate) pages: Pages,
    pub(crate) guard: Guard,
    pub(crate) feeds: Arc<Feeds>,
    pub(crate) patience: Duration,
    /// The number of viewers with the token.
    pub(crate) holders: AtomicUsize,
}

impl Hall {
    /// Reports activity of a viewer with the token to the site.
    fn heard(&self) {
        self.pages.heard(self.holders.load(Ordering::Relaxed));
    }
}

/// A viewer with the token.
struct Holder(Arc<Hall>);

impl Holder {
    fn new(hall: &Arc<Hall>) -> Self {
        hall.holders.fetch_add(1, Ordering::Relaxed);
        hall.heard();
        Self(Arc::clone(hall))
    }
}

impl Drop for Holder {
    fn drop(&mut self) {
        self.0.holders.fetch_sub(1, Ordering::Relaxed);
        self.0.heard();
    }
}

type Body = UnsyncBoxBody<Bytes, Infallible>;

/// A status and a sentence.
type Refusal = (StatusCode, String);

pub(crate) async fn answer(
    hall: &Arc<Hall>,
    request: Request<Incoming>,
) -> Result<Response<Body>, Infallible> {
    let answered = respond(hall, request).await;
    let mut response = answered.unwrap_or_else(|(status, text)| {
        let json = serde_json::json!({ "code": status.as_u16(), "text": text });
        let mut response = full(JSON, format!("{json}\n"));
        *response.status_mut() = status;
        if status == StatusCode::METHOD_NOT_ALLOWED {
            let methods = HeaderValue::from_static("GET, PUT, DELETE");
            response.headers_mut().insert(ALLOW, methods);
        }
        response
    });
    let headers = response.headers_mut();
    for (name, value) in [
        (CACHE_CONTROL, "no-store"),
        (CONTENT_SECURITY_POLICY, POLICY),
        (REFERRER_POLICY, "no-referrer"),
        (X_CONTENT_TYPE_OPTIONS, "nosniff"),
        (
            HeaderName::from_static("cross-origin-resource-policy"),
            "same-origin",
        ),
    ] {
        headers.insert(name, HeaderValue::from_static(value));
    }
    Ok(response)
}

async fn respond(hall: &Arc<Hall>, request: Request<Incoming>) -> Result<Response<Body>, Refusal> {
    if request.uri().authority().is_some() {
        let text = "this is not a proxy; ask for a path";
        return Err((StatusCode::BAD_REQUEST, text.to_owned()));
    }
    hall.guard
        .check_source(request.headers())
        .map_err(|why| (StatusCode::FORBIDDEN, why))?;
    let token = hall.guard.token_of(request.headers());
    if token == Token::Right {
        hall.heard();
    }
    let path = request.uri().path().to_owned();
    let verb = match *request.method() {
        Method::GET => return get(hall, &path, request.uri().query(), token).await,
        Method::PUT => Verb::Put,
        Method::DELETE => Verb::Delete,
        _ => {
            let text = "use GET to look, PUT and DELETE to change";
            return Err((StatusCode::METHOD_NOT_ALLOWED, text.to_owned()));
        }
    };
    if token != Token::Right {
        return Err(no_token(token));
    }
    let longest = hall.pages.longest_body(&path).ok_or_else(nobody)?;
    let body = body(hall, request, longest).await?;
    let (answer, outcome) = Answer::new();
    hall.pages.change(Change { verb, path, body }, answer);
    let outcome = timeout(hall.patience, outcome).await;
    let outcome = outcome.map_err(|_| undecided())?.map_err(|_| nobody())?;
    // A refused change changed nothing, unless the site itself failed.
    if outcome
        .as_ref()
        .err()
        .is_none_or(|refused| refused.status >= 500)
    {
        hall.feeds.changed();
    }
    outcome.map_err(|refused| {
        let status = StatusCode::from_u16(refused.status);
        (
            status.unwrap_or(StatusCode::INTERNAL_SERVER_ERROR),
            refused.text,
        )
    })?;
    Ok(full(JSON, "{\"code\":200,\"text\":\"done\"}\n".to_owned()))
}

async fn get(
    hall: &Arc<Hall>,
    path: &str,
    query: Option<&str>,
    token: Token,
) -> Result<Response<Body>, Refusal> {
    let holder = || (token == Token::Right).then(|| Holder::new(hall));
    if let Some(query) = query.filter(|_| path == "/events") {
        let pages = events::asked(query).map_err(|text| (StatusCode::BAD_REQUEST, text))?;
        return Ok(stream(events::of_pages(&hall.feeds, pages), holder()));
    }
    // The state of the page at what is before the end of the path.
    let viewer = |end: &str| {
        let page = path.strip_suffix(end)?;
        hall.feeds
            .subscribe(if page.is_empty() { "/" } else { page })
    };
    if let Some(viewer) = viewer("/state") {
        let mut viewer = viewer.starting_now();
        let state = timeout(hall.patience, viewer.next()).await;
        let state = state.map_err(|_| hung())?;
        return Ok(full(JSON, json(&state.ok_or_else(nobody)?)));
    }
    if let Some(viewer) = viewer("/events") {
        return Ok(stream(events::of_page(viewer), holder()));
    }
    match path {
        "/tabs" => Ok(full(JSON, hall.pages.tabs().to_string())),
        "/access" if token == Token::Wrong => Err(no_token(token)),
        "/access" => Ok(full(
            JSON,
            format!("{{\"may_change\":{}}}\n", token == Token::Right),
        )),
        _ => {
            if let Some(asset) = hall.pages.asset(path) {
                return Ok(full(asset.kind, slim(&asset)));
            }
            if let Some(other) = hall.pages.instead_of_first().filter(|_| path == "/") {
                return Ok(see_other(&other));
            }
            if hall.pages.is_private(path) && token != Token::Right {
                return Err(no_token(token));
            }
            let (answer, document) = Answer::new();
            hall.pages.get(path, answer);
            let document = timeout(hall.patience, document).await;
            let document = document.map_err(|_| hung())?.map_err(|_| nobody())?;
            let none = || (StatusCode::NOT_FOUND, format!("there is no {path} here"));
            let document = document.ok_or_else(none)?;
            Ok(full(document.kind, document.text))
        }
    }
}

/// The answer that lasts; its viewer counts as present if it has the token.
fn stream(
    events: impl Stream<Item = events::Sent> + Send + 'static,
    holder: Option<Holder>,
) -> Response<Body> {
    let events = events.inspect(move |_| {
        let _ = &holder;
    });
    respond_with("text/event-stream", StreamBody::new(events).boxed_unsync())
}

async fn body(hall: &Hall, request: Request<Incoming>, longest: usize) -> Result<String, Refusal> {
    let body = Limited::new(request.into_body(), longest).collect();
    let Ok(body) = timeout(hall.patience, body).await else {
        let text = "the body did not arrive in time; send it at once";
        return Err((StatusCode::REQUEST_TIMEOUT, text.to_owned()));
    };
    let body = body.map_err(|error| {
        if error.is::<http_body_util::LengthLimitError>() {
            let text = format!("the body has more than {longest} bytes; send less at a time");
            (StatusCode::PAYLOAD_TOO_LARGE, text)
        } else {
            (StatusCode::BAD_REQUEST, "the body broke off".to_owned())
        }
    })?;
    let text = String::from_utf8(body.to_bytes().into());
    let text = text.map_err(|_| (StatusCode::BAD_REQUEST, "the body is not UTF-8".to_owned()))?;
    Ok(text.trim().to_owned())
}

fn see_other(path: &str) -> Response<Body> {
    let mut response = full(JSON, "{}\n".to_owned());
    *response.status_mut() = StatusCode::SEE_OTHER;
    // A path that is no header leads nowhere.
    if let Ok(path) = HeaderValue::from_str(path) {
        response.headers_mut().insert(LOCATION, path);
    }
    response
}

fn no_token(token: Token) -> Refusal {
    let text = if token == Token::Wrong {
        "the token is not this room's, as after a restart; open the address that is printed now"
    } else {
        "there is no token; send Authorization: Bearer and the token of the printed address"
    };
    (StatusCode::UNAUTHORIZED, text.to_owned())
}

fn nobody() -> Refusal {
    let text = "what this page shows has ended; start it again";
    (StatusCode::SERVICE_UNAVAILABLE, text.to_owned())
}

fn hung() -> Refusal {
    let text = "what this page shows does not answer; look at its log, or start it again";
    (StatusCode::GATEWAY_TIMEOUT, text.to_owned())
}

fn undecided() -> Refusal {
    let text = "what this page shows does not answer, and may still make the change; look at its log, or start it again";
    (StatusCode::GATEWAY_TIMEOUT, text.to_owned())
}

fn full(kind: &'static str, text: impl Into<Bytes>) -> Response<Body> {
    respond_with(kind, Full::new(text.into()).boxed_unsync())
}

fn respond_with(kind: &'static str, body: Body) -> Response<Body> {
    let mut response = Response::new(body);
    let kind = HeaderValue::from_static(kind);
    response.headers_mut().insert(CONTENT_TYPE, kind);
    response
}
