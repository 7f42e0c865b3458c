//! Access control: who may look, and who may change something.
//!
//! A page of another site, open in the same browser, can send requests to this machine. Without permission it can
//! neither forge `Origin` nor send `Authorization`. A page whose own host name suddenly resolves to this machine (DNS
//! rebinding) would have the same origin as the room, but its requests have that name in `Host`.

use std::io;
use std::net::IpAddr;

use hyper::header::{AUTHORIZATION, HOST, HeaderMap, HeaderName, ORIGIN};

use tickbus_base::is_same_secret;

use crate::token;

/// Checks requests.
pub(crate) struct Guard {
    token: String,
    /// The host name of the room.
    host: String,
}

/// The state of a request's token.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Token {
    Right,
    Wrong,
    Missing,
}

impl Guard {
    /// Guards a room that is served as `host`, with a new token.
    pub(crate) fn new(host: &str) -> io::Result<Self> {
        let host = host.to_ascii_lowercase();
        let token = token::fresh()?;
        Ok(Self { token, host })
    }

    pub(crate) fn set_token(&mut self, token: String) {
        self.token = token;
    }

    pub(crate) fn token(&self) -> &str {
        &self.token
    }

    /// Checks that the request is meant for this room, and comes from nowhere else; if not, says why.
    pub(crate) fn check_source(&self, headers: &HeaderMap) -> Result<(), String> {
        const HOSTS: &str =
            "the request does not say once for which host it is; send one Host header";
        const OTHER: &str =
            "the request comes from a page of another site; open the address that was printed";

        let host = only(headers, &HOST).ok_or(HOSTS)?;
        if !self.is_own(host) {
            let (name, port) = host.rsplit_once(':').unwrap_or((host, "80"));
            return Err(format!(
                "this page is not served under the name {name}; open it by the computer's IP address, or start it with \
                 --page {name}:{port}"
            ));
        }
        if headers.contains_key(ORIGIN) {
            // Behind a proxy the page may come by HTTPS.
            let origin = only(headers, &ORIGIN).and_then(|origin| {
                let other = origin.strip_prefix("http://");
                other.or_else(|| origin.strip_prefix("https://"))
            });
            if !origin.is_some_and(|origin| origin.eq_ignore_ascii_case(host)) {
                return Err(OTHER.to_owned());
            }
        }
        // A browser sends no Origin when a page of another site loads a picture or a script from here. A link from
        // there may be followed.
        let is_elsewhere = headers
            .get_all("sec-fetch-site")
            .iter()
            .any(|site| site == "cross-site" || site == "same-site");
        let mode = HeaderName::from_static("sec-fetch-mode");
        if is_elsewhere && only(headers, &mode) != Some("navigate") {
            return Err(OTHER.to_owned());
        }
        Ok(())
    }

    /// True if a `Host` means this room: by an address, which cannot be rebound, or by its name. The port is not
    /// compared, since a tunnel may use a different one.
    fn is_own(&self, host: &str) -> bool {
        let name = match host.rsplit_once(':') {
            Some((name, port)) if port.bytes().all(|byte| byte.is_ascii_digit()) => name,
            _ => host,
        };
        let inner = name.strip_prefix('[').and_then(|it| it.strip_suffix(']'));
        inner.unwrap_or(name).parse::<IpAddr>().is_ok()
            || name.eq_ignore_ascii_case("localhost")
            || name.eq_ignore_ascii_case(&self.host)
    }

    pub(crate) fn token_of(&self, headers: &HeaderMap) -> Token {
        if !headers.contains_key(AUTHORIZATION) {
            return Token::Missing;
        }
        let given = only(headers, &AUTHORIZATION).and_then(|it| it.strip_prefix("Bearer "));
        let is_right =
            given.is_some_and(|given| is_same_secret(given.as_bytes(), self.token.as_bytes()));
        if is_right { Token::Right } else { Token::Wrong }
    }
}

/// The value of a header that occurs once.
fn only<'h>(headers: &'h HeaderMap, name: &HeaderName) -> Option<&'h str> {
    let mut all = headers.get_all(name).iter();
    let first = all.next()?.to_str().ok()?;
    all.next().is_none().then_some(first)
}

#[cfg(test)]
mod tests {
    use hyper::header::HeaderValue;

    use super::*;

    fn headers(all: &[(HeaderName, &'static str)]) -> HeaderMap {
        let mut map = HeaderMap::new();
        for (name, value) in all {
            map.append(name, HeaderValue::from_static(value));
        }
        map
    }

    #[test]
    fn a_request_is_for_this_room_by_address_or_by_its_name() {
        let guard = Guard::new("Lab.example").expect("random numbers");
        for host in [
            "127.0.0.1:20080",
            "localhost:20080",
            "LOCALHOST",
            "[::1]:8",
            "192.168.0.20",
            "lab.example:1",
        ] {
            assert_eq!(
                guard.check_source(&headers(&[(HOST, host)])),
                Ok(()),
                "{host}"
            );
        }
        for host in [
            "evil.example",
            "evil.example:20080",
            "127.0.0.1.evil.example",
            "localhost.evil.example",
            "",
            ":80",
            "127.0.0.1:80@evil.example",
            "[::1].evil.example",
        ] {
            assert!(
                guard.check_source(&headers(&[(HOST, host)])).is_err(),
                "{host}"
            );
        }
        assert!(guard.check_source(&headers(&[])).is_err());
        let two = headers(&[(HOST, "localhost"), (HOST, "localhost")]);
        assert!(guard.check_source(&two).is_err());
    }

    #[test]
    fn a_page_of_another_site_is_refused() {
        let guard = Guard::new("127.0.0.1").expect("random numbers");
        let of = |origin| headers(&[(HOST, "127.0.0.1:80"), (ORIGIN, origin)]);
        for own in ["http://127.0.0.1:80", "https://127.0.0.1:80"] {
            assert_eq!(guard.check_source(&of(own)), Ok(()), "{own}");
        }
        for origin in [
            "http://evil.example",
            "http://127.0.0.1:81",
            "http://127.0.0.1",
            "https://127.0.0.1:81",
            "ftp://127.0.0.1:80",
            "null",
            "",
        ] {
            assert!(guard.check_source(&of(origin)).is_err(), "{origin}");
        }
    }

    #[test]
    fn what_another_site_loads_is_refused_but_its_links_may_be_followed() {
        let guard = Guard::new("127.0.0.1").expect("random numbers");
        let of = |site, mode| {
            headers(&[
                (HOST, "127.0.0.1:80"),
                (HeaderName::from_static("sec-fetch-site"), site),
                (HeaderName::from_static("sec-fetch-mode"), mode),
            ])
        };
        for site in ["none", "same-origin"] {
            assert_eq!(guard.check_source(&of(site, "no-cors")), Ok(()), "{site}");
        }
        for site in ["cross-site", "same-site"] {
            assert_eq!(guard.check_source(&of(site, "navigate")), Ok(()), "{site}");
            for mode in ["no-cors", "cors", "websocket"] {
                assert!(
                    guard.check_source(&of(site, mode)).is_err(),
                    "{site} {mode}"
                );
            }
        }
    }

    #[test]
    fn the_refusal_of_a_name_says_how_to_have_it() {
        let guard = Guard::new("localhost").expect("random numbers");
        let refused = guard.check_source(&headers(&[(HOST, "labpc:20080")]));
        assert_eq!(
            refused.expect_err("not its name"),
            "this page is not served under the name labpc; open it by the computer's IP address, or start it with \
             --page labpc:20080"
        );
    }

    #[test]
    fn the_token_is_right_or_wrong() {
        let guard = Guard::new("127.0.0.1").expect("random numbers");
        let other = Guard::new("127.0.0.1").expect("random numbers");
        assert_eq!(guard.token().len(), 32);
        assert_ne!(guard.token(), other.token());
        let with = |text: &str| {
            let mut map = HeaderMap::new();
            map.insert(AUTHORIZATION, HeaderValue::from_str(text).expect("text"));
            map
        };
        let right = format!("Bearer {}", guard.token());
        assert_eq!(guard.token_of(&with(&right)), Token::Right);
        for text in [
            "",
            "Bearer ",
            &right[..38],
            &format!("{right}0"),
            guard.token(),
            other.token(),
        ] {
            assert_eq!(guard.token_of(&with(text)), Token::Wrong, "{text}");
        }
        assert_eq!(guard.token_of(&HeaderMap::new()), Token::Missing);
    }
}
