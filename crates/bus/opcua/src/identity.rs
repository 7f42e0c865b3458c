//! `[fieldbus.identity]`: how the server names itself.

use tickbus_base::toml_text::{Key, Shape, Value};

/// The longest text, in characters.
const LONGEST: usize = 200;

const TEXT: Shape = Shape::Label(LONGEST);

/// The keys of the table.
pub(crate) const IDENTITY_KEYS: &[Key] = &[
    Key::new(
        "application",
        TEXT,
        "The ApplicationName; \"tickbus\" and the driver's name by default",
    ),
    Key::new(
        "uri",
        TEXT,
        "The ApplicationUri, and namespace 1; \"urn:tickbus:NAME\" by default",
    ),
    Key::new(
        "manufacturer",
        TEXT,
        "The ManufacturerName of the BuildInfo",
    ),
    Key::new("product", TEXT, "The ProductName of the BuildInfo"),
    Key::new("product_uri", TEXT, "The ProductUri"),
    Key::new("version", TEXT, "The SoftwareVersion of the BuildInfo"),
    Key::new("build", TEXT, "The BuildNumber of the BuildInfo"),
];

/// The stated names; each that is `None` has its default.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Identity {
    /// The application name, for people.
    pub application: Option<String>,
    /// The application URI, for programs.
    pub uri: Option<String>,
    /// The name of the manufacturer.
    pub manufacturer: Option<String>,
    /// The name of the product.
    pub product: Option<String>,
    /// The URI of the product.
    pub product_uri: Option<String>,
    /// The version of the software.
    pub version: Option<String>,
    /// The number of the build.
    pub build: Option<String>,
}

/// Reads the table.
pub(crate) fn read_identity(value: &Value<'_>) -> Option<Identity> {
    let mut table = value.table(
        "[fieldbus.identity]",
        "write a table such as { application = \"Press\", uri = \"urn:acme:press:1\" }",
    )?;
    let mut text = |name: &'static str| {
        let Some(value) = table.take(name) else {
            return Some(None);
        };
        let text = value.label(LONGEST, "write the text in quotes")?;
        Some(Some(text.to_owned()))
    };
    let application = text("application");
    let uri = text("uri");
    let manufacturer = text("manufacturer");
    let product = text("product");
    let product_uri = text("product_uri");
    let version = text("version");
    let build = text("build");
    table.finish();
    Some(Identity {
        application: application?,
        uri: uri?,
        manufacturer: manufacturer?,
        product: product?,
        product_uri: product_uri?,
        version: version?,
        build: build?,
    })
}
