//! Checks the owner of a certificate: the ApplicationUri must be among its alternative names.

use opcua::crypto::X509;
use x509_cert::Certificate;
use x509_cert::der::Decode as _;
use x509_cert::ext::pkix::SubjectAltName;
use x509_cert::ext::pkix::name::GeneralName;

/// Checks that a certificate belongs to the application `uri`: one of its alternative names is that URI, in
/// any position among the host names (OPC 10000-6, 6.2.2).
///
/// # Errors
///
/// The application that the certificate belongs to instead.
pub(super) fn check(certificate: &X509, uri: &str) -> Result<(), String> {
    let der = certificate
        .to_der()
        .map_err(|_| "it cannot be read".to_owned())?;
    let uris = uris(&der)?;
    if uris.iter().any(|own| own == uri) {
        return Ok(());
    }
    Err(match &uris[..] {
        [] => format!("it names no application, and the one that shows it is \"{uri}\""),
        uris => format!(
            "it is that of \"{}\", and the one that shows it is \"{uri}\"",
            uris.join("\", \"")
        ),
    })
}

/// The URIs among the alternative names of a certificate.
fn uris(der: &[u8]) -> Result<Vec<String>, String> {
    let parsed = Certificate::from_der(der);
    let names = parsed.and_then(|parsed| parsed.tbs_certificate.get::<SubjectAltName>());
    let names = names.map_err(|error| format!("it cannot be read: {error}"))?;
    let names = names.map(|(_, names)| names.0).unwrap_or_default();
    let uris = names.iter().filter_map(|name| match name {
        GeneralName::UniformResourceIdentifier(uri) => Some(uri.to_string()),
        _ => None,
    });
    Ok(uris.collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// As made by node-opcua with openssl: `DNS:vm, IP:127.0.0.1, URI:urn:vm:NodeOPCUA-Server`.
    const HOST_FIRST: &[u8] = include_bytes!("../../../../tests/peers/host-first.der");

    #[test]
    fn the_uri_of_an_application_counts_wherever_it_stands_among_the_names() {
        let certificate = X509::from_der(HOST_FIRST).expect("a certificate");
        check(&certificate, "urn:vm:NodeOPCUA-Server").expect("its own");
        for other in ["urn:somebody:else", "vm", "127.0.0.1", ""] {
            let told = check(&certificate, other).expect_err(other);
            assert!(
                told.contains("that of \"urn:vm:NodeOPCUA-Server\""),
                "{told}"
            );
        }
    }
}
