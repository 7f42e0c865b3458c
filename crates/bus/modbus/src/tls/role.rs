//! The role in a certificate, by the extension of Modbus/TCP Security.

use x509_cert::Certificate;
use x509_cert::der::Decode as _;
use x509_cert::der::asn1::Utf8StringRef;
use x509_cert::der::oid::ObjectIdentifier;

/// The extension, in the range of the Modbus Organization.
const ROLE: ObjectIdentifier = ObjectIdentifier::new_unwrap("1.3.6.1.4.1.50316.802.1");

/// The role in a certificate; `None` without one, or with one that is no text.
pub(super) fn of(certificate: &[u8]) -> Option<String> {
    let certificate = Certificate::from_der(certificate).ok()?;
    let extensions = certificate.tbs_certificate.extensions?;
    let role = extensions
        .iter()
        .find(|extension| extension.extn_id == ROLE)?;
    let role = Utf8StringRef::from_der(role.extn_value.as_bytes()).ok()?;
    Some(role.as_str().to_owned())
}
