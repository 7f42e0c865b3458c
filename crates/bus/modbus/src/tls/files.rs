//! Certificates and keys in files.

use std::fmt::Display;
use std::path::Path;

use rustls::RootCertStore;
use rustls::pki_types::pem::PemObject as _;
use rustls::pki_types::{CertificateDer, PrivateKeyDer};
use tickbus_base::Mistake;
use tickbus_base::toml_text::load_text;

use crate::tls_options::Tls;

/// The contents of the files of one end.
pub(super) struct Files {
    pub(super) chain: Vec<CertificateDer<'static>>,
    pub(super) key: PrivateKeyDer<'static>,
    pub(super) roots: RootCertStore,
}

impl Files {
    pub(super) fn read(tls: &Tls, folder: &Path) -> Result<Self, Mistake> {
        let text = |key: &str, file: &Path| {
            load_text(&folder.join(file)).map_err(|mistakes| {
                let mistake = mistakes.iter().next().map(|one| one.mistake.to_string());
                wrong(key, &mistake.unwrap_or_default())
            })
        };
        let certificates = |key: &str, file: &Path| {
            let text = text(key, file)?;
            let all: Result<Vec<_>, _> = CertificateDer::pem_slice_iter(text.as_bytes()).collect();
            let all = all.map_err(|error| wrong(key, &error))?;
            if all.is_empty() {
                return Err(wrong(key, &"it has no certificate"));
            }
            Ok(all)
        };
        let chain = certificates("certificate_file", &tls.certificate)?;
        let key = text("private_key_file", &tls.private_key)?;
        let key = PrivateKeyDer::from_pem_slice(key.as_bytes());
        let key = key.map_err(|error| wrong("private_key_file", &error))?;
        let mut roots = RootCertStore::empty();
        for authority in certificates("ca_file", &tls.authorities)? {
            roots
                .add(authority)
                .map_err(|error| wrong("ca_file", &error))?;
        }
        Ok(Self { chain, key, roots })
    }
}

/// The mistake that what a key names cannot be used.
pub(super) fn wrong(key: &str, error: &dyn Display) -> Mistake {
    Mistake::new(
        format!("{key} cannot be used ({error})"),
        "name a file in PEM, which begins with -----BEGIN",
    )
}
