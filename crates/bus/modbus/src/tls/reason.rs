//! Why an encrypted connection failed, and what to do.

use rustls::{AlertDescription, CertificateError, Error};

/// The reason behind an error, in words about the peer.
pub(super) fn of(error: &Error) -> String {
    match error {
        Error::InvalidCertificate(CertificateError::UnknownIssuer) => {
            "its certificate is not signed by an authority of ca_file; add the authority that has signed it".to_owned()
        }
        Error::InvalidCertificate(
            CertificateError::NotValidForName | CertificateError::NotValidForNameContext { .. },
        ) => "its certificate is for another name; write the name of the certificate as server_name".to_owned(),
        Error::InvalidCertificate(
            CertificateError::Expired | CertificateError::ExpiredContext { .. },
        ) => "its certificate has expired; renew it, or check this computer's clock".to_owned(),
        Error::InvalidCertificate(
            CertificateError::NotValidYet | CertificateError::NotValidYetContext { .. },
        ) => "its certificate is not valid yet; check the clocks of both computers".to_owned(),
        Error::InvalidCertificate(other) => format!("its certificate is refused ({other})"),
        Error::NoCertificatesPresented => {
            "it shows no certificate; Modbus/TCP Security needs one of each end".to_owned()
        }
        Error::InvalidMessage(_) => {
            "it does not speak TLS; check its port, and whether it has Modbus/TCP Security".to_owned()
        }
        Error::AlertReceived(
            alert @ (AlertDescription::UnknownCA
            | AlertDescription::BadCertificate
            | AlertDescription::CertificateUnknown
            | AlertDescription::CertificateRequired
            | AlertDescription::CertificateExpired
            | AlertDescription::AccessDenied),
        ) => format!(
            "it refuses the certificate of this end ({alert:?}); let it trust the authority of certificate_file"
        ),
        Error::AlertReceived(alert) => format!("it ends the connection ({alert:?}); its log says why"),
        other => format!("the encryption failed ({other})"),
    }
}
