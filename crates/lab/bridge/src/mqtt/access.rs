//! The secrets that a map file names: for the broker, and for the dispatcher.

use std::fmt;
use std::path::Path;

use tickbus_base::toml_text::{Table, Value, load_text};
use tickbus_dispatcher::Key;

/// The longest path or name, in characters.
const LONGEST: usize = 1000;

/// How the broker lets this client in.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Access {
    /// The user, if the broker asks for one.
    pub login: Option<Login>,
    /// The certificates, if the connection is encrypted.
    pub tls: Option<Tls>,
}

/// A user of the broker.
#[derive(Clone, PartialEq, Eq)]
pub struct Login {
    /// The name.
    pub user: String,
    /// The password.
    pub password: String,
}

/// Omits the password.
impl fmt::Debug for Login {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Login")
            .field("user", &self.user)
            .finish_non_exhaustive()
    }
}

/// The texts of the certificates, in PEM.
#[derive(Clone, PartialEq, Eq)]
pub struct Tls {
    /// The authorities, one of which has signed the broker's certificate.
    pub authorities: String,
    /// This client's own certificate and its private key, if the broker asks for one.
    pub own: Option<(String, String)>,
}

/// Omits the private key.
impl fmt::Debug for Tls {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Tls")
            .field("has_own", &self.own.is_some())
            .finish_non_exhaustive()
    }
}

impl Access {
    /// Reads `user`, `password_file`, `ca_file`, `certificate_file` and `private_key_file`; paths are relative to `folder`.
    pub(super) fn read(table: &mut Table<'_>, folder: &Path) -> Option<Self> {
        let (user, password) = (table.take("user"), table.take("password_file"));
        let authorities = table.take("ca_file");
        let own = (
            table.take("certificate_file"),
            table.take("private_key_file"),
        );
        let login = match (user, password) {
            (None, None) => Some(None),
            (Some(user), Some(password)) => {
                let user = user.label(LONGEST, "write the name of the user");
                let password = text_of(&password, folder);
                user.zip(password).map(|(user, password)| {
                    let password = password.lines().next().unwrap_or_default().to_owned();
                    let user = user.to_owned();
                    Some(Login { user, password })
                })
            }
            (Some(user), None) => {
                user.wrong(
                    "\"user\" stands without a password",
                    "add password_file = \"broker.password\", a file whose first line is the password",
                );
                None
            }
            (None, Some(password)) => {
                password.wrong("there is a password and no user", "add user = \"…\"");
                None
            }
        };
        let tls = match (authorities, own) {
            (None, (None, None)) => Some(None),
            (None, (Some(one), _) | (_, Some(one))) => {
                one.wrong(
                    "a certificate stands without \"ca_file\"",
                    "add ca_file = \"ca.pem\", the certificate of the authority that has signed the broker's",
                );
                None
            }
            (Some(authorities), own) => {
                let authorities = text_of(&authorities, folder);
                let own = match own {
                    (None, None) => Some(None),
                    (Some(certificate), Some(key)) => {
                        let certificate = text_of(&certificate, folder);
                        certificate.zip(text_of(&key, folder)).map(Some)
                    }
                    (Some(one), None) | (None, Some(one)) => {
                        one.wrong(
                            "the other file is missing",
                            "write both certificate_file and private_key_file, or none of them",
                        );
                        None
                    }
                };
                let both = authorities.zip(own);
                both.map(|(authorities, own)| Some(Tls { authorities, own }))
            }
        };
        let (login, tls) = (login?, tls?);
        Some(Self { login, tls })
    }
}

/// The text of the file that `value` names, relative to `folder`.
fn text_of(value: &Value<'_>, folder: &Path) -> Option<String> {
    let file = folder.join(value.label(LONGEST, "write the name of a file")?);
    match load_text(&file) {
        // Some editors begin a file with a byte-order mark.
        Ok(text) => Some(match text.strip_prefix('\u{feff}') {
            Some(rest) => rest.to_owned(),
            None => text,
        }),
        Err(mistakes) => {
            for one in &mistakes {
                let what = format!("{}: {}", file.display(), one.mistake.what);
                value.wrong(what, &*one.mistake.right);
            }
            None
        }
    }
}

/// The key of the laboratory in the file that `value` names, relative to `folder`.
pub(super) fn key_of(value: &Value<'_>, folder: &Path) -> Option<Key> {
    let file = value.label(LONGEST, "write the name of the file with the key")?;
    let key = Key::load(&folder.join(file));
    key.map_err(|mistake| value.refuse(mistake)).ok()
}
