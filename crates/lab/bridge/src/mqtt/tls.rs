//! Encrypted connections with a broker.

use std::error::Error;
use std::io;
use std::sync::Arc;

use rumqttc::{ConnectReturnCode, ConnectionError, TlsError, Transport};
use rustls::pki_types::pem::PemObject as _;
use rustls::pki_types::{CertificateDer, PrivateKeyDer};
use rustls::{CertificateError, ClientConfig, RootCertStore};
use tickbus_base::Mistake;

use super::access::Tls;

/// The transport with these certificates, and the number of authorities that were left out because they cannot be read:
/// a system's list can contain such.
///
/// # Errors
///
/// No authority can be read, or another text is no certificate or no key.
pub(super) fn transport(tls: &Tls) -> Result<(Transport, usize), Mistake> {
    const RIGHT: &str = "name a file in PEM, which begins with -----BEGIN";

    let wrong = |what: &str, error: &dyn std::fmt::Display| {
        Mistake::new(format!("{what} cannot be used ({error})"), RIGHT)
    };
    let certificates = |text: &str, what: &str| {
        let all: Result<Vec<_>, _> = CertificateDer::pem_slice_iter(text.as_bytes()).collect();
        match all {
            Ok(all) if all.is_empty() => Err(wrong(what, &"it has no certificate")),
            Ok(all) => Ok(all),
            Err(error) => Err(wrong(what, &error)),
        }
    };
    let mut roots = RootCertStore::empty();
    let (readable, broken): (Vec<_>, Vec<_>) =
        CertificateDer::pem_slice_iter(tls.authorities.as_bytes()).partition(Result::is_ok);
    let (added, ignored) = roots.add_parsable_certificates(readable.into_iter().flatten());
    let left_out = ignored + broken.len();
    match (added, left_out) {
        (0, 0) => return Err(wrong("ca_file", &"it has no certificate")),
        (0, _) => {
            return Err(wrong(
                "ca_file",
                &format_args!("it has no certificate that can be read, and {left_out} that cannot"),
            ));
        }
        _ => {}
    }
    let provider = Arc::new(rustls::crypto::ring::default_provider());
    let config = ClientConfig::builder_with_provider(provider)
        .with_safe_default_protocol_versions()
        .map_err(|error| wrong("TLS", &error))?
        .with_root_certificates(roots);
    let config = match &tls.own {
        None => config.with_no_client_auth(),
        Some((certificate, key)) => {
            let chain = certificates(certificate, "certificate_file")?;
            let key = PrivateKeyDer::from_pem_slice(key.as_bytes());
            let key = key.map_err(|error| wrong("private_key_file", &error))?;
            let config = config.with_client_auth_cert(chain, key);
            config.map_err(|error| wrong("certificate_file with private_key_file", &error))?
        }
    };
    Ok((Transport::tls_with_config(config.into()), left_out))
}

/// Why a connection failed, and what to do.
pub(super) fn reason(error: &ConnectionError) -> String {
    match error {
        ConnectionError::ConnectionRefused(
            ConnectReturnCode::BadUserNamePassword | ConnectReturnCode::NotAuthorized,
        ) => "it refuses this client; check user and password_file, and that the user may connect"
            .to_owned(),
        ConnectionError::ConnectionRefused(ConnectReturnCode::BadClientId) => {
            "it refuses the name of this client; give it another \"name\"".to_owned()
        }
        // Some of these come when the first bytes are read, inside of other errors.
        other => rustls_error(other).map_or_else(|| of_others(other), of_tls),
    }
}

/// The error of TLS behind an error.
fn rustls_error(error: &ConnectionError) -> Option<&rustls::Error> {
    let mut next: Option<&(dyn Error + 'static)> = Some(error);
    while let Some(error) = next {
        if let Some(found) = error.downcast_ref() {
            return Some(found);
        }
        let inner = error
            .downcast_ref::<io::Error>()
            .and_then(io::Error::get_ref);
        if let Some(found) = inner.and_then(|inner| inner.downcast_ref()) {
            return Some(found);
        }
        next = error.source();
    }
    None
}

fn of_others(error: &ConnectionError) -> String {
    match error {
        ConnectionError::Tls(TlsError::Io(io)) => {
            format!(
                "it does not speak TLS at this port ({io}); name its port for TLS, usually 8883"
            )
        }
        other => other.to_string(),
    }
}

fn of_tls(error: &rustls::Error) -> String {
    match error {
        rustls::Error::InvalidCertificate(CertificateError::UnknownIssuer) => {
            "its certificate is not signed by an authority of ca_file; name the right one"
                .to_owned()
        }
        rustls::Error::InvalidCertificate(
            CertificateError::NotValidForName | CertificateError::NotValidForNameContext { .. },
        ) => {
            "its certificate is for another name; write the name of the certificate into \"broker\""
                .to_owned()
        }
        rustls::Error::InvalidCertificate(
            CertificateError::Expired | CertificateError::ExpiredContext { .. },
        ) => "its certificate has expired; renew it, or check this computer's clock".to_owned(),
        rustls::Error::InvalidMessage(_) => {
            "it does not speak TLS at this port; name its port for TLS, usually 8883".to_owned()
        }
        rustls::Error::AlertReceived(alert) => format!(
            "it ends the connection ({alert:?}); it may want a certificate_file of this client that it trusts"
        ),
        other => other.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An authority, made by `openssl req -x509`.
    const AUTHORITY: &str = "-----BEGIN CERTIFICATE-----\n\
        MIIBdTCCARugAwIBAgIUZlQ5SaU69stclsslLKRCqEagp4YwCgYIKoZIzj0EAwIw\n\
        DzENMAsGA1UEAwwEdGVzdDAgFw0yNjExMjgxMTEyNDBaGA8yMTI2MTEwNDExMTI0\n\
        MFowDzENMAsGA1UEAwwEdGVzdDBZMBMGByqGSM49AgEGCCqGSM49AwEHA0IABPfs\n\
        mQ/ZovRI49AMNg9kY/FztJ3KNlQ6ZNAkJ05MdX586+NJVNbt1h80Rn9HrXnIw7LG\n\
        sPJuwrJwjAa12e6O1FujUzBRMB0GA1UdDgQWBBRw/9Ven+ihfUDef0g5tM92IoBe\n\
        QjAfBgNVHSMEGDAWgBRw/9Ven+ihfUDef0g5tM92IoBeQjAPBgNVHRMBAf8EBTAD\n\
        AQH/MAoGCCqGSM49BAMCA0gAMEUCIENwGfCSVqp3HH/lZV1FyGaNQFzIgRSy/Mk9\n\
        KQ9ESPr0AiEAw+FmgH+5BdDZIE6bq2OrkCSjzd2jhPCS8mQPqlzlxPQ=\n\
        -----END CERTIFICATE-----\n";

    fn left_out(authorities: &str) -> Result<usize, String> {
        let tls = Tls {
            authorities: authorities.to_owned(),
            own: None,
        };
        let made = transport(&tls).map(|(_, left_out)| left_out);
        made.map_err(|mistake| mistake.to_string())
    }

    #[test]
    fn authorities_that_cannot_be_read_are_left_out_unless_none_is_left() {
        // A certificate of a single byte, and one whose text is broken.
        let short = "-----BEGIN CERTIFICATE-----\nMAA=\n-----END CERTIFICATE-----\n";
        let broken = "-----BEGIN CERTIFICATE-----\n!!!!\n-----END CERTIFICATE-----\n";
        assert_eq!(left_out(AUTHORITY), Ok(0));
        assert_eq!(left_out(&[short, AUTHORITY].concat()), Ok(1));
        assert_eq!(left_out(&[broken, short, AUTHORITY].concat()), Ok(2));
        let told = left_out(&[short, broken].concat()).expect_err("no authority is left");
        assert!(
            told.contains("no certificate that can be read, and 2 that cannot"),
            "{told}"
        );
        let told = left_out("notes\n").expect_err("it has none");
        assert!(
            told.contains("ca_file cannot be used (it has no certificate)"),
            "{told}"
        );
    }
}
