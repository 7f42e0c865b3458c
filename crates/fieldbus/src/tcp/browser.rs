//! Telling a web browser from a peer.

/// Request lines of browsers begin so. The published grammar of dispatchers has a `CONNECT` of its own, and browsers send
/// that to proxies only.
const REQUESTS: [&[u8]; 9] = [
    b"GET /",
    b"POST /",
    b"HEAD /",
    b"OPTIONS /",
    b"OPTIONS *",
    b"PUT /",
    b"DELETE /",
    b"PATCH /",
    b"TRACE /",
];

/// What every STUN message has behind its type and length.
const STUN_COOKIE: [u8; 4] = [0x21, 0x12, 0xA4, 0x42];

/// Why such a connection is closed, for a log or as an answer.
pub const IS_BROWSER: &str = "this is an HTTP request or another message of a web browser, as a web page may send it without the user's knowledge; no web server is here";

/// Whether the first bytes of a connection are those of a web browser: an HTTP request, the hello of TLS behind `https:` and
/// `wss:`, or a message to a relay of WebRTC.
///
/// Any web site can have a browser open connections to ports of the same computer and its network, and chooses parts of what is
/// sent: the body of a request, and the ticket in a hello. Ports without a password therefore close such a connection before
/// they look further.
pub fn begins_like_browser(bytes: &[u8]) -> bool {
    REQUESTS.iter().any(|it| bytes.starts_with(it)) || is_tls_hello(bytes) || is_stun(bytes)
}

/// How a handshake record with a `ClientHello` begins; versions and lengths stand as `None`.
const HELLO: [Option<u8>; 10] = [
    Some(0x16),
    Some(3),
    None,
    None,
    None,
    Some(1),
    Some(0),
    None,
    None,
    Some(3),
];

/// Whether the bytes, or as many as a beginning has, are those of a hello.
fn fits_hello(bytes: &[u8]) -> bool {
    let mut pairs = bytes.iter().zip(HELLO);
    pairs.all(|(byte, right)| right.is_none_or(|right| *byte == right))
}

/// A handshake record that holds one `ClientHello` and nothing else.
fn is_tls_hello(bytes: &[u8]) -> bool {
    let &[_, _, _, high, low, _, _, hello_high, hello_low, _, ..] = bytes else {
        return false;
    };
    let record = u16::from_be_bytes([high, low]);
    fits_hello(bytes) && record.checked_sub(4) == Some(u16::from_be_bytes([hello_high, hello_low]))
}

/// The types that browsers send begin with 0 or 1: the methods of STUN and TURN (RFC 8489, RFC 8656) and the class.
fn is_stun(bytes: &[u8]) -> bool {
    matches!(bytes, [0 | 1, ..]) && bytes.get(4..8) == Some(&STUN_COOKIE)
}

/// Whether bytes that [`begins_like_browser`] does not know yet may turn out to be a browser's with those that follow.
///
/// A hello of TLS and a message of STUN may have a line feed among their first bytes, so that a port that takes lines must not
/// take such a line for one before the rest is there.
pub fn may_become_browser(bytes: &[u8]) -> bool {
    let cookie = bytes.get(4..).unwrap_or_default();
    let is_hello = bytes.len() < HELLO.len() && fits_hello(bytes);
    let is_message =
        matches!(bytes, [0 | 1, ..]) && bytes.len() < 8 && STUN_COOKIE.starts_with(cookie);
    !bytes.is_empty() && (is_hello || is_message)
}

#[cfg(test)]
mod tests {
    use super::{begins_like_browser, may_become_browser};

    #[test]
    fn requests_of_browsers_are_told_from_lines_and_records() {
        for request in [
            "GET / HTTP/1.1\r\n",
            "POST /any?thing HTTP/1.1",
            "OPTIONS * HTTP/1.1",
            "PUT /",
        ] {
            assert!(begins_like_browser(request.as_bytes()), "{request}");
        }
        for line in [
            "P Q1=24",
            "CONNECT I1:P1:Q2",
            "VR POST Q1",
            "GET",
            "",
            "\0\0",
        ] {
            assert!(!begins_like_browser(line.as_bytes()), "{line}");
        }
    }

    #[test]
    fn what_browsers_send_with_https_and_webrtc_is_told_from_records() {
        // As Chromium sends it to https://127.0.0.1:20070/, and with turn:127.0.0.1:20070?transport=tcp.
        let hello = b"\x16\x03\x01\x07\x6b\x01\x00\x07\x67\x03\x03\x2a\xbd";
        let allocate = b"\x00\x03\x00\x08\x21\x12\xa4\x42\x32\x4d\x58\x4d";
        assert!(begins_like_browser(hello));
        assert!(begins_like_browser(allocate));
        for record in [
            b"\x16\x03\x01\x07\x6b\x01\x00\x07\x68\x03\x03".as_slice(),
            b"\x16\x03\x01\x00\x03\x01\x00\xff\xff\x03\x03",
            b"\x16\x03\x01\x07",
            b"\x00\x03\x00\x08\x21\x12\xa4\x43",
            b"\x02\x03\x00\x08\x21\x12\xa4\x42",
        ] {
            assert!(!begins_like_browser(record), "{record:02x?}");
        }
        for whole in [hello.as_slice(), allocate] {
            let known = (1..=whole.len()).find(|count| begins_like_browser(&whole[..*count]));
            let known = known.expect("it is known at some byte");
            for count in 1..known {
                assert!(
                    may_become_browser(&whole[..count]),
                    "{count} bytes of {whole:02x?}"
                );
            }
        }
        assert!(!may_become_browser(b"P Q1=24\n"));
        assert!(!may_become_browser(b"\0\x01~~\n"));
        assert!(!may_become_browser(b""));
        assert!(!may_become_browser(&[0; 10]));
    }
}
