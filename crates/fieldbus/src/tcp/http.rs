//! Telling a web browser from a peer.

/// Request lines of browsers begin so. The published grammar of dispatchers has a `CONNECT` of its own, and browsers send
/// that to proxies only.
const BEGINNINGS: [&[u8]; 9] = [
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

/// Why such a connection is closed, for a log or as an answer.
pub const IS_HTTP: &str = "this is an HTTP request, as a web page may send it without the user's knowledge; no web server is here";

/// Whether the first bytes of a connection begin an HTTP request.
///
/// Any web site can have a browser send requests to ports of the same computer and its network, and chooses the body. Ports
/// without a password therefore close such a connection before they look at the body.
pub fn begins_like_http(bytes: &[u8]) -> bool {
    BEGINNINGS.iter().any(|it| bytes.starts_with(it))
}

#[cfg(test)]
mod tests {
    use super::begins_like_http;

    #[test]
    fn requests_of_browsers_are_told_from_lines_and_records() {
        for request in [
            "GET / HTTP/1.1\r\n",
            "POST /any?thing HTTP/1.1",
            "OPTIONS * HTTP/1.1",
            "PUT /",
        ] {
            assert!(begins_like_http(request.as_bytes()), "{request}");
        }
        for line in [
            "P Q1=24",
            "CONNECT I1:P1:Q2",
            "VR POST Q1",
            "GET",
            "",
            "\0\0",
        ] {
            assert!(!begins_like_http(line.as_bytes()), "{line}");
        }
    }
}
