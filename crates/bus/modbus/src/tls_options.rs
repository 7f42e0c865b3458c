//! `[fieldbus.tls]`: the certificates of Modbus/TCP Security, and the roles that may write.

use std::path::{Path, PathBuf};

use crate::line::Line;
use tickbus_base::toml_text::{Key, Shape, Value};
use tickbus_fieldbus::NamedFile;

/// The longest path, name of a host or role, in characters.
const TEXT_LIMIT: usize = 1000;

/// The most roles that may write.
const ROLES: usize = 64;

const FILE: Shape = Shape::Label(TEXT_LIMIT);

const CERTIFICATE: Key = Key::required(
    "certificate_file",
    FILE,
    "The certificate of this end, in PEM, with those between it and the other end's authority",
);
const PRIVATE_KEY: Key = Key::required("private_key_file", FILE, "Its private key, in PEM");
const AUTHORITIES: Key = Key::required(
    "ca_file",
    FILE,
    "The authorities, in PEM, of which one has signed the certificate of the other end",
);

/// The keys at a server.
pub(crate) const SERVER_KEYS: &[Key] = &[
    CERTIFICATE,
    PRIVATE_KEY,
    AUTHORITIES,
    Key::new(
        "write_roles",
        Shape::List(&Shape::Label(TEXT_LIMIT), 1, ROLES),
        "The roles in certificates of clients that may write; every client without this key",
    ),
];

/// The keys at a client.
pub(crate) const CLIENT_KEYS: &[Key] = &[
    CERTIFICATE,
    PRIVATE_KEY,
    AUTHORITIES,
    Key::new(
        "server_name",
        Shape::Label(TEXT_LIMIT),
        "The host's name or IP address in the certificate of the server; that of \"address\" without this key",
    ),
];

/// The options of an encrypted line. Files are relative to the folder of the driver.cfg.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Tls {
    /// The certificate of this end.
    pub certificate: PathBuf,
    /// The private key of that certificate.
    pub private_key: PathBuf,
    /// The authorities of the other end.
    pub authorities: PathBuf,
    /// At a server: the roles that may write, if stated.
    pub write_roles: Option<Vec<String>>,
    /// At a client: the name in the certificate of the server, if stated.
    pub server_name: Option<String>,
    /// The offset of the table.
    pub at: usize,
}

impl Tls {
    /// Reads the table, of a server or of a client, with the line that it belongs to.
    pub(crate) fn read(value: &Value<'_>, line: Option<&Line>, is_server: bool) -> Option<Self> {
        const RIGHT: &str = "write a table such as { certificate_file = \"own.pem\", private_key_file = \"own.key\", \
                             ca_file = \"ca.pem\" }";
        let mut table = value.table("[fieldbus.tls]", RIGHT)?;
        let mut file = |key: &Key| {
            let value = table.require(key.name, "name a file in PEM, such as \"own.pem\"")?;
            let text = value.label(TEXT_LIMIT, "write the name of a file")?;
            Some(PathBuf::from(text))
        };
        let [certificate, private_key, authorities] =
            [&CERTIFICATE, &PRIVATE_KEY, &AUTHORITIES].map(&mut file);
        let roles = is_server.then(|| table.take("write_roles")).flatten();
        let name = (!is_server).then(|| table.take("server_name")).flatten();
        table.finish();
        let roles = roles.as_ref().map(read_roles);
        let name = name.as_ref().map(read_name);
        if let Some(line) = line
            && !matches!(line, Line::Tcp(_))
        {
            value.wrong(
                "[fieldbus.tls] is for Modbus TCP",
                "remove it, or write \"address\" without \"framing\"",
            );
            return None;
        }
        Some(Self {
            certificate: certificate?,
            private_key: private_key?,
            authorities: authorities?,
            write_roles: roles.map_or(Some(None), |roles| roles.map(Some))?,
            server_name: name.map_or(Some(None), |name| name.map(Some))?,
            at: value.at(),
        })
    }

    /// The named files.
    pub(crate) fn files(&self) -> Vec<NamedFile> {
        vec![
            NamedFile::Plain(self.certificate.clone()),
            NamedFile::Secret(self.private_key.clone()),
            NamedFile::Plain(self.authorities.clone()),
        ]
    }

    /// The part of `tickbus check` about this.
    pub(crate) fn shown(&self) -> String {
        let certificate = show(&self.certificate);
        let authorities = show(&self.authorities);
        let mut text = format!(
            "over TLS with the certificate {certificate}, to peers with one of {authorities}"
        );
        if let Some(roles) = &self.write_roles {
            text.push_str("; only these roles write: ");
            text.push_str(&roles.join(", "));
        }
        text
    }
}

fn show(path: &Path) -> String {
    tickbus_base::toml_text::shown(&path.display().to_string())
}

fn read_roles(value: &Value<'_>) -> Option<Vec<String>> {
    const RIGHT: &str = "write a list of roles, such as [\"Operator\"]";
    let list = value.list(RIGHT)?;
    if !(1..=ROLES).contains(&list.len()) {
        value.wrong(
            format!("it has {} roles", list.len()),
            format!("write 1 to {ROLES}, or remove the key if every client may write"),
        );
        return None;
    }
    let roles = list
        .iter()
        .map(|role| role.label(TEXT_LIMIT, RIGHT).map(str::to_owned));
    roles.collect::<Vec<_>>().into_iter().collect()
}

fn read_name(value: &Value<'_>) -> Option<String> {
    let right = "write the name in the certificate of the server, such as \"plc-7.example.com\"";
    value.label(TEXT_LIMIT, right).map(str::to_owned)
}
