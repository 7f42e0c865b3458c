//! Encryption, certificates and logins in a driver.cfg: the same keys for both ends.

use std::path::PathBuf;

use tickbus_base::toml_text::{Key, Shape, Table, Value, names};
use tickbus_fieldbus::NamedFile;

/// The longest path, name or password, in characters.
const TEXT_LIMIT: usize = 1000;

/// The default folder of certificates.
const PKI: &str = "pki";

/// The encryption and signing of messages.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Policy {
    /// No encryption or signing.
    None,
    /// `Basic256Sha256`: supported by nearly every server.
    Basic256Sha256,
    /// `Aes128_Sha256_RsaOaep`.
    Aes128Sha256RsaOaep,
    /// `Aes256_Sha256_RsaPss`: the strongest.
    Aes256Sha256RsaPss,
}

impl Policy {
    /// All policies, by their names in OPC UA.
    pub const NAMES: [(&'static str, Self); 4] = [
        ("None", Self::None),
        ("Basic256Sha256", Self::Basic256Sha256),
        ("Aes128_Sha256_RsaOaep", Self::Aes128Sha256RsaOaep),
        ("Aes256_Sha256_RsaPss", Self::Aes256Sha256RsaPss),
    ];

    /// The policies that protect messages.
    pub const SECURE: [Self; 3] = [
        Self::Basic256Sha256,
        Self::Aes128Sha256RsaOaep,
        Self::Aes256Sha256RsaPss,
    ];

    /// The name in OPC UA.
    pub fn name(self) -> &'static str {
        let mut names = Self::NAMES.iter();
        names
            .find(|(_, policy)| *policy == self)
            .map_or("None", |(name, _)| name)
    }
}

/// The message security mode.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Mode {
    /// Signed, but readable by everyone.
    Sign,
    /// Signed and encrypted.
    #[default]
    SignAndEncrypt,
}

impl Mode {
    const NAMES: [(&'static str, Self); 2] = [
        ("Sign", Self::Sign),
        ("SignAndEncrypt", Self::SignAndEncrypt),
    ];

    /// The name in OPC UA.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Sign => "Sign",
            Self::SignAndEncrypt => "SignAndEncrypt",
        }
    }
}

/// The certificates to trust.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Trust {
    /// Certificates in the folder `trusted`.
    #[default]
    Listed,
    /// All certificates; each is stored in the folder `trusted`.
    Any,
}

/// A user, and the source of the password.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Login {
    /// The user's name.
    pub user: String,
    /// The source of the password.
    pub password: Secret,
}

/// The source of a password.
#[derive(Clone, PartialEq, Eq)]
pub enum Secret {
    /// In the first line of a file; relative to the folder of the driver.cfg.
    File(PathBuf),
    /// In an environment variable.
    Environment(String),
    /// In the driver.cfg itself.
    Clear(String),
}

/// Omits the password: options are logged.
impl std::fmt::Debug for Secret {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::File(file) => f.debug_tuple("File").field(file).finish(),
            Self::Environment(name) => f.debug_tuple("Environment").field(name).finish(),
            Self::Clear(_) => f.write_str("Clear"),
        }
    }
}

impl Credentials {
    /// The named files: certificates and keys, if messages are protected by one of `policies`, and passwords.
    pub(super) fn files(&self, policies: &[Policy]) -> Vec<NamedFile> {
        let protected = policies.iter().any(|policy| *policy != Policy::None);
        let password = self.login.as_ref().and_then(|login| match &login.password {
            Secret::File(file) => Some(NamedFile::Secret(file.clone())),
            Secret::Environment(_) => None,
            Secret::Clear(_) => Some(NamedFile::InClear("password_in_clear")),
        });
        let pki = protected.then(|| NamedFile::Secret(self.pki.clone()));
        pki.into_iter().chain(password).collect()
    }
}

/// The keys of both ends, but for `security`: for the schema of a driver.cfg.
pub(crate) const KEYS: &[Key] = &[
    Key::new(
        "mode",
        Shape::Choice(&names(&Mode::NAMES)),
        "The mode of protected messages",
    )
    .or("\"SignAndEncrypt\""),
    Key::new(
        "user",
        Shape::Label(TEXT_LIMIT),
        "The user, with one of password_file, password_env and password_in_clear",
    ),
    Key::new(
        "password_file",
        Shape::Label(TEXT_LIMIT),
        "The file whose first line is the password, relative to the folder of this file",
    ),
    Key::new(
        "password_env",
        Shape::Label(TEXT_LIMIT),
        "The environment variable that has the password",
    ),
    Key::new(
        "password_in_clear",
        Shape::Text,
        "The password, for everybody to read",
    ),
    Key::new(
        "pki",
        Shape::Label(TEXT_LIMIT),
        "The folder of certificates, relative to the folder of this file",
    )
    .or("\"pki\""),
    Key::new(
        "trust",
        Shape::Choice(&names(&WAYS_TO_TRUST)),
        "\"any\" accepts every certificate, and files it under \"trusted\"",
    )
    .or("\"listed\""),
];

const WAYS_TO_TRUST: [(&str, Trust); 2] = [("listed", Trust::Listed), ("any", Trust::Any)];

/// The names of the security policies.
pub(crate) const POLICIES: Shape = Shape::Choice(&names(&Policy::NAMES));

/// The keys of both ends, as written in the driver.cfg.
pub(super) struct Keys<'a> {
    pub(super) security: Option<Value<'a>>,
    mode: Option<Value<'a>>,
    user: Option<Value<'a>>,
    passwords: [Option<Value<'a>>; 3],
    pki: Option<Value<'a>>,
    trust: Option<Value<'a>>,
    whole: bool,
}

/// A mistake was reported.
struct Reported;

/// The values of those keys.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Credentials {
    /// The mode of protected messages.
    pub mode: Mode,
    /// The user, if there is one.
    pub login: Option<Login>,
    /// The folder of certificates; relative to the folder of the driver.cfg.
    pub pki: PathBuf,
    /// The certificates to trust.
    pub trust: Trust,
}

impl<'a> Keys<'a> {
    /// Takes the keys from the table.
    pub(super) fn take(table: &mut Table<'a>) -> Self {
        Self {
            security: table.take("security"),
            mode: table.take("mode"),
            user: table.take("user"),
            passwords: ["password_file", "password_env", "password_in_clear"]
                .map(|key| table.take(key)),
            pki: table.take("pki"),
            trust: table.take("trust"),
            whole: table.is_whole(),
        }
    }

    /// True if a user is named, with or without mistakes.
    pub(super) fn has_user(&self) -> bool {
        self.user.is_some()
    }

    /// Reads all keys except `security`.
    pub(super) fn read(&self) -> Option<Credentials> {
        let mode = self.mode.as_ref().map_or(Some(Mode::default()), |value| {
            value.choice("security modes", &Mode::NAMES)
        });
        let trust = self.trust.as_ref().map_or(Some(Trust::default()), |value| {
            value.choice("ways to trust", &WAYS_TO_TRUST)
        });
        let pki = self.pki.as_ref().map_or(Some(PKI), |value| {
            value.label(TEXT_LIMIT, "name the folder of certificates")
        });
        let login = self.login();
        Some(Credentials {
            mode: mode?,
            login: login.ok()?,
            pki: pki?.into(),
            trust: trust?,
        })
    }

    /// The user and the password, if a user is named; errors have been reported.
    fn login(&self) -> Result<Option<Login>, Reported> {
        let user = self.user.as_ref().map(|value| {
            let user = value.label(TEXT_LIMIT, "write the name of the user")?;
            Some((value, user.to_owned()))
        });
        let mut passwords = self.passwords.iter().flatten();
        let (first, second) = (passwords.next(), passwords.next());
        if let Some(second) = second {
            second.wrong(
                "the password is named twice",
                "keep one of password_file, password_env and password_in_clear",
            );
            return Err(Reported);
        }
        let secret = match &self.passwords {
            [Some(file), ..] => file
                .label(TEXT_LIMIT, "name the file whose first line is the password")
                .map(|file| Secret::File(file.into())),
            [_, Some(name), _] => name
                .label(
                    TEXT_LIMIT,
                    "name the environment variable that has the password",
                )
                .map(|name| Secret::Environment(name.to_owned())),
            [.., Some(clear)] => clear
                .text("write the password in quotes")
                .map(|clear| Secret::Clear(clear.to_owned())),
            [None, None, None] => None,
        };
        match (user, first) {
            (None, None) => Ok(None),
            (None, Some(value)) => {
                if self.whole {
                    value.wrong("there is a password and no user", "add user = \"…\"");
                }
                Err(Reported)
            }
            (Some(user), None) => {
                if let (true, Some((value, _))) = (self.whole, user) {
                    value.wrong(
                        "\"user\" stands without a password",
                        "add password_file = \"plc.password\" or password_env = \"PLC_PASSWORD\"; \
                         password_in_clear = \"…\" writes it here, where everybody can read it",
                    );
                }
                Err(Reported)
            }
            (Some(user), Some(_)) => {
                let both = user.zip(secret).ok_or(Reported)?;
                let ((_, user), password) = both;
                Ok(Some(Login { user, password }))
            }
        }
    }
}
