//! Certificates: the driver's own, and those of peers.
//!
//! All are in one folder, for all drivers that name it:
//!
//! ```text
//! pki/own/tickbus-4711.der      the certificate of the driver with id 4711: for peers to trust
//! pki/private/tickbus-4711.pem  its key, readable by its owner alone
//! pki/trusted/                  certificates of peers that are trusted
//! pki/rejected/                 those that are not; move one to trusted to trust it
//! ```

use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::time::Duration;

use opcua::crypto::{CertificateStore, SecurityPolicy, X509, X509Data};
use opcua::types::{ByteString, DateTime, DateTimeUtc, StatusCode};

use tickbus_base::time::{WallClock, system_time};
use tickbus_fieldbus::{BusError, BusSetup};

use super::{Credentials, Login, Policy, Secret, Trust, application};

/// The product name of all programs of this project.
pub(super) const PRODUCT: &str = "tickbus";
/// The URI of the product.
pub(super) const PRODUCT_URI: &str = "urn:tickbus";

/// Size of the driver's key, in bits: accepted by every policy.
const KEY_BITS: u32 = 2048;

/// Validity of the driver's certificate, in days.
const DAYS: u32 = 3650;

/// The certificates and names of one driver.
#[derive(Clone, Debug)]
pub(super) struct Pki {
    /// The folder, absolute.
    pub(super) folder: PathBuf,
    /// The driver's certificate and its key, within the folder.
    pub(super) certificate: PathBuf,
    pub(super) key: PathBuf,
    /// The application name, for people.
    pub(super) application: String,
    /// The application URI, for programs.
    pub(super) uri: String,
    pub(super) trust: Trust,
    /// An additional host that the driver's certificate names.
    pub(super) host: Option<String>,
    /// The clock against which certificates are checked.
    pub(super) wall: WallClock,
    directory: PathBuf,
    login: Option<Login>,
}

impl Pki {
    /// The certificates and names of the driver of `line`.
    pub(super) fn new(credentials: &Credentials, setup: &BusSetup<'_>) -> Self {
        let folder = setup.folder.join(&credentials.pki);
        Self {
            folder: std::path::absolute(&folder).unwrap_or(folder),
            certificate: format!("own/tickbus-{}.der", setup.id).into(),
            key: format!("private/tickbus-{}.pem", setup.id).into(),
            application: format!("{PRODUCT} {}", setup.name),
            uri: application_uri(setup.name),
            trust: credentials.trust,
            host: None,
            wall: system_time,
            directory: setup.folder.to_owned(),
            login: credentials.login.clone(),
        }
    }

    /// Creates missing parts: the folders, the driver's certificate and its key.
    ///
    /// # Errors
    ///
    /// A part cannot be created, or the existing certificate belongs to another application or has expired.
    pub(super) fn prepare(&self) -> Result<(), BusError> {
        let cannot = |error: io::Error| {
            let folder = self.folder.display();
            BusError::Refused(format!(
                "the certificates cannot be kept in \"{folder}\" ({error}); let this program write there, \
                 or name another folder with pki"
            ))
        };
        for folder in ["own", "trusted", "rejected", "private"] {
            fs::create_dir_all(self.folder.join(folder)).map_err(cannot)?;
        }
        keep_private(&self.folder.join("private"), 0o700).map_err(cannot)?;
        let certificate = self.folder.join(&self.certificate);
        if certificate.exists() && self.folder.join(&self.key).exists() {
            return self.check_own(&certificate);
        }
        let uri = &self.uri;
        let data = X509Data {
            key_size: KEY_BITS,
            common_name: self.application.clone(),
            organization: PRODUCT.to_owned(),
            organizational_unit: PRODUCT.to_owned(),
            country: "EU".to_owned(),
            state: "-".to_owned(),
            alt_host_names: X509Data::alt_host_names(
                uri,
                self.host.clone().map(|host| vec![host]),
                true,
                true,
                false,
            ),
            certificate_duration_days: DAYS,
        };
        let store = CertificateStore::new(&self.folder);
        let key = self.folder.join(&self.key);
        CertificateStore::create_certificate_and_key(&data, true, &certificate, &key)
            .map_err(|error| cannot(io::Error::other(error)))?;
        drop(store);
        keep_private(&key, 0o600).map_err(cannot)?;
        log::warn!(
            "made a certificate for \"{}\" ({uri}): \"{}\"; the other end has to trust it before it takes an \
             encrypted connection",
            self.application,
            certificate.display()
        );
        Ok(())
    }

    fn check_own(&self, file: &Path) -> Result<(), BusError> {
        let certificate = CertificateStore::read_cert(file);
        let why = match certificate {
            Err(error) => error,
            Ok(certificate) => match self.examine(&certificate, &self.uri) {
                Ok(()) => return Ok(()),
                Err(why) => why,
            },
        };
        Err(BusError::Refused(format!(
            "the own certificate \"{}\" cannot be used ({why}); delete it, and a new one is made for {}",
            file.display(),
            self.uri
        )))
    }

    /// Checks that the certificate of the server `uri` is trusted.
    ///
    /// # Errors
    ///
    /// The certificate is not trusted: the reason, and the remedy.
    pub(super) fn judge(
        &self,
        certificate: &ByteString,
        policy: Policy,
        uri: &str,
    ) -> Result<(), BusError> {
        let refused = |text: String| Err(BusError::Refused(text));
        let certificate = match X509::from_byte_string(certificate) {
            Ok(certificate) => certificate,
            Err(error) => {
                return refused(format!("the server's certificate cannot be read ({error})"));
            }
        };
        let mut store = CertificateStore::new(&self.folder);
        store.set_trust_unknown_certs(self.trust == Trust::Any);
        // Compare only the file itself: its place in the folder is more significant than the names in it.
        store.set_skip_verify_certs(true);
        let policy = security_policy(policy);
        let name = CertificateStore::cert_file_name(&certificate);
        let trusted = self.folder.join("trusted");
        match store.validate_application_instance_cert(&certificate, policy, None, None) {
            Ok(()) => {}
            Err(_) if self.folder.join("rejected").join(&name).exists() => {
                return refused(format!(
                    "the certificate of the server is not trusted; if it is the right one, move \"{}\" to \
                     \"{}\"",
                    self.folder.join("rejected").join(&name).display(),
                    trusted.display()
                ));
            }
            Err(error) => {
                return refused(format!(
                    "the certificate of the server is not good enough ({error})"
                ));
            }
        }
        if self.trust == Trust::Any {
            return Ok(());
        }
        match self.examine(&certificate, uri) {
            Ok(()) => Ok(()),
            Err(why) => refused(format!(
                "the certificate of the server is not good ({why}); give the server a new one, or write \
                 trust = \"any\" to accept it anyway"
            )),
        }
    }

    /// Checks that a certificate is valid today, and belongs to the application `uri`.
    fn examine(&self, certificate: &X509, uri: &str) -> Result<(), String> {
        certificate
            .is_time_valid(&date((self.wall)()).as_chrono())
            .map_err(|error| error.to_string())?;
        application::check(certificate, uri)
    }

    /// The user and the password.
    ///
    /// # Errors
    ///
    /// The password cannot be read.
    pub(super) fn login(&self) -> Result<Option<(String, String)>, BusError> {
        let Some(Login { user, password }) = &self.login else {
            return Ok(None);
        };
        let password = match password {
            Secret::Clear(password) => password.clone(),
            Secret::Environment(name) => std::env::var(name).map_err(|_| {
                BusError::Refused(format!(
                    "the environment variable {name} has no password for user \"{user}\"; set it before \
                     the simulator starts"
                ))
            })?,
            Secret::File(file) => {
                let file = self.directory.join(file);
                let text = fs::read_to_string(&file).map_err(|error| {
                    BusError::Refused(format!(
                        "the password of user \"{user}\" cannot be read from \"{}\" ({error}); write it \
                         into the first line of that file",
                        file.display()
                    ))
                })?;
                text.lines().next().unwrap_or_default().to_owned()
            }
        };
        Ok(Some((user.clone(), password)))
    }
}

/// The crate's name for a policy.
pub(super) fn security_policy(policy: Policy) -> SecurityPolicy {
    match policy {
        Policy::None => SecurityPolicy::None,
        Policy::Basic256Sha256 => SecurityPolicy::Basic256Sha256,
        Policy::Aes128Sha256RsaOaep => SecurityPolicy::Aes128Sha256RsaOaep,
        Policy::Aes256Sha256RsaPss => SecurityPolicy::Aes256Sha256RsaPss,
    }
}

/// The application URI of the driver called `name`.
///
/// The machine's name is not part of it, so that the other end can be configured before this one runs.
fn application_uri(name: &str) -> String {
    use std::fmt::Write as _;

    let mut uri = "urn:tickbus:".to_owned();
    for byte in name.bytes() {
        if byte.is_ascii_alphanumeric() || b"-._~".contains(&byte) {
            uri.push(char::from(byte));
        } else {
            // Writing to a string cannot fail.
            let _ = write!(uri, "%{byte:02X}");
        }
    }
    uri
}

/// The time of day in OPC UA's format.
pub(super) fn date(since_1970: Duration) -> DateTime {
    let seconds = i64::try_from(since_1970.as_secs()).ok();
    let time = seconds.and_then(|s| DateTimeUtc::from_timestamp(s, since_1970.subsec_nanos()));
    time.map_or_else(DateTime::endtimes, DateTime::from)
}

/// The meaning of a service's `status`.
pub(super) fn meaning(status: StatusCode) -> String {
    let name = status.sub_code().name();
    match status.sub_code().description() {
        "" => name.to_owned(),
        words => format!("{name}: {words}"),
    }
}

#[cfg(unix)]
fn keep_private(path: &Path, mode: u32) -> io::Result<()> {
    use std::os::unix::fs::PermissionsExt as _;

    fs::set_permissions(path, fs::Permissions::from_mode(mode))
}

#[cfg(not(unix))]
fn keep_private(_: &Path, _: u32) -> io::Result<()> {
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_name_of_an_application_has_only_what_a_urn_may_have() {
        assert_eq!(application_uri("Test rig"), "urn:tickbus:Test%20rig");
        assert_eq!(
            application_uri("Pr\u{fc}fstand-1"),
            "urn:tickbus:Pr%C3%BCfstand-1"
        );
    }
}
