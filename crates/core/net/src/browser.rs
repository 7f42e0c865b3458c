//! Distinguishes a web browser from a peer.

/// The beginnings of browsers' request lines. `CONNECT` is not among them: the published grammar of dispatchers has its
/// own `CONNECT`, and browsers send that method only to proxies.
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

/// The bytes that follow type and length in every STUN message.
const STUN_COOKIE: [u8; 4] = [0x21, 0x12, 0xA4, 0x42];

/// The reason for closing such a connection, for a log or as an answer.
pub const IS_BROWSER: &str = "this is an HTTP request or another message of a web browser, as a web page may send it without the user's knowledge; no web server is here";

/// Returns true if the first bytes of a connection are those of a web browser: an HTTP request, the TLS hello of
/// `https:` and `wss:`, or a message to a WebRTC relay.
///
/// Any web site can make a browser open connections to ports of the same computer and its network. The site chooses
/// parts of the sent bytes: the body of a request, and the ticket in a hello. Ports without a password therefore close
/// such a connection before they read further.
pub fn begins_like_browser(bytes: &[u8]) -> bool {
    REQUESTS.iter().any(|it| bytes.starts_with(it)) || is_tls_hello(bytes) || is_stun(bytes)
}

/// The beginning of a handshake record with a `ClientHello`; `None` for versions and lengths.
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

/// Returns true if the bytes, compared as far as [`HELLO`] goes, are those of a hello.
fn fits_hello(bytes: &[u8]) -> bool {
    let mut pairs = bytes.iter().zip(HELLO);
    pairs.all(|(byte, right)| right.is_none_or(|right| *byte == right))
}

/// Returns true for a handshake record that holds one `ClientHello` and nothing else.
fn is_tls_hello(bytes: &[u8]) -> bool {
    let &[_, _, _, high, low, _, _, hello_high, hello_low, _, ..] = bytes else {
        return false;
    };
    let record = u16::from_be_bytes([high, low]);
    fits_hello(bytes) && record.checked_sub(4) == Some(u16::from_be_bytes([hello_high, hello_low]))
}

/// Returns true for a STUN message. The types that browsers send begin with 0 or 1: the methods of STUN and TURN (RFC
/// 8489, RFC 8656) and the class.
fn is_stun(bytes: &[u8]) -> bool {
    matches!(bytes, [0 | 1, ..]) && bytes.get(4..8) == Some(&STUN_COOKIE)
}

/// Returns true if bytes that [`begins_like_browser`] does not recognise yet may still become a browser's, together
/// with the bytes that follow.
///
/// The first bytes of a TLS hello or a STUN message may contain a line feed. A port that reads lines must therefore
/// wait for the rest before it accepts such a line.
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
        // The bytes that Chromium sends to https://127.0.0.1:20070/, and with turn:127.0.0.1:20070?transport=tcp.
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
